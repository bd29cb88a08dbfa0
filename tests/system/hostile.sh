#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Input from elsewhere does not steer the terminal: whatever names, notes, events, headers, keys and file names hold, no
# verb prints a control character of theirs, in what it tells, in its errors or as JSON. And a session's own word about
# where its model goes replaces nothing but a model. Prints TAP.
set -u
. "$(dirname "$0")/lib.sh"

# A title, a bell, CSI as one character (U+009B), a text from right to left, a lone continuation byte.
esc=$(printf '\033]0;owned\007\302\2332J\342\200\256')
bad=$(printf '%s\377' "$esc")

# quiet NAME STATUS COMMAND...: it ends with the status (any: whatever it is), and what it prints is harmless.
quiet() {
    name=$1 wanted=$2
    shift 2
    "$@" >"$work/out" 2>&1 </dev/null
    got=$?
    if [ "$wanted" != any ] && [ $got -ne "$wanted" ]; then
        fail "$name" "exit status $got, expected $wanted" "$(head -c 400 "$work/out" | tr -d '\000-\011\013-\037')"
    elif tr -d '\n\t' <"$work/out" | LC_ALL=C grep -qaP '[\x00-\x1f\x7f]|\xc2[\x80-\x9f]|\xe2\x80[\xaa-\xae]'; then
        fail "$name" "a control character in: $(tr '\000-\011\013-\037\177' '?' <"$work/out" | head -c 400)"
    else
        pass "$name"
    fi
}

small=camera.width=24,camera.height=24,scan.dark_frames=4,scan.reference_frames=4,scan.trap_frames=2,sample.region_radius_mm=1
measure() { "$GONIO" measure --sample lambert:rho=0.4 --plan nusselt:3 --set $small "$@"; }

quiet "measure" 0 measure --operator "$esc" --notes "$esc" --sample-id "$esc" --set "rig.serials=$esc" "$work/s"
quiet "doctor" 0 "$GONIO" doctor "$work/s"
check "doctor tells what the notes hold" grep -qF '\x1b]0;owned\x07\u009b2J\u202e' "$work/out"
quiet "doctor as JSON" 0 "$GONIO" doctor --json "$work/s"
quiet "replay" 0 "$GONIO" replay "$work/s"
quiet "samples" 0 "$GONIO" samples "$work/s" -o "$work/s.csv"
quiet "resume" 0 "$GONIO" resume --set "rig.serials=$esc" "$work/s"
quiet "doctor, of the events" 0 "$GONIO" doctor "$work/s"
quiet "a session of that name" any measure "$work/$bad"
quiet "which is not there" 3 "$GONIO" doctor "$work/no$bad"

# Every kind of file, with such texts where names and numbers are expected.
{ printf 'theta_i,phi_i,theta_o,phi_o,%s\n' "$esc"; printf '10,0,20,0,0.1\n30,0,40,0,0.2\n'; } >"$work/names.csv"
printf 'theta_i,phi_i,theta_o,phi_o,value\n10,0,%s,0,0.1\n' "$bad" >"$work/numbers.csv"
printf '%s' "$bad" >"$work/garbage"
printf 'theta_i,phi_i,theta_o,phi_o\n%s,0,0,0\n' "$bad" >"$work/plan.csv"
printf '[rig]\n%s = 1\n' "$bad" >"$work/key.ini"
printf '[%s]\nx = 1\n' "$bad" >"$work/section.ini"
printf '[camera]\ndriver = %s\n' "$bad" >"$work/value.ini"
printf 'GONIOMDL%s' "$bad" >"$work/broken.gonio"
for file in names.csv numbers.csv garbage broken.gonio; do
    quiet "fit $file" 3 "$GONIO" fit "$work/$file" -o "$work/m"
    quiet "fit $file as JSON" 3 "$GONIO" fit --json "$work/$file" -o "$work/m"
    quiet "compare $file" 3 "$GONIO" compare "$work/$file" "$work/s.csv"
    quiet "eval $file" 3 "$GONIO" eval "$work/$file" "$work/s.csv"
done
quiet "a plan" 3 "$GONIO" measure --sample lambert:rho=0.4 --plan "$work/plan.csv" "$work/p"
for file in key section value; do
    quiet "a rig file's $file" 3 "$GONIO" measure --rig "$work/$file.ini" --sample lambert:rho=0.4 "$work/p"
done
quiet "a spec" any "$GONIO" eval "spec:$bad" "$work/s.csv"
quiet "a response curve" any measure --set "camera.response=$work/garbage" "$work/p"
quiet "an alignment" any measure --set "rig.alignment=$work/garbage" "$work/p"
quiet "a setting" 2 measure --set "rig.$bad=1" "$work/p"
quiet "an option" 2 "$GONIO" fit "--$bad" "$work/s.csv"

# The model of a session goes where the session says only where nothing but a model is.
measure --model "$work/model" "$work/t" >"$work/out" 2>&1
quiet "a finished session fits its model again" 0 "$GONIO" resume "$work/t"
echo precious >"$work/model"
exits "but replaces nothing else" 3 "$GONIO" resume "$work/t"
check "which is still there" grep -q precious "$work/model"
exits "unless told to" 0 "$GONIO" resume --model "$work/model" "$work/t"
finish
