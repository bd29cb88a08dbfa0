#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# gonio virtual end to end: a patch is measured, fitted and evaluated; what is refused leaves nothing behind.
set -u
. "$(dirname "$0")/lib.sh"
cd "$work" || exit 1
"$GONIO" virtual sawtooth:slope=45,rho=0.5 --plan nusselt:300,anisotropic=1 -o teeth.csv --json >teeth.json 2>err
ok $? "a sawtooth is measured"
grep -q '"poses": *300,' teeth.json && grep -q '"missed": *0,' teeth.json; ok $? "every pose within the error asked for"
"$GONIO" virtual sawtooth:slope=45,rho=0.5 --plan nusselt:300,anisotropic=1 -o again.csv --threads 1 >out 2>err && cmp teeth.csv again.csv
ok $? "the same bytes with one thread"
"$GONIO" fit teeth.csv -o teeth.gonio --method mba --hold-out 0 >out 2>err && [ -s teeth.gonio ]; ok $? "its samples are fitted"
printf '[patch]\nshape = mesh\nfile = hole.obj\n' >hole.ini
printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\n' >hole.obj
"$GONIO" virtual hole.ini -o hole.csv >out 2>err
[ $? = 3 ] && grep -q holes err && [ ! -e hole.csv ]; ok $? "a patch with a hole: exit 3, nothing written"
"$GONIO" virtual hole.ini -o hole.ini >out 2>err
[ $? = 2 ] && grep -q shape hole.ini; ok $? "a target that is the patch's file: refused, and it is still there"
"$GONIO" virtual cylinders --light 30 --plan uniform:80 -o wide.csv >out 2>err
[ $? = 1 ] && grep -q horizon err; ok $? "a lamp below the horizon: refused with the reason"
interrupts "Ctrl-C: exit 4" "$GONIO" virtual velvet --error 0.01 --max-rays 16M -o long.csv
[ ! -e long.csv ]; ok $? "nothing is written"
# The whole chain on a microgeometry: frames, radiance and samples give what the rays give.
printf 'theta_i,phi_i,theta_o,phi_o\n40,0,20,180\n30,90,50,200\n' >pair.csv
"$GONIO" virtual sawtooth:slope=40,rho=0.5 --interreflection --plan pair.csv --error 0.3 -o rays.csv >out 2>err &&
    "$GONIO" measure --sample patch:sawtooth:slope=40,rho=0.5 --plan pair.csv --method mba --level 1 --hold-out 0 chain >out 2>err &&
    "$GONIO" samples chain -o chain.csv >out 2>err
ok $? "the simulated rig measures a patch"
# In the rig's own order; by theta_i.
for f in rays chain; do grep -v '^[#t]' $f.csv | sort -t, -k1n >$f.rows; done
paste -d, rays.rows chain.rows | awk -F, '{ n++; d = $5 / $11 - 1; if (d * d > 0.0009) bad++ } END { exit !(n == 2 && !bad) }'
ok $? "within 3 % of the rays"
finish
