#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# What a scene needs, from its file to a plan, a fit and the pictures' error; and what is wrong with each.
set -u
. "$(dirname "$0")/lib.sh"
cd "$work" || exit 1
printf 'v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n' >square.obj
cat >room.ini <<'INI'
[image]
width = 24
height = 16
samples = 4
[camera front]
eye = 1/-2/2
[camera side]
eye = 2/0/2
[material lid]
model = ward:rho_d=0.3,rho_s=0.1,alpha=0.2
[mesh plate]
file = square.obj
[light lamp]
toward = 1/0/1
intensity = 3
[light fill]
toward = -1/1/1
intensity = 0.5
INI
truth=spec:ward:rho_d=0.3,rho_s=0.1,alpha=0.2
exits "needs, with a picture" 0 "$GONIO" scene needs room.ini -o room.needs --picture room.svg
grep -q 'half-vector .*level 6: .* no scene reaches' out; ok $? "tells what is asked and what no scene reaches"
grep -q '<svg' room.svg; ok $? "the picture is an SVG"
exits "of every camera, light and a turn" 0 "$GONIO" scene needs room.ini -o all.needs --camera all --light all --orbit 2 --json --threads 1
grep -q '"frames": *8.*"unreachable": *[1-9]' out; ok $? "eight frames; what is unreachable stands apart"
exits "the same by three threads" 0 "$GONIO" scene needs room.ini -o all3.needs --camera all --light all --orbit 2 --threads 3
cmp -s all.needs all3.needs; ok $? "the same bytes"
exits "no such camera" 3 "$GONIO" scene needs room.ini -o x.needs --camera top
exits "no such light" 3 "$GONIO" scene needs room.ini -o x.needs --light moon
exits "no such scene" 3 "$GONIO" scene needs none.ini -o x.needs
exits "no such action" 2 "$GONIO" scene wants room.ini -o x.needs
exits "nowhere to put them" 2 "$GONIO" scene needs room.ini
exits "onto the scene's mesh" 2 "$GONIO" scene needs room.ini -o square.obj
[ ! -e x.needs ]; ok $? "no failure wrote anything"

# ---- plans ----
exits "a plan of 12 poses" 0 "$GONIO" plan scene:room.needs,N=12 -o p.csv
[ "$(grep -c '^[0-9]' p.csv)" -eq 12 ]; ok $? "has 12 poses"
exits "within a budget" 0 "$GONIO" plan scene:room.needs,N=60 --budget 7min -o b.csv --json
python3 -c 'import json; p = json.load(open("out")); assert 1 < p["poses"] and 360 < p["total_s"] <= 420 and p["pictures"]["after"] < p["pictures"]["before"]' 2>err
ok $? "fills it and says what it is worth"
exits "a budget of a plan by rule" 0 "$GONIO" plan nusselt:500 --budget 8min -o b.csv
exits "a budget too short" 2 "$GONIO" plan nusselt:500 --budget 1s
exits "a budget that is no time" 2 "$GONIO" plan nusselt:500 --budget soon
exits "a plan of a missing file" 3 "$GONIO" plan scene:none.needs
exits "a plan of what is no file of needs" 3 "$GONIO" plan scene:room.ini
exits "a measure for the scene" 0 "$GONIO" measure --plan scene:room.needs,N=8 --sample ward:rho_d=0.3,rho_s=0.1,alpha=0.2 --method mba --level 2 s.session
exits "... replays" 0 "$GONIO" replay s.session

# ---- pictures' errors ----
exits "the truth in its scene" 0 "$GONIO" compare $truth room.ini --json
grep -q '"mae": *0.0,' out; ok $? "is not off"
exits "another model, other cameras" 0 "$GONIO" compare spec:lambert:rho=0.3 all.needs --truth $truth --turn 5 --json
python3 -c 'import json; c = json.load(open("out")); assert c["frames"] == 8 and c["turn_deg"] == 5 and c["mae"] > 1 and c["material"] == "lid"' 2>err
ok $? "is off, and by how much"
exits "a material that is not there" 2 "$GONIO" compare $truth room.ini --material tin
says "a material that is not there: lists them" "it has lid"
exits "an option of scenes" 2 "$GONIO" compare $truth p.csv --turn 5

# ---- fits ----
"$GONIO" plan nusselt:40 -o n.csv >out 2>&1 && "$GONIO" eval $truth n.csv >s.csv
exits "the smallest model for the pictures" 0 "$GONIO" fit s.csv -o m.gonio --scene room.needs --image-error 1.5 --truth $truth --json
python3 -c '
import json
s = json.load(open("out"))["scene"]
last = [k for k in s["steps"] if k["chosen"]][0]
assert last["met"] and s["image"]["mae"] <= 1.5 and s["turned"]["mae"] > 0 and s["compared"] >= len(s["steps"]), s' 2>err
ok $? "meets the limit, and shows its steps"
exits "it is as good when it is compared" 0 "$GONIO" compare m.gonio room.needs --truth $truth --json
python3 -c 'import json; assert json.load(open("out"))["mae"] <= 1.5' 2>err; ok $? "by a verb of its own"
exits "bricks of a level" 0 "$GONIO" fit s.csv -o b.gonio --scene room.needs --psnr 40 --method cbmba --level 5 --storage float --coordinates half-vector
grep -q 'a lattice of this level has' out; ok $? "are held against the lattice"
"$GONIO" fit s.csv -o b1.gonio --scene room.needs --psnr 40 --method cbmba --level 5 --storage float --coordinates half-vector --threads 1 >out 2>err
cmp -s b.gonio b1.gonio; ok $? "the same bytes by one thread"
printf 'theta_i,phi_i,theta_o,phi_o\n45,0,40,170\n' | "$GONIO" eval b.gonio - --sigma >out 2>err && grep -q 'sigma' out; ok $? "with a sigma"
exits "a limit that these samples do not reach" 1 "$GONIO" fit s.csv --scene room.needs --image-error 0.001 --truth spec:lambert:rho=0.9
says "a limit that these samples do not reach: says so" "the best fit of these samples"
exits "no limit" 2 "$GONIO" fit s.csv --scene room.needs
exits "two limits" 2 "$GONIO" fit s.csv --scene room.needs --image-error 1 --psnr 40
exits "a limit without a scene" 2 "$GONIO" fit s.csv --image-error 1
exits "neither bytes nor ns" 2 "$GONIO" fit s.csv --scene room.needs --image-error 1 --least cost
exits "a material that the scene lacks" 2 "$GONIO" fit s.csv --scene room.needs --image-error 1 --material tin
exits "needs that are not there" 3 "$GONIO" fit s.csv --scene none.needs --image-error 1
exits "onto the scene" 2 "$GONIO" fit s.csv -o room.ini --scene room.needs --image-error 1
sed '/^lid/{s/,/,9/;}' room.needs >bad.needs
exits "needs that were changed" 3 "$GONIO" fit s.csv --scene bad.needs --image-error 1
says "needs that were changed: says so" "its checksum is"
sed 's/intensity = 3/intensity = 4/' room.ini >other.ini && cp other.ini room.ini
exits "a scene that changed since" 3 "$GONIO" fit s.csv --scene room.needs --image-error 1
says "a scene that changed since: says so" "it has changed since"
finish
