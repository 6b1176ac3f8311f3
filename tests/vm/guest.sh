#!/bin/sh
# What runs in the guest (boot.sh): the real arris on vivid's and usbcam's devices. Content and loss are
# checked, never rates. /dev/video0 and 1 are vivid's HDMI input and output, 2 is another vivid's webcam
# and TV tuner, 3 is usbcam by uvcvideo.
# shellcheck disable=SC2086 # the words of launch lines
cd /arris || exit 1
failures=0
started=$(cut -d. -f1 /proc/uptime)
out=/tmp/out

# ok WHAT: the result of the command before.
ok() {
    code=$?
    [ $code = 0 ] && echo "ok      $1 ($(($(cut -d. -f1 /proc/uptime) - started)) s)" && return
    echo "FAILED  $1 (code $code)"
    sed 's/^/        /' $out
    failures=$((failures + 1))
}
# Runs arris, its words in $out.
run() { timeout 200 ./arris launch --stats "$@" </dev/null 2>&1 | cat >$out; }
# Runs it; it must exit with a code and say all of the texts.
run_code() {
    wanted=$1
    shift
    timeout 200 ./arris launch --stats "$@" </dev/null >$out 2>&1
    [ $? = "$wanted" ]
}
says() {
    for text in "$@"; do
        grep -q -- "$text" $out || { echo "it does not say: $text" >>$out && return 1; }
    done
}
wait_for() {
    tries=0
    until [ -e "$1" ]; do
        sleep 0.1
        tries=$((tries + 1))
        [ $tries -lt 300 ] || return 1
    done
}
wait_gone() {
    tries=0
    while [ -e "$1" ] && [ $tries -lt 300 ]; do
        sleep 0.1
        tries=$((tries + 1))
    done
}
plug_in() {
    ./usbcam "$@" 2>/tmp/usbcam.log &
    cam=$!
    wait_for /dev/video3
}
unplug() {
    kill $cam
    wait $cam 2>/dev/null
    wait_gone /dev/video3
}
control() { v4l2-ctl -d "$1" -c "$2" >/dev/null; }
# Runs arris and meanwhile presses vivid's button, again until arris says the text; then ends it.
disturbed() {
    button=$1
    text=$2
    shift 2
    ./arris launch --stats "$@" </dev/null >$out 2>&1 &
    pid=$!
    tries=0
    until grep -q -- "$text" $out || [ $tries = 30 ]; do
        sleep 2
        control /dev/video0 "$button=1" 2>/dev/null
        sleep 1
        tries=$((tries + 1))
    done
    [ "$text" = 'has not come back' ] || kill -INT $pid
    wait $pid
}

roomy='queue max-frames=200 leaky=oldest'
v4l2() { run v4l2src device=A0123 timeout=1500 "$@"; }
usb() { run usbsrc timeout=1500 "$@"; }
vivid='v4l2src device=/dev/video0 width=640 height=480 timeout=1500'

# ---- open, start, stop, close, under the sanitizers ---------------------------------------------

rmmod uvcvideo
./usbcam bulk fast=1 &
cam=$!
sleep 1
cycles() {
    (cd $1 && ASAN_OPTIONS=quarantine_size_mb=16 TSAN_OPTIONS=halt_on_error=1 timeout 500 ./cycles $2 \
        'v4l2src device=/dev/video2 width=320 height=180 frames=2 ! fakesink' \
        'usbsrc frames=2 ! fakesink') >$out 2>&1
    ok "$2 times open, start, stop, close on v4l2src and usbsrc at once: $1"
}
cycles asan 200
cycles tsan 20
kill $cam
sleep 1
insmod /modules/uvcvideo.ko

# ---- vivid: our own pictures out and in again, measured ----------------------------------------

mkdir /tmp/padded
./pad box /tmp/padded 120 >$out 2>&1
ok 'the padded recording'
for node in 0 1; do v4l2-ctl -d /dev/video$node --set-dv-bt-timings index=0 >/dev/null; done
control /dev/video0 loop_video=1,osd_text_mode=2
scan='edges ! undistort ! segments ! track ! reconstruct pose-sigma=0 rot-sigma=0'
run imagesrc location=/tmp/padded/frames.csv ! $scan ! filesink location=/tmp/files.json
run $vivid format=RGB3 camera=/tmp/padded/camera.json \
    ! vividloop location=/tmp/padded device=/dev/video1 \
    ! pose location=/tmp/padded/frames.csv ! $scan ! filesink location=/tmp/loop.json
