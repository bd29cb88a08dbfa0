#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Real drivers through the program: the controller as a process (TCP and pty), an independent Modbus slave, simulated
# camera on real arms, and the actions of `gonio rig`.
. tests/system/lib.sh
if ! start_controller 9 pty --pty "$work/controller" --speed 30; then
    skip "real drivers" "gonio-controller is not built"
    finish
    exit
fi
start_controller 8 tcp --tcp 0 --speed 30

# Nothing tells where the switches are: the controller's own parameters do.
rig() {
    cat <<END
[rig]
driver = sim
[controller]
port = $1
deadman_s = 300
[stage]
driver = modbus
END
    for axis in light_theta light_phi camera_theta camera_phi; do
        printf '[axis %s]\nsteps_per_deg = 100\nspeed_deg_per_s = 300\nacceleration_deg_per_s2 = 2000\n' $axis
        printf 'jerk_deg_per_s3 = 40000\nhome_fast_deg_per_s = 200\n'
    done
}
rig "tcp:127.0.0.1:$port" >"$work/tcp.ini"
rig "$work/controller" >"$work/pty.ini"
for axis in light_theta light_phi camera_theta camera_phi; do
    sed -n "/axis $axis/,\$p" "$work/tcp.ini" | sed -n '1,5p' | grep -v -e steps_per_deg -e home
done | sed '1i [rig]\ndriver = sim' >"$work/plain.ini"
sample=ward:rho_d=0.3,rho_s=0.2,alpha=0.15

exits "identify" 0 "$GONIO" rig identify --rig "$work/tcp.ini" --sample $sample --json
check "its controller is named" grep -q '"controller":{"firmware"' "$work/out"
exits "selftest" 0 "$GONIO" rig selftest --rig "$work/tcp.ini" --sample $sample
exits "its words" 0 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --json
check "it has moved nothing, and nobody holds the rig" grep -q '"homed":0,.*"held":"by nobody"' "$work/out"
echo "hold door 1" >&8
sleep 0.1
exits "a lamp is not switched on at an open door" 1 "$GONIO" rig lamp 1 --rig "$work/tcp.ini" --sample $sample --set lamp.driver=modbus
check "and nobody says so" sh -c "! grep -q lamp_level '$work/out'"
exits "selftest sees the door" 1 "$GONIO" rig selftest --rig "$work/tcp.ini" --sample $sample
says "of the controller" "the door is open"
echo "release door" >&8
echo "hold estop 1" >&8
sleep 0.1
exits "selftest sees the held stop" 1 "$GONIO" rig selftest --rig "$work/tcp.ini" --sample $sample
says "of the controller" "emergency stop is pressed"
exits "an alarm is not cleared while its cause stands" 1 "$GONIO" rig clear --rig "$work/tcp.ini" --sample $sample
check "and nobody says so" sh -c "! grep -q alarm-cleared '$work/out' '$work/err'"
echo "release estop" >&8
sleep 0.1
exits "then it is" 0 "$GONIO" rig clear --rig "$work/tcp.ini" --sample $sample
exits "usb" 0 "$GONIO" rig usb
check "says what there is, or none" grep -q '^instruments' "$work/out"
exits "a speed beyond the controller is bad input" 3 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --set "axis light_theta.speed_deg_per_s=700"
says "naming key, value and the largest" "[axis light_theta] speed_deg_per_s = 700: the controller's largest is 625"
exits "a move before homing is refused" 1 "$GONIO" rig move light_theta=10 --rig "$work/tcp.ini" --sample $sample
says "and says so" "not homed"
exits "home" 0 "$GONIO" rig home --rig "$work/tcp.ini" --sample $sample --json
check "homing tells what had drifted" grep -q home_difference_deg "$work/out"
exits "a move" 0 "$GONIO" rig move light_theta=10 camera_theta=-20 --rig "$work/tcp.ini" --sample $sample --json
exits "which another program finds" 0 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --json
check "where it ended" grep -q 'position_deg.*10[.,].*-20[.,]' "$work/out"
# An edited rig file: looking at it changes nothing, moving by it asks for homing.
edited="axis light_phi.steps_per_deg=150"
exits "status with another scale" 0 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --set "$edited" --json
check "leaves all axes homed" grep -q '"homed":15' "$work/out"
exits "a move with another scale is refused" 1 "$GONIO" rig move light_phi=20 --rig "$work/tcp.ini" --sample $sample --set "$edited"
says "naming the difference" "light_phi steps_per_deg: the controller had 100, the rig file has 150; home it again"
exits "and that axis is not homed" 0 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --json
check "but the others are" grep -q '"homed":13' "$work/out"
exits "home with the rig file" 0 "$GONIO" rig home --rig "$work/tcp.ini" --sample $sample
exits "a move beyond the limits is refused" 1 "$GONIO" rig move light_theta=400 --rig "$work/tcp.ini" --sample $sample
says "with the limits" "limits are"
exits "a wrong axis is wrong usage" 2 "$GONIO" rig move shoulder=4 --rig "$work/tcp.ini" --sample $sample
exits "no port is a device fault" 1 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --set controller.port=/dev/null/x
exits "an unknown key is bad input" 3 sh -c "printf '[controller]\nport = x\nbauds = 3\n' > $work/bad.ini; $GONIO rig status --rig $work/bad.ini --sample $sample"

