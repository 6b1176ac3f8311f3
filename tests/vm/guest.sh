#!/bin/sh
# What runs in the guest (boot.sh): the real arris on vivid's and usbcam's devices. Content and loss are
# checked, never rates. /dev/video0 and 1 are vivid's HDMI input and output, 2 is another vivid's webcam
# and TV tuner, 3 is usbcam by uvcvideo. Both emulators are worked on at the same time.
# shellcheck disable=SC2086 # the words of launch lines
cd /arris || exit 1
started=$(cut -d. -f1 /proc/uptime)

# ok WHAT: the result of the command before.
ok() {
    code=$?
    [ $code = 0 ] && echo "ok      $1 ($(($(cut -d. -f1 /proc/uptime) - started)) s)" && return
    echo "FAILED  $1 (code $code)"
    sed 's/^/        /' $out
    failures=$((failures + 1))
}
# Runs arris, its words in $out; it must exit with the code.
run_code() {
    wanted=$1
    shift
    timeout 200 ./arris launch --stats "$@" </dev/null >$out 2>&1
    [ $? = "$wanted" ]
}
run() { run_code 0 "$@"; }
says() {
    for text in "$@"; do
        grep -q -- "$text" $out || { echo "it does not say: $text" >>$out && return 1; }
    done
}
# Tries a command 20 times a second, for so many seconds.
within() {
    tries=$(($1 * 20))
    shift
    until "$@"; do
        tries=$((tries - 1))
        [ $tries -gt 0 ] || return 1
        sleep 0.05
    done
}
gone() { ! [ -e "$1" ]; }
control() { v4l2-ctl -d "$1" -c "$2" >/dev/null; }
# Runs arris ending with digest, and presses vivid's button once it streams, again until it says the text;
# then it is ended, if need be. Returns arris's code.
disturbed() {
    button=$1
    text=$2
    shift 2
    ./arris launch --stats "$@" ! digest </dev/null >$out 2>&1 &
    pid=$!
    within 30 grep -q streams $out
    for _ in 1 2 3 4 5; do
        control /dev/video0 "$button=1" 2>/dev/null
        within 5 grep -q -- "$text" $out && break
    done
    kill -INT $pid 2>/dev/null
    wait $pid
}

# ---- vivid -------------------------------------------------------------------------------------

hdmi='v4l2src device=/dev/video0 width=640 height=480 timeout=1500'
webcam='v4l2src device=/dev/video2 input=0 width=320 height=180'
tv='v4l2src device=/dev/video2 input=1 format=GREY'

# Our own pictures out and in again, measured.
vivid_loop() {
    mkdir /tmp/padded
    ./pad box /tmp/padded 120 >$out 2>&1
    ok 'the padded recording'
    for node in 0 1; do v4l2-ctl -d /dev/video$node --set-dv-bt-timings index=0 >/dev/null; done
    control /dev/video0 loop_video=1,osd_text_mode=2
    scan='edges ! undistort ! segments ! track ! reconstruct pose-sigma=0 rot-sigma=0'
    run $hdmi format=RGB3 camera=/tmp/padded/camera.json \
        ! vividloop location=/tmp/padded device=/dev/video1 \
        ! pose location=/tmp/padded/frames.csv ! $scan ! filesink location=/tmp/loop.json &&
        says '120 of 120 came back bit for bit'
    ok 'vivid gives the recording back bit for bit'
    run imagesrc location=/tmp/padded/frames.csv ! $scan ! filesink location=/tmp/files.json &&
        cmp /tmp/files.json /tmp/loop.json >>$out 2>&1 && grep -q '"id"' /tmp/loop.json
    ok 'the lines are those of the files'
    control /dev/video0 loop_video=0
}

