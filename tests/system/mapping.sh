#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Tables as labs have them become samples by a mapping, which is given once, kept beside the data, found again and said in
# words; what a table seems to be is told and proposed.
. tests/system/lib.sh

cd "$work" || exit 1
# One scan of a glossy surface at 30 deg, in three dresses; the truth as a samples file.
python3 - <<'PY'
from math import cos, pi, radians, exp
f = lambda o: round(0.1 + 3 * exp(-((o - 30) / 8) ** 2), 6)
scan = range(-85, 86, 5)
comma = lambda x: f"{x:.8g}".replace(".", ",")
with open("truth.csv", "w") as t:
    t.write("theta_i,phi_i,theta_o,phi_o,r\n")
    t.writelines(f"30,0,{abs(o)},{180 if o >= 0 else 0},{f(o)}\n" for o in scan)
with open("lab.csv", "w") as t: # a German spreadsheet
    t.write("Messung 17 vom 3.4.2020\nProbe: Blech; Anlage 2\n\nIncident_angle;Measure_angle;BRF [%]\nGrad;Grad;%\n")
    t.writelines(f"30,0;{comma(o)};{comma(100 * pi * f(o))}\n" for o in scan)
with open("tabs.dat", "w") as t: # azimuths, with the mirror direction at 0
    t.write("Theta_in\tTheta_out\tPhi_out\tBRDF*cos\n")
    t.writelines(f"30\t{abs(o)}\t{0 if o >= 0 else 180}\t{f(o) * cos(radians(o)):.9g}\n" for o in scan)
with open("bare.txt", "w") as t: # only numbers
    t.writelines(f"  {o}   {f(o)}\n" for o in scan)
with open("rows.csv", "w") as t: # a row for each wavelength, with uncertainties and missing values
    t.write("lambda (nm),angle in,angle out,BRDF,std\n")
    t.writelines(f"{w},30,{o},{0 if o == 30 and w == 550 else f(o) * w / 450:.9g},0.01\n" for o in scan for w in (450, 550) if o != 30)
PY
# same NAME FILE: the samples are the truth's, to the digits that the table has.
same() {
    check "$1" python3 -c '
import sys
rows = [[[float(x) for x in l.split(",")] for l in open(f) if l[0] in "0123456789"] for f in sys.argv[1:3]]
assert len(rows[0]) == len(rows[1]) > 30
for a, b in zip(*rows):
    assert len(a) == len(b) and abs(a[0] - b[0]) + abs(a[2] - b[2]) < 1e-9 and abs(a[4] - b[4]) < 1e-6 * b[4], (a, b)
    assert (a[3] - b[3]) % 360 == 0 or b[2] == 0, (a, b)' "$2" truth.csv
}
exits "a spreadsheet" 0 "$GONIO" convert lab.csv out.csv --columns 'theta_i=Incident_angle,theta_o=Measure_angle' --signed --separator ';' \
    --decimal , --quantity percent --mirror-at 0 --save-map
says "a spreadsheet: in words" "column 2 'Measure_angle' is theta_o in degrees, signed; values are f_r = column 3 'BRF [%]' / 100 / pi"
says "a spreadsheet: where its mapping is kept" "its mapping is kept in lab.csv.gonio-map"
same "a spreadsheet: the samples" out.csv
exits "tabs" 0 "$GONIO" convert tabs.dat out.csv --quantity f_r_cos --mirror-at 0
same "tabs: the samples, of names alone" out.csv
exits "only numbers" 0 "$GONIO" convert bare.txt out.csv --columns theta_i=30,theta_o=#1,value=2 --signed --mirror-at 0
same "only numbers: the samples" out.csv
exits "only numbers, the mirror direction not stated" 0 "$GONIO" convert bare.txt out.csv --columns theta_i=30,theta_o=#1,value=2 --signed
says "the mirror direction where the values show it: says so" "taken to stand at 0, as the values show"
same "the mirror direction where the values show it" out.csv
exits "wavelengths in rows" 0 "$GONIO" convert rows.csv out.csv --columns 'theta_i=angle in,theta_o=angle out' --signed --mirror-at 0 --wavelength-column 'lambda (nm)'
check "wavelengths in rows: channels with sigma" grep -q '^theta_i,phi_i,theta_o,phi_o,450nm,550nm,sigma_450nm,sigma_550nm' out.csv

