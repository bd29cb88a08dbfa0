#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# What a lab's table says is heeded or refused by name: declarations, columns that are no channels, missing values.
. tests/system/lib.sh

cd "$work" || exit 1
header=theta_i,phi_i,theta_o,phi_o
convert() { "$GONIO" convert t.text out.csv --to samples "$@" >said 2>&1; }
# refused NAME TEXT SAYS: with status 3, by a message that has SAYS.
refused() {
    printf "$2" >t.text
    rm -f out.csv
    exits "$1" 3 "$GONIO" convert t.text out.csv --to samples
    says "$1: names it" "$3"
    check "$1: nothing is written" [ ! -e out.csv ]
}
# heeded NAME TEXT ROWS: the rows of the samples file that comes of it, without their header, joined by blanks.
heeded() {
    printf "$2" >t.text
    exits "$1" 0 "$GONIO" convert t.text out.csv --to samples
    rows=$(grep -v theta_i out.csv | tr '\n' ' ')
    check "$1: [$rows]" [ "$rows" = "$3 " ]
}

# ---- every declaration that could change a value, in every text format and spelling ----
samples="$header,r\n10,0,60,0,0.25\n"
cornell='1\n500\n0.1 0 0.2 3 1\n'
nist='lambda,thetai,phii,thetar,phir,f_r11,a,b,c,d,e,f,g,h,i,j,k,l,m,n,o\n0.5,-10,0,20,30,1,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n'
retro='#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n0.26 0.26 0 72.5\n'
for format in samples cornell nist retro; do
    eval "body=\$$format"
    [ $format = retro ] && first='#SAMPLE x\n' || first=
    # The reading of comments is one for all formats: a few lines show that each goes through it.
    [ $format = samples ] && all=1 || all=
    for line in '# units = percent' '#unit: %%' '# Quantity = transmittance' '# angles = gon' '# angle convention: signed' \
        '# symmetry = bilateral' '# wavelength unit: cm' '# polarisation = s' '# polarization: p' '# scale = 100' '# Factor: 0.5' \
        '# offset = 3' '# normalized: yes' '# half = absorption' '#PARAM_OUT UNHEARD_OF' '#UNITS PERCENT' \
        '# values are brdf times cos(theta)' '# Note: multiplied by cos(theta_o)' '# all values in percent' '# log10 of the brdf'; do
        case $all$line in 1* | '# scale'* | *PARAM_OUT* | *times*) ;; *) continue ;; esac
        refused "$format: $line" "$first$line\n$body" "$(printf "$line" | sed 's/^# *//')"
    done
    for line in '# units = 1/sr' '# Quantity: BRDF' '# symmetry = isotropic' '# polarisation = unpolarised' '# Operator: me' \
        '# 50 % humidity' '# made on 2020-01-01' '# sample = white, 3 mm thick' '#URL https://example.org/cos' '# values: 1'; do
        case $all$line in 1* | *Quantity* | *made*) ;; *) continue ;; esac
        line=$(echo "$line" | sed 's/%/%%/g')
        printf "$first$line\n$body" >t.text
        convert
        check "$format takes $line" [ $? = 0 ]
    done
    printf "$first# units = percent\n$body" >t.text
    convert --declared ignore
    check "$format: --declared ignore" [ $? = 0 ]
done
for line in 'quantity = f_r cos(theta_o)' 'quantity: BRDF*cos' 'quantity = ccbrdf' 'cosine factor = yes'; do
    heeded "# $line" "# $line\n$samples" '10,0,60,0,0.4999999999999999'
    says "# $line is told" "divided by"
