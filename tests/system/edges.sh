#!/bin/sh
# Poses that reach over the sample's edge: plan --check names them, measure leaves them out or counts them, samples
# lists them.
set -u
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
n=0
ok() { # ok CONDITION-STATUS NAME
    n=$((n + 1))
    if [ "$1" -eq 0 ]; then echo "ok $n - $2"; else echo "not ok $n - $2"; fi
}
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
echo "1..$n"