exits "a key of another driver is bad input" 3 sh -c "printf '[rig]\ndriver = null\n[lamp]\ndriver = gpio\n[controller]\nport = x\n' > $work/bad.ini; $GONIO rig status --rig $work/bad.ini"
says "which says whose it is, with its line" "bad.ini:6: controller.port is a key of [stage] driver = modbus"
exits "the drivers" 0 "$GONIO" drivers
check "with their keys" grep -q '\[camera\] trigger_pulse_ms .*a number from 0 to 1000' "$work/out"
exits "the drivers as JSON" 0 "$GONIO" drivers --json
check "with what they are" python3 -c "
import json
drivers=json.load(open('$work/out'))['drivers']
assert {d['device'] for d in drivers if d['driver']=='null'} == {'stage','lamp','meter','camera','interlock','mount'}
assert all(k['value'] for d in drivers for k in d['keys'])"
exits "a null device on a simulated rig" 0 "$GONIO" rig identify --rig sim --sample $sample --set camera.driver=null
exits "a simulated camera bursts" 0 "$GONIO" rig burst 5 "$work/burst" --rig sim --sample $sample --exposure 0.01 --json
check "every frame" grep -q '"frames":5,"lost":0,' "$work/out"
exits "into a session that is sound" 0 "$GONIO" doctor "$work/burst"
exits "a camera without a rate of its own does not" 1 "$GONIO" rig burst 5 "$work/none" --rig sim --sample $sample --set camera.driver=null
says "and says so" "a null camera has no frames at a rate of its own"
exits "a simulated rig tests its camera" 0 "$GONIO" rig selftest --rig sim --sample $sample --json
check "and how soon it follows" grep -q '"settle_frames_needed":0' "$work/out"

exits "a travel of nothing is refused" 2 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --set "axis light_theta.home_travel_deg=0"
says "with what was expected" "[axis light_theta] home_travel_deg: found '0', expected a number from 0.001 to 1440"
exits "home_pressed is 0 or 1" 3 sh -c "(cat '$work/tcp.ini'; printf '[stage]\nhome_pressed = 2\n') >'$work/bad.ini'; '$GONIO' rig status --rig '$work/bad.ini' --sample $sample"
says "with its line" "bad.ini:$(grep -n home_pressed "$work/bad.ini" | cut -d: -f1):"
says "and what was found" "[stage] home_pressed: found '2', expected a whole number from 0 to 1"
exits "both are keys of the controller alone" 2 "$GONIO" rig status --rig sim --sample $sample --set stage.home_pressed=1
exits "both are taken" 0 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --set "stage.home_pressed=1,axis light_theta.home_travel_deg=800"

