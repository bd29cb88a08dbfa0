#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# fit, eval, compare, convert as users call them: what they print, and that their figures are true.
. tests/system/lib.sh

json() { python3 -c "import json,sys; d=json.load(open('$work/out')); sys.exit(0 if ($1) else 1)"; }

# ---- eval of an exact BRDF: Lambert is rho/pi everywhere ----
printf 'theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n10.50,0,20,180\n89.9,-360,90,360\n' >"$work/d.csv"
exits "eval of a spec" 0 "$GONIO" eval spec:lambert:rho=0.5/0.25/1 "$work/d.csv"
printf 'theta_i,phi_i,theta_o,phi_o,r,g,b\n' >"$work/want"
for row in 0,0,0,0 10.50,0,20,180 89.9,-360,90,360; do
    echo "$row,0.15915494309189535,0.07957747154594767,0.3183098861837907" >>"$work/want"
done
check "the rows are echoed as they were, then the channels" cmp "$work/out" "$work/want"
"$GONIO" eval spec:lambert:rho=0.5/0.25/1 <"$work/d.csv" >"$work/stdin"
check "directions from standard input" cmp "$work/stdin" "$work/want"
"$GONIO" eval spec:lambert:rho=0.5/0.25/1 "$work/d.csv" -o "$work/file"
check "-o writes a file" cmp "$work/file" "$work/want"
"$GONIO" eval spec:lambert:rho=0.5/0.25/1 "$work/d.csv" -o /dev/stdout | cat >"$work/piped"
check "-o /dev/stdout writes into the pipe" cmp "$work/piped" "$work/want"
for to in /dev/stdout /dev/fd/1 /proc/self/fd/1; do
    echo before >"$work/appended"
    "$GONIO" eval spec:lambert:rho=0.5/0.25/1 "$work/d.csv" -o $to >>"$work/appended"
    { echo before; cat "$work/want"; } | cmp - "$work/appended" >/dev/null
    ok $? "-o $to writes after what is there"
    "$GONIO" eval spec:lambert:rho=0.5/0.25/1 "$work/d.csv" -o $to >"$work/piped"
    check "or into the file, which keeps being it" cmp "$work/piped" "$work/want"
done
check "and /dev/stdout stays what it is" [ -L /dev/stdout ]
exits "eval --json" 0 "$GONIO" eval spec:lambert:rho=0.5 "$work/d.csv" --json
check "its rows" json "len(d['rows'])==3 and abs(d['rows'][1]['values'][0]-0.15915494309189535)<1e-15 and d['rows'][1]['theta_i']==10.5"
exits "an exact BRDF has no sigma" 1 "$GONIO" eval spec:lambert:rho=0.5 "$work/d.csv" --sigma
exits "nor support" 1 "$GONIO" eval spec:lambert:rho=0.5 "$work/d.csv" --support

# ---- one incidence in one plane: the model says where it knows nothing ----
{
    echo theta_i,phi_i,theta_o,phi_o
    for theta in $(seq 0 5 80); do echo "40,0,$theta,0" && echo "40,0,$theta,180"; done
} >"$work/plane.csv"
printf 'theta_i,phi_i,theta_o,phi_o\n40,0,30,180\n70,0,40,90\n' >"$work/two.csv"
"$GONIO" eval spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.2 "$work/plane.csv" -o "$work/p.csv"
exits "a fit of one plane" 0 "$GONIO" fit "$work/p.csv" -o "$work/p.gonio" --hold-out 0 --json
check "says how little that is" json "'the samples say little' in d['note']"
exits "eval --support" 0 "$GONIO" eval "$work/p.gonio" "$work/two.csv" --sigma --support --json
check "is high beside a sample, low in another plane" json "d['rows'][0]['support']>0.9 and d['rows'][1]['support']<0.3"
check "and the truth within two sigma there" json "abs(d['rows'][1]['values'][0]-0.095493)<2*d['rows'][1]['sigma'][0]"
"$GONIO" eval "$work/p.gonio" "$work/two.csv" --support >"$work/out"
check "as a column too" grep -q '^theta_i,phi_i,theta_o,phi_o,value,support$' "$work/out"

