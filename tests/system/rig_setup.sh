#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# From a controller that nobody has set up to a homed rig, by answers from a pipe; the controller's parameters by name;
# single axes.
. tests/system/lib.sh
unset GONIO_RIG
if ! start_controller 8 controller --tcp 0 --speed 30 --flash "$work/flash"; then
    skip "setting a rig up" "gonio-controller is not built"
    finish
    exit
fi
ini=$work/rig.ini

# ---- setup: an emergency stop that reads high at rest, three home switches, one axis of a wrong direction ----
echo "hold estop 1" >&8
mkfifo "$work/answers"
"$GONIO" rig setup "$ini" --json <"$work/answers" >"$work/out" 2>"$work/err" &
setup=$!
pids="$pids $setup"
exec 7>"$work/answers"
printf 'tcp:127.0.0.1:%s\n300\n' "$port" >&7
check "setup shows an input's level" wait_for 30 grep -q 'estop (emergency stop) reads high' "$work/err"
echo "hold estop 0" >&8
check "as it changes" wait_for 30 grep -q 'estop: low' "$work/err"
echo seen >&7
check "and takes none that is not back" wait_for 30 grep -q 'it is not back at rest' "$work/err"
echo "hold estop 1" >&8
check "until it is" wait_for 30 grep -q 'estop: high' "$work/err"
printf '%s\n' seen unwired low low low unwired no >&7
wait_for 30 grep -q 'light_theta: motor steps' "$work/err"
echo "hold estop 0" >&8 # the simulated contact follows input_invert
printf '%s\n' 100 20 -10 80 lower "" yes smaller yes turn again >&7 # light_theta turns the right way already
printf '%s\n' 100 900 20 -90 90 sideways upper "" yes larger yes >&7
printf '%s\n' 100 20 -90 90 "" "" no yes >&7
printf '%s\n' 0 >&7
printf '%s\n' modbus yes turn yes turn yes yes >&7 # it burned at once; and now it does not: as it was, then
printf '%s\n' /dev/gonio-absent again none >&7
printf '%s\n' scpi tcp:127.0.0.1:1 again modbus yes >&7
exec 7>&-
wait $setup
ok $? "setup ends well" "$(tail -n 5 "$work/err")"
check "with three homed axes" grep -q '"homed":\["light_theta","light_phi","camera_theta"\]' "$work/out"
check "it told of the wrong direction" grep -q 'no home switch within home_travel' "$work/err"
check "and of numbers that cannot be" grep -q 'expected a number from 0.001 to 625' "$work/err"
check "and of words" grep -q 'expected lower, upper' "$work/err"
check "the file names the wired inputs" grep -q '^input_enable = home_light_theta,home_light_phi,home_camera_theta,estop$' "$ini"
check "lamp and meter were tried" sh -c "grep -q 'it reads 0' '$work/err' && grep -q 'look away from it' '$work/err'"
check "and stand in the file" sh -c "grep -A1 '^.lamp.$' '$ini' | grep -q modbus && grep -A1 '^.meter.$' '$ini' | grep -q modbus"
check "the lamp's output as it was in the end" grep -q '^output_invert = none$' "$ini"
check "a camera that is not there is told" sh -c "grep -A1 'or none .*/dev/gonio-absent' '$work/err' | grep -q 'cannot be opened'"
check "and is not in the file" sh -c "! grep -q '^.camera.$' '$ini'"
check "and so is a meter" grep -q '127.0.0.1:1' "$work/err"
check "and their polarity" grep -q '^input_invert = estop$' "$ini"
exits "status of that rig" 0 "$GONIO" rig status --rig "$ini" --json
check "homed, without an alarm" grep -q '"alarm":"0 NONE","homed":15' "$work/out"
exits "it homes by its file" 0 "$GONIO" rig home light_theta light_phi camera_theta --rig "$ini"
exits "and its parameters are those of the file" 0 "$GONIO" rig parameters --rig "$ini" --json
check "all of them with unit and bounds" python3 -c "
import json
p = json.load(open('$work/out'))['parameters']
assert len(p) > 30 and all(set(v) == {'value', 'unit', 'bounds', 'meaning', 'key'} for v in p.values())
assert p['input_invert']['value'] == 'estop' and p['home_up']['value']['light_phi'] == '1'
assert p['temperature_max'] | {'meaning': ''} == {'value': '90', 'unit': 'degC', 'bounds': '-40 to 250', 'meaning': '',
    'key': '[controller] temperature_max_c'}
