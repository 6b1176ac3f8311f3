#!/bin/sh
# What runs in the guest (boot.sh) of test-vm-cycles: both drivers at once, opened, started, stopped and
# closed 200 times in a row under a sanitizer, whose name is the argument.
rmmod uvcvideo
/arris/usbcam bulk fast=1 &
until [ -e /sys/bus/usb/devices/1-1:1.1 ]; do sleep 0.1; done
cd "/arris/$1" || exit 1
ASAN_OPTIONS=quarantine_size_mb=16 TSAN_OPTIONS=halt_on_error=1 ./cycles 200 \
    'v4l2src device=/dev/video2 width=320 height=180 fps=60 frames=2 ! fakesink' 'usbsrc frames=2 ! fakesink' ||
    exit 1
echo "ok      200 times open, start, stop, close on v4l2src and usbsrc at once: $1 ($(cut -d. -f1 /proc/uptime) s)"
