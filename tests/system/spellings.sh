#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# One direction has many spellings: whole turns of phi, and theta on the other side of the normal. Files mean the same by
# all of them, and a rig takes the one that its axes can reach.
. tests/system/lib.sh

cd "$work" || exit 1
header=theta_i,phi_i,theta_o,phi_o
spec=ward:rho_d=0.3,rho_s=0.2,alpha=0.3
printf '%s\n30,10,40,200\n' $header >one.csv
"$GONIO" eval spec:$spec one.csv | tail -n 1 | cut -d, -f5 >one
for row in 30,370,40,200 30,10,40,-160 30,-350,40,560 -30,190,40,200 -30,-170,40,-160 30,10,-40,20 30,10,-40,380 -30,190,-40,-340 30,3610,40,3800; do
    printf '%s\n%s\n' $header "$row" >other.csv
    "$GONIO" eval spec:$spec other.csv | tail -n 1 | cut -d, -f5 >other
    check "eval $row" awk 'NR == FNR { a = $1 } NR != FNR { exit !(($1 - a) ^ 2 < 1e-24 * a ^ 2) }' one other
    printf '%s,r\n%s,0.5\n' $header "$row" >s.csv
    exits "samples $row" 0 "$GONIO" convert s.csv t.csv
    check "samples $row: within the ranges" awk -F, 'NR == 2 { exit !($1 >= 0 && $3 >= 0 && $2 ^ 2 <= 360 ^ 2 && $4 ^ 2 <= 360 ^ 2) }' t.csv
done
for row in 91,0,0,0 -91,0,0,0 0,0,90.1,0 0,40000,0,0; do
    printf '%s\n%s\n' $header "$row" >other.csv
    exits "no direction: $row" 3 "$GONIO" eval spec:$spec other.csv
done

# A rig whose azimuths go from -180 to 180, and one that has none: all in one plane.
printf '[rig]\ndriver = sim\n[axis camera_phi]\nmin_deg = -180\nmax_deg = 180\n[axis light_phi]\nmin_deg = -180\nmax_deg = 180\n' >half.ini
printf '%s\n30,0,40,180\n30,0,40,200\n30,0,40,270\n30,350,40,10\n30,-200,40,0\n' $header >plan.csv
exits "azimuths beyond the axes" 0 "$GONIO" plan plan.csv --check half.ini --sample lambert:rho=0.5
for row in 30,-10,40,10 30,0,40,-90 30,0,40,-160 30,160,40,0; do
    check "azimuths beyond the axes: $row" grep -qx -- "$row" out
done
printf '[rig]\ndriver = sim\n[axis light_phi]\nmin_deg = 0\nmax_deg = 0\n[axis camera_phi]\nmin_deg = 0\nmax_deg = 0\n[axis camera_theta]\nmin_deg = -85\nmax_deg = 85\n' >flat.ini
printf '%s\n30,0,20,180\n30,0,40,180\n30,0,40,0\n45,0,-10,0\n30,720,50,-180\n0,77,20,0\n30,0,0,123\n' $header >plan.csv
exits "a goniometer in one plane" 0 "$GONIO" plan plan.csv --check flat.ini --sample lambert:rho=0.5
exits "it measures forward scatter" 0 "$GONIO" measure --rig flat.ini --sample $spec --plan plan.csv --method mba --level 2 flat.session
"$GONIO" samples flat.session -o told.csv
grep -v '^#' told.csv >flat.csv
check "forward scatter stands at phi 180" [ "$(grep -c '^[0-9.]*,[-0-9.]*,[0-9.]*,180,' flat.csv)" = 4 ]
cut -d, -f1-4 flat.csv >where.csv
"$GONIO" eval spec:$spec where.csv | cut -d, -f5 >truth
check "the values are those of the directions" sh -c "paste -d, flat.csv truth | awk -F, 'NR > 1 && (\$5 - \$NF) ^ 2 > 25 * \$6 ^ 2 { exit 1 }'"
exits "it is replayed" 0 "$GONIO" replay flat.session
printf '%s\n30,0,40,90\n' $header >plan.csv
exits "out of its plane" 1 "$GONIO" plan plan.csv --check flat.ini --sample lambert:rho=0.5
says "out of its plane: says so" "camera_phi cannot go to 90 deg"
finish
