image_PKGS = libpng libturbojpeg jansson