says '120 of 120 came back bit for bit'
ok 'vivid gives the recording back bit for bit'
cmp /tmp/files.json /tmp/loop.json >>$out 2>&1 && grep -q '"id"' /tmp/loop.json
ok 'the lines are those of the files'
control /dev/video0 loop_video=0

# ---- vivid: faults -----------------------------------------------------------------------------

run_code 0 $vivid format=GREY frames=30 ! $roomy ! fakesink && says 'v4l2src  *30' 'damaged 0' && ! says copied
ok 'GREY is not copied'
control /dev/video0 percentage_of_dropped_buffers=30
run_code 0 $vivid format=YUYV frames=40 ! $roomy ! fakesink && says 'missed [1-9]' 'damaged 0'
ok 'dropped buffers are counted as missed'
control /dev/video0 percentage_of_dropped_buffers=0
for what in reqbufs qbuf streamon; do
    control /dev/video0 inject_vidioc_${what}_error=1
    run_code 0 $vivid frames=9 ! $roomy ! fakesink && says 'the camera is lost: ' 'the camera is back' 'lost 1'
    ok "an error of $what at the start is got over"
done
control /dev/video0 inject_v4l2_buf_flag_error=1
run_code 0 $vivid format=GREY frames=20 ! $roomy ! fakesink && says 'damaged 1' && ! says 'lost'
ok 'a flagged buffer is counted as damaged'
disturbed inject_vidioc_qbuf_error 'is back' $vivid format=YUYV ! $roomy ! fakesink && says 'does not take a buffer back' 'is back'
ok 'a queueing error is got over'
disturbed inject_fatal_streaming_error 'is back' $vivid format=GREY ! $roomy ! fakesink && says 'lost: .*Input/output error' 'is back'
ok 'a broken stream is got over'
control /dev/video0 wrap_timestamp=1
run_code 0 $vivid frames=20 ! $roomy ! fakesink && says 'not those of this machine' 'undated [1-9]'
ok 'stamps out of this world are not believed'
control /dev/video0 wrap_timestamp=0
disturbed disconnect 'has not come back' $vivid retry=2 ! $roomy ! edges ! segments ! filesink location=/tmp/segments.csv
[ $? = 4 ] && says 'has not come back in 2 s' && [ "$(wc -l </tmp/segments.csv)" -gt 9 ]
ok 'a disconnected device ends the stream with its results written'

# ---- vivid: fields, formats, controls, lists ----------------------------------------------------

tv='v4l2src device=/dev/video2 input=1 standard=PAL'
run_code 0 $tv fields=weave frames=5 ! fakesink && says 'use fields=top'
ok 'weave warns'
for fields in top bottom auto; do
    ./arris launch --check $tv fields=$fields ! fakesink >$out 2>&1 && says '720x288 8 bit'
    ok "fields=$fields gives half the rows"
    run_code 0 $tv fields=$fields frames=5 ! fakesink
    ok "fields=$fields streams"
done
webcam='v4l2src device=/dev/video2 input=0 width=320 height=180'
for format in GREY Y10 Y12 Y16 YUYV UYVY NV12 RGB3; do
    run_code 0 $webcam format=$format frames=3 ! fakesink && says 'v4l2src  *3 '
    ok "vivid sends $format"
done
run_code 2 v4l2src device=/dev/video2 input=0 width=333 ! fakesink && says 'does not send' 'it has 320x180'
ok 'a size that there is not'
run_code 2 $webcam gain=300 ! fakesink && says 'gain cannot be .300.: it is 0 to 255'
ok 'a value out of range'
run_code 2 $webcam expsure=3 ! fakesink && says 'no control of that name' 'brightness contrast'
ok 'a control that there is not'
run_code 4 v4l2src device=nonesuch ! fakesink && says 'there is no camera of the name'
ok 'a camera that there is not'

# ---- usbcam: every byte, by both drivers ---------------------------------------------------------

for transfer in bulk iso; do
    plug_in $transfer
    for format in YUYV GREY MJPEG; do
        seen=seen
        [ $format = MJPEG ] && seen='seen jpeg=true'
        for source in v4l2 usb; do
            $source format=$format frames=20 ! $roomy ! $seen
            says 'seen [0-9]*-[0-9]*; 0 wrong, 0 out of order, 0 misdated'
            ok "20 of 20 $format, $transfer, ${source}src"
        done
    done
    [ -e /dev/video3 ]
    ok 'the camera is given back to uvcvideo'
    ./arris stages v4l2src --devices >$out 2>&1 && says 'Arris test camera' 'format MJPEG: 320x240' 'gain: 0 to 100'
    ok 'v4l2src lists it'
    unplug