done
heeded "a reflectance factor" "# quantity = reflectance factor\n$header,r,sigma_r\n10,0,60,0,3.14159265358979312,3.14159265358979312\n" '10,0,60,0,1,1'
heeded "# symmetry = anisotropic" "# symmetry = anisotropic\n$samples" '# anisotropic 10,0,60,0,0.25'
heeded "# missing = 7" "# missing = 7\n${samples}10,0,61,0,7\n" '10,0,60,0,0.25'
printf '#SAMPLE x\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n#PARAM_OUT INV_STERADIAN_COSINE_FACTOR\n0.5 0 0 0.4\n0.5 1.0471975511965976 0 0.25\n0.5 1.5707963268 0 0.1\n' >t.text
convert
check "a cosine factor is divided out" grep -qE ',(0.500000000000|0.499999999999)' out.csv
check "the horizon is left out and counted" grep -q '1 rows at the horizon' said
refused "columns of uncertainty" "#SAMPLE x\n#VS 2\n$retro" "VS 2"
refused "f_r11 of another name" "$(printf "$nist" | sed 's/f_r11/f_r11_percent/')" "f_r11_percent"
refused "wavelengths in nm for um" "$(printf "$nist" | sed 's/^0.5,/500,/')" "100 um"
refused "wavelengths in um for nm" "$(printf "$cornell" | sed 's/500/0.5/')" "20 to 1e6 nm"
printf 'nm,reflectance (%%),sigma\n350,0.9,0.01\n800,0.9,0.01\n' >c.csv
exits "a certificate in percent" 3 "$GONIO" calibrate reference c.csv
printf 'nm,reflectance,U (k=2)\n350,0.9,0.01\n800,0.9,0.01\n' >c.csv
exits "a certificate's expanded uncertainty" 3 "$GONIO" calibrate reference c.csv

# ---- what the measurement was ----
for format in samples cornell nist retro; do
    eval "body=\$$format"
    [ $format = retro ] && first='#SAMPLE x\n' || first=
    printf "$first# light_half_angle_deg = 0.5\n# Operator: me\n# sample = white, 3 mm\n$body" >t.text
    check "$format keeps its head" tells 0 '"operator":"me"' "$GONIO" info --json t.text
    convert
    check "$format: in a samples file" grep -q '^# light_half_angle_deg = 0.5$' out.csv
    printf "$first# temperature_c = warm\n$body" >t.text
    exits "$format: a figure that is none" 3 "$GONIO" convert t.text out.csv --to samples
    says "$format: is named" "temperature_c"
done

# ---- columns ----
for name in wavelength Wavelength lambda wavelength_nm 'wavelength (nm)' 'lambda [nm]' wl; do
    heeded "a row for each wavelength: $name" "$header,$name,brdf\n1,0,2,0,450,1\n1,0,2,0,550,2\n1,0,3,0,450,3\n1,0,3,0,550,4\n" \
        '1,0,2,0,1,2 1,0,3,0,3,4'
    check "$name names the channels" grep -q ',450nm,550nm$' out.csv
done
for name in 'wavelength_um' 'lambda (um)' wavelength; do
    heeded "wavelengths in um: $name" "$header,brdf,$name,std\n1,0,2,0,1,0.45,0.1\n1,0,2,0,2,0.55,0.2\n" '1,0,2,0,1,2,0.1,0.2'
done
printf "$header,wavelength,brdf\n1,0,2,0,450,1\n1,0,2,0,550,2\n" >t.text
convert --wavelength 550
check "one of the wavelengths" [ "$(tail -n 1 out.csv)" = 1,0,2,0,2 ]
refused "a geometry without one of the wavelengths" "$header,wavelength,brdf\n1,0,2,0,450,1\n1,0,2,0,550,2\n1,0,3,0,450,3\n" "does not come once with each"
refused "wavelengths and two channels" "$header,wavelength,r,g\n1,0,2,0,450,1,1\n" "one column of values, found 2"
for name in std stdev unc uncertainty err sigma SD 'u'; do
    heeded "an uncertainty: $name" "$header,r,$name\n1,0,2,0,0.5,0.25\n" '1,0,2,0,0.5,0.25'
