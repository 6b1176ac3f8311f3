usb_uses := camera
usb_PKGS := libusb-1.0 libturbojpeg