vivid_faults() {
    run $hdmi format=GREY frames=30 ! fakesink && says 'v4l2src  *30' 'damaged 0' && ! says copied
    ok 'GREY is not copied'
    control /dev/video0 percentage_of_dropped_buffers=30,inject_v4l2_buf_flag_error=1
    run $hdmi format=YUYV frames=40 ! queue leaky=oldest ! digest pause=100 &&
        says 'missed [1-9]' 'damaged 1 ' '^queue  *[0-9]*  *[1-9]' && ! says lost
    ok 'dropped buffers, a flagged one and our own drops are counted apart'
    control /dev/video0 percentage_of_dropped_buffers=0
    for what in reqbufs qbuf streamon; do
        control /dev/video0 inject_vidioc_${what}_error=1
        run $hdmi frames=9 ! fakesink && says 'the camera is lost: ' 'the camera is back' 'lost 1'
        ok "an error of $what at the start is got over"
    done
    disturbed inject_vidioc_qbuf_error 'is back' $hdmi format=YUYV && says 'does not take a buffer back' 'is back'
    ok 'a queueing error is got over'
    disturbed inject_fatal_streaming_error 'is back' $hdmi format=GREY && says 'lost: .*Input/output error' 'is back'
    ok 'a broken stream is got over'
    control /dev/video0 wrap_timestamp=1
    run $hdmi frames=20 ! fakesink && says 'not those of this machine' 'undated [1-9]'
    ok 'stamps out of this world are not believed'
    control /dev/video0 wrap_timestamp=0
    exec 9</dev/video1 # vivid is whole again when its last user closes it
    disturbed disconnect 'has not come back' $hdmi retry=1 ! tee name=t t. ! queue ! edges ! segments \
        ! filesink location=/tmp/segments.csv t. ! queue leaky=oldest
    [ $? = 4 ] && says 'has not come back in 1 s' && [ "$(wc -l </tmp/segments.csv)" -gt 9 ]
    ok 'a disconnected device ends the stream with its results written'
    exec 9<&-
}

# The TV's rows are dark and light in turn, 0 and 254.
vivid_formats() {
    run v4l2src device=/dev/video2 input='TV 0' standard=PAL test_pattern='Alternating Hor Lines' osd_text_mode=2 \
        format=GREY fields=weave frames=3 ! digest && says 'use fields=top' '720x576, rows 0 254'
    ok 'weave weaves, and warns'
    for fields in top bottom auto; do
        grey=0
        [ $fields = bottom ] && grey=254
        run $tv fields=$fields frames=3 ! digest && says "720x288, rows $grey $grey"
        ok "fields=$fields takes its field"
    done
    run $tv standard=NTSC fields=bottom frames=3 ! digest && says '720x240, rows 254 254'
    ok 'another standard'
    ./arris stages v4l2src --devices >$out 2>&1 && says 'input 1: TV 0' 'standards: .*PAL' \
        'test_pattern: 0 75% Colorbar, .*, now 15'
    ok 'inputs, standards and menus are listed'
    # Other checks hold every byte of GREY, YUYV and RGB3 to the truth. Vivid's luma is not quite its grey.
    for format in GREY Y10 Y12 Y16 YUYV UYVY NV12; do
        run $webcam test_pattern=0 osd_text_mode=2 format=$format frames=3 ! digest
        digest=$(grep '^digest [0-9a-f]*,' $out)
        [ $format != GREY ] && [ $format != YUYV ] || known=$digest
        [ -n "$known" ] && [ "$digest" = "$known" ]
        ok "$format is the same picture"
    done
    run_code 2 v4l2src device=/dev/video2 input=0 width=333 ! fakesink && says 'does not send' 'it has 320x180'
    ok 'a size that there is not'
    run_code 2 $webcam fps=59 ! fakesink && says 'sends 60 frames/s at this size, not 59'
    ok 'a rate that there is not'
    run_code 2 $webcam gain=300 ! fakesink && says 'gain cannot be .300.: it is 0 to 255'
    ok 'a value out of range'
    run_code 2 $webcam expsure=3 ! fakesink && says 'no control of that name' 'brightness contrast'
    ok 'a control that there is not'
    run_code 4 v4l2src device=nonesuch ! fakesink && says 'there is no camera of the name'
    ok 'a camera that there is not'
    ./cycles 20 "$webcam fps=60 frames=2 ! fakesink" >$out 2>&1
    ok '20 times open, start, stop, close: v4l2src'
}