done
heeded "uncertainties of channels" "$header,r,g,std_r,g_unc\n1,0,2,0,1,2,3,4\n" '1,0,2,0,1,2,3,4'
refused "an uncertainty of two channels" "$header,r,g,std\n1,0,2,0,1,2,3\n" "sigma_<channel>"
for name in temp temperature 'temp [C]' id index date timestamp exposure_s file humidity_rh; do
    heeded "not a channel: $name" "$header,$name,r\n1,0,2,0,x y,0.5\n" '1,0,2,0,0.5'
    says "not a channel: $name is told" "no channels"
done
for name in brdf_percent percent 'r%%' f_r_cos brdf_cos counts btdf brf log10_brdf voltage; do
    refused "no f_r: $name" "$header,$name\n1,0,2,0,0.5\n" "no f_r"
done
heeded "names as you like" "$header,left eye,my right eye\n1,0,2,0,1,2\n" '1,0,2,0,1,2'
heeded "equal geometries that differ" "$header,r\n1,0,2,0,1\n1,0,2,0,2\n" '1,0,2,0,1 1,0,2,0,2'
says "equal geometries that differ are told" "1 geometries stand in 2 rows"
heeded "equal geometries within sigma" "$header,r,sigma_r\n1,0,2,0,1,0.5\n1,0,2,0,2,0.5\n" '1,0,2,0,1,0.5 1,0,2,0,2,0.5'
check "equal geometries within sigma are no news" [ "$(grep -c geometries "$work/err")" = 0 ]

# ---- the nearest wavelength ----
printf '3\n500 510 540\n0.1 0 0.2 3 1 2 3\n' >t.text
printf "$header,wavelength,r\n1,0,2,0,500,1\n1,0,2,0,510,2\n1,0,2,0,540,3\n" >tall.csv
for file in t.text tall.csv; do
    for case in '510 510nm' '.51 510nm' '514 510nm' '524 510nm' '526 540nm' '498 500nm' '542 540nm'; do
        exits "$file: wavelength $case" 0 "$GONIO" convert $file out.csv --wavelength "${case% *}"
        [ $file = tall.csv ] || check "$file: wavelength $case is taken" grep -q ",${case#* }$" out.csv
    done
    check "$file: it is said" grep -q 'the nearest, is taken' "$work/err"
    for wavelength in 480 560 1000; do
        exits "$file: no wavelength near $wavelength" 3 "$GONIO" convert $file out.csv --wavelength $wavelength
    done
done
# A large plan is ordered in about the time of a small one.
exits "uniform:2" 0 "$GONIO" plan uniform:2 --sample lambert:rho=0.5 -o plan.csv
check "uniform:2 has all its poses" [ "$(sort -u plan.csv | wc -l)" = 160610 ]

# ---- missing values ----
for number in -99 -999 -9999 9.9e37 9.91E+37 1e30 -32768; do
    heeded "missing as $number" "$header,r,g\n1,0,2,0,1,2\n1,0,3,0,1,$number\n1,0,4,0,$number,3\n" '1,0,2,0,1,2'
    says "missing as $number is told" "2 rows with"
    says "missing as $number is told with its place" "line 3"
done
heeded "missing as -1, twice" "$header,r\n1,0,2,0,1\n1,0,3,0,-1\n1,0,4,0,-1\n" '1,0,2,0,1'
refused "a single -1 is negative" "$header,r\n1,0,2,0,1\n1,0,3,0,-1\n" "1 negative values"
printf "$header,r\n1,0,2,0,1\n1,0,3,0,7\n1,0,4,0,NaN\n" >t.text
convert --missing 7
check "--missing 7: another word is bad" [ $? = 3 ]
convert --missing nan && check "--missing nan" [ "$(grep -c '^1' out.csv)" = 2 ]
printf "$header,r\n1,0,2,0,1\n1,0,3,0,-99\n" >t.text
convert --missing none
check "--missing none" [ $? = 3 ]
python3 - "$header" <<'PYTHON'
import math, sys
def table(name, value, sigma=None):
    with open(name, 'w') as f:
        f.write(sys.argv[1] + ',r' + (',sigma_r' if sigma else '') + '\n')
        for ti in (10, 20, 30, 45, 60):
            for to in range(-75, 78, 3):
                phi = 0 if to >= 0 else 180
                v = value(ti, to)
                f.write(f'{ti},0,{abs(to)},{phi},{v:.6g}' + (f',{sigma(ti, to)}' if sigma else '') + '\n')
