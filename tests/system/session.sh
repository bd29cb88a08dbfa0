#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# measure, resume, replay, samples, doctor on tiny simulated sessions: what is stopped anywhere ends as if it had not
# been stopped. Prints TAP.
set -u
. "$(dirname "$0")/lib.sh"

# status_is STATUS COMMAND...: the command ends with just this status.
status_is() {
    wanted=$1
    shift
    "$@"
    got=$?
    [ $got -eq "$wanted" ] || { echo "exit status $got, expected $wanted"; return 1; }
}

ward=ward:rho_d=0.3,rho_s=0.2,alpha=0.3
plan=nusselt:40
quick=scan.dark_frames=4,scan.reference_frames=4

# A quick fit: what is compared here are bits, whatever the model.
measure() { "$GONIO" measure --sample $ward --plan $plan --set $quick --method mba --level 2 "$@"; }
frames() { find "$1/frames" -name '0*.png' 2>/dev/null | wc -l; }
# Start a measure in the background and send it the signal once so many frames are there.
stop_at() { # stop_at SIGNAL FRAMES COMMAND... SESSION
    signal=$1 enough=$2
    shift 2
    for session; do :; done
    "$@" >"$work/stopped.log" 2>&1 &
    pid=$!
    while kill -0 $pid 2>/dev/null && [ "$(frames "$session")" -lt "$enough" ]; do sleep 0.01; done
    kill -s "$signal" $pid 2>/dev/null
    wait $pid
}
same() { [ "$(field "$1" "$2")" = "$(field "$1" "$3")" ] && [ -n "$(field "$1" "$2")" ]; }
same_results() { same samples_sha256 "$1" "$2" && same model_sha256 "$1" "$2" && same frames "$1" "$2"; }

# ---- the whole way ----
check "measure" "$GONIO" measure --sample $ward --plan $plan --set $quick --json --operator "A. Person" --sample-id "tile 7" --notes "first, try" \
    --set rig.serials=SN-42 "$work/a"
measure --json --threads 1 "$work/b" >"$work/b.json" 2>/dev/null
check "its JSON has what others rely on" sh -c "for key in session poses frames samples samples_sha256 model_sha256; do
    grep -q \"\\\"\$key\\\":\" '$work/b.json' || exit 1; done"
check "counts are right" sh -c "[ $(field poses "$work/b.json") = 40 ] && [ $(field samples "$work/b.json") = 40 ] &&
    [ $(field frames "$work/b.json") = $(frames "$work/b") ]"
"$GONIO" replay --json --threads 2 "$work/b" >"$work/b2.json" 2>/dev/null
check "replay gives the same bits" same_results "$work/b.json" "$work/b2.json"
"$GONIO" replay --json --threads 1 --model "$work/b.model" "$work/b" >"$work/b1.json" 2>/dev/null
check "on one thread too" same_results "$work/b.json" "$work/b1.json"
check "and says so" grep -q '"equal":true' "$work/b1.json"
check "of a fit that chooses by itself, too" tells 0 '"equal":true' "$GONIO" replay --json --threads 2 "$work/a"
check "the model's checksum is the file's" sh -c \
    "[ \$(sha256sum <'$work/b.model' | cut -d' ' -f1) = $(field model_sha256 "$work/b.json") ]"
check "samples" "$GONIO" samples "$work/b" -o "$work/b.csv"
check "their checksum is the CSV's" sh -c \
    "[ \$(sha256sum <'$work/b.csv' | cut -d' ' -f1) = $(field samples_sha256 "$work/b.json") ]"
check "the same on standard output" sh -c "'$GONIO' samples '$work/b' | cmp - '$work/b.csv'"
check "a budget names its terms" tells 0 '"reference":' "$GONIO" samples "$work/b" --budget 30,0,30,180 --json
check "a budget outside the hemisphere" status_is 2 "$GONIO" samples "$work/b" --budget 30,0,100,180
check "doctor tells who measured what" tells 0 "A. Person" "$GONIO" doctor "$work/a"
check "and the notes" tells 0 "first, try" "$GONIO" doctor "$work/a"
check "and the serial numbers" tells 0 "SN-42" "$GONIO" doctor "$work/a"
check "the samples are the sample's" sh -c "'$GONIO' compare spec:$ward '$work/b' --json >'$work/c.json' &&
    awk -v x=\$(sed 's/.*\"median_rel\":\([^,}]*\).*/\1/' '$work/c.json') 'BEGIN { exit !(x < 0.01) }'"
