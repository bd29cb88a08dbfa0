#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The shared libraries export what the public headers declare and nothing else, need what they may need, and work
# together in one process.
set -u
. "$(dirname "$0")/lib.sh"
export LC_ALL=C
eval=$GONIO_BUILD/libgonio-eval.so.1 lib=$GONIO_BUILD/libgonio.so.1

# Functions that the headers declare: preprocessed, one statement a line, no bodies.
for header in include/gonio/*.h; do echo "#include \"${header#include/}\""; done >"$work/all.h"
${CC:-cc} -E -P -Iinclude -x c "$work/all.h" | grep -v '^#' | tr '\n' ' ' | sed 's/[;{}]/\n/g' |
    grep -vE '^ *(static|typedef|return) ' | sed -nE 's/^ *([A-Za-z_0-9]+[ *]+)+(\(\*)?(gonio_[a-z0-9_]+)\(.*/\3/p' |
    sort -u >"$work/declared"
exported() { # exported LIBRARY VERSION
    nm -D --defined-only --with-symbol-versions "$1" | awk -v version="@@$2" '$2 != "A" && index($3, version) { sub(/@.*/, "", $3); print $3 }' | sort
}
exported "$eval" GONIO_1 >"$work/eval"
exported "$lib" GONIO_1 >"$work/lib"
exported "$eval" GONIO_PRIVATE >"$work/private"
empty() { # empty NAME FILE: passes where nothing is listed
    if [ ! -s "$2" ]; then pass "$1"; else fail "$1" "$(head -c 400 "$2")"; fi
}
[ "$(wc -l <"$work/declared")" -gt 100 ] && grep -qx gonio_model_open "$work/declared" && grep -qx gonio_calib_channel_names "$work/declared"
ok $? "the headers declare functions ($(wc -l <"$work/declared"))"
sort "$work/eval" "$work/lib" | comm -13 "$work/declared" - >"$work/extra"
empty "what is exported is declared" "$work/extra"
sort "$work/eval" "$work/lib" | comm -23 "$work/declared" - >"$work/missing"
empty "what is declared is exported" "$work/missing"
comm -12 "$work/eval" "$work/lib" >"$work/twice"
empty "by one library" "$work/twice"
for so in "$eval" "$lib"; do nm -D --defined-only "$so" | awk '$2 != "A" && $3 !~ /^gonio_/'; done >"$work/foreign"
empty "every exported symbol begins with gonio_" "$work/foreign"
comm -12 "$work/private" "$work/declared" >"$work/both"
empty "nothing that is declared is private" "$work/both"
exported "$lib" GONIO_PRIVATE >"$work/lib_private"
empty "libgonio lends nothing" "$work/lib_private"

needed() { readelf -d "$1" | sed -nE 's/.*\(NEEDED\).*\[(.*)\]/\1/p'; }
needed "$eval" | grep -vE '^(libc|libm|ld-linux[-a-z0-9_]*)\.so\.[0-9]+$' >"$work/needs"
empty "libgonio-eval needs libc and libm only" "$work/needs"
needed "$lib" | grep -qx libgonio-eval.so.1
ok $? "libgonio needs libgonio-eval"
readelf -d "$eval" | grep -q 'SONAME.*\[libgonio-eval.so.1\]' && readelf -d "$lib" | grep -q 'SONAME.*\[libgonio.so.1\]'
ok $? "both have their soname"

# A program with both: what libgonio fitted and saved, libgonio-eval opens, and libgonio recognises.
cat >"$work/both.c" <<'C'
#include <gonio/fit.h>
#include <gonio/io.h>
#include <gonio/metrics.h>
#include <stdio.h>
int main(int argc, char **argv) {
    gonio_error error = {0};
    gonio_read_options read;
    gonio_fit_options options;
    gonio_read_options_default(&read);
    gonio_fit_options_default(&options);
    options.hold_out = 0;
    gonio_samples *samples;
    gonio_model *model, *opened;
    gonio_fit_report report;
    gonio_errors errors;
    if (argc < 3 || gonio_read(argv[1], &read, &samples, NULL, &error) != GONIO_OK ||
        gonio_fit(samples, &options, &model, &report, &error) != GONIO_OK ||
        gonio_model_save(model, argv[2], &error) != GONIO_OK || gonio_model_open(argv[2], &opened, &error) != GONIO_OK ||
        gonio_errors_model(opened, samples, NULL, 0, &errors, &error) != GONIO_OK) {
        fprintf(stderr, "%s\n", error.message);
        return 1;
    }
    printf("%s %s %.3f\n", model->ops->kind, model->ops == opened->ops ? "same" : "other", errors.rmse);
    gonio_model_free(opened);
    gonio_model_free(model);
    gonio_samples_free(samples);
    return 0;
}
C
printf 'theta_i,phi_i,theta_o,phi_o,r\n10,0,10,180,0.25\n30,0,30,90,0.25\n60,0,20,0,0.25\n' >"$work/samples.csv"
check "a program links with both" ${CC:-cc} -std=c17 -Wall -Wextra -Werror -Iinclude "$work/both.c" -L"$GONIO_BUILD" -lgonio -lgonio-eval -Wl,-rpath,"$PWD/$GONIO_BUILD" -o "$work/both"
"$work/both" "$work/samples.csv" "$work/model" >"$work/out" 2>&1
[ $? -eq 0 ] && grep -qE '^[a-z-]+ same 0.000$' "$work/out"
ok $? "fits, saves, opens, compares: $(head -n 1 "$work/out")"
check "the headers are C++ too" ${CXX:-c++} -std=c++17 -Iinclude -Wall -Wextra -Werror -fsyntax-only -x c++ "$work/all.h"
finish
