lcm_PKGS := lcm jansson
