#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# gonio calibrate rig end to end: a simulated rig with axes 0.5 deg askew takes frames of board, ball and mirror, its
# axes are found, and what it then measures is right where the uncalibrated rig's is not. And what is refused.
set -u
. "$(dirname "$0")/lib.sh"
folder=$work
value() { sed -n "s/.*\"$1\":\([-0-9.e+]*\).*/\1/p"; }
below() { awk -v x="$1" -v a="$2" 'BEGIN { exit !(x != "" && x < a) }'; }
status_of() { "$@" >"$folder/out" 2>"$folder/err"; echo $?; }

axes=
for axis in light_theta light_phi camera_theta camera_phi; do axes="$axes${axes:+,}axis $axis.tilt_deg=0.5"; done
sample=ward:rho_d=0.3,rho_s=0.2,alpha=0.15

"$GONIO" calibrate rig --seed 3 --set "$axes" --json -o "$folder/rig.csv" --save "$folder/frames" >"$folder/rig.json" 2>"$folder/err"
ok $? "calibrate rig on the simulated rig"
below "$(value direction_sigma_deg <"$folder/rig.json")" 0.01; ok $? "directions known to 0.01 deg"
for rig in askew known; do
    extra=
    [ $rig = known ] && extra=",rig.alignment=$folder/rig.csv"
    "$GONIO" measure --seed 3 --sample $sample --set "$axes$extra" --plan nusselt:200,theta_max=80 "$folder/$rig" >"$folder/out" 2>"$folder/err"
    ok $? "measure with the axes $rig"
    "$GONIO" samples "$folder/$rig" -o "$folder/$rig.csv" >"$folder/out"
    "$GONIO" compare "spec:$sample" "$folder/$rig.csv" --json >"$folder/$rig.json"
done
askew=$(value rms_log <"$folder/askew.json") known=$(value rms_log <"$folder/known.json")
echo "# rms_log $askew askew, $known with the axes known"
below "$known" 0.01; ok $? "samples right to 1 % rms with the axes known"
below "$known" "$(awk -v x="$askew" 'BEGIN { print x / 4 }')"; ok $? "four times better than with the axes askew"
# The CSV states the true directions, with their sigma: 99 % of the values within 4 sigma.
grep -v '^#' "$folder/known.csv" | cut -d, -f1-4 >"$folder/directions.csv"
"$GONIO" eval "spec:$sample" "$folder/directions.csv" >"$folder/truth.csv"
grep -v '^#' "$folder/known.csv" | paste -d, - "$folder/truth.csv" |
    awk -F, 'NR == 1 { next } { d = $5 - $NF; s = $6 * $6; all++; far += d * d > 16 * s } END { exit !(all > 150 && far <= all / 100) }'
ok $? "and their sigma holds"
"$GONIO" replay "$folder/known" >"$folder/out"; ok $? "replay needs no alignment file and gets the same bits"

printf '[camera]\nwidth = 640\nheight = 512\nfx_px = 10000\nfy_px = 10000 ; +- 0.5\ncx_px = 319.5\ncy_px = 255.5\nk1 = -2\n' >"$folder/camera.ini"
head -130 "$folder/frames/frames.csv" >"$folder/frames/some.csv"
"$GONIO" calibrate rig "$folder/frames/some.csv" --camera "$folder/camera.ini" --json >"$folder/list.json" 2>"$folder/err"
ok $? "calibrate rig from a list of frames, without the mirror"
grep -q '"views": *{[^}]*"mirror": *0}' "$folder/list.json"; ok $? "the list's frames are counted"
[ "$(status_of "$GONIO" calibrate rig "$folder/frames/some.csv")" = 2 ] && grep -q -- --camera "$folder/err"; ok $? "no intrinsics: wrong usage"
printf 'file,object,theta\n' >"$folder/bad.csv"
[ "$(status_of "$GONIO" calibrate rig "$folder/bad.csv" --camera "$folder/camera.ini")" = 3 ] && grep -q 'bad.csv:1:' "$folder/err"; ok $? "wrong header: file and line"
printf 'file,object,light_theta,light_phi,camera_theta,camera_phi\nx.png,moon,0,0,0,0\n' >"$folder/bad.csv"
[ "$(status_of "$GONIO" calibrate rig "$folder/bad.csv" --camera "$folder/camera.ini")" = 3 ] && grep -q 'bad.csv:2:.*moon' "$folder/err"; ok $? "unknown object: file and line"
printf '[camera]\nfx_px = x\n' >"$folder/bad.ini"
[ "$(status_of "$GONIO" calibrate rig "$folder/frames/some.csv" --camera "$folder/bad.ini")" = 3 ] && grep -q 'bad.ini:2:' "$folder/err"; ok $? "bad intrinsics: file and line"
head -5 "$folder/frames/frames.csv" >"$folder/frames/few.csv"
[ "$(status_of "$GONIO" calibrate rig "$folder/frames/few.csv" --camera "$folder/camera.ini")" = 3 ] && grep -q '0 of the ball' "$folder/err"; ok $? "no ball: refused with the reason"
[ "$(status_of "$GONIO" calibrate rig "$folder/frames/some.csv" --camera "$folder/camera.ini" --azimuth-deg 90)" = 3 ] && grep -q 'azimuth of about' "$folder/err"; ok $? "a board that lies turned: refused with the reason"
[ "$(status_of "$GONIO" measure --sample $sample --set rig.alignment="$folder/none.csv" "$folder/session")" = 3 ] && [ ! -e "$folder/session" ]; ok $? "missing alignment: bad input, no session"
finish