if command -v python3 >/dev/null; then
    check "session.log is as docs/formats.md says" python3 "$(dirname "$0")/session_log.py" "$work/b/session.log"
else
    skip "session.log is as docs/formats.md says" "python3 is not installed"
fi
check "a second measure there is refused" tells 2 "gonio resume" measure "$work/b"

# ---- stopped ----
stop_at INT 60 "$GONIO" measure --sample $ward --plan nusselt:400 "$work/i"
status=$?
check "Ctrl-C ends with 4" [ $status -eq 4 ]
check "and names the way on" grep -q "gonio resume $work/i" "$work/stopped.log"
check "the session is sound" "$GONIO" doctor "$work/i"
check "its samples can be read" tells 0 "not finished" "$GONIO" samples "$work/i" -o "$work/i.csv"
check "it can be replayed as far as it is" tells 0 "not finished" "$GONIO" replay "$work/i"

stop_at KILL 5 "$GONIO" measure --sample $ward --plan $plan --set $quick --method mba --level 2 "$work/k" # among the dark frames
for at in 12 25 40 55; do
    stop_at KILL $at "$GONIO" resume "$work/k"
done
check "killed five times, the session is sound" "$GONIO" doctor "$work/k"
: >"$work/k/frames/000039-00.png" # as a kill between renaming and entering leaves it
"$GONIO" resume --json "$work/k" >"$work/k.json" 2>"$work/k.log"
check "and ends as if it had not been killed" same_results "$work/b.json" "$work/k.json"
check "resuming a finished session changes nothing" sh -c \
    "'$GONIO' resume --json '$work/k' >'$work/k2.json' && cmp '$work/k/model.gonio' '$work/b/model.gonio'"

# ---- damage ----
cp -r "$work/b" "$work/d"
truncate -s 300 "$work/d/frames/000010-00.png"
rm "$work/d/frames/000001-03.png"
check "doctor finds bad frames" tells 1 "000010-00.png" "$GONIO" doctor "$work/d"
check "replay refuses them" tells 3 "000001-03.png" "$GONIO" replay "$work/d"
check "doctor repairs" "$GONIO" doctor --repair "$work/d"
"$GONIO" resume --json "$work/d" >"$work/d.json" 2>/dev/null
check "resume measures again what was lost" same_results "$work/b.json" "$work/d.json"

# ---- what the journal does not vouch for ----
i=$(ls "$work/i/frames" | grep -c '^0') # the stopped session of 400 poses, with a folder's name as long as it takes
cp -r "$work/i" "$work/j"
rm "$work/j/frames/000003-00.png"
check "resume wants every frame of a finished step" tells 3 "frames/000003-00.png is missing" "$GONIO" resume "$work/j"
check "and takes none away" [ "$(ls "$work/j/frames" | grep -c '^0')" -eq $((i - 1)) ]
if command -v sqlite3 >/dev/null; then
    cp "$work/i/frames/000003-00.png" "$work/j/frames/"
    sqlite3 "$work/j/session.db" "UPDATE frames SET monitor = 1.01 WHERE step = 3 AND frame = 0"
    for verb in resume replay samples; do
        check "a row that was changed: $verb names it" tells 3 "table frames, row 3/0, column monitor: found 1.01" \
            "$GONIO" $verb "$work/j"
    done
    check "doctor too" tells 1 "table frames, row 3/0, column monitor" "$GONIO" doctor "$work/j"
    check "fit does not take its samples" tells 3 "table frames, row 3/0" "$GONIO" fit "$work/j" -o "$work/j.model"
else
    skip "a row that was changed" "sqlite3 is not installed"
fi

