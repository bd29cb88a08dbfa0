#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# gonio check: DeYoung's measures, what --apply writes, the pictures, and fit --physical.
set -u
. tests/system/lib.sh
json() { python3 -c "import json,sys; d=json.load(open('$work/out')); sys.exit(0 if ($1) else 1)"; }
ward=spec:ward:rho_d=0.1,rho_s=0.3,alpha_x=0.05,alpha_y=0.3

exits "check" 0 "$GONIO" check spec:lambert:rho=0.5/0.6/0.7 --json
check "its figures" json "d['form']=='model' and d['reciprocity']==0 and d['isotropy']==0 and d['excess']==0 and abs(d['energy']-0.7)<1e-6 and abs(d['albedo']-0.6)<1e-6 and max(d['separability'])<1e-12"
check "the old medians have names of their own" json "d['reciprocity_median']==0 and d['isotropy_median']==0"
exits "a limit that is exceeded" 1 "$GONIO" check spec:lambert:rho=0.5 --max-energy 0.4

"$GONIO" convert "$ward" "$work/w.csv" --plan uniform:15,anisotropic=1
exits "a uniform table" 0 "$GONIO" check "$work/w.csv" --json
check "P_i, P_r, P_ec and the largest albedo are known" json "d['form']=='uniform' and abs(d['isotropy']-0.0763957)<5e-8 and d['reciprocity']<1e-30 and d['excess']==0 and abs(d['energy']-0.3912)<5e-5"
check "as many ranks as are kept" json "len(d['separability'])==16 and all(a>=b for a,b in zip(d['separability'],d['separability'][1:]))"

"$GONIO" convert "$ward" "$work/w.csv" --plan uniform:30,anisotropic=1
# Divided by cos(theta_i) it is neither reciprocal nor passive.
awk -F, 'BEGIN { OFS = ","; deg = atan2(0, -1) / 180 } /^theta|^#/ { print; next } { printf "%s,%s,%s,%s,%.17g\n", $1, $2, $3, $4, $5 / cos($1 * deg) }' "$work/w.csv" >"$work/n.csv"
for change in reciprocity:0.25 isotropy:0.5 separable.5:0.5; do
    made=$(echo "${change%:*}" | tr . :)
    key=$(echo "${made%:*}" | sed 's/separable/separability/')
    exits "$made half of the way" 0 "$GONIO" check "$work/n.csv" --apply "$made" --delta 0.5 -o "$work/half.csv" --json
    check "leaves ${change#*:} of it" json "(lambda v: abs(v(d['after'])/v(d)-${change#*:})<1e-9)(lambda r: r['$key'][4] if '$key'=='separability' else r['$key'])"
    exits "$made all of the way" 0 "$GONIO" check "$work/n.csv" --apply "$made" -o "$work/whole.csv" --json
    check "leaves nothing" json "(lambda v: v(d['after'])<=1e-12*v(d))(lambda r: r['$key'][4] if '$key'=='separability' else r['$key'])"
done
check "as many rows as before" [ "$(wc -l <"$work/whole.csv")" -eq "$(wc -l <"$work/n.csv")" ]
exits "energy" 0 "$GONIO" check "$work/n.csv" --apply energy -o "$work/e.csv" --json
check "scales down what exceeds 1" json "d['excess']>0.001 and d['after']['energy']<=1+1e-9"
exits "energy to a ceiling" 0 "$GONIO" check "$work/n.csv" --apply energy --ceiling 0.9 --one-scalar -o "$work/e.csv" --json
check "by one scalar" json "abs(d['after']['energy']-0.9)<1e-9"

exits "a model" 0 "$GONIO" check spec:ward:rho_d=0.1,rho_s=0.3,alpha_x=0.5,alpha_y=0.9 --apply isotropy -o "$work/w.gonio" --json
check "becomes isotropic" json "d['isotropy']>0.005 and d['after']['isotropy']<1e-10"
exits "and is a model" 0 "$GONIO" info "$work/w.gonio"
check "of kind transformed" grep -q transformed "$work/w.gonio"
exits "a model as CSV" 2 "$GONIO" check "$ward" --apply isotropy -o "$work/w.csv"
exits "an unknown transform" 2 "$GONIO" check "$work/w.csv" --apply symmetry -o "$work/x.csv"
check "names those there are" grep -q 'separable:K' "$work/err"
exits "no number of products" 2 "$GONIO" check "$work/w.csv" --apply separable -o "$work/x.csv"
exits "more than all the way" 2 "$GONIO" check "$work/w.csv" --apply reciprocity --delta 1.5 -o "$work/x.csv"

exits "pictures" 0 "$GONIO" check spec:lambert:rho=0.5 --apply reciprocity --images "$work/pictures" --json
check "and their error" json "d['pictures'][0]['name']=='reciprocity' and d['pictures'][0]['largest']==0"
for file in reciprocity.png reciprocity-difference.png reciprocity-lobe.svg reciprocity-lobe.png albedo.svg albedo.png separability.svg separability.png; do
    check "$file" [ -s "$work/pictures/$file" ]
done

# ---- physical by construction ----
"$GONIO" convert spec:ward:rho_d=0.6,rho_s=0.5,alpha=0.4 "$work/f.csv" --plan nusselt:300
awk -F, 'BEGIN { OFS = ","; deg = atan2(0, -1) / 180 } /^theta|^#/ { print; next } { printf "%s,%s,%s,%s,%.17g\n", $1, $2, $3, $4, $5 * (1.2 - 0.2 * cos($1 * deg)) }' "$work/f.csv" >"$work/p.csv"
exits "a physical fit" 0 "$GONIO" fit "$work/p.csv" -o "$work/p.gonio" --method mba --level 3 --physical reciprocal,passive --json
check "says what it cost" json "d['physical']['reciprocity_before']>0 and d['physical']['energy']<=1 and d['physical']['held_out']['samples']>0"
exits "checked" 0 "$GONIO" check "$work/p.gonio" --json
check "is reciprocal and passive" json "d['reciprocity']==0 and d['excess']==0 and d['energy']<=1"
exits "no such property" 2 "$GONIO" fit "$work/p.csv" --physical isotropic
finish
