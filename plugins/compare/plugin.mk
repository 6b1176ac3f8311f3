compare_PKGS := assimp libmd jansson