def matt(ti, to):
    return 0.1 + math.exp(-((ti + to) / 10) ** 2)
table('matt.csv', matt)
table('shadow.csv', lambda ti, to: 0 if abs(ti - to) < 8 else matt(ti, to))
table('black.csv', lambda ti, to: max(0, round(math.exp(-((ti + to) / 5) ** 2), 4)))
table('noise.csv', lambda ti, to: max(0, 0.001 * math.sin(1e4 * (ti + 0.37 * to))))
table('one.csv', matt, lambda ti, to: 1)
table('tiny.csv', matt, lambda ti, to: 1e-9)
table('clipped.csv', lambda ti, to: min(0.8, matt(ti, to)))
PYTHON
told() { # NAME FILE TEXT: fit tells it
    exits "$1" 0 "$GONIO" fit "$2" -o m.gonio --method lsq --hold-out 0
    says "$1: told" "$3"
}
told "a shadowed block" shadow.csv "25 rows of exact zeros within 7 deg of the light"
"$GONIO" eval m.gonio - <<EVAL >v.csv
$header
30,0,30,0
EVAL
check "a shadowed block is no black hole" awk -F, 'NR == 2 { exit !($5 > 0.09 && $5 < 0.11) }' v.csv
for file in matt black noise; do
    exits "$file" 0 "$GONIO" convert $file.csv out.csv
    check "$file: nothing is left out" [ "$(wc -l <out.csv)" = "$(wc -l <$file.csv)" ]
done
exits "--missing none" 0 "$GONIO" convert shadow.csv out.csv --missing none
check "--missing none: nothing is left out" [ "$(wc -l <out.csv)" = "$(wc -l <shadow.csv)" ]
told "a ceiling" clipped.csv "the largest value, 0.8, stands in"
# A sigma that all rows share changes no answer.
for file in matt one tiny; do
    "$GONIO" fit $file.csv -o $file.gonio --method lsq --hold-out 0 >said 2>&1
done
check "a common sigma of 1 changes no bit" cmp matt.gonio one.gonio
check "a common sigma of 1e-9 changes no bit" cmp matt.gonio tiny.gonio
# ---- what was sampled ----
python3 -c "
for to in range(-85, 86):
    print(('$header,r\n' if to == -85 else '') + f'30,0,{abs(to)},{180 if to < 0 else 0},{0.3 + to / 1000}')" >plane.csv
for verb in look check "fit --method mba --level 2"; do
    set -- $verb
    exits "$1 of a plane" 0 "$GONIO" $verb plane.csv
    check "$1 of a plane says what was sampled" grep -q '171 geometries of 1 incidence, theta_i 30 deg, theta_o 0 to 85 deg, in the plane of incidence alone' "$work/out"
    check "$1 of a plane says what errors are of" grep -q 'say nothing of the rest' "$work/out"
    exits "$1 of a plane, JSON" 0 "$GONIO" $verb plane.csv --json
    check "$1 of a plane, JSON" grep -q '"narrow": *true' "$work/out"
done
"$GONIO" plan nusselt:400 --sample lambert:rho=0.5 -o where.csv >said
"$GONIO" eval spec:lambert:rho=0.5 where.csv -o whole.csv
exits "fit of the whole" 0 "$GONIO" fit whole.csv --method mba --level 2
check "fit of the whole says nothing of a rest" [ "$(grep -c 'rest' "$work/out")" = 0 ]
finish