done
rmmod uvcvideo
./usbcam bulk &
cam=$!
sleep 1
./arris stages usbsrc --devices >$out 2>&1 && says '1d6b:0102: Arris test camera' 'serial number A0123' \
    'format YUYV: 320x240, 30, 15' 'exposure_time_absolute: 1 to 5000' 'brightness: -64 to 64'
ok 'usbsrc lists it'
run_code 2 usbsrc gain=101 ! fakesink && says 'gain cannot be .101.: it is 0 to 100, default 16'
ok 'a value out of range, by USB'
run_code 0 usbsrc gain=7 exposure=80 frames=3 ! fakesink && ./arris stages usbsrc --devices >$out && says 'gain:.*now 7' \
    'exposure_time_absolute:.*now 80' 'auto_exposure:.*now 1'
ok 'controls are set, and automatic exposure is off'
kill $cam
sleep 1
insmod /modules/uvcvideo.ko

# ---- usbcam: faults ------------------------------------------------------------------------------

for transfer in bulk iso; do
    faults='short=5 long=7 error=11 header=13'
    runs='seen 0-4 6 8-9 12 16-19 23-24 27 29 31-32 34; 0 wrong, 0 out of order'
    # uvcvideo loses 27, too: it has not seen the FID of 26, whose only header is damaged.
    kernels=$runs frames=20
    [ $transfer = bulk ] && kernels='seen 0-4 6 8-9 12 16-19 23-24 29 31-32 34; 0 wrong, 0 out of order' frames=19
    plug_in $transfer $faults
    usb frames=20 ! $roomy ! seen
    says "$runs" 'short [1-9]' 'overlong [1-9]' 'flagged [1-9]'
    ok "damaged pictures are left out, $transfer, usbsrc"
    unplug
    plug_in $transfer $faults
    v4l2 frames=$frames ! $roomy ! seen
    says "$kernels" 'missed [1-9]\|damaged [1-9]'
    ok "damaged pictures are left out, $transfer, v4l2src"
    unplug
    plug_in $transfer id=7
    usb frames=20 ! $roomy ! seen
    says 'seen 0-19; 0 wrong' 'wrong id 2'
    ok "a wrong FID is seen through, $transfer, usbsrc"
    v4l2 frames=20 ! $roomy ! seen
    says '; 0 wrong, 0 out of order'
    ok "a wrong FID does no harm, $transfer, v4l2src"
    unplug
    for source in v4l2 usb; do
        plug_in $transfer unplug=7 pause=1000
        $source frames=20 ! $roomy ! seen
        says 'seen 0-19; 0 wrong, 0 out of order' 'the camera is lost' 'the camera is back' 'lost 1'
        ok "unplugged and plugged in again, $transfer, ${source}src"
        unplug
        plug_in $transfer silent=7 pause=3000
        $source frames=20 ! $roomy ! seen
        says 'seen 0-19; 0 wrong' 'it has sent nothing for 1500 ms' 'is back'
        ok "a silent camera is started anew, $transfer, ${source}src"
        unplug
    done
done
plug_in iso lost=7
usb frames=18 ! $roomy ! seen
says 'seen 0-6 8-13 15-19; 0 wrong' 'flagged 2'
ok 'lost packets cost their pictures, usbsrc'
unplug
# By usbsrc only: uvcvideo clears no stall, and its queue has broken down under one.
plug_in bulk stall=7
usb frames=20 ! $roomy ! seen
says 'seen 0-19; 0 wrong, 0 out of order' 'stalls 2'
ok 'stalls are got over, usbsrc'
unplug
plug_in bulk unplug=12 pause=600000
run_code 4 usbsrc retry=2 ! $roomy ! edges ! segments ! filesink location=/tmp/usb.segments.csv && says \
    'has not come back in 2 s' && [ "$(wc -l </tmp/usb.segments.csv)" -gt 9 ]
ok 'an unplugged camera ends the stream with its results written'
kill $cam
sleep 1
./usbcam bulk broken=26 &
cam=$!
sleep 2
run_code 4 usbsrc ! fakesink && says 'descriptors are damaged\|no USB camera'
ok 'damaged descriptors are refused'
kill $cam

echo "$failures failed, $(($(cut -d. -f1 /proc/uptime) - started)) s in the guest"
[ $failures = 0 ]
