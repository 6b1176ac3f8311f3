v4l2_uses := camera
v4l2_PKGS := libturbojpeg
