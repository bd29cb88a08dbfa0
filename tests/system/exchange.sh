#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Sessions elsewhere: as one HDF5 file and back, several as one samples file, what a session says of itself, and which
# stage of a replay differs. Prints TAP.
set -u
. "$(dirname "$0")/lib.sh"


cd "$work" || exit 1
ward=ward:rho_d=0.3,rho_s=0.2,alpha=0.3
quick=scan.dark_frames=4,scan.reference_frames=4
cat >plan.csv <<'PLAN'
theta_i,phi_i,theta_o,phi_o
10,0,20,180
30,0,30,180
40,0,10,90
50,0,30,20
20,0,60,180
5,0,5,10
PLAN
printf '[rig]\nserials = SN-42\n[sample]\nspec = %s\nid = tile\n' "$ward" >rig.ini
measure() { "$GONIO" measure --rig rig.ini --set $quick "$@" >"$work/log" 2>&1; }
check "measure" measure --plan plan.csv --operator "A. Person" --notes "first, try" --model elsewhere.gonio a
"$GONIO" replay --json a >a.json 2>/dev/null

# ---- what it says of itself ----
for text in "finished" "A. Person" "SN-42" "regmap" "SIM-1" "mounted" "ready after" "plan.seed" "sim.settings" \
    "gonio measure" "result.stage.radiance"; do
    check "info tells: $text" tells 0 "$text" "$GONIO" info a
done
for file in plan.csv rig.ini; do
    check "info knows $file" tells 0 "$(sha256sum <$file | cut -d' ' -f1)" "$GONIO" info a
