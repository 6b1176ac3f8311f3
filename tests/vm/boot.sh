#!/usr/bin/env bash
# Runs a command under a real Debian kernel in QEMU, without /dev/kvm, and exits as it does.
#
#   boot.sh -c CACHE [-m "module module:option=value:..."]... [-t SECONDS] FILE... -- COMMAND
#
# The files (of programs and plugins with the libraries that they need, of folders with all that is in
# them) lie in /arris in the guest, where the command runs with busybox's shell. The kernel's package
# is downloaded once into CACHE and only unpacked there. 77: it cannot run here, and says why.
set -euo pipefail

cache='' modules='' seconds=300
while getopts c:m:t: option; do
    case $option in
    c) cache=$OPTARG ;;
    m) modules="$modules $OPTARG" ;;
    t) seconds=$OPTARG ;;
    *) exit 2 ;;
    esac
done
shift $((OPTIND - 1))
files=()
while [ $# -gt 0 ] && [ "$1" != -- ]; do
    files+=("$1")
    shift
done
shift
skip() {
    echo "boot.sh: $*" >&2
    exit 77
}
for tool in qemu-system-x86_64 busybox cpio modprobe xz dpkg-deb apt-get; do
    command -v "$tool" >/dev/null || skip "there is no $tool"
done
[ "$(uname -m)" = x86_64 ] || skip "the guest is an x86_64 machine, this one is $(uname -m)"

# ---- the kernel ------------------------------------------------------------------------------

fetch_kernel() {
    local package release image at
    rm -rf "$cache/new"
    mkdir -p "$cache/new"
    kernel_package() {
        apt-cache depends linux-image-amd64 2>/dev/null | awk '/Depends: linux-image-[0-9]/ {print $2; exit}'
    }
    package=$(kernel_package)
    [ -n "$package" ] || { apt-get -qq update || true; package=$(kernel_package); }
    [ -n "$package" ] || skip "apt knows no package linux-image-amd64"
    (cd "$cache/new" && apt-get -qq -o APT::Sandbox::User=root download "$package") ||
        skip "the package $package cannot be downloaded"
    dpkg-deb --fsys-tarfile "$cache"/new/*.deb | tar -x -C "$cache/new" ./boot ./lib/modules
    rm "$cache"/new/*.deb
    release=${package#linux-image-}
    image=$cache/new/boot/vmlinuz-$release
    # What it is packed from boots at once; unpacking would take the emulator seconds.
    at=$(LC_ALL=C grep -obUaP '\xfd7zXZ\x00' "$image" | head -1 | cut -d: -f1)
    tail -c +$((at + 1)) "$image" | xz -dc >"$cache/new/boot/kernel" 2>/dev/null || true
    head -c 4 "$cache/new/boot/kernel" | grep -q ELF || cp "$image" "$cache/new/boot/kernel"
    depmod -b "$cache/new" "$release"
    echo "$release" >"$cache/new/release"
    rm -rf "$cache/kernel"
    mv "$cache/new" "$cache/kernel"
}
[ -e "$cache/kernel/release" ] || fetch_kernel
release=$(cat "$cache/kernel/release")

# ---- its first file system -------------------------------------------------------------------

root=$(mktemp -d)
trap 'rm -rf "$root" "$root.cpio"' EXIT
mkdir -p "$root"/{bin,proc,sys,dev,tmp,run,arris,modules}
cp "$(command -v busybox)" "$root/bin/busybox"
ln -s busybox "$root/bin/sh"

add_libraries() {
    local library
    for library in $(ldd "$1" 2>/dev/null | grep -o '/[^ ]*' || true); do
        [ -e "$root$library" ] && continue
        mkdir -p "$root$(dirname "$library")"
        cp -L "$library" "$root$library"
    done
}
for file in ${files[@]+"${files[@]}"}; do
    cp -rL "$file" "$root/arris/"
    while read -r elf; do
        add_libraries "$elf"
    done < <(find -L "$file" -type f \( -name '*.so*' -o -perm -u+x \))
done

# Modules in their order, each after those that it needs: "/modules/x.ko option=value".
for module in $modules; do
    name=${module%%:*}
    options=${module#"$name"}
    while read -r kind path _; do
        if [ "$kind" != insmod ] || [ -e "$root/modules/$(basename "$path")" ]; then continue; fi
        cp "$path" "$root/modules/"
        loaded=$(basename "$path" .ko)
        echo "/modules/$loaded.ko $([ "${loaded//-/_}" = "${name//-/_}" ] && echo "$options" | tr : ' ')" >>"$root/load"
    done < <(modprobe -d "$cache/kernel" -S "$release" --show-depends "$name")
done
touch "$root/load"
printf '%s\n' "$*" >"$root/arris/command"

# The exit code leaves by QEMU's debug port, which makes 2 code + 1 of it.
cat >"$root/init" <<'INIT'
#!/bin/sh
/bin/busybox --install -s /bin
export PATH=/arris:/bin HOME=/tmp
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
mkdir -p /dev/shm
mount -t tmpfs tmp /dev/shm
mount -t tmpfs -o size=80% tmp /tmp
ip link set lo up
code=0
while read -r line; do insmod $line || code=125; done </load
cd /arris
[ $code = 0 ] && { sh ./command; code=$?; }
printf "\\$(printf %o $((code & 127)))" | dd of=/dev/port bs=1 seek=244 conv=notrunc 2>/dev/null
poweroff -f
INIT
chmod +x "$root/init"
(cd "$root" && find . -mindepth 1 | cpio -o -H newc --quiet) >"$root.cpio"

# ---- the machine -----------------------------------------------------------------------------

code=0
timeout --foreground "$seconds" qemu-system-x86_64 -M pc -nodefaults -no-user-config -display none \
    -no-reboot -monitor none -serial stdio -accel tcg,thread=multi -cpu max -smp 2 \
    -m "${ARRIS_VM_MEMORY:-1024}" -kernel "$cache/kernel/boot/kernel" -initrd "$root.cpio" \
    -device isa-debug-exit,iobase=0xf4,iosize=0x04 -append "console=ttyS0 quiet loglevel=3 oops=panic panic=-1 \
    tsc=reliable no_timer_check mitigations=off random.trust_cpu=on nokaslr" </dev/null || code=$?
if [ $code = 124 ]; then
    echo "boot.sh: it takes more than $seconds s" >&2
    exit 124
fi
if [ $((code & 1)) = 0 ]; then
    echo "boot.sh: the guest ended without a word" >&2
    exit 126
fi
exit $(((code - 1) / 2))
