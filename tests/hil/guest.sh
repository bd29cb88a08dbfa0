# SPDX-License-Identifier: BSD-3-Clause
# What runs in the test machine: independent groups side by side, each with its own simulated devices.
# /tests holds the programs, /modules the kernel modules and, a file a module, what has to be loaded for it in order.
up() { cut -d' ' -f1 /proc/uptime; }
skipped() { echo "ok - $1 # SKIP $2"; }
# load MODULE [OPTION ...]
load() {
    name=$1
    shift
    [ -f "/modules/$name.list" ] || return 1
    while read -r file; do
        module=$(echo "${file%.ko}" | tr - _)
        options=
        [ "${file%.ko}" = "$name" ] && options=$*
        # Side by side, another may have loaded it in the same moment.
        [ -d "/sys/module/$module" ] || insmod "/modules/$file" $options 2>/tmp/insmod.$name || [ -d "/sys/module/$module" ] || {
            echo "# $name: $(cat /tmp/insmod.$name)"
            return 1
        }
    done <"/modules/$name.list"
}
# wait_for TENTHS COMMAND ...
wait_for() {
    left=$1
    shift
    until "$@" 2>/dev/null; do
        left=$((left - 1))
        [ "$left" -gt 0 ] || return 1
        sleep 0.1
    done
}
config=/sys/kernel/config

vivid_group() {
    load vivid n_devs=2 node_types=0x1,0x1 input_types=0x00,0x00 num_inputs=1,1 multiplanar=1,2 vid_cap_nr=0,1 ||
        { skipped "camera" "no vivid"; return; }
    wait_for 100 test -e /dev/video1
    vivid /dev/video0 /dev/video1 /tmp/tape
    # Through the program, into a session; vivid's own pace under emulation is nobody's figure.
    answer=$(gonio rig burst 40 /tmp/burst --json --rig sim --sample lambert:rho=0.5 \
        --set camera.driver=v4l2,camera.device=/dev/video0,camera.format=Y16,camera.width=320,camera.height=180,camera.fixed_exposure_ms=10 2>&1)
    case $answer in
    *'"frames":40,'*) echo "ok - gonio rig burst stores every frame in a session" ;;
    *) echo "not ok - gonio rig burst stores every frame in a session"; echo "# $answer" ;;
    esac
    before=$(du -s /tmp/burst/frames | cut -f1)
    answer=$(gonio doctor /tmp/burst --compress --json)
    case $answer in
    *'"sound":true,'*'"frames":40,'*) echo "ok - compressed, $before KiB to $(du -s /tmp/burst/frames | cut -f1), it is sound" ;;
    *) echo "not ok - compressed it is sound"; echo "# $answer" ;;
    esac
    report=$(gonio rig camera /dev/video0 --json)
    case $report in
    *'"format":"Y16"'*'"fit":"yes"'*) echo "ok - gonio rig camera tells which formats are fit" ;;
    *) echo "not ok - gonio rig camera tells which formats are fit"; echo "# $report" ;;
    esac
}

# Lines 0 to 4 of a chip; its folder in sysfs on stdout.
make_chip() {
    chip=$config/gpio-sim/gonio
    mkdir -p "$chip/bank0"
    echo 8 >"$chip/bank0/num_lines"
    n=0
    for line in gonio-estop gonio-door gonio-lamp gonio-shutter gonio-trigger; do
        mkdir "$chip/bank0/line$n"
        echo $line >"$chip/bank0/line$n/name"
        n=$((n + 1))
    done
    echo 1 >"$chip/live"
    echo "/sys/devices/platform/$(cat "$chip/dev_name")/$(cat "$chip/bank0/chip_name")"
}

gpio_group() {
    gonio-controller --pty /tmp/controller >/tmp/controller.log 2>&1 </dev/null &
    wait_for 100 test -e /tmp/controller
    gpio "$1" /tmp/controller
}

usbtmc_group() {
    load libcomposite && load usb_f_fs && load dummy_hcd || { skipped "USB instrument" "no dummy_hcd"; return; }
    gadget=$config/usb_gadget/meter
    mkdir "$gadget"
    echo 0x1209 >"$gadget/idVendor"
    echo 0x0001 >"$gadget/idProduct"
    mkdir "$gadget/strings/0x409" "$gadget/configs/c.1" "$gadget/functions/ffs.meter" /tmp/ffs
    echo GONIO >"$gadget/strings/0x409/manufacturer"
    echo PM-2 >"$gadget/strings/0x409/product"
    echo S1 >"$gadget/strings/0x409/serialnumber"
    ln -s "$gadget/functions/ffs.meter" "$gadget/configs/c.1/"
    mount -t functionfs meter /tmp/ffs
    usbtmc_gadget /tmp/ffs >/tmp/gadget.log 2>&1 &
    wait_for 100 grep -q ready /tmp/gadget.log
    udc=$(ls /sys/class/udc)
    echo "$udc" >"$gadget/UDC"
    usbtmc "$gadget" "$udc"
}

chain_group() {
    load xhci_pci && load ftdi_sio || { skipped "USB serial adapter" "no ftdi_sio"; return; }
    wait_for 200 test -e /dev/ttyUSB0 || { echo "not ok - a USB serial adapter appears"; return; }
    chain /dev/ttyUSB0 "$(cat /tests/board)" 0
}

# A whole measure whose camera is v4l2loopback: the frames of a simulated measure, one a trigger pulse, give its samples.
measure_group() {
    load v4l2loopback video_nr=7 exclusive_caps=0 || { skipped "a measure over v4l2loopback" "no v4l2loopback"; return; }
    wait_for 100 test -e /dev/video7
    loopback /tests/session 160 128 /dev/video7 "$1/sim_gpio4/value" >/tmp/loopback.log 2>&1 &
    wait_for 200 grep -q ready /tmp/loopback.log
    answer=$(gonio measure --rig /tests/loopback.ini --seed 3 --plan /tests/plan.csv --method mba --json /tmp/measured 2>/tmp/measure.err)
    wanted=$(cat /tests/session.samples_sha256)
    case $answer in
    *"\"samples_sha256\":\"$wanted\""*) echo "ok - a measure over v4l2loopback has the simulated measure's samples" ;;
    *)
        echo "not ok - a measure over v4l2loopback has the simulated measure's samples"
        echo "# wanted $wanted"
        echo "# $answer" | cut -c1-600
        cat /tmp/measure.err /tmp/loopback.log | tail -n 5 | sed 's/^/# /'
        ;;
    esac
}

echo "# booted: $(up) s"
load configfs
mount -t configfs c $config
chip=
load gpio-sim && chip=$(make_chip)
run() {
    group=$1
    shift
    from=$(up)
    "${group}_group" "$@" >/tmp/$group.tap 2>&1
    echo "# $group: from $from to $(up) s" >>/tmp/$group.tap
}
wanted=$(cat /tests/groups)
for group in $wanted; do
    case $group in
    gpio | measure)
        if [ -n "$chip" ]; then run "$group" "$chip" & else
            { skipped "$group" "no gpio-sim"; echo "# $group: from 0 to 0 s"; } >/tmp/$group.tap
        fi
        ;;
    *) run "$group" & ;;
    esac
done
for group in $wanted; do
    wait_for 1800 grep -q "^# $group: from" /tmp/$group.tap
    sed "s/^\(not ok\|ok\) - /\1 - $group: /" /tmp/$group.tap
done
