#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The README's C example as a whole program: it opens mine.gonio and prints three channels.
# usage: tests/packages/example.sh README.md >example.c
set -eu
cat <<'C'
#include <gonio/model.h>
#include <stdio.h>
int main(void) {
    const gonio_vec3 wi = gonio_direction(0.5, 0), wo = gonio_direction(0.5, GONIO_PI);
    float rgb[3] = {0};
C
sed -n '/^```c$/,/^```$/p' "$1" | grep -v '^```'
cat <<'C'
    printf("%.3f %.3f %.3f\n", rgb[0], rgb[1], rgb[2]);
    gonio_model_free(model);
    return 0;
}
C
