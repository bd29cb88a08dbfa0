#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Device tests in a virtual machine: the stock Debian kernel with simulated devices and, in memory, Gonio's programs.
# usage: tests/hil/run.sh BUILD_FOLDER [GROUP ...]     groups: chain vivid usbtmc gpio measure; prints TAP and a summary; SKIP where QEMU or the kernel cannot be had
set -u
PATH=$PATH:/usr/sbin:/sbin
build=$1
shift
[ $# -gt 0 ] || set -- chain vivid usbtmc gpio measure
vm=$PWD/$build/vm
root=$vm/root
log=$build/test-logs/vm.tap
mkdir -p "$vm" "$build/test-logs"
helpers=
stop_helpers() { for pid in $helpers; do kill "$pid" 2>/dev/null; done; }
trap stop_helpers EXIT
skip_all() {
    echo "ok 1 - device tests in a virtual machine # SKIP $1"
    echo "0 passed, 0 failed, 1 skipped"
    exit 0
}
[ "$(uname -m)" = x86_64 ] || skip_all "for x86-64 only"
# libelf1: what builds kernel modules needs it; its package is only taken apart, not installed.
tools/deps.sh qemu-system-x86 busybox-static cpio kmod xz-utils make gcc binutils libelf1 >"$vm/deps.log" 2>&1 ||
    skip_all "$(tail -n 1 "$vm/deps.log")"
tests/hil/modules.sh "$vm" >"$vm/modules.log" || skip_all "no kernel package can be had"
sed 's/^/# /' "$vm/modules.log"
version=$(cat "$vm/version")
start=$(date +%s)

# ---- the guest's files ----
rm -rf "$root"
mkdir -p "$root/bin" "$root/tests" "$root/modules" "$root/lib64"
cp /bin/busybox "$root/bin/"
cp tests/hil/init.sh "$root/init"
chmod +x "$root/init"
programs="$build/gonio $build/gonio-controller"
for name in vivid gpio usbtmc usbtmc_gadget loopback chain; do programs="$programs $build/tests/hil/$name"; done
for program in $programs; do strip -o "$root/tests/${program##*/}" "$program"; done
# shellcheck disable=SC2086
ldd $programs | grep -o '/[^ ]*' | grep -v : | sort -u | while read -r library; do
    mkdir -p "$root${library%/*}"
    cp -L "$library" "$root$library"
done
for file in "$vm/extra/gpio-sim.ko" "$vm/extra/v4l2loopback.ko"; do
    [ -f "$file" ] || continue
    name=${file##*/}
    cp "$file" "$root/modules/"
    for needed in $(modinfo -F depends "$file" | tr , ' '); do
        modprobe -S "$version" -d "$vm/linux" --show-depends "$needed" | awk '/^insmod/ {print $2}'
    done >"$vm/needed"
    while read -r module; do cp "$module" "$root/modules/"; echo "${module##*/}"; done <"$vm/needed" >"$root/modules/${name%.ko}.list"
    echo "$name" >>"$root/modules/${name%.ko}.list"
done
for name in configfs vivid libcomposite usb_f_fs dummy_hcd xhci_pci ftdi_sio; do
    modprobe -S "$version" -d "$vm/linux" --show-depends $name 2>/dev/null | awk '/^insmod/ {print $2}' >"$vm/needed" || continue
    [ -s "$vm/needed" ] || grep -q "/$name.ko" "$vm/linux/lib/modules/$version/modules.builtin" || continue
    while read -r module; do cp "$module" "$root/modules/"; echo "${module##*/}"; done <"$vm/needed" >"$root/modules/$name.list"
done
cp tests/hil/guest.sh tests/hil/loopback.ini "$root/tests/"
printf 'theta_i,phi_i,theta_o,phi_o\n20,0,30,180\n35,0,10,90\n10,0,45,30\n' >"$root/tests/plan.csv"

# The simulated measure whose frames v4l2loopback will carry.
rm -rf "$vm/session"
sed '/^# the real camera/,$d' tests/hil/loopback.ini >"$vm/simulated.ini"
"$build/gonio" measure --rig "$vm/simulated.ini" --seed 3 --plan "$root/tests/plan.csv" --method mba --json "$vm/session" 2>"$vm/measure.log" |
    sed -n 's/.*"samples_sha256":"\([0-9a-f]*\)".*/\1/p' >"$root/tests/session.samples_sha256"
cp -r "$vm/session" "$root/tests/session"

# ---- the controller at the far end of the USB serial adapter: the emulated board where it can be built ----
rm -f "$vm/line" "$vm/output"
if command -v arm-none-eabi-gcc >/dev/null && command -v qemu-system-arm >/dev/null &&
    make --no-print-directory firmware B="$build" >"$vm/firmware.log" 2>&1; then
    qemu-system-arm -M lm3s6965evb -kernel "$build/firmware/lm3s6965evb.elf" -display none -monitor none -accel tcg \
        -icount shift=5 -serial "unix:$vm/line,server=on,wait=off" >"$vm/arm.log" 2>&1 </dev/null &
    line="socket,id=line,path=$vm/line" board=2
else
    "$build/gonio-controller" --pty "$vm/line" >"$vm/controller.log" 2>&1 </dev/null &
    line="serial,id=line,path=$vm/line" board=1
fi
helpers=$!
# An emulated processor never rests; once its test is over it is taken away from the others.
(until grep -q '^# chain: from' "$vm/output" 2>/dev/null; do sleep 0.5; done; kill "$helpers") 2>/dev/null &
helpers="$helpers $!"
echo $board >"$root/tests/board"
for i in 1 2 3 4 5 6 7 8 9 10; do [ -e "$vm/line" ] && break; sleep 0.2; done
echo "# prepared in $(($(date +%s) - start)) s"

# ---- the machine ----
# boot DEVICES GROUP ...: run groups; their lines to the log. A group whose end is missing has failed.
boot() {
    devices=$1
    shift
    echo "$*" >"$root/tests/groups"
    (cd "$root" && find . | cpio -o -H newc --quiet) >"$vm/initrd"
    rm -f "$vm/output"
    # shellcheck disable=SC2086
    timeout "${LIMIT:-300}" qemu-system-x86_64 -nodefaults -no-user-config -no-reboot -display none -machine q35 \
        -accel "${ACCEL:-tcg,thread=multi,tb-size=512}" -cpu "${CPU:-max,-erms,-fsrm}" -smp 2 -m 1536 \
        -kernel "$vm/linux/boot/vmlinuz-$version" -initrd "$vm/initrd" \
        -append "console=ttyS0 quiet panic=-1 tsc=unstable mitigations=off nokaslr random.trust_cpu=on no_timer_check rdinit=/init" \
        -serial "file:$vm/console" -serial "file:$vm/output" -device qemu-xhci $devices </dev/null >"$vm/qemu.log" 2>&1 &
    machine=$!
    # A group that hangs in the kernel keeps the machine from ending by itself.
    while kill -0 $machine 2>/dev/null; do
        grep -q '^finished' "$vm/output" 2>/dev/null && sleep 3 && kill $machine 2>/dev/null
        sleep 1
    done
    tr -d '\r' <"$vm/output" 2>/dev/null | grep -v '^finished' >>"$log"
    for group; do
        grep -q "^# $group: from" "$log" || echo "not ok - $group: has not come to its end" >>"$log"
    done
}
: >"$log"
boot "-chardev $line -device usb-serial,chardev=line" "$@"
# An emulated machine's clocks stand still while others hold the processor, and its kernel may race: what failed is run
# once more, and that counts. The board at the far end of the USB adapter (chain) is there once only.
again=
for group; do
    [ "$group" != chain ] && grep -q "^not ok - $group:" "$log" && again="$again $group"
done
if [ -n "$again" ]; then
    for group in $again; do
        grep "^not ok - $group:" "$log" | sed 's/^not ok/# the first time: not ok/'
        grep -vE "^(# |ok - |not ok - )$group:" "$log" >"$log.rest"
        mv "$log.rest" "$log"
    done
    # shellcheck disable=SC2086
    boot "" $again
fi
cat "$log"
skipped=$(grep -c '^ok .*# SKIP' "$log") passed=$(grep '^ok ' "$log" | grep -vc '# SKIP') failed=$(grep -c '^not ok ' "$log")
echo "# $(($(date +%s) - start)) s"
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
