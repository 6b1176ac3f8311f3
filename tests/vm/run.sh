#!/usr/bin/env bash
# The drivers against a real kernel: puts what the build made into the guest of boot.sh and runs guest.sh
# there. Exits with 0 when it passes or cannot run here, which it says; ARRIS_VM=required forbids that.
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

# Only the plugins that are asked for: each takes the guest time to unpack.
plugin_of() {
    grep -lx "stage $1" "$B"/lib/arris/*.stages | sed 's/stages$/so/'
}
rm -rf "$pack"
mkdir -p "$pack/lib/arris"
cp "$B/arris" "$B"/tests/vm/{usbcam,pad} tests/vm/guest.sh "$pack"
cp -L "$B/lib/libarris.so.1" "$pack/lib"
for stage in v4l2src usbsrc imagesrc pose edges undistort segments track reconstruct filesink; do
    so=$(plugin_of $stage) || { echo "run.sh: no plugin in $B has the stage $stage" >&2 && exit 1; }
    cp "$so" "${so%.so}.stages" "$pack/lib/arris"
done
cp "$B/tests/vm/parts.so" "$pack/lib/arris"
cp -r samples/box "$pack"
for build in asan tsan; do
    mkdir -p "$pack/$build/lib/arris"
    cp "$B/$build/tests/vm/cycles" "$pack/$build"
    cp -L "$B/$build/lib/libarris.so.1" "$pack/$build/lib"
    cp "$B/$build"/lib/arris/{v4l2,usb}.* "$pack/$build/lib/arris"
done

# An HDMI input looped to an output; a webcam with a TV tuner.
modules='vivid:n_devs=2:node_types=0x101,0x1:num_inputs=1,2:input_types=0x3,0x4:num_outputs=1,1:output_types=0x1,0x0'
boot() {
    tests/vm/boot.sh -c "$B/vm" -t "${ARRIS_VM_SECONDS:-900}" -m "$modules vhci-hcd uvcvideo" \
        "$pack"/* "$(command -v v4l2-ctl)" -- ./guest.sh
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