assert p['slave_address']['key'] is None"
check "nothing was left to write" sh -c "! grep -q parameters: '$work/err'"
exits "a file that is there is not written over" 2 "$GONIO" rig setup "$ini"
says "and that is said" "exists"
exits "answers that end leave no file" 2 sh -c "printf 'tcp:127.0.0.1:$port\n300\n' | '$GONIO' rig setup '$work/half.ini'"
[ ! -e "$work/half.ini" ]
ok $? "none at all"
printf '[rig]\ndriver = null\n[controller]\nport = tcp:127.0.0.1:%s\ndeadman_s = 300\nsettle_ms = 20\n[stage]\ndriver = modbus\n' "$port" >"$work/bare.ini"
bare="--rig $work/bare.ini"
exits "the inputs as they are wired" 0 "$GONIO" rig set input_enable=home_light_theta,home_light_phi,home_camera_theta,estop $bare

# ---- parameters, set, save ----
exits "parameters for a reader" 0 "$GONIO" rig parameters speed_max safe_motors $bare
check "are assignments" grep -q '^light_phi.speed_max=2000 steps/s$' "$work/out"
exits "set" 0 "$GONIO" rig set pulse=5 camera_phi.home_order=0 temperature_max=80.5 safe_motors=light_theta,camera_phi $bare --json
check "tells what is held now" grep -q '"pulse":{"value":"5","unit":"us"' "$work/out"
exits "which others see" 0 "$GONIO" rig parameters temperature_max $bare
exits "a name that is none" 2 "$GONIO" rig parameters velocity $bare
exits "what changes no step's meaning" 0 "$GONIO" rig status $bare --json
check "leaves the axes homed" grep -q '"homed":15' "$work/out"
exits "what changes it" 0 "$GONIO" rig set direction_invert=light_phi $bare --json
check "names the axes that are not homed any more" grep -q '"not_homed_any_more":\["light_phi"\]' "$work/out"
says "and asks for homing" "light_phi: a step means something else now; home it again"
exits "one axis of a parameter" 0 "$GONIO" rig set light_theta.steps_per_deg=888.889 $bare --json
check "leaves the others" grep -q '"light_theta":"888.889","light_phi":"100"' "$work/out"
for bad in pulse=8 pulse=2.5 pulse= pulse temperature_max=251 input_enable=home light_phi.pulse=3 knee.speed_max=3 =3 velocity=3 position=0; do
    exits "set $bad" 2 "$GONIO" rig set "$bad" pulse=4 $bare
done
exits "nothing was written by those" 0 "$GONIO" rig parameters pulse $bare
check "of what stood beside them" grep -q '^pulse=5 us' "$work/out"
exits "what the rig file says is changed there" 2 "$GONIO" rig set settle=30 $bare
says "by its key" "[controller] settle_ms"
exits "the same of an axis" 2 "$GONIO" rig set light_phi.speed_max=30 --rig "$ini"
says "by its key" "[axis ...] speed_deg_per_s"
exits "the simulator has none" 1 "$GONIO" rig parameters --rig sim
exits "a key of the rig file" 3 sh -c "sed 's/^settle_ms.*/input_enable = knee/' '$work/bare.ini' >'$work/bad.ini'; '$GONIO' rig status --rig '$work/bad.ini'"
says "with what it may be" "bad.ini:6:"
exits "set back" 0 "$GONIO" rig set direction_invert=none light_theta.steps_per_deg=100 $bare
exits "save" 0 "$GONIO" rig save $bare
check "into flash" test -s "$work/flash"

# ---- single axes ----
exits "a slow jog of an axis that is not homed" 0 "$GONIO" rig jog --slow light_phi=2 $bare
exits "goes no further than it may" 1 "$GONIO" rig jog --slow light_phi=11 $bare
says "which is told" "by up to 10 deg"
exits "one axis at a time" 2 "$GONIO" rig jog --slow light_phi=1 light_theta=1 $bare
exits "home one axis" 0 "$GONIO" rig home light_phi $bare
exits "the others stay as they are" 0 "$GONIO" rig status $bare --json
check "and that one is homed" grep -q '"homed":14' "$work/out"
exits "release one" 0 "$GONIO" rig release light_phi $bare --json
check "is told" grep -q '"released":\["light_phi"\]' "$work/out"
exits "it is not homed then" 0 "$GONIO" rig status $bare --json
check "but the other" grep -q '"homed":12' "$work/out"
exits "an axis that is none" 2 "$GONIO" rig home shoulder $bare
exits "nor has the simulator single ones" 1 "$GONIO" rig home light_phi --rig sim
exits "home all" 0 "$GONIO" rig home $bare
"$GONIO" rig move camera_theta=-60 $bare --set "axis camera_theta.speed_deg_per_s=0.02" >"$work/move.out" 2>&1 &
moving=$!
pids="$pids $moving"
check "a move" wait_for 30 sh -c "'$GONIO' rig status $bare --json | grep -q 'a move is under way'"
exits "nothing is set while an axis moves" 1 "$GONIO" rig set pulse=4 $bare
says "because somebody drives it" "drives this rig"
exits "stop" 0 "$GONIO" rig stop $bare
finish