# A second terminal reaches the program that drives the rig, on a line that is that program's alone.
for way in tcp pty; do
    rig="--rig $work/$way.ini --sample $sample"
    exits "$way: stop without a program at work" 0 "$GONIO" rig stop $rig
    "$GONIO" rig home $rig >/dev/null 2>&1
    "$GONIO" rig move light_theta=80 $rig --set "axis light_theta.speed_deg_per_s=0.2" >"$work/move.out" 2>"$work/move.err" &
    moving=$!
    check "$way: status of a rig that moves" wait_for 5 sh -c "'$GONIO' rig status $rig --json >'$work/out' && grep -q '\"pid\":$moving,.*a move is under way' '$work/out'"
    check "$way: where it is" grep -q '"position_deg":{"light_theta":[0-9.]*,' "$work/out"
    exits "$way: nobody else may move it" 1 "$GONIO" rig move light_theta=10 $rig
    says "$way: and hears who does" "process $moving, drives this rig"
    exits "$way: nor measure with it" 1 "$GONIO" measure --rig "$work/$way.ini" --sample $sample --plan nusselt:6 "$work/none"
    exits "$way: stop" 0 env GONIO_RIG="$work/$way.ini" "$GONIO" rig stop --sample $sample
    wait $moving
    got=$?
    if [ $got -eq 4 ] && grep -q 'interrupted in mid-move; the axes were stopped' "$work/move.err"; then pass "$way: ends the move as Ctrl-C does"; else
        fail "$way: ends the move as Ctrl-C does" "status $got" "$(cat "$work/move.err")"
    fi
    exits "$way: it stands where it was stopped" 0 "$GONIO" rig status $rig --json
    check "$way: between here and there" sh -c "grep -q 'ready for a command' '$work/out' && ! grep -q '\"light_theta\":80' '$work/out'"
done
[ ! -e "$work/none" ]
ok $? "what was refused has begun no session"
for action in identify status home "move light_theta=1" "jog light_theta=1" stop clear "lamp 1" "shutter open" capture "burst 2 $work/none" selftest; do
    exits "$action: which rig?" 2 env -u GONIO_RIG "$GONIO" rig $action
    says "it asks" "--rig RIG.ini, or GONIO_RIG"
done
exits "nobody can stop the simulator of another program" 2 "$GONIO" rig stop --rig sim
says "and is told what can be stopped" "gonio stop SESSION"
(
    "$GONIO" measure --rig "$work/tcp.ini" --sample $sample --plan nusselt:40 --seed 3 "$work/far" >"$work/far.log" 2>&1
    echo $? >"$work/far.status"
) &
wait_for 5 sh -c "'$GONIO' status --json '$work/far' | grep -q '\"state\":\"running\"'"
exits "a measure's rig" 0 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --json
check "tells of its session" grep -q "\"session\":\"$work/far\"" "$work/out"
exits "rig stop ends the measure" 0 "$GONIO" rig stop --rig "$work/tcp.ini" --sample $sample
wait_for 5 test -s "$work/far.status"
check "which can be gone on with" sh -c "[ \$(cat '$work/far.status') = 4 ] && grep -q 'gonio resume' '$work/far.log'"

# Equal seeds, equal samples, whichever stage moves.
measure() {
    "$GONIO" measure --rig "$1" --sample $sample --plan nusselt:6 --seed 3 --set scan.settle_s=0.02 --json "$2" 2>"$work/measure.err" |
        sed -n 's/.*"samples_sha256":"\([0-9a-f]*\)".*/\1/p'
}
plain=$(measure "$work/plain.ini" "$work/plain")
tcp=$(measure "$work/tcp.ini" "$work/tcp.session")
tail -n 3 "$work/measure.err" >"$work/said"
pty=$(measure "$work/pty.ini" "$work/pty.session")
if [ -n "$plain" ] && [ "$plain" = "$tcp" ]; then pass "a measure over Modbus TCP gives the in-process stage's samples"; else
    fail "a measure over Modbus TCP gives the in-process stage's samples" "in process '$plain', TCP '$tcp'" "$(cat "$work/said")"
