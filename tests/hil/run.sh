#!/bin/sh
# Device tests in a virtual machine: the stock Debian kernel with simulated devices, this machine's own files read-only.
# usage: tests/hil/run.sh BUILD_FOLDER [TEST ...]     tests are tests/hil/*.guest.sh; prints TAP
# Installs nothing by itself where it is not root; prints SKIP where QEMU cannot be had.
set -u
build=$1
shift
vm=$PWD/$build/vm
mkdir -p "$vm"
skip_all() {
    echo "ok 1 - device tests # SKIP $1"
    echo "1..1"
    exit 0
}
for package in qemu-system-x86 busybox-static cpio kmod; do
    dpkg-query -W -f='${Status}' $package 2>/dev/null | grep -q 'ok installed' && continue
    [ "$(id -u)" -eq 0 ] || skip_all "$package is not installed"
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $package >"$vm/apt.log" 2>&1 ||
        skip_all "$package cannot be installed"
done
kernel=$(ls -d "$vm"/linux/boot/vmlinuz-* 2>/dev/null | head -n 1)
if [ -z "$kernel" ]; then
    name=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/.*Depends: \(linux-image-[^ ]*\)$/\1/p' | head -n 1)
    [ -n "$name" ] || skip_all "no kernel package is known"
    (cd "$vm" && apt-get download -qq "$name" >apt.log 2>&1 && dpkg-deb -x "$name"_*.deb linux && rm "$name"_*.deb) ||
        skip_all "the kernel package cannot be had"
    kernel=$(ls -d "$vm"/linux/boot/vmlinuz-*)
fi
version=${kernel##*/vmlinuz-}
[ -f "$vm/linux/lib/modules/$version/modules.dep" ] || depmod -b "$vm/linux" "$version"

# The first file system: busybox and the modules that reach this machine's files.
root=$vm/initrd
rm -rf "$root"
mkdir -p "$root/bin" "$root/modules" "$root/proc" "$root/sys" "$root/dev" "$root/root"
cp /bin/busybox "$root/bin/"
number=10
for module in virtio_pci virtio_console 9pnet_virtio 9p; do
    for file in $(modprobe -S "$version" -d "$vm/linux" --show-depends $module | awk '/^insmod/ {print $2}'); do
        ls "$root/modules" | grep -q -- "-${file##*/}\$" && continue
        cp "$file" "$root/modules/$number-${file##*/}"
        number=$((number + 1))
    done
done
cp tests/hil/init.sh "$root/init"
chmod +x "$root/init"
(cd "$root" && find . | cpio -o -H newc --quiet | gzip -1) >"$vm/initrd.gz"

# What the guest is to do.
[ $# -gt 0 ] || set -- tests/hil/*.guest.sh
cat >"$vm/guest" <<END
export KERNEL=$version MODULES=$vm/linux HOME=/tmp PATH=/usr/sbin:/usr/bin:/sbin:/bin GONIO=$PWD/$build/gonio
cd $PWD
for test in $*; do sh \$test || echo "not ok - \$test ended with \$?"; done
echo finished
END
rm -f "$vm/output"
timeout "${LIMIT:-240}" qemu-system-x86_64 -nodefaults -no-user-config -no-reboot -display none -machine q35 \
    -accel tcg,thread=multi -cpu max -smp 2 -m 1024 -kernel "$kernel" -initrd "$vm/initrd.gz" \
    -append "console=ttyS0 quiet panic=-1 tsc=unstable mitigations=off gonio=$vm" -serial "file:$vm/console" \
    -device virtio-serial-pci -chardev "file,id=out,path=$vm/output" -device virtserialport,chardev=out \
    -fsdev local,id=root,path=/,security_model=none,readonly=on,multidevs=remap \
    -device virtio-9p-pci,fsdev=root,mount_tag=root </dev/null >"$vm/qemu.log" 2>&1
if ! grep -q '^finished' "$vm/output" 2>/dev/null; then
    [ -f "$vm/output" ] && cat "$vm/output"
    tail -n 20 "$vm/console" "$vm/qemu.log" 2>/dev/null | sed 's/^/# /'
    echo "not ok - the virtual machine did not finish in ${LIMIT:-240} s"
    exit 1
fi
grep -v '^finished' "$vm/output"
! grep -q '^not ok' "$vm/output"
