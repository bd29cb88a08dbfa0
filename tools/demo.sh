#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The whole chain on the simulated rig: measure, replay, fit, compare with the truth, render. `make demo` runs it.
# usage: tools/demo.sh BUILD_FOLDER     everything it makes is under BUILD_FOLDER/demo, replaced at each run
set -eu
build=$1
gonio=$build/gonio
out=$build/demo
specular=rho_s=0.2,alpha=0.15
diffuse=0.30/0.12/0.05
sample=ward:rho_d=$diffuse,$specular
plan=${GONIO_DEMO_PLAN:-nusselt:1400}

rm -rf "$out"
mkdir -p "$out"

now() { date +%s.%N; }
times=
stage() { # stage NAME COMMAND...: run it and keep its wall time
    name=$1
    shift
    printf '\n== %s\n   %s\n' "$name" "$(echo "$*" | sed "s|^$build/||")"
    start=$(now)
    "$@"
    times="$times$name $start $(now)
"
}

stage measure "$gonio" measure --rig sim --sample $sample --plan "$plan" --operator demo "$out/session"
stage replay "$gonio" replay "$out/session"
stage samples "$gonio" samples "$out/session" -o "$out/samples.csv"
stage fit "$gonio" fit "$out/session" -o "$out/model.gonio"

# The truth at directions that the measurement never saw: another seed's plan.
truth() {
    "$gonio" plan nusselt:20000,theta_max=75 --seed 2 -o "$out/directions.csv" >/dev/null
    "$gonio" eval "spec:$sample" "$out/directions.csv" -o "$out/truth.csv"
    "$gonio" eval "spec:ward:rho_d=$diffuse,rho_s=0,alpha=0.15" "$out/directions.csv" -o "$out/diffuse.csv"
    "$gonio" eval "$out/model.gonio" "$out/directions.csv" -o "$out/model.csv"
    "$gonio" compare "spec:$sample" "$out/session"
    "$gonio" compare "$out/model.gonio" "$out/truth.csv"
}
stage compare truth

# Median and 95th percentile of |model - truth| / truth over all channels, where the specular term exceeds the given
# share of the diffuse one.
percentiles() {
    paste -d, "$out/truth.csv" "$out/model.csv" "$out/diffuse.csv" | awk -F, -v share="$1" '
        NR > 1 { n = NF / 3; for (c = 5; c <= n; c++) if ($c - $(2*n+c) > share * $(2*n+c)) {
            e = ($(n+c) - $c) / $c; print e < 0 ? -e : e } }' | sort -g | awk '
        { v[NR] = $1 }
        END { if (NR == 0) print "none"; else
            printf "median %.3f %%, 95th percentile %.2f %% (%d values)", 100*v[int((NR+1)/2)], 100*v[int(NR*0.95+0.5)], NR }'
}

stage render "$gonio" render "spec:$sample" "$out/model.gonio" -o "$out/truth_and_fit.png"

printf '\n== wall time\n'
printf '%s' "$times" | awk '{ printf "   %-10s %6.1f s\n", $1, $3 - $2; total += $3 - $2 } END { printf "   %-10s %6.1f s\n", "total", total }'
printf '\n== made\n'
for file in session samples.csv model.gonio truth.csv truth_and_fit.png; do
    printf '   %-32s %s\n' "$out/$file" "$(du -sh "$out/$file" | cut -f1)"
done
printf '\n== error of the fitted model at 20,000 directions that it never saw, theta <= 75 deg\n'
printf '   all:                        %s\n' "$(percentiles -1)"
printf '   specular > 10 %% of diffuse: %s\n' "$(percentiles 0.1)"
rm -f "$out/diffuse.csv" "$out/model.csv"