fi
if [ -n "$plain" ] && [ "$plain" = "$pty" ]; then pass "a measure over a serial line gives the in-process stage's samples"; else
    fail "a measure over a serial line gives the in-process stage's samples" "in process '$plain', pty '$pty'" "$(tail -n 3 "$work/measure.err")"
fi

# The emergency stop of the controller ends a measure with a named fault, and the resumed one ends with the same samples.
("$GONIO" measure --rig "$work/pty.ini" --sample $sample --plan nusselt:6 --seed 3 --set scan.settle_s=0.02 "$work/stopped" >"$work/stop.log" 2>&1; echo $? >"$work/stop.status") &
wait_for 5 test -s "$work/stopped/session.db"
sleep 0.4
echo "hold estop 1" >&9
wait_for 5 test -s "$work/stop.status"
if [ "$(cat "$work/stop.status")" = 1 ] && grep -q EMERGENCY "$work/stop.log"; then pass "an emergency stop ends a measure and is named"; else
    fail "an emergency stop ends a measure and is named" "status $(cat "$work/stop.status")" "$(tail -n 3 "$work/stop.log")"
fi
exits "nothing moves while it is pressed" 1 "$GONIO" resume --stored-rig "$work/stopped"
echo "release estop" >&9
sleep 0.2
exits "a stored rig is not opened unasked" 2 "$GONIO" resume "$work/stopped" </dev/null
# The adapter has come back under another name, and the rig file says so.
line=$(sed -n 's/^port = //p' "$work/pty.ini")
ln -s "$line" "$work/other-name"
sed "s|^port = .*|port = $work/other-name|" "$work/pty.ini" >"$work/moved.ini"
for change in steps_per_deg=101 home_deg=-9 min_deg=-6; do
    (cat "$work/moved.ini"; printf '[axis light_theta]\n%s\n' "$change") >"$work/changed.ini"
    exits "a rig file with another ${change%=*} is refused" 3 "$GONIO" resume --rig "$work/changed.ini" "$work/stopped"
    says "with its line" "changed.ini:$(grep -n "^$change" "$work/changed.ini" | cut -d: -f1): [axis light_theta] ${change%=*}"
done
resumed=$("$GONIO" resume --rig "$work/moved.ini" --json "$work/stopped" 2>"$work/resume.err" </dev/null | sed -n 's/.*"samples_sha256":"\([0-9a-f]*\)".*/\1/p')
if [ -n "$plain" ] && [ "$plain" = "$resumed" ]; then pass "the resumed measure has the same samples"; else
    fail "the resumed measure has the same samples" "'$plain', resumed '$resumed'" "$(tail -n 3 "$work/resume.err")"
fi

check "and tells what was changed" sh -c "'$GONIO' doctor '$work/stopped' | grep -q 'settings changed: .*controller.port=$work/other-name'"

# A record of a session's line answers in the controller's place.
exits "record" 0 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --set "controller.record=$work/tape" --json
mv "$work/out" "$work/recorded"
exits "replay" 0 "$GONIO" rig status --rig "$work/tcp.ini" --sample $sample --set "controller.replay=$work/tape,controller.port=/dev/null/x" --json
check "the replay says what the record said" cmp "$work/recorded" "$work/out"
exits "a replay of something else is noticed" 1 "$GONIO" rig home --rig "$work/tcp.ini" --sample $sample --set "controller.replay=$work/tape"

