#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# gonio calibrate: the simulated sensor's own figures, real photographs, and refusals with their exit status.
set -u
. "$(dirname "$0")/lib.sh"
data=$GONIO_DATA
folder=$work
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
    skip "calibrate camera on photographs" "no data in $data"
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
    skip "calibrate response on photographs" "no data in $data"
fi

# Every verb that reads a list of frames checks their words alike: none beyond --bits, none of 12 bits taken for 16; and a
# response states what its readings cover, and none that explains nothing.
python3 - "$folder" <<'PYTHON'
import struct, sys, zlib
def png(name, top, scale, exposure):
    rows = b''
    for y in range(64):
        rows += b'\0' + b''.join(struct.pack('>H', min(top, int((1 + (x // 8) + 8 * (y // 8)) * exposure * scale)) * shift) for x in range(64))
    def chunk(kind, data):
        body = kind + data
        return struct.pack('>I', len(data)) + body + struct.pack('>I', zlib.crc32(body))
    open(f'{sys.argv[1]}/{name}', 'wb').write(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', struct.pack('>IIBBBBB', 64, 64, 16, 0, 0, 0, 0))
                                              + chunk(b'IDAT', zlib.compress(rows)) + chunk(b'IEND', b''))
for list_name, shift in (('low', 1), ('high', 16)):
    lines = 'file,exposure_s\n'
    for k in range(6):
        png(f'{list_name}{k}.png', 4095, 4, 2.0 ** k)
        lines += f'{list_name}{k}.png,{0.001 * 2 ** k}\n'
    open(f'{sys.argv[1]}/{list_name}.csv', 'w').write(lines)
    open(f'{sys.argv[1]}/{list_name}_lit.csv', 'w').write(lines.replace('\n', ',1\n').replace('s,1', 's,light'))
shift, lines = 1, 'file,exposure_s\n'
for k in range(4): # nothing beyond half of the range
    png(f'half{k}.png', 4095, 4, 2.0 ** k)
    lines += f'half{k}.png,1/{1000 / 2 ** k}\n' # as photographers write it
open(f'{sys.argv[1]}/half.csv', 'w').write(lines)
open(f'{sys.argv[1]}/turned.csv', 'w').write('file,exposure_s\n' + ''.join(f'low{k}.png,{0.001 * 2 ** (5 - k)}\n' for k in range(6)))
PYTHON
for verb in response noise flat; do
    [ $verb = response ] && lit= || lit=_lit
    exits "$verb: 12 bits in words of 16" 3 "$GONIO" calibrate $verb "$folder/low$lit.csv"
    says "$verb: 12 bits in words of 16: says so" "none beyond 4095"
    exits "$verb: words beyond the bits" 3 "$GONIO" calibrate $verb "$folder/high$lit.csv" --bits 12
    says "$verb: words beyond the bits: says so" "12 bits end at 4095"
    exits "$verb: bits that do not exist" 2 "$GONIO" calibrate $verb "$folder/low$lit.csv" --bits 40
done
exits "a response of frames in the wrong order" 1 "$GONIO" calibrate response "$folder/turned.csv" --bits 12 --times-sigma 0 -o "$folder/none.csv"
says "a response of frames in the wrong order: says so" "no response explains these images"
check "a response of frames in the wrong order: no curve" [ ! -e "$folder/none.csv" ]
exits "a response" 0 "$GONIO" calibrate response "$folder/half.csv" --bits 12 --json
between "$(value high <"$folder/out")" 0.35 0.55; ok $? "the stated range ends where the readings do"
between "$(value low <"$folder/out")" 0.02 0.04; ok $? "the stated range begins where the readings do"
between "$(value gap <"$folder/out")" 0.001 0.1; ok $? "the widest gap is stated"

# The flat field of the simulated sensor: PRNU 1 %, 3 % vignetting at the corners, 32 frames of about 1.2 % noise.
"$GONIO" calibrate flat --rig sim --seed 3 --json -o "$folder/field.flat" --maps "$folder/maps" >"$folder/flat.json"
ok $? "calibrate flat on the simulated rig"
between "$(value relative_sigma <"$folder/flat.json")" 0.002 0.004; ok $? "its uncertainty is the frames' noise"
between "$(value low <"$folder/flat.json")" 0.92 0.96; ok $? "its range is PRNU's and vignetting's"
[ -s "$folder/maps/flat.tiff" ] && [ -s "$folder/maps/sigma.tiff" ]; ok $? "maps for viewing"
ward=ward:rho_d=0.3,rho_s=0.2,alpha=0.15
quick=scan.dark_frames=4,scan.reference_frames=4,camera.flat=$folder/field.flat
"$GONIO" measure --seed 3 --sample $ward --plan nusselt:20 --set "$quick" --json "$folder/session" >"$folder/m.json" 2>"$folder/err"
ok $? "measure takes the flat field"
mv "$folder/field.flat" "$folder/gone.flat"
"$GONIO" replay "$folder/session" >"$folder/out" 2>&1; ok $? "replay has its own copy, and gives the same bits"
mv "$folder/gone.flat" "$folder/field.flat"
[ "$(status_of "$GONIO" measure --seed 4 --sample $ward --plan nusselt:20 --set "$quick" "$folder/other")" = 3 ] && grep -q "of the camera 'SIM-3'" "$folder/err"
ok $? "a flat field of another camera is refused"
truncate -s 5000 "$folder/field.flat"
[ "$(status_of "$GONIO" measure --seed 3 --sample $ward --plan nusselt:20 --set "$quick" "$folder/cut")" = 3 ] && grep -q 'shorter than its header' "$folder/err"
ok $? "a cut one too"

# A list of frames as a flat field: the session's own dark and reference frames, then lists with something wrong.
at=$folder/session/frames
list() { # list NAME DARK-FRAMES REFERENCE-FRAMES EXPOSURES: rows "file,exposure_s,light"
    echo file,exposure_s,light
    for i in $1; do echo "$at/000000-0$i.png,2e-5,0"; done
    for i in $2; do echo "$at/00000$3-0$i.png,${4:-0.01},1"; done
}
list "0 1 2 3" "1 2 3" 2 >"$folder/even.csv"
"$GONIO" calibrate flat "$folder/even.csv" --json -o "$folder/even.flat" >"$folder/even.json"; ok $? "calibrate flat on a list of frames"
list "0 1 2 3" "0 1 2" 0 >"$folder/off.csv"
[ "$(status_of "$GONIO" calibrate flat "$folder/off.csv")" = 1 ] && grep -q '000000-00.png: .*the lamp is off' "$folder/err"; ok $? "lamp off: named, with the frame"
{ list "0 1 2 3" "1 2 3" 2; echo "$at/000002-01.png,2e-5,0"; } >"$folder/lit.csv"
[ "$(status_of "$GONIO" calibrate flat "$folder/lit.csv")" = 1 ] && grep -q '000002-01.png: .*dark frame not dark' "$folder/err"; ok $? "a dark frame that is not dark: named, with the frame"
[ "$(status_of "$GONIO" calibrate flat "$folder/even.csv" --frames 1)" = 2 ]; ok $? "one frame: wrong usage"

# The white reference's certificate.
printf 'nm,reflectance,sigma\n300,0.9775,0.004\n800,0.99,0.004\n' >"$folder/white.csv"
"$GONIO" calibrate reference "$folder/white.csv" -o "$folder/white.ini" >"$folder/out"; ok $? "calibrate reference"
grep -q '^reflectance = 0.985000/0.983500/0.981500$' "$folder/white.ini" && grep -q '^sigma_percent = 0.407' "$folder/white.ini"
ok $? "a [reference] section with the channels' reflectances"
"$GONIO" measure --sample $ward --plan nusselt:20 --set scan.dark_frames=4,scan.reference_frames=4 --with "$folder/white.ini" "$folder/white" >"$folder/out" 2>&1 &&
    "$GONIO" samples "$folder/white" --budget 30,0,30,180 | grep -q '^  reference .* 0.407'
ok $? "measure --with it: its uncertainty is the budget's"
[ "$(status_of "$GONIO" calibrate reference "$folder/white.csv" --bands 350:100)" = 3 ] && grep -q '250' "$folder/err"; ok $? "a band beyond the table: bad input"
[ "$(status_of "$GONIO" calibrate reference "$folder/white.csv" --geometry 8/h)" = 2 ]; ok $? "8/h without a BRDF: wrong usage"
printf '400,0.98,0.004\n390,0.98,0.004\n' >"$folder/bad.csv"
[ "$(status_of "$GONIO" calibrate reference "$folder/bad.csv")" = 3 ] && grep -q 'bad.csv:2:' "$folder/err"; ok $? "wavelengths that fall: file and line"
# Sintered PTFE returns a little more toward 45/0 than its hemispherical reflectance says: 1 to 2 % is what the field reports.
if [ -r "$data/nist_ptfe/PTFE.data.csv" ]; then
    "$GONIO" fit "$data/nist_ptfe/PTFE.data.csv" --wavelength 532 --method lsq --level 3 -o "$folder/ptfe.gonio" >"$folder/out" 2>&1
    "$GONIO" calibrate reference "$folder/white.csv" --bands 532:10 --geometry 8/h --brdf "$folder/ptfe.gonio" --json >"$folder/ptfe.json"
    ok $? "an 8/h certificate, through PTFE's measured BRDF"
    between "$(value factor <"$folder/ptfe.json")" 1.005 1.025; ok $? "its radiance factor over its reflectance"
else
    skip "8/h through PTFE's BRDF" "no data in $data"
fi
finish