# Kept beside the data it is found by every verb that takes INPUT.
exits "found again" 0 "$GONIO" convert lab.csv out.csv
says "found again: said" "read as lab.csv.gonio-map says"
same "found again: the samples" out.csv
exits "fit" 0 "$GONIO" fit lab.csv -o lab.gonio --method mba --level 2
exits "compare" 0 "$GONIO" compare lab.gonio lab.csv
exits "check" 0 "$GONIO" check lab.csv
exits "tradeoff knows the options" 3 "$GONIO" tradeoff lab.csv -o t --columns theta_i=x,theta_o=#2
says "what is given comes before it" "no column 'x'"
exits "another map file" 0 "$GONIO" convert lab.csv out.csv --map lab.csv.gonio-map
exits "what is given changes it" 0 "$GONIO" convert lab.csv other.csv --quantity brf
check "what is given changes it: the values" awk -F, 'NR == FNR { v[FNR] = $5 } NR != FNR && FNR > 1 && ($5 / v[FNR] - 100) ^ 2 > 1e-12 { exit 1 }' out.csv other.csv
mv lab.csv.gonio-map kept
exits "without it the text is unknown" 3 "$GONIO" convert lab.csv out.csv
says "without it: look is named" "gonio look"
for verb in fit convert check tradeoff compare look; do
    if "$GONIO" $verb --help | grep -q -e '^  --columns KEY=COLUMN,\.\.\.' && "$GONIO" $verb --help | grep -q -e '^  --signed  '; then
        pass "$verb takes a mapping"
    else
        fail "$verb takes a mapping"
    fi
done
# Formats of their own know nothing of it.
exits "a samples file" 0 "$GONIO" convert truth.csv out.csv
"$GONIO" convert spec:lambert:rho=0.5 merl.binary 2>said
exits "a MERL table" 2 "$GONIO" convert merl.binary out.csv --columns theta_i=1,theta_o=2
says "a MERL table has no columns" "columns: no option of format merl"

# ---- look ----
exits "look" 0 "$GONIO" look lab.csv --picture lab.svg
cp out looked
check "look: the columns" grep -q "^column 2 .*'Measure_angle': -85 to 85, 35 distinct -> theta_o" looked
check "look: the signs" grep -q 'header in line 4, separator ;, decimal sign ,' looked
check "look: the lobe" grep -q 'the lobe stands at azimuth 0' looked
check "look: what is sampled" grep -q '35 geometries of 1 incidence' looked
check "look: an SVG" grep -q '<svg' lab.svg
exits "look: a PNG" 0 "$GONIO" look lab.csv --picture lab.png
check "look: it is one" sh -c 'head -c 4 lab.png | tail -c 3 | grep -q PNG'
sed -n 's/^propose *gonio fit lab.csv \(.*\) -o MODEL.gonio$/\1/p' looked >proposed
check "look: proposes the command line" grep -q -e '--signed.*--quantity percent --mirror-at 0' proposed
check "what look proposes is a command line" sh -c 'eval "\"$1\" convert lab.csv out.csv $(cat proposed)"' - "$GONIO"
same "what look proposes: the samples" out.csv
exits "look, JSON" 0 "$GONIO" look lab.csv --json
check "look, JSON" python3 -c '
import json
a = json.load(open("out"))
assert a["table"]["columns"][1]["as"] == "theta_o" and a["table"]["rows"] == 35 and a["sampled"]["samples"] == 35'
exits "look keeps its proposal" 0 "$GONIO" look lab.csv --save-map
exits "look's proposal is found" 0 "$GONIO" convert lab.csv out.csv
same "look's proposal is found: the samples" out.csv
exits "look of what lacks an angle" 0 "$GONIO" look bare.txt
check "look of what lacks an angle: says so" grep -q '^open .*theta_i is in no column' out
exits "no picture of that" 2 "$GONIO" look bare.txt --picture bare.svg
printf 'hello\nworld\n' >prose.txt
exits "look of prose" 3 "$GONIO" look prose.txt
# ---- matrices, footers, quotes, retro-reflectors ----
python3 - <<'PY'
import math
f = lambda ti, to, p: .1 + .8 * math.exp(-(math.degrees(math.acos(max(-1, min(1, math.cos(math.radians(ti)) * math.cos(math.radians(to)) -
    math.sin(math.radians(ti)) * math.sin(math.radians(to)) * math.cos(math.radians(p)))))) / 8) ** 2)
tis, tos, phis = [10, 30, 50, 70], range(0, 81, 10), [0, 45, 90, 135, 180]
rows = [(ti, to, p, round(f(ti, to, p), 5)) for p in phis for to in tos for ti in tis]
def put(name, text): open(name, 'w', encoding='utf-8').write(text)
put('long.text', 'theta_i;theta_o;phi;BRDF\n' + ''.join('%g;%g;%g;%g\n' % r for r in rows))
cell = {r[:3]: r[3] for r in rows}
def block(p, corner, sep, dec='.'):
    return (corner + sep.join(map(str, tis)) + '\n' + ''.join(str(to) + sep + sep.join(str(cell[ti, to, p]).replace('.', dec) for ti in tis) + '\n' for to in tos))