# ---- faults ----
for fault in camera_timeout camera_error stage_stall stage_timeout lamp_off meter_error interlock_open; do
    rm -rf "$work/f"
    check "$fault ends with its name" tells 1 "gonio resume" measure --set "faults.$fault=20" "$work/f"
    "$GONIO" resume --json --set "faults.$fault=never" "$work/f" >"$work/f.json" 2>/dev/null
    check "and resumes to the same samples" same_results "$work/b.json" "$work/f.json"
done

# ---- lost steps ----
audited() { measure --json --set "scan.audit_poses=10" "$@"; }
audited --set faults.lost_steps=17x1 "$work/l" >"$work/l.json" 2>"$work/l.log"
check "lost steps are found and measured again" same_results "$work/b.json" "$work/l.json"
check "and told" grep -q "steps were lost.*10 steps are measured again" "$work/l.log"
check "and journalled" tells 0 "audit: steps were lost" "$GONIO" doctor "$work/l"
encoders=
for axis in light_theta light_phi camera_theta camera_phi; do encoders="$encoders,encoder $axis.encoder_deg=0.1"; done
compared() { audited --set "${encoders#,},scan.encoder_audit_poses=0" "$@"; }
compared --set faults.lost_steps=17x1 "$work/e" >"$work/e.json" 2>"$work/e.log"
check "with encoders lost steps are found at their pose" tells 0 "step 17: lost steps:" cat "$work/e.log"
check "and no other is measured again" sh -c "! grep -q 'steps are measured again' '$work/e.log'"
check "nor do the samples differ" [ "$(field samples_sha256 "$work/e.json")" = "$(field samples_sha256 "$work/l.json")" ]
check "an axis that loses them at every pose is a fault" tells 1 "3 times in a row, lost steps" compared --set faults.lost_steps=17 "$work/e1"
check "an encoder that is silent is a named fault" tells 1 "encoder of light_theta: it does not answer" compared --set faults.encoder_silent=17 "$work/e2"
check "and so is one that stands still" tells 1 "is frozen, or its axis is blocked" compared --set faults.encoder_frozen=18 "$work/e3"
"$GONIO" resume --json --set faults.encoder_frozen=never "$work/e3" >"$work/e3.json" 2>/dev/null
check "after which resume has the same samples" [ "$(field samples_sha256 "$work/e3.json")" = "$(field samples_sha256 "$work/l.json")" ]
check "rig status shows encoders" tells 0 '"encoders":{"light_theta":{"counts":0.0,"deg":0.0}' "$GONIO" rig status --rig sim --set "${encoders#,}" --json
check "a stage without an encoder of its own says so" tells 3 "this stage has no encoder of its own" "$GONIO" rig status --rig sim --set "stage.driver=null,encoder light_phi.encoder_deg=0.1"
check "an axis that goes on losing them is a fault" tells 1 "audits in a row" audited --set faults.lost_steps=17 "$work/l2"
"$GONIO" resume --json --set faults.lost_steps=never "$work/l2" >"$work/l2.json" 2>/dev/null
check "mended, it resumes to the same samples" same_results "$work/b.json" "$work/l2.json"
check "a fault leaves steps flagged" tells 1 "gonio resume" audited --set faults.lost_steps=17x1,faults.camera_error=19 "$work/l3"
flagged=$("$GONIO" doctor --json "$work/l3" | sed -n 's/.*"flagged":\([0-9]*\).*/\1/p')
check "doctor counts them" [ "${flagged:-0}" -gt 0 ]
check "samples too" tells 0 "samples of $flagged poses are flagged" "$GONIO" samples "$work/l3" -o "$work/l3.csv"
"$GONIO" resume --json --set faults.lost_steps=never,faults.camera_error=never "$work/l3" >"$work/l3.json" 2>"$work/l3.log"
check "what nobody can vouch for is measured again" same_results "$work/b.json" "$work/l3.json"
check "and told, too" grep -q "not known; $flagged steps are measured again" "$work/l3.log"
check "then nothing is flagged" tells 0 '"flagged":0' "$GONIO" doctor --json "$work/l3"

