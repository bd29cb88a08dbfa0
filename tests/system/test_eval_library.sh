#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# libgonio-eval stands on libc and libm alone: a renderer's program links with nothing else and evaluates a model file.
set -u
. "$(dirname "$0")/lib.sh"
cat >"$work/renderer.c" <<'C'
#include <stdio.h>
#include "gonio/model.h"
int main(int argc, char **argv) {
    gonio_model *model;
    gonio_error error = {0};
    if (argc < 2 || gonio_model_open(argv[1], &model, &error) != GONIO_OK) {
        fprintf(stderr, "%s\n", error.message);
        return 1;
    }
    float value[1];
    gonio_model_eval_f32(model, gonio_direction(gonio_radians(30), 0), gonio_direction(gonio_radians(20), 1), value);
    printf("%.4g\n", value[0]);
    gonio_model_free(model);
    return 0;
}
C
if ${CC:-cc} -std=c17 -Iinclude "$work/renderer.c" "$GONIO_BUILD/libgonio-eval.a" -lm -o "$work/renderer" 2>"$work/log"; then
    echo "ok 1 - links with libm alone"
else
    sed 's/^/# /' "$work/log"
    echo "not ok 1 - links with libm alone"
fi
if ldd "$work/renderer" | grep -vqE 'linux-vdso|libm\.so|libc\.so|ld-linux'; then
    ldd "$work/renderer" | sed 's/^/# /'
    echo "not ok 2 - needs libc and libm only"
else
    echo "ok 2 - needs libc and libm only"
fi
# Every kind that `gonio kinds` lists, saved by the program, opened here.
printf 'theta_i,phi_i,theta_o,phi_o\n30,0,20,%.17g\n' 57.295779513082323 >"$work/direction.csv"
"$GONIO" convert spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.3 "$work/samples.csv" --plan nusselt:60 >/dev/null 2>&1
"$GONIO" kinds --json | python3 -c 'import json, sys; print(*(k["name"] for k in json.load(sys.stdin)["kinds"]), sep="\n")' >"$work/kinds"
n=2
while read -r kind; do
    n=$((n + 1))
    rm -f "$work/model.gonio"
    make_kind "$kind" >"$work/log" 2>&1 && told=$("$work/renderer" "$work/model.gonio" 2>&1)
    value=$("$GONIO" eval "$work/model.gonio" "$work/direction.csv" 2>>"$work/log" | tail -n 1 | cut -d, -f5)
    if [ -n "$value" ] && [ "$told" = "$(printf '%.4g' "$value")" ] && head -c 32 "$work/model.gonio" | grep -aq "$kind"; then
        echo "ok $n - evaluates a model of kind $kind"
    else
        sed 's/^/# /' "$work/log"
        echo "# the renderer: $told; gonio eval: $value"
        echo "not ok $n - evaluates a model of kind $kind"
    fi
done <"$work/kinds"
[ $n -gt 2 ] && echo "1..$n" || echo "not ok - gonio kinds lists nothing"