# Keep-out zones: refused in a plan before anything moves, and in a move.
(cat "$work/plain.ini"; printf '[keep-out post]\nlight_theta = 20 30\ncamera_theta = 20 30\n[keep-out]\nretro_deg = 5\n') >"$work/zones.ini"
printf 'theta_i,phi_i,theta_o,phi_o\n10,0,40,180\n40,0,10,180\n' >"$work/through.csv"
printf 'theta_i,phi_i,theta_o,phi_o\n10,0,40,180\n10,0,12,0\n' >"$work/shadow.csv"
printf 'theta_i,phi_i,theta_o,phi_o\n10,0,40,180\n15,0,45,180\n' >"$work/clear.csv"
exits "a plan with a way through a zone is refused" 1 "$GONIO" plan "$work/through.csv" --check "$work/zones.ini" --sample $sample -o "$work/poses.csv"
says "naming the zone" "keep-out zone 'post'"
exits "a plan with a shadowed pose is refused" 1 "$GONIO" plan "$work/shadow.csv" --check "$work/zones.ini" --sample $sample -o "$work/poses.csv"
says "as unmeasurable" "camera shadows the light"
sed 's/^light_theta = 20 30/light_theta = 70 80/; s/^retro_deg = 5/retro_deg = 0/' "$work/zones.ini" >"$work/elsewhere.ini"
exits "the same zone elsewhere lets a plan pass" 0 "$GONIO" plan "$work/clear.csv" --check "$work/elsewhere.ini" --sample $sample -o "$work/poses.csv"
printf '[rig]\ndriver = sim\n' >"$work/any.ini"
exits "a plan needs no sample, whatever names the simulator" 0 "$GONIO" plan "$work/clear.csv" --rig "$work/any.ini" -o "$work/poses.csv"
exits "nor does --rig sim" 0 "$GONIO" rig status --rig sim
exits "a zone of no width is bad input" 3 sh -c "(cat $work/plain.ini; printf '[keep-out post]\nlight_theta = 30 20\n') > $work/bad.ini; $GONIO plan $work/clear.csv --check $work/bad.ini --sample $sample"

# Other arms: the simulated switches stand where the rig file has them.
start_controller 7 other --tcp 0 --speed 30
rig "tcp:127.0.0.1:$port" |
    sed -e 's/^steps_per_deg = 100/steps_per_deg = 888.889\nmin_deg = -5\nmax_deg = 92\nhome_deg = -4.5/' \
        -e 's/^speed_deg_per_s = 300/speed_deg_per_s = 40/' -e 's/^home_fast_deg_per_s = 200/home_fast_deg_per_s = 30/' \
        -e 's/^jerk_deg_per_s3 = 40000/jerk_deg_per_s3 = 0/' >"$work/other.ini"
exits "other arms home" 0 "$GONIO" rig home --rig "$work/other.ini" --sample $sample
exits "and move over all of their range" 0 "$GONIO" rig move light_theta=92 light_phi=-4.5 --rig "$work/other.ini" --sample $sample
exits "an azimuth beyond the limits is another turn's" 0 "$GONIO" rig move light_phi=358 camera_phi=-300 --rig "$work/other.ini" --sample $sample
exits "status" 0 "$GONIO" rig status --rig "$work/other.ini" --sample $sample --json
check "within them" grep -qE '"light_phi":-2.0.*"camera_phi":59.99' "$work/out"

# An independent slave: another implementation of the protocol, with this table's first registers.
if /usr/bin/python3 -c 'import pymodbus' 2>/dev/null; then
    /usr/bin/python3 tests/system/pymodbus_slave.py "$work/slave.port" >"$work/slave.log" 2>&1 &
    pids="$pids $!"
    wait_for 5 test -s "$work/slave.port"
    sed "s/^port = .*/port = tcp:127.0.0.1:$(cat "$work/slave.port")/" "$work/tcp.ini" >"$work/slave.ini"
    exits "an independent slave is identified" 0 "$GONIO" rig identify --rig "$work/slave.ini" --sample $sample --json
    check "with what it says" grep -q '"firmware":"7.8.9","protocol":2,"board":77' "$work/out"
    exits "its alarm is named" 1 "$GONIO" rig home --rig "$work/slave.ini" --sample $sample --set controller.retries=1
    says "with its number" "alarm: 6 HOME_MISSING"
else
    skip "an independent slave" "python3-pymodbus is not installed"
fi
finish
