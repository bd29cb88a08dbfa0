#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Every text that a user writes is read alike: a byte order mark, CRLF, tabs and blanks count for nothing, comments stand
# where docs/formats.md says; UTF-16, lines with CR alone and missing values are named as what they are.
. tests/system/lib.sh

cd "$work" || exit 1
header=theta_i,phi_i,theta_o,phi_o
python3 - <<'PYTHON'
def put(name, text):
    open(name, 'w').write(text)
header = 'theta_i,phi_i,theta_o,phi_o'
put('samples', header + ',r,sigma_r\n10,0,20,180,0.25,0.01\n30,10,40.5,190,0.5,0.02\n')
put('plan', header + '\n10,0,20,180\n30,10,40.5,190\n')
put('certificate', 'nm,reflectance,sigma\n350,0.98,0.005\n800,0.97,0.005\n')
put('frames', 'file,exposure_s\nnone.png,0.5\nnone2.png,0.25\n')
put('lit_frames', 'file,exposure_s,light\nnone.png,0.5,1\n')
put('views', 'file,object,light_theta,light_phi,camera_theta,camera_phi\nnone.png,board,0,0,0,0\n')
put('curve', 'exposure,value\n0,0\n0.25,0.5\n1,1\n')
put('nist', 'lambda,thetai,phii,thetar,phir,f_r11,' + ','.join('abcdefghijklmno') + '\n0.5,-10,0,20,30,1' + ',0' * 15 + '\n')
rows = ['camera azimuth axis', 'camera tilt axis', 'camera', 'light azimuth axis', 'light tilt axis', 'light']
names = []
for arm in ('camera', 'light'):
    for axis in ('azimuth', 'tilt'):
        names += [f'{arm} {axis} axis {p}' for p in ('a', 'b', 'c_mm', 'd_mm')]
    names += [f'{arm} {p}_mm' for p in 'xyz']
    if arm == 'camera':
        names += [f'camera turn {p}_rad' for p in 'xyz']
put('alignment', 'parameter,value,covariance\n' + ''.join(
    f'{n},{900 if n.endswith("z_mm") else 0}' + ',0' * 25 + '\n' for n in names))
put('cornell', '2\n400 500\n0.1 0 0.2 3.141593 1 2\n0.3 0 0.3 0 0 0.5\n')
put('retro', '#SAMPLE\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n0.26 0.26 0 72.5\n')
put('camera', '[camera]\nfx_px = 800\nfy_px = 800\ncx_px = 320\ncy_px = 256\nwidth = 640\nheight = 512\n')
put('rig', '[rig]\ndriver = sim\nnotes = two words\n[axis camera_phi]\nmin_deg = -180\nmax_deg = 180\n')
put('part', '[lamp]\ndrift_percent_per_hour = 0.5\n')
PYTHON
# NAME COMMAND, with FILE for the text. Where it goes wrong behind the text (there are no frames), it must go wrong alike.
cat >readers <<'READERS'
samples convert FILE out.csv --to samples
plan plan FILE --sample lambert:rho=0.5
plan eval spec:lambert:rho=0.5 FILE
certificate calibrate reference FILE
frames calibrate response FILE
frames calibrate flat FILE
lit_frames calibrate noise FILE
views calibrate rig FILE --camera camera
curve plan plan --sample lambert:rho=0.5 --set camera.response=FILE
curve measure --rig null.ini --with null2.ini --plan plan --yes --set camera.response=FILE s.session
alignment plan plan --sample lambert:rho=0.5 --set rig.alignment=FILE
nist convert FILE out.csv --to samples
cornell convert FILE out.csv --to samples
retro convert FILE out.csv --to samples
camera calibrate rig views --camera FILE
rig plan plan --sample lambert:rho=0.5 --rig FILE
part plan plan --sample lambert:rho=0.5 --with FILE
READERS
printf '[rig]\ndriver = null\n' >null.ini
printf '[sample]\nid = x\n' >null2.ini

