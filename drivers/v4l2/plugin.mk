v4l2_uses := camera
v4l2_PKGS := libturbojpeg

# Of what both drivers share the compiler vectorises the loops.
camera_CFLAGS := -O3
