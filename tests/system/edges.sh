#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Poses that reach over the sample's edge: plan --check names them, measure leaves them out or counts them, samples
# lists them. And a camera that moved between start and end.
set -u
. "$(dirname "$0")/lib.sh"
folder=$work
printf '[rig]\ndriver = sim\nlight_spot_mm = 15\n[sample]\nplate_mm = 11\nspec = lambert:rho=0.5\n' >"$folder/rig.ini"
printf 'theta_i,phi_i,theta_o,phi_o\n10,0,20,0\n20,0,30,90\n30,0,10,90\n80,0,20,90\n10,0,87,0\n' >"$folder/plan.csv"
"$GONIO" plan "$folder/plan.csv" --check "$folder/rig.ini" >"$folder/out" 2>"$folder/err"
[ $? -eq 1 ] && grep -q 'step .*averaged region' "$folder/err" && grep -q '1 poses would give no sample' "$folder/err"
ok $? "plan --check names a pose whose region reaches over the edge"
"$GONIO" plan "$folder/plan.csv" --check "$folder/rig.ini" --set sample.plate_mm=50 >"$folder/out" 2>"$folder/err"
[ $? -eq 0 ] && grep -q 'lit spot reaches 94' "$folder/err"; ok $? "a lit spot that does is told, and is no failure"
"$GONIO" measure --rig "$folder/rig.ini" --plan "$folder/plan.csv" --method mba --level 1 --json "$folder/s" >"$folder/measure.json" 2>"$folder/err"
ok $? "measure goes on"
session=$folder/s
grep -q 'no sample: .*averaged region' "$folder/err"; ok $? "it says why a pose gave no sample"
grep -q '"edges_excluded": *1' "$folder/measure.json"; ok $? "and counts it"
"$GONIO" samples "$session" --edges >"$folder/edges.csv" && grep -q ',region$' "$folder/edges.csv" && grep -q ',spill$' "$folder/edges.csv"
ok $? "samples --edges lists both kinds"
"$GONIO" samples "$session" 2>&1 >"$folder/samples.csv" | grep -q 'gave no sample and'; ok $? "samples mentions them"
[ "$(grep -c '^[0-9]' "$folder/samples.csv")" = 4 ]; ok $? "four of five poses are samples"
# A camera that is bumped between start and end: found, named with its frame, journalled; replay finds it too.
"$GONIO" measure --sample ward:rho_d=0.3,rho_s=0.2,alpha=0.15 --set camera.moved_px=2,camera.moved_at=8 --plan nusselt:8,theta_max=60 --method mba "$folder/moved" >"$folder/out" 2>"$folder/err"
[ $? -eq 0 ] && grep -q 'moved: step 12 frame 0 lies (1.9.*, .*) px from step 3\|moved: step 12 frame 0 lies (2.0.*, .*) px from step 3' "$folder/out"
ok $? "a moved camera is found and named with its frame"
"$GONIO" replay "$folder/moved" --json 2>/dev/null | grep -q '"moved": *true'; ok $? "and by replay"
"$GONIO" measure --sample ward:rho_d=0.3,rho_s=0.2,alpha=0.15 --plan nusselt:8,theta_max=60 --method mba --json "$folder/still" 2>/dev/null | grep -q '"moved": *false'
ok $? "one that stands is not"
finish