# ---- a simulated set: fit it, compare with itself and with the truth ----
truth='ward:rho_d=0.3,rho_s=0.05,alpha=0.4'
exits "sampling a spec" 0 "$GONIO" convert "spec:$truth" "$work/s.csv" --plan nusselt:1500,theta_max=75
exits "the truth against its own samples" 0 "$GONIO" compare "spec:$truth" "$work/s.csv" --json
check "has no error" json "d['errors']['max_abs']==0 and d['samples']==1500 and d['channels']==1 and d['errors']['rms_log']==0"
exits "fit" 0 "$GONIO" fit "$work/s.csv" -o "$work/m" --method mba --level 5 --json
check "its JSON has every key" json "all(k in d for k in 'method level coordinates domain samples channels control_points bytes fit_seconds train held_out'.split()) and all(k in d[e] for e in ('train','held_out') for k in 'rmse max_abs max_rel median_rel rms_log rmse_70 samples'.split())"
check "its counts" json "d['samples']==1500 and d['channels']==1 and d['level']==5 and d['held_out']['samples']==300 and d['train']['samples']==1500"
cp "$work/out" "$work/fit.json"
exits "compare the model with its samples" 0 "$GONIO" compare "$work/m" "$work/s.csv" --json
check "gives the training error that fit printed" python3 -c "
import json
a=json.load(open('$work/fit.json'))['train']; b=json.load(open('$work/out'))['errors']
assert all(abs(a[k]-b[k])<=1e-12*abs(a[k]) for k in a), (a,b)"
"$GONIO" convert "spec:$truth" "$work/new.csv" --plan nusselt:3000,theta_max=70 --seed 9
exits "compare at directions that it never saw" 0 "$GONIO" compare "$work/m" "$work/new.csv" --json
check "is close to the truth" json "d['errors']['median_rel']<0.05"
exits "fit for people" 0 "$GONIO" fit "$work/s.csv" -o "$work/m2" --method mba --level 5
check "prints training and held-out errors" grep -q '^held out.*rmse' "$work/out"
check "the same seed gives the same bytes" cmp "$work/m" "$work/m2"
"$GONIO" fit "$work/s.csv" -o "$work/m3" --method mba --level 5 --threads 1 >/dev/null
check "so does another number of threads" cmp "$work/m" "$work/m3"
exits "folds" 0 "$GONIO" fit "$work/s.csv" --method mba --level 3 --folds 4 --json
check "hold every sample out once" json "d['held_out']['samples']==1500"
exits "no hold-out" 0 "$GONIO" fit "$work/s.csv" --method mba --level 3 --hold-out 0 --json
check "gives null figures" json "d['held_out']['samples']==0 and d['held_out']['rmse'] is None"
# Levels finer than the grid that samples are sorted by once wrote outside their sums.
exits "level 7" 0 "$GONIO" fit "$work/s.csv" --method mba --thesis --level 7 --json
check "interpolates the training samples" json "d['train']['max_rel']<1e-3"
exits "level 8" 0 "$GONIO" fit "$work/s.csv" --method mba --thesis --level 8 --hold-out 0 --json
check "no worse" json "d['train']['max_rel']<1e-3"
exits "a tolerance" 0 "$GONIO" fit "$work/s.csv" --method mba --tolerance 0.05 --json
check "is met on held-out samples, and says so" json "d['held_out']['rmse']<=0.05 and 'held-out RMSE' in d['note']"
exits "a tolerance without a hold-out" 0 "$GONIO" fit "$work/s.csv" --method mba --tolerance 0.01 --hold-out 0 --json
check "is met on the training samples, and says so" json "d['train']['rmse']<=0.01 and 'training RMSE' in d['note']"
exits "a limit on memory" 1 "$GONIO" fit "$work/s.csv" --method mba --level 9 --max-memory 100M
says "tells the need, the limit and what would fit" "there are 0.1 GB, enough for level 7"

# ---- tables ----
exits "the formats" 0 "$GONIO" formats
check "with what they are" grep -q '^merl .*samples, model .*from a model .*\.binary' "$work/out"
exits "the formats as JSON" 0 "$GONIO" formats --json
check "with their options" python3 -c "
import json
for f in json.load(open('$work/out'))['formats']: assert (f['reads'] or f['writes_table']) and f['extensions'][0]=='.' and all(o['help'] for o in f['options']), f"
exits "a MERL table from a spec" 0 "$GONIO" convert spec:ggx:rho_d=0.2/0.3/0.4,rho_s=0.3,alpha=0.3 "$work/t.binary"
check "has the format's size" [ "$(wc -c <"$work/t.binary")" -eq 34992012 ]
exits "the spec against the table's samples" 0 "$GONIO" compare spec:ggx:rho_d=0.2/0.3/0.4,rho_s=0.3,alpha=0.3 "$work/t.binary" --limit 20000 --json
check "agrees to rounding" json "d['errors']['max_rel']<1e-7 and d['samples']>12000"
exits "the table as a spec" 0 "$GONIO" eval "spec:file:$work/t.binary" "$work/d.csv"