vivid() {
    vivid_loop
    vivid_faults
    vivid_formats
}

# ---- usbcam ------------------------------------------------------------------------------------

roomy='queue max-frames=200 leaky=oldest'
v4l2() { run v4l2src device=A0123 buffers=32 fps=30 timeout=1500 "$@"; }
usb() { run usbsrc fps=15 timeout=1500 "$@"; }
# Until the last node of what it is to be: the driver's device, or the interface that nobody has.
plug_in() {
    ./usbcam "$@" 2>/tmp/usbcam.log &
    cam=$!
    within 30 [ -e $node ]
}
unplug() {
    kill $cam
    wait $cam 2>/dev/null
    within 30 gone $node
}
node=/dev/video3
without_uvcvideo() {
    rmmod uvcvideo
    node=/sys/bus/usb/devices/1-1:1.1
}
with_uvcvideo() {
    insmod /modules/uvcvideo.ko
    node=/dev/video3
}

# Every byte, by both drivers; when it was exposed.
usbcam_formats() {
    for transfer in bulk iso; do
        plug_in $transfer
        for format in YUYV GREY MJPEG; do
            seen=seen
            [ $format = MJPEG ] && seen='seen jpeg=true'
            for source in v4l2 usb; do
                $source format=$format frames=20 ! $roomy ! $seen &&
                    says 'seen [0-9]*-[0-9]*; 0 wrong, 0 out of order'
                ok "20 of 20 $format, $transfer, ${source}src"
            done
        done
        ./arris launch usbsrc ! seen </dev/null >$out 2>&1 &
        pid=$!
        within 30 gone $node && kill -INT $pid && wait $pid && [ -e $node ]
        ok "interrupted, it gives the camera back to uvcvideo, $transfer"
        for source in v4l2 usb; do
            $source exposure=4000 frames=4 ! seen && says ' dates -\?[0-9]\{1,2\} ms off'
            ok "the middle of 400 ms is told to 100 ms, $transfer, ${source}src"
        done
        [ $transfer = iso ] || unplug
    done
    ./arris stages v4l2src --devices >$out 2>&1 && says 'Arris test camera' 'format MJPEG: 320x240' \
        '320x240: 30, 15 frames/s' 'gain: 0 to 100'
    ok 'v4l2src lists it'
    run v4l2src device='Arris test camera' gain=9 exposure=80 frames=3 ! fakesink && ./arris stages v4l2src --devices \
        >$out && says 'gain:.*now 9' 'exposure_time_absolute:.*now 80' 'auto_exposure: 1 Manual Mode, .*now 1'
    ok 'controls are set, and automatic exposure is off, v4l2src'
    unplug
}

usbcam_alone() {
    without_uvcvideo
    plug_in bulk
    ./arris stages usbsrc --devices >$out 2>&1 && says '1d6b:0102: Arris test camera' 'serial number A0123' \
        'format YUYV: 320x240, 30, 15' 'exposure_time_absolute: 1 to 5000' 'brightness: -64 to 64' \
        'auto_exposure: 1 Manual Mode, 3 Aperture Priority Mode, default 3'
    ok 'usbsrc lists it'
    run_code 2 usbsrc gain=101 ! fakesink && says 'gain cannot be .101.: it is 0 to 100, default 16'
    ok 'a value out of range, usbsrc'
    run_code 2 usbsrc gian=1 ! fakesink && says 'no control of that name' 'brightness gain'
    ok 'a control that there is not, usbsrc'
    run usbsrc gain=7 exposure=80 frames=3 ! fakesink && ./arris stages usbsrc --devices >$out &&
        says 'gain:.*now 7' 'exposure_time_absolute:.*now 80' 'auto_exposure:.*now 1'
    ok 'controls are set, and automatic exposure is off, usbsrc'
    ./cycles 10 'usbsrc frames=2 ! fakesink' >$out 2>&1
    ok '10 times open, start, stop, close: usbsrc'
    unplug
    node=${node%1}0
    plug_in bulk broken=26
    run_code 4 usbsrc ! fakesink && says 'the descriptors are damaged at byte 26'
    ok 'damaged descriptors are refused'
    unplug
    with_uvcvideo
}

