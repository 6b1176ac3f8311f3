#!/usr/bin/env bash
# The drivers against a real kernel: puts what the build made into the guest of boot.sh and runs guest.sh
# there; or, `run.sh cycles SANITIZER`, guest_cycles.sh. Exits with 0 when it passes or cannot run here, which
# it says; ARRIS_VM=required forbids that.
set -euo pipefail
cd "$(dirname "$0")/../.."
B=${B:-build}
pack=$B/vm/pack

skipped() {
    echo "test-vm: SKIPPED: $1" >&2
    [ "${ARRIS_VM:-}" != required ] || exit 1
    exit 0
}
for tool in qemu-system-x86_64 busybox v4l2-ctl; do
    command -v $tool >/dev/null || skipped "there is no $tool; 'make setup-vm' installs what it needs"
done

# add FROM TO STAGE...: a build's library and cycles, and the plugins of the stages only: each takes the guest
# time to unpack.
add() {
    local from=$1 to=$2 so
    shift 2
    mkdir -p "$to/lib/arris"
    cp -L "$from/lib/libarris.so.1" "$to/lib"
    cp "$from/tests/vm/cycles" "$to"
    for stage; do
        so=$(grep -lx "stage $stage" "$from"/lib/arris/*.stages) ||
            { echo "run.sh: no plugin in $from has the stage $stage" >&2 && exit 1; }
        cp "$so" "${so%stages}so" "$to/lib/arris"
    done
}
rm -rf "$pack"
if [ "${1:-}" = cycles ]; then
    add "$B/$2" "$pack/$2" v4l2src usbsrc
    cp "$B/tests/vm/usbcam" tests/vm/guest_cycles.sh "$pack"
    command="./guest_cycles.sh $2"
else
    add "$B" "$pack" v4l2src usbsrc imagesrc pose edges undistort segments track reconstruct filesink
    cp "$B/tests/vm/parts.so" "$pack/lib/arris"
    cp -r "$B/arris" "$B"/tests/vm/{usbcam,pad} samples/box tests/vm/guest.sh "$pack"
    command=./guest.sh
fi

# An HDMI input looped to an output; a webcam with a TV tuner.
modules='vivid:n_devs=2:node_types=0x101,0x1:num_inputs=1,2:input_types=0x3,0x4:num_outputs=1,1:output_types=0x1,0x0'
boot() {
    tests/vm/boot.sh -c "$B/vm" -t "${ARRIS_VM_SECONDS:-900}" -m "$modules vhci-hcd uvcvideo" \
        "$pack"/* "$(command -v v4l2-ctl)" -- "$command"
}
code=0
boot || code=$?
if [ $code = 126 ]; then
    echo 'run.sh: the kernel of the guest has broken down; once more'
    code=0
    boot || code=$?
fi
[ $code != 77 ] || skipped 'boot.sh says why above'
exit $code