done
check "as JSON" tells 0 '"poses_done":6' "$GONIO" info --json a
check "of a model" tells 0 '"form":"lobe-spline"' "$GONIO" info --json elsewhere.gonio
check "what is neither is bad input" tells 3 "expected" "$GONIO" info plan.csv
# What was known of the measurement goes from the session into its samples, from there into models and back.
for text in "# operator = A. Person" "# notes = first, try" "# sample = tile" "# light_distance_mm = 1000" "# reference_sigma_percent = 0.2"; do
    check "samples tell: $text" tells 0 "$text" "$GONIO" samples a
    check "the model too: ${text#\# }" sh -c "'$GONIO' info elsewhere.gonio | tr -s ' ' | grep -qF '$(echo "${text#\# }" | sed 's/ = / /')'"
done
check "of what was sampled" tells 0 '"geometries":6' "$GONIO" info --json elsewhere.gonio
check "and how well it was fitted" tells 0 "held_out" "$GONIO" info elsewhere.gonio
"$GONIO" samples a -o known.csv 2>/dev/null
check "a file" tells 0 '"operator":"A. Person"' "$GONIO" info --json known.csv
check "a fit of the file" sh -c "'$GONIO' fit known.csv -o known.gonio && '$GONIO' info known.gonio | grep -q 'A. Person'"
check "samples of that model" tells 0 "# operator = A. Person" sh -c "'$GONIO' convert known.gonio m.csv --plan nusselt:5 && cat m.csv"
check "a table has no place for it, which is said" tells 0 "dropped: sample" "$GONIO" convert known.gonio known.binary
rm -f known.binary
check "its checksum is that of the file" sh -c "[ \$(sha256sum <known.csv | cut -d' ' -f1) = $(field samples_sha256 a.json) ]"
printf '[rig]\ndriver = null\nlight_polarisation = sideways\n' >bad.ini
check "a rig's polarisation is one" tells 3 "light_polarisation" "$GONIO" measure --rig bad.ini --plan plan.csv z
check "and the room's temperature" tells 0 "# temperature_c = 21.5" sh -c "'$GONIO' measure --rig rig.ini --set $quick,rig.temperature_c=21.5,reference.traceability=PTB-7,rig.light_polarisation=p --plan plan.csv t >log 2>&1; '$GONIO' samples t"
check "as the reference's certificate" tells 0 "# traceability = PTB-7" "$GONIO" samples t

# ---- HDF5 ----
check "as one file" "$GONIO" convert a a.h5
rm elsewhere.gonio
check "and back" "$GONIO" convert a.h5 b
check "it replays" tells 0 '"equal":true' "$GONIO" replay --json b
check "to the same samples" sh -c "'$GONIO' samples a >a.csv && '$GONIO' samples b | cmp - a.csv"
check "the journal's log is the same" cmp a/session.log b/session.log
check "the frames are" sh -c "cd a/frames && sha256sum * >../../sums && cd ../../b/frames && sha256sum --quiet -c ../../sums"
check "the model came along" sh -c "[ \$(sha256sum <b/model.gonio | cut -d' ' -f1) = $(field model_sha256 a.json) ]"
check "doctor finds it sound" tells 0 '"sound":true' "$GONIO" doctor --json b
check "info tells the same events" sh -c "'$GONIO' info a | sed -n '/^events/,\$p' >ea && '$GONIO' info b | sed -n '/^events/,\$p' | cmp - ea"
check "a third time, from the copy" sh -c "'$GONIO' convert b c.h5 && '$GONIO' convert c.h5 c && cmp a/session.log c/session.log"
check "nothing is written over" tells 2 "into the session" "$GONIO" convert a.h5 b
check "its samples are read in one step" sh -c "'$GONIO' convert a.h5 x.csv && cmp x.csv a.csv && '$GONIO' samples a.h5 | cmp - a.csv"
for verb in fit info check look; do
    check "as any input: $verb" "$GONIO" $verb a.h5
done
check "a budget needs the session" tells 2 "convert" "$GONIO" samples a.h5 --budget 30,0,30,180
head -c 100000 a.h5 >cut.h5
check "a cut file is no input either" tells 3 "not an HDF5 file" "$GONIO" fit cut.h5
check "a file that was cut short" tells 3 "not an HDF5 file" "$GONIO" convert cut.h5 d
check "other words for it" sh -c "'$GONIO' convert --to hdf5 a e.bin && '$GONIO' convert --to session e.bin e && cmp a/session.log e/session.log"
check "nothing half is left" sh -c "[ \$(ls -d b.* c.?????? d* e.?????? *.h5.* 2>/dev/null | wc -l) = 0 ]"
# libhdf5 crashes on some damaged file or other: the process apart that reads is ended in its midst.
cat >crash.c <<'C'
#include <signal.h>
int H5Dclose(long long id);
int H5Dclose(long long id) { (void)id; return raise(SIGSEGV); }
C
if cc -shared -fPIC -o crash.so crash.c 2>/dev/null; then
    mkdir left
    for verb in "convert a.h5 d" "convert a.h5 d.csv" "fit a.h5" "samples a.h5"; do
        check "a crash of the reader is told: $verb" tells 3 "did not survive" env TMPDIR="$work/left" LD_PRELOAD="$work/crash.so" "$GONIO" $verb
        check "and leaves nothing" sh -c "[ \$(ls -d d* left/* 2>/dev/null | wc -l) = 0 ]"
    done
fi
mkdir full && if mount -t tmpfs -o size=300k none full 2>/dev/null; then
    check "a full disk is named" tells 1 "No space left" "$GONIO" convert a full/a.h5
    check "on the way back too" tells 1 "No space left" "$GONIO" convert a.h5 full/a
    check "and leaves nothing" sh -c '[ $(ls full | wc -l) = 0 ]'
    umount full
else
    echo "# SKIP the full disk: nothing may be mounted here"
fi

# ---- several sessions ----
check "more poses, another day" measure --plan nusselt:12,theta_max=60 --operator "B. Person" f
check "merged" "$GONIO" merge a f -o both.csv
check "each session is a group" sh -c "[ \$(grep -c ',1\$' both.csv) = 6 ] && [ \$(grep -c ',2\$' both.csv) = 12 ]"
check "which names it" tells 0 '"systematic_group":2,"session":"f"' head -n 4 both.csv
check "the values are the sessions'" sh -c "grep -v '^#' both.csv | cut -d, -f1-8 >v && { '$GONIO' samples a | grep -v '^#'; '$GONIO' samples f | grep -v '^#' | tail -n +2; } 2>/dev/null | cmp - v"
check "it is fitted" "$GONIO" fit both.csv -o both.gonio
check "the model names the sessions" sh -c "[ \$('$GONIO' info both.gonio | grep -c '^session ') = 2 ]"
check "what differs between them is nobody's" sh -c "! '$GONIO' info both.gonio | grep -q '^operator'"
check "the same session twice" tells 3 "the same samples as of a" "$GONIO" merge a b -o x.csv
check "not without a place" tells 2 "-o CSV" "$GONIO" merge a f
check "another rig" sh -c "'$GONIO' measure --rig rig.ini --plan plan.csv --seed 2 --set $quick g >log 2>&1"
check "is refused by name" tells 3 'camera.serial ("SIM-1", "SIM-2")' "$GONIO" merge a g -o x.csv
check "another statement" measure --plan nusselt:7 --set rig.serials=SN-43 h
check "is refused" tells 3 'facts.serials ("SN-42", "SN-43")' "$GONIO" merge a h -o x.csv
check "unless that is meant" "$GONIO" merge a h -o x.csv --force
check "another sample never" sh -c "'$GONIO' measure --rig rig.ini --plan nusselt:7 --sample-id other --set $quick i >log 2>&1"
check "even with force" tells 3 'sample_id ("tile", "other")' "$GONIO" merge a i -o y.csv --force
check "a refused merge writes nothing" sh -c '[ ! -e y.csv ]'

finish
