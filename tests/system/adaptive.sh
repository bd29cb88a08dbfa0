#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Plans that are made while they are measured, priors, and the trade of acquisition: killed and gone on with, replayed,
# wrong texts. Prints TAP.
set -u
. "$(dirname "$0")/lib.sh"

ward=ward:rho_d=0.3,rho_s=0.2,alpha=0.3
quick=camera.width=44,camera.height=44,camera.white_e_per_s=4e6,camera.exposure_max_s=0.06,camera.exposure_min_s=1e-6,sample.region_radius_mm=1
sha() { sed -n 's/.*"samples_sha256": *"\([0-9a-f]*\)".*/\1/p' "$1" | head -1; }
model_sha() { sed -n 's/.*"model_sha256": *"\([0-9a-f]*\)".*/\1/p' "$1" | head -1; }

# ---- a measure that is killed in its second batch ----
plan=adaptive:24,first=12,batch=6
"$GONIO" measure --sample $ward --set $quick --plan $plan --method mba --json "$work/whole" >"$work/whole.json" 2>/dev/null
check "an adaptive measure" [ -s "$work/whole.json" ]
check "its JSON says what more poses would buy" grep -q '"adaptive": *{.*"batches": *3.*"more"' "$work/whole.json"
# 58 frames calibrate; the second batch begins with about the 77th.
"$GONIO" measure --sample $ward --set $quick --plan $plan --method mba "$work/killed" >/dev/null 2>&1 &
pid=$!
while kill -0 $pid 2>/dev/null && [ "$(find "$work/killed/frames" -name '0*.png' 2>/dev/null | wc -l)" -lt 80 ]; do
    sleep 0.01
done
kill -KILL $pid 2>/dev/null
wait $pid 2>/dev/null
exits "killed and resumed" 0 "$GONIO" resume "$work/killed" --json
cp "$work/out" "$work/killed.json"
check "it has the same samples" [ "$(sha "$work/whole.json")" = "$(sha "$work/killed.json")" ]
check "and the same model" [ "$(model_sha "$work/whole.json")" = "$(model_sha "$work/killed.json")" ]
check "a replay is identical, its batches were chosen on these samples" tells 0 "3 of 3 were chosen" "$GONIO" replay "$work/killed"
check "doctor finds it sound" "$GONIO" doctor "$work/killed"

# ---- texts that cannot be ----
exits "an unknown option" 2 "$GONIO" measure --sample $ward --plan adaptive:50,shares=1 "$work/x"
says "its place" "character 13"
exits "too few poses" 2 "$GONIO" measure --sample $ward --plan adaptive:3 "$work/x"
exits "a sphere" 2 "$GONIO" measure --sample $ward,shape=sphere,radius_mm=20 --plan adaptive:50 "$work/x"
check "and no session is begun" [ ! -e "$work/x" ]
exits "plan shows no adaptive plan" 2 "$GONIO" plan adaptive:50

# ---- for a scene ----
printf 'v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n' >"$work/square.obj"
cat >"$work/room.ini" <<'INI'
[image]
width = 24
height = 16
samples = 4
[camera front]
eye = 1/-2/2
[material lid]
model = ward:rho_d=0.3,rho_s=0.1,alpha=0.2
[mesh plate]
file = square.obj
[light lamp]
toward = 1/0/1
intensity = 3
INI
check "what it needs" "$GONIO" scene needs "$work/room.ini" -o "$work/room.needs"
exits "an adaptive measure for it" 0 "$GONIO" measure --sample $ward --set $quick --method mba --json \
    --plan "adaptive:400,first=12,batch=8,scene=$work/room.needs,codes=30" "$work/pictured"
check "ends when the pictures are good enough" sh -c "grep -q '\"poses\": *[1-9][0-9],' '$work/out'"
check "the session keeps what it went by" cmp "$work/room.needs" "$work/pictured/scene.needs"
exits "codes without a scene" 2 "$GONIO" measure --sample $ward --plan adaptive:50,codes=1 "$work/x"
exits "a scene that is none" 3 "$GONIO" measure --sample $ward --plan "adaptive:50,scene=$work/room.ini" "$work/x"
check "and no session is begun" [ ! -e "$work/x" ]

# ---- a prior ----
"$GONIO" learn --components 4 -o "$work/prior" \
    spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.3 spec:ward:rho_d=0.1,rho_s=0.1,alpha=0.2 spec:ward:rho_d=0.5,rho_s=0.05,alpha=0.4 \
    spec:ward:rho_d=0.2,rho_s=0.3,alpha=0.25 spec:lambert:rho=0.6 spec:ward:rho_d=0.4,rho_s=0.1,alpha=0.35 >"$work/learnt" 2>&1
check "learn" grep -q "4 components" "$work/learnt"
check "a prior's plan" "$GONIO" plan "prior:$work/prior,N=8" --sample $ward -o "$work/few.csv"
check "has its poses" [ "$(grep -c '^[0-9]' "$work/few.csv")" -eq 8 ]
"$GONIO" eval spec:ward:rho_d=0.25,rho_s=0.15,alpha=0.3 "$work/few.csv" >"$work/few_samples.csv" 2>/dev/null
check "few samples are fitted with it" "$GONIO" fit "$work/few_samples.csv" -o "$work/few.gonio" --prior "$work/prior" --hold-out 0
check "the model tells sigma" sh -c "'$GONIO' eval '$work/few.gonio' '$work/few.csv' --sigma | grep -q sigma_"
"$GONIO" eval spec:phong:rho_d=0.01,rho_s=0.5,n=3 "$work/few.csv" >"$work/other.csv" 2>/dev/null
exits "a sample that is not like the library is refused" 1 "$GONIO" fit "$work/other.csv" -o "$work/no.gonio" --prior "$work/prior" --hold-out 0
says "with words" "not like the library"
exits "an adaptive measure with it" 0 "$GONIO" measure --sample ward:rho_d=0.25,rho_s=0.15,alpha=0.3 --set $quick --prior "$work/prior" \
    --plan adaptive:10,first=10 --hold-out 0 "$work/known"
check "the session keeps it" cmp "$work/prior" "$work/known/library.prior"
mv "$work/prior" "$work/moved"
check "and is replayed without the library" tells 0 "1 of 1 were chosen" "$GONIO" replay "$work/known"
mv "$work/moved" "$work/prior"
head -c 1000 "$work/prior" >"$work/cut"
exits "a prior that was cut is no prior" 3 "$GONIO" fit "$work/few_samples.csv" -o "$work/no.gonio" --prior "$work/cut"
exits "nor is one that is not there" 3 "$GONIO" fit "$work/few_samples.csv" -o "$work/no.gonio" --prior "$work/none"
exits "two models are no library" 3 "$GONIO" learn spec:lambert:rho=0.5 spec:lambert:rho=0.6 -o "$work/no"
exits "plan text" 2 "$GONIO" plan "prior:$work/prior,M=12"
says "its place too" "character"

# ---- the trade of acquisition ----
exits "tradeoff --acquire" 0 "$GONIO" tradeoff --acquire --sample $ward --set $quick --plans uniform,nusselt --poses 8 \
    -o "$work/trade" --json
check "has a row a plan" [ "$(grep -o '"rig_min"' "$work/out" | wc -l)" -eq 2 ]
for file in acquire.csv error_poses.svg error_minutes.svg; do check "it wrote $file" [ -s "$work/trade/$file" ]; done
exits "without a sample" 2 "$GONIO" tradeoff --acquire -o "$work/trade"
exits "a list that is none" 2 "$GONIO" tradeoff --acquire --sample $ward -o "$work/trade" --poses 16,,20
finish