exits "the table as MODEL" 0 "$GONIO" compare "$work/t.binary" "$work/t.binary" --limit 2000 --json
check "holds its own samples" json "d['errors']['max_rel']<1e-6"

# ---- as a model file ----
exits "a spec as a model file" 0 "$GONIO" convert "spec:$truth" "$work/truth.gonio"
exits "is the same BRDF" 0 "$GONIO" compare "$work/truth.gonio" "$work/s.csv" --json
check "exactly" json "d['errors']['max_abs']==0"

# ---- real data ----
if [ -r "$GONIO_DATA/cornell/garnet_red.brdf" ]; then
    exits "the thesis' fit of garnet_red" 0 "$GONIO" fit "$GONIO_DATA/cornell/garnet_red.brdf" --thesis --level 3 --json
    check "takes all of it" json "d['samples']==1439 and d['channels']==31 and d['coordinates']=='nusselt' and d['domain']=='linear'"
    exits "one wavelength" 0 "$GONIO" fit "$GONIO_DATA/cornell/garnet_red.brdf" --wavelength 550 --method mba --level 3 --json
    check "is one channel" json "d['channels']==1"
    # Two grazing neighbours share a level 6 cell: 7 to 9 % of the standard deviation stays; level 7 parts them.
    "$GONIO" convert "$GONIO_DATA/cornell/garnet_red.brdf" "$work/550.csv" --wavelength 550
    for level in 6 7; do
        "$GONIO" fit "$work/550.csv" --thesis --level $level --json >"$work/thesis$level"
    done
    check "the thesis' training error at 550 nm" python3 -c "
import csv, json, statistics
deviation = statistics.pstdev(float(r[4]) for r in list(csv.reader(open('$work/550.csv')))[1:])
a, b = (json.load(open('$work/thesis%d' % k))['train']['rmse'] / deviation for k in (6, 7))
assert 0.07 <= a <= 0.09 and b < 1e-3, (a, b)"
    exits "one NIST element" 0 "$GONIO" convert "$GONIO_DATA/nist_ptfe/PTFE.data.csv" "$work/n.csv" --wavelength 633 --mueller f_r33
    check "becomes a samples file" grep -q '^theta_i,phi_i,theta_o,phi_o,633nm$' "$work/n.csv"
    exits "a wavelength between the bands takes the nearest" 0 "$GONIO" convert "$GONIO_DATA/cornell/garnet_red.brdf" \
        "$work/555.csv" --wavelength 555
    check "and says so" grep -q '555nm: 550nm, the nearest' "$work/err"
    exits "one beyond them" 3 "$GONIO" convert "$GONIO_DATA/cornell/garnet_red.brdf" "$work/w.csv" --wavelength 2000
else
    skip "real data" "no $GONIO_DATA/cornell"
fi

# ---- Ctrl-C ----
"$GONIO" convert "spec:$truth" "$work/big.csv" --plan nusselt:60000
"$GONIO" fit "$work/big.csv" -o "$work/stopped" --method mba --level 6 --folds 500 >/dev/null 2>"$work/err" &
child=$!
# Not before it listens: whom a shell starts in the background ignores it until then.
listens() { [ $((0x0$(awk '/^SigCgt/ { print $2 }' /proc/$child/status 2>/dev/null) & 2)) -ne 0 ]; }
for wait in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20; do listens || sleep 0.5; done
sleep 1
if kill -INT $child 2>/dev/null; then
    wait $child
    got=$?
    if [ $got -eq 4 ]; then pass "Ctrl-C ends a fit with status 4"; else fail "Ctrl-C ends a fit with status 4" "status $got"; fi
    check "and without a model" [ ! -e "$work/stopped" ]
else
    skip "Ctrl-C" "the fit was done within a second"
fi
finish
