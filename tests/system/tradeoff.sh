#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# gonio tradeoff, and what the default method tells about its choice.
. tests/system/lib.sh

json() { python3 -c "import json,sys; d=json.load(open('$work/out')); sys.exit(0 if ($1) else 1)"; }

exits "a set" 0 "$GONIO" convert spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.3 "$work/s.csv" --plan nusselt:150,theta_max=75
exits "tradeoff" 0 "$GONIO" tradeoff "$work/s.csv" -o "$work/t" --json
check "it tells of the front as it grows" grep -q '^front: ' "$work/err"
check "a row has every key" json "all(k in r for r in d['rows'] for k in 'method level options fit_seconds eval_ns bytes file_bytes image_error train held_out pareto'.split())"
check "every method has a row" json "set('mba cbmba lsq auto lambert phong blinn-phong lafortune ward ward-duer cook-torrance ashikhmin-shirley oren-nayar schlick he ggx principled koenderink spherical-harmonics table control-mesh interpolating-spline hierarchical kernel wavelet separable'.split()) <= {r['method'] for r in d['rows']} and not d['failed']"
check "pictures are compared with the most accurate row's" json "min(d['rows'], key=lambda r: r['held_out']['rms_log'])['image_error']==0 and all(0 <= r['image_error'] < 442 for r in d['rows'])"
check "mba has 8 levels in 5 coordinates, each in its better domain" json "sum(r['method']=='mba' for r in d['rows'])==40"
check "each of them in every coordinates" json "all(sum(r['method']=='mba' and r['options'].split()[0]==c for r in d['rows'])==8 for c in 'nusselt half-vector reflected half-vector-narrow half-vector-wide'.split())"
check "the most accurate row is on the front" json "any(r['pareto'] for r in d['rows'] if r['held_out']['rms_log']==min(q['held_out']['rms_log'] for q in d['rows']))"
check "a least-squares fit beats every multilevel one" json "min(r['held_out']['median_rel'] for r in d['rows'] if r['method'] in ('lsq','auto')) < min(r['held_out']['median_rel'] for r in d['rows'] if r['method']=='mba')"
check "the table has a line a row" python3 -c "
import csv,json
rows=list(csv.DictReader(open('$work/t/tradeoff.csv'))); want=json.load(open('$work/out'))['rows']
assert [r['method'] for r in rows]==[r['method'] for r in want] and all(None not in r and None not in r.values() for r in rows)"
for plot in error_bytes error_ns error_seconds; do
    check "$plot is a PNG" python3 -c "assert open('$work/t/$plot.png','rb').read(8)==b'\x89PNG\r\n\x1a\n'"
done
exits "both domains, against the truth" 0 "$GONIO" tradeoff "$work/s.csv" -o "$work/t" --methods mba,kernel --all-forms --truth spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.3 --json
check "every form, and the truth's pictures" json "len(d['rows'])==81 and d['image_reference']=='the truth' and min(r['image_error'] for r in d['rows']) > 0"
exits "a budget" 0 "$GONIO" tradeoff "$work/s.csv" -o "$work/t" --budget 0.001 --json
check "leaves forms out and says so" json "d['not_reached'] > 50"
exits "an impossible budget" 2 "$GONIO" tradeoff "$work/s.csv" -o "$work/t" --budget -1
exits "four dimensions" 0 "$GONIO" convert spec:ward:rho_d=0.3,rho_s=0.2,alpha_x=0.2,alpha_y=0.4 "$work/a.csv" --plan nusselt:60,anisotropic=1,theta_max=75
exits "of several families" 0 "$GONIO" tradeoff "$work/a.csv" -o "$work/t" --methods kernel,hierarchical,homomorphic,ggx --json
check "rows of four dimensions" json "not d['failed'] and len(d['rows']) == 5"
exits "nowhere to write" 2 "$GONIO" tradeoff "$work/s.csv"
exits "an impossible folder" 1 "$GONIO" tradeoff "$work/s.csv" -o "$work/s.csv/no"

exits "the default method" 0 "$GONIO" fit "$work/s.csv" -o "$work/m" --json
check "is auto and tells its choice" json "d['method']=='auto' and 'base=' in d['options'] and 'next better' in d['note'] and 'next cheaper' in d['note']"
printf 'theta_i,phi_i,theta_o,phi_o\n30,0,40,180\n30,0,89,10\n' >"$work/d.csv"
exits "its sigma" 0 "$GONIO" eval "$work/m" "$work/d.csv" --sigma --json
cp "$work/m" "$work/m1"
exits "on one thread" 0 "$GONIO" fit "$work/s.csv" -o "$work/m" --threads 1
check "the same file" cmp "$work/m" "$work/m1"
finish