usbcam_faults() {
    faults='short=5 long=7 error=11 header=13'
    runs='seen 0-4 6 8-9 12 16-19 23-24 27 29 31-32 34; 0 wrong, 0 out of order'
    # By bulk uvcvideo loses 27, too: it has not seen the FID of 26, whose only header is damaged.
    kernels=$runs frames=20
    [ $1 = bulk ] && kernels='seen 0-4 6 8-9 12 16-19 23-24 29 31-32 34; 0 wrong, 0 out of order' frames=19
    plug_in $1 $faults
    usb frames=20 ! $roomy ! seen && says "$runs" 'short [1-9]' 'overlong [1-9]' 'flagged [1-9]'
    ok "damaged pictures are left out, $1, usbsrc"
    unplug
    plug_in $1 $faults
    v4l2 frames=$frames ! $roomy ! seen && says "$kernels" 'missed [1-9]\|damaged [1-9]'
    ok "damaged pictures are left out, $1, v4l2src"
    unplug
    plug_in $1 id=7
    usb frames=20 ! $roomy ! seen && says 'seen 0-19; 0 wrong' 'wrong id 2'
    ok "a wrong FID is seen through, $1, usbsrc"
    v4l2 frames=20 ! $roomy ! seen && says '; 0 wrong, 0 out of order'
    ok "a wrong FID does no harm, $1, v4l2src"
    unplug
    for source in v4l2 usb; do
        plug_in $1 unplug=7
        $source frames=20 ! $roomy ! seen &&
            says 'seen 0-19; 0 wrong, 0 out of order' 'the camera is lost' 'the camera is back' 'lost 1'
        ok "unplugged and plugged in again, $1, ${source}src"
        unplug
        plug_in $1 silent=7
        $source frames=20 timeout=800 ! $roomy ! seen &&
            says 'seen 0-19; 0 wrong' 'it has sent nothing for 800 ms' 'is back'
        ok "a silent camera is started anew, $1, ${source}src"
        unplug
    done
}

usbcam_losses() {
    plug_in iso lost=7
    usb frames=18 ! $roomy ! seen && says 'seen 0-6 8-13 15-19; 0 wrong' 'flagged 2'
    ok 'lost packets cost their pictures, usbsrc'
    unplug
    # By usbsrc only: uvcvideo clears no stall, and its queue has broken down under one.
    plug_in bulk stall=7
    usb frames=20 ! $roomy ! seen && says 'seen 0-19; 0 wrong, 0 out of order' 'stalls 2'
    ok 'stalls are got over, usbsrc'
    unplug
    plug_in bulk unplug=12 pause=600000
    run_code 4 usbsrc retry=1 ! $roomy ! edges ! segments ! filesink location=/tmp/usb.segments.csv &&
        says 'has not come back in 1 s' && [ "$(wc -l </tmp/usb.segments.csv)" -gt 9 ]
    ok 'an unplugged camera ends the stream with its results written'
    kill $cam
}

usbcam() {
    usbcam_formats
    usbcam_alone
    usbcam_faults bulk
    usbcam_faults iso
    usbcam_losses
}

# ------------------------------------------------------------------------------------------------

# part NAME: what it is called, with its own words; exits with how many have failed.
part() {
    out=/tmp/$1.out
    failures=0
    $1
    exit $failures
}
# uvcvideo copies pictures in several kernel threads, and hands one out after the next when they run on
# processors of which one stands still.
echo 1 >/sys/devices/virtual/workqueue/cpumask
(part vivid) >/tmp/vivid.log 2>&1 &
vivid=$!
(part usbcam)
failures=$?
wait $vivid
failures=$((failures + $?))
cat /tmp/vivid.log
echo "$failures failed, $(($(cut -d. -f1 /proc/uptime) - started)) s in the guest"
[ $failures = 0 ]