# ---- bad input ----
check "an unknown key" tells 2 "[camera] colour" measure --set camera.colour=1 "$work/x"
printf '[rig]\ndriver = sim\n\n[camera]\nbits = 12\nwobble = 3\n' >"$work/bad.ini"
check "unknown key in a rig file: with its line" tells 3 "bad.ini:6: " measure --rig "$work/bad.ini" "$work/x"
printf '[rig]\ndriver = sim\nnonsense\n' >"$work/bad.ini"
check "no key = value: with its line" tells 3 "bad.ini:3: " measure --rig "$work/bad.ini" "$work/x"
printf '[rig]\nnotes = %0400d\n' 0 >"$work/bad.ini"
check "a line beyond all bounds" tells 3 "bad.ini:2: " measure --rig "$work/bad.ini" "$work/x"
# ---- something nearly black: its noise goes below zero, and the samples are as good a set as the session ----
check "measure a black sample" "$GONIO" measure --sample lambert:rho=1e-5 --plan $plan --set $quick --seed 3 "$work/black"
"$GONIO" samples "$work/black" -o "$work/black.csv" 2>/dev/null
check "some of its values are below zero" [ "$(cut -d, -f5 "$work/black.csv" | grep -c '^-')" -gt 5 ]
check "fit takes them as noise and says so" tells 0 "within 5 sigma of 0 kept, as noise about zero" \
    "$GONIO" fit "$work/black.csv" --seed 3 -o "$work/black.model" # the measure's split: a model tells its held-out errors
check "its model is the measure's own" cmp "$work/black.model" "$work/black/model.gonio"
check "they are refused where that is asked for" tells 3 "negative values, the first here" \
    "$GONIO" fit "$work/black.csv" --negatives reject -o "$work/black.model"
check "no rig file" status_is 3 measure --rig "$work/none.ini" "$work/x"
check "no sample" tells 2 "--sample" "$GONIO" measure --plan $plan "$work/x"
check "a plan of nothing" status_is 3 "$GONIO" measure --sample $ward --plan "$work/none.csv" "$work/x"
check "nothing of all this made a session" [ ! -e "$work/x" ]
check "not a session" tells 3 "session.db" "$GONIO" resume "$work"
cp -r "$work/b" "$work/v"
printf '\0\0\0\3' | dd of="$work/v/session.db" bs=1 seek=60 conv=notrunc 2>/dev/null # user_version
for verb in resume replay samples doctor; do
    check "a newer session: $verb says so" tells 3 "version 3" "$GONIO" $verb "$work/v"
done

# A disk that ends: the limit on file sizes stands in for it.
check "a full disk stops cleanly" sh -c "ulimit -f 300; '$GONIO' measure --sample $ward --plan nusselt:400 '$work/u'; [ \$? -eq 1 ]"
check "and the session is sound" "$GONIO" doctor "$work/u"

# ---- hands ----
check "no terminal to ask at" tells 2 "--yes" sh -c "'$GONIO' measure --sample $ward --plan $plan --set mount.by=operator '$work/h' </dev/null"
check "nothing was begun" [ ! -e "$work/h" ]
measure --json --yes --set mount.by=operator "$work/h" </dev/null >"$work/h.json" 2>"$work/h.log"
check "--yes goes on" same samples_sha256 "$work/b.json" "$work/h.json"
check "and tells what must lie there" grep -q "white reference" "$work/h.log"

# ---- the null rig ----
printf '[rig]\ndriver = null\n' >"$work/null.ini"
check "a rig of null devices" tells 0 "null camera" "$GONIO" rig identify --rig "$work/null.ini"
check "tells where it stands" tells 0 "light_theta" "$GONIO" rig status --rig "$work/null.ini"
check "measures nothing and says why" tells 1 "reference" "$GONIO" measure --rig "$work/null.ini" --plan $plan "$work/n"
check "plan writes poses that measure takes" sh -c "'$GONIO' plan uniform:45 -o '$work/p.csv' &&
    '$GONIO' plan '$work/p.csv' -o '$work/q.csv' && [ \$(wc -l <'$work/p.csv') = \$(wc -l <'$work/q.csv') ]"
finish