# answer COMMAND ...: status and everything that is said and written, with the file's name and place left out.
answer() {
    rm -rf out.csv s.session
    "$GONIO" "$@" >said 2>&1
    {
        echo $?
        sed "s/[^ ]*\.text/FILE/g; s/FILE:[0-9]*:/FILE:/" said
        [ ! -e out.csv ] || cat out.csv
    }
}
vary() { # KIND FILE: the text, written otherwise
    case $1 in
    windows) printf '\357\273\277' && sed 's/,/ , /g; s/ = /   =  /; s/^/ /; s/$/  \r/' "$2" ;;
    tabs) sed 's/,/\t,\xc2\xa0/g; s/ = /\t=\t/; s/^\([0-9a-z].*\)$/\1\t\n\n# a comment, with = and ;/' "$2" ;;
    no_commas) sed 's/,/ \t /g' "$2" ;;
    hash) sed 's/\( = .*\)$/\1 # what it is, = and ; too/' "$2" ;;
    semicolon) sed 's/\( = .*\)$/\1\t; what it is, = and # too/' "$2" ;;
    esac
}
without_number() { # TEXT: with a missing value instead of its last number
    case $1 in
    camera) sed 's/= 800/= NaN/' "$1" ;;
    retro) sed 's|72.5|nan|' "$1" ;;
    nist) sed 's|30,1,|30,n/a,|' "$1" ;;
    lit_frames) sed 's|0.5,1|NA,1|' "$1" ;;
    *) sed '$s|[0-9.]*$|NA|' "$1" ;;
    esac
}
while read -r text command; do
    of() { rm -rf s.session && echo "$command" | sed "s/FILE/$1/"; }
    cp "$text" plain.text
    answer $(of plain.text) >plain
    case $text in
    samples | plan | certificate | frames | lit_frames | views | curve) kinds="windows tabs no_commas" ;;
    camera) kinds="windows tabs hash semicolon" ;;
    rig | part) kinds="windows tabs hash semicolon" ;;
    *) kinds="windows tabs" ;;
    esac
    for kind in $kinds; do
        vary $kind "$text" >other.text
        answer $(of other.text) | sed 's/^\([0-9.]*\) , \([0-9.]*\) , \([0-9.]*\) , /\1,\2,\3,/' >other
        # What eval echoes keeps the blanks that it had.
        tr -d ' \t\302\240' <plain >plain.flat
        tr -d ' \t\302\240' <other >other.flat
        check "$command: $kind" diff plain.flat other.flat
    done
    iconv -f UTF-8 -t UTF-16 "$text" >other.text
    exits "$command: UTF-16" 3 "$GONIO" $(of other.text)
    says "$command: UTF-16 is named" "byte 0: it is UTF-16 text"
    tr '\n' '\r' <"$text" >other.text
    exits "$command: CR alone" 3 "$GONIO" $(of other.text)
    says "$command: CR alone is named" "its lines end with CR alone"
    case $text in rig | part) continue ;; esac
    without_number "$text" >other.text
    exits "$command: a missing value" 3 "$GONIO" $(of other.text)
    says "$command: a missing value is named" "which stands for a missing one"
done <readers
iconv -f UTF-8 -t UTF-16BE samples >other.text
exits "UTF-16 without a mark" 3 "$GONIO" fit other.text
says "UTF-16 without a mark is named" "it is UTF-16 text"

# ---- binaries of the other byte order, and an ending that promises something else ----
python3 - <<'PYTHON'
import struct
open('big.binary', 'wb').write(struct.pack('>3i', 90, 90, 180) + bytes(3 * 8 * 90 * 90 * 180))
open('big.bsdf', 'wb').write(b'tensor_file\0\1\0' + struct.pack('>I', 6) + bytes(100))
PYTHON
for file in big.binary big.bsdf; do
    exits "$file" 3 "$GONIO" convert $file out.csv
    says "$file is named" "its numbers are big-endian"
done
printf '%s,r\n10,0,20,180,0.25\n20,0,20,180,0.25\n30,0,20,180,0.25\n' $header >d.csv
"$GONIO" convert spec:lambert:rho=0.5 m.gonio
while read -r command; do
    exits "$command" 2 "$GONIO" $command
    says "$command: says so" "the ending promises"
    target=$(echo "$command" | grep -oE '(wrong|new)\.[a-z]+' | head -n 1)
    check "$command: nothing is written" [ ! -e "$target" ]
done <<'COMMANDS'
convert d.csv wrong.bsdf --to samples
convert d.csv wrong.BSDF --to samples
convert d.csv wrong.gonio --to samples
convert m.gonio wrong.csv --to merl
convert m.gonio wrong.csv --to model
convert m.gonio wrong.binary --to samples
fit d.csv -o wrong.csv
fit d.csv -o wrong.bsdf
fit d.csv -o wrong.png
render m.gonio -o wrong.gonio
render m.gonio -o wrong.csv
eval m.gonio plan -o wrong.bsdf
eval m.gonio plan -o wrong.gonio
check d.csv --apply mirror -o wrong.gonio
plan plan -o wrong.ini --sample lambert:rho=0.5
plan plan -o wrong.gonio --sample lambert:rho=0.5
samples none.session -o wrong.gonio
samples none.session -o wrong.dat
replay none.session --model wrong.csv
resume none.session --model wrong.csv
measure --sample lambert:rho=0.5 --model wrong.csv new.session
calibrate response frames -o wrong.gonio
calibrate reference certificate -o wrong.csv
calibrate camera none.png -o wrong.csv
calibrate rig views --camera camera -o wrong.ini
COMMANDS
finish
