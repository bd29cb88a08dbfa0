#!/bin/sh
# libgonio-eval stands on libc and libm alone: a renderer's program links with nothing else and evaluates a model file.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
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
    gonio_model_eval_f32(model, gonio_direction(0.5, 0), gonio_direction(0.5, GONIO_PI), value);
    printf("%.6f\n", value[0]);
    gonio_model_free(model);
    return 0;
}
C
echo "1..3"
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
echo "theta_i,phi_i,theta_o,phi_o,r
10,0,10,180,0.25
30,0,30,90,0.25
60,0,20,0,0.25" >"$work/samples.csv"
ok=1
for method in mba cbmba; do
    "$GONIO" fit "$work/samples.csv" -o "$work/model" --method $method --hold-out 0 >/dev/null 2>"$work/log" || ok=0
    [ "$("$work/renderer" "$work/model")" = 0.250000 ] || ok=0
done
[ $ok = 1 ] && echo "ok 3 - evaluates fitted models" || echo "not ok 3 - evaluates fitted models"
