# The V4L2 driver against the kernel's vivid: every format it has and Gonio unpacks, automatic functions, a report.
modprobe -S "$KERNEL" -d "$MODULES" vivid n_devs=1 node_types=0x1 input_types=0x00 num_inputs=1 || {
    echo "ok - camera # SKIP no vivid"
    exit 0
}
for i in 1 2 3 4 5 6 7 8 9 10; do [ -e /dev/video0 ] && break; sleep 0.2; done
report=$("$GONIO" rig camera /dev/video0 --json)
case $report in
*'"format":"Y16"'*'"fit":"yes"'*) echo "ok - vivid's formats are reported" ;;
*) echo "not ok - vivid's formats are reported"; echo "# $report" ;;
esac
for format in GREY Y10 Y12 Y16 Y16_BE SRGGB8 SBGGR10 SGRBG12 SGBRG16 YUYV; do
    answer=$("$GONIO" rig capture --json --exposure 0.02 --sample lambert:rho=0.5 \
        --set "camera.driver=v4l2,camera.device=/dev/video0,camera.format=$format,camera.fixed_exposure_ms=20" 2>&1)
    # The default picture is colour bars: neither empty nor flat.
    case $answer in
    *'"deviation":0.0,'*) echo "not ok - $format is captured"; echo "# $answer" ;;
    *'"width":'*'"deviation":'*) echo "ok - $format is captured" ;;
    *) echo "not ok - $format is captured"; echo "# $answer" ;;
    esac
done
answer=$("$GONIO" rig capture --sample lambert:rho=0.5 \
    --set camera.driver=v4l2,camera.device=/dev/video0,camera.format=MJPG,camera.fixed_exposure_ms=20 2>&1)
case $answer in
*compressed*) echo "ok - MJPEG is refused" ;;
*) echo "not ok - MJPEG is refused"; echo "# $answer" ;;
esac
answer=$("$GONIO" rig capture --sample lambert:rho=0.5 --set camera.driver=v4l2,camera.device=/dev/video0 2>&1)
case $answer in
*"no exposure control"*) echo "ok - a camera without an exposure control is refused" ;;
*) echo "not ok - a camera without an exposure control is refused"; echo "# $answer" ;;
esac
# A record of the real kernel's answers replays to the same picture.
rig="camera.driver=v4l2,camera.device=/dev/video0,camera.format=Y12,camera.fixed_exposure_ms=20"
recorded=$("$GONIO" rig capture --json --exposure 0.02 --sample lambert:rho=0.5 --set "$rig,camera.record=/tmp/tape" 2>&1)
replayed=$("$GONIO" rig capture --json --exposure 0.02 --sample lambert:rho=0.5 --set "$rig,camera.replay=/tmp/tape" 2>&1)
if [ "$recorded" = "$replayed" ]; then echo "ok - a recorded capture replays"; else
    echo "not ok - a recorded capture replays"; echo "# $recorded"; echo "# $replayed"
fi
