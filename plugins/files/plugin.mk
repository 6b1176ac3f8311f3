files_PKGS := libpng libmd
