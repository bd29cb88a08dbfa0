#!/bin/sh
# gonio calibrate: the simulated sensor's own figures, real photographs, and refusals with their exit status.
set -u
data=${GONIO_DATA:-../shared/data}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
n=0
ok() { # ok CONDITION-STATUS NAME
    n=$((n + 1))
    if [ "$1" -eq 0 ]; then echo "ok $n - $2"; else echo "not ok $n - $2"; fi
}
# value KEY < JSON, the first one
value() { sed -n "s/.*\"$1\":\([-0-9.e+]*\).*/\1/p"; }
between() { awk -v x="$1" -v a="$2" -v b="$3" 'BEGIN { exit !(x >= a && x <= b) }'; }
status_of() { "$@" >"$folder/out" 2>"$folder/err"; echo $?; }

# 10000 e- fill 4095 - 64 DN; standard errors are far below the limits (0.06 % and 0.1 %).
"$GONIO" calibrate noise --rig sim --seed 3 --json -o "$folder/maps" >"$folder/noise.json"
ok $? "calibrate noise on the simulated rig"
between "$(value gain_e_per_dn <"$folder/noise.json")" 2.456 2.506; ok $? "gain within 1 %"
between "$(value read_noise_e <"$folder/noise.json")" 4.85 5.15; ok $? "read noise within 3 %"
between "$(value saturation_dn <"$folder/noise.json")" 4095 4095; ok $? "saturation exact"
between "$(value dark_e_per_s <"$folder/noise.json")" 4.9 5.1; ok $? "dark current within 2 %"
between "$(value prnu <"$folder/noise.json")" 0.0095 0.0105; ok $? "PRNU within 5 %"
[ -s "$folder/maps/dsnu.tiff" ] && [ -s "$folder/maps/prnu.tiff" ] && head -1 "$folder/maps/defects.csv" | grep -q '^u,v,kind$'
ok $? "maps and defects are written"

[ "$(status_of "$GONIO" calibrate)" = 2 ]; ok $? "no kind: wrong usage"
[ "$(status_of "$GONIO" calibrate nonsense)" = 2 ]; ok $? "unknown kind: wrong usage"
[ "$(status_of "$GONIO" calibrate noise "$folder/none.csv")" = 3 ]; ok $? "missing list: bad input"
printf 'file,exposure\n' >"$folder/bad.csv"
[ "$(status_of "$GONIO" calibrate noise "$folder/bad.csv")" = 3 ] && grep -q 'bad.csv:1:' "$folder/err"; ok $? "wrong header: file and line"
printf 'file,exposure_s,light\nx.png,0.1,2\n' >"$folder/bad.csv"
[ "$(status_of "$GONIO" calibrate noise "$folder/bad.csv")" = 3 ] && grep -q 'bad.csv:2:' "$folder/err"; ok $? "light neither 0 nor 1: file and line"
printf 'not an image' >"$folder/x.png"
[ "$(status_of "$GONIO" calibrate camera "$folder/x.png")" = 3 ] && grep -q 'x.png' "$folder/err"; ok $? "an image that is none: bad input"
[ "$(wc -l <"$folder/err")" = 1 ]; ok $? "and one line of message"

if [ -r "$data/chessboard/left01.jpg" ]; then
    "$GONIO" calibrate camera "$data"/chessboard/left[01]?.jpg --json -o "$folder/camera.ini" >"$folder/camera.json"
    ok $? "calibrate camera on 13 photographs"
    between "$(value rms_px <"$folder/camera.json" | head -1)" 0.01 0.25; ok $? "reprojection within 0.25 px"
    grep -q '^fx_px = 53' "$folder/camera.ini"; ok $? "rig file section written"
    [ "$(status_of "$GONIO" calibrate camera "$data"/chessboard/left0[12].jpg)" = 3 ] && grep -q 'at least 3' "$folder/err"
    ok $? "two views: refused with the reason"
    [ "$(status_of "$GONIO" calibrate camera "$data"/chessboard/left0?.jpg --board 8x5x2)" = 2 ]; ok $? "a board of three sizes: wrong usage"
else
    n=$((n + 1)); echo "ok $n - calibrate camera on photographs # SKIP no data in $data"
fi
printf "file,exposure_s\nx.png,1\n" >"$folder/bad.csv"
[ "$(status_of "$GONIO" calibrate response "$folder/bad.csv")" = 3 ] && grep -q "x.png" "$folder/err"; ok $? "response: an image that is none"
[ "$(status_of "$GONIO" calibrate response "$folder/bad.csv" --method magic)" = 2 ]; ok $? "response: unknown method"
if [ -r "$data/hdr_memorial/list.txt" ]; then
    { echo file,exposure_s; sed "s#^\([^ ]*\) \(.*\)#$(cd "$data" && pwd)/hdr_memorial/\1,\2#" "$data/hdr_memorial/list.txt"; } >"$folder/stack.csv"
    "$GONIO" calibrate response "$folder/stack.csv" --channel 1 --times-sigma 0.01 -o "$folder/curve.csv" >"$folder/out"
    ok $? "calibrate response on eight photographs"
    grep -q "memorial0061.*stands apart" "$folder/out"; ok $? "the shifted image is named"
    head -2 "$folder/curve.csv" | grep -q "^relative exposure,relative value$"; ok $? "curve written"
else
    n=$((n + 1)); echo "ok $n - calibrate response on photographs # SKIP no data in $data"
fi
echo "1..$n"