put('blocks.text', 'Our lab\n' + '\n'.join('phi = %d deg\n' % p + block(p, 'to/ti ', ' ') for p in phis))
put('comma.text', '\n'.join('# Azimut %d\n' % p + block(p, 'x;', ';', ',') for p in phis))
put('bare.text', '\n'.join('phi %d\n' % p + block(p, '', ' ') for p in phis))
put('once.text', 'corner,' + ','.join(map(str, tis)) + '\n' + ''.join('phi: %d\n' % p + block(p, 'c,', ',').split('\n', 1)[1] for p in phis))
put('waves.text', 'incidence 30 deg\nnm;0;10;20;30;40\n' + ''.join('%d;' % w + ';'.join(str(cell[30, to, 180]) for to in (0, 10, 20, 30, 40)) + '\n' for w in (400, 500, 600)))
put('footer.text', open('long.text').read() + '\nEnd of data\nMean; 0.1\n')
put('quoted.text', '"Incidence, deg","Detector, deg","Azimuth, deg","BRDF, 1/sr"\n' + ''.join('"%s","%s","%s","%s"\n' % tuple(str(v).replace('.', ',') for v in r) for r in rows))
put('degrees.text', 'theta_i;theta_o;phi;BRDF\n' + ''.join('%g\u00b0;%g\u00b0;%g\u00b0;%g\n' % r for r in rows))
put('elevation.text', 'elevation_i;elevation_o;phi;BRDF\n' + ''.join('%g;%g;%g;%g\n' % (90 - r[0], 90 - r[1], r[2], r[3]) for r in rows))
put('empty.text', 'theta_i;theta_o;phi;BRDF\n' + ''.join('%g;%g;%g;%s\n' % (*r[:3], '' if i % 9 == 4 else r[3]) for i, r in enumerate(rows)))
put('german.text', 'Einfallswinkel;Ausfallswinkel;Azimut;BRDF\n' + ''.join('%g;%g;%g;%g\n' % r for r in rows).replace('.', ','))
put('percent.text', 'theta_i;theta_o;phi;BRDF;uncertainty [%]\n' + ''.join('%g;%g;%g;%g;2\n' % r for r in rows))
put('sheet.text', 'theta_i;theta_o;BRDF\n' + ''.join('%d;%d;%g\n' % (ti, to, .1 + 5 * math.exp(-((to - ti) / 3) ** 2) + math.exp(-((to + ti) / 5) ** 2)) for ti in (20, 30, 45) for to in range(-80, 81, 2)))
PY
"$GONIO" convert long.text long.csv --columns auto 2>/dev/null
# same NAME FILE OPTIONS...: the same samples as the table of rows, in whatever order, whatever the values are called.
bare() { tail -n +2 "$1" | sort; }
same() {
    name=$1 file=$2
    shift 2
    rm -f out.csv
    "$GONIO" convert $file out.csv "$@" >said 2>&1
    bare out.csv >left 2>/dev/null
    bare long.csv >right
    check "$name" cmp left right
}
same "blocks under headings" blocks.text --matrix theta_o,theta_i,phi
same "headings in comments, decimal commas" comma.text --matrix theta_o,theta_i,phi
same "no corner" bare.text --matrix theta_o,theta_i,phi
same "the columns' heads stand once" once.text --matrix theta_o,theta_i,phi
same "footers" footer.text --columns auto
check "are counted" grep -q "2 lines of text behind the table are not read" said
same "separators between quotes" quoted.text --columns auto
same "degrees by their sign" degrees.text --columns auto
same "angles from the surface" elevation.text --columns auto --elevation
same "German names" german.text --columns auto
same "a relative uncertainty is no channel" percent.text --columns auto
check "and named" grep -q "not read: uncertainty" said
"$GONIO" convert empty.text out.csv --columns auto >said 2>&1
check "an empty value is a missing one" grep -q "20 rows with an empty field" said
for file in blocks comma bare once waves quoted degrees elevation german empty percent; do
    options=$("$GONIO" look $file.text 2>/dev/null | sed -n 's/^propose *gonio fit [^ ]* \(.*\) -o MODEL.gonio$/\1/p')
    check "look proposes for $file: $options" sh -c '[ -n "$3" ] && eval "\"$1\" convert $2.text proposed.csv $3"' - "$GONIO" $file "$options"
done
exits "wavelengths in rows" 0 "$GONIO" convert waves.text out.csv --matrix wavelength,theta_o --columns theta_i=30deg
check "are channels" grep -q 400nm,500nm,600nm out.csv
exits "a second block without a key" 3 "$GONIO" convert blocks.text out.csv --matrix theta_o,theta_i
says "is named" "begins another block"
exits "rows and columns are two things" 2 "$GONIO" convert blocks.text out.csv --matrix theta_o,theta_o
printf 'phi 1\nx;10;20\n30;1;bad\n' >t.text
exits "a bad cell" 3 "$GONIO" convert t.text out.csv --matrix theta_o,theta_i,phi
says "has its line" "t.text:3"
exits "two peaks leave the mirror open" 3 "$GONIO" fit sheet.text --columns auto --signed
says "and ask" "--mirror-at 180"
check "look asks as well" tells 0 "peaks stand on both sides" "$GONIO" look sheet.text
exits "with --mirror-at it is read" 0 "$GONIO" convert sheet.text out.csv --columns auto --signed --mirror-at 180

finish
