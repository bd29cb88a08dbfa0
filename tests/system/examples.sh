#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Gonio as a C library, as it is installed: headers that stand alone in C and C++, one version everywhere, the README's
# program and docs/examples built by pkg-config and run.
set -u
. tests/system/lib.sh
: "${GONIO_BUILD:=build}"
root=$work/root
check "make install" make --no-print-directory install B="$GONIO_BUILD" PREFIX=/opt/gonio DESTDIR="$root"
include=$root/opt/gonio/include libraries=$root/opt/gonio/lib
flags() { PKG_CONFIG_PATH="$libraries/pkgconfig" PKG_CONFIG_SYSROOT_DIR="$root" pkg-config "$@"; }
build() { # build SOURCE PROGRAM PACKAGE
    # shellcheck disable=SC2046
    ${CC:-cc} -std=c17 -Wall -Wextra -Werror "$1" $(flags --cflags --libs "$3") -o "$2"
}
export LD_LIBRARY_PATH="$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"

# ---- headers ----
bad=
for header in "$include"/gonio/*.h; do
    printf '#include <gonio/%s>\nextern int something;\n' "$(basename "$header")" >"$work/one.c"
    ${CC:-cc} -std=c17 -Wall -Wextra -Wpedantic -Werror -fsyntax-only -I"$include" "$work/one.c" 2>>"$work/log" || bad="$bad $(basename "$header")"
    ${CXX:-c++} -std=c++17 -Wall -Wextra -Werror -fsyntax-only -I"$include" -x c++ "$work/one.c" 2>>"$work/log" || bad="$bad $(basename "$header")(C++)"
done
if [ -z "$bad" ]; then pass "every header stands alone in C and C++"; else fail "every header stands alone in C and C++" "$bad" "$(head -c 400 "$work/log")"; fi
lacking=
for header in "$include"/gonio/*.h; do
    name=$(basename "$header")
    [ "$name" = gonio.h ] || [ "$name" = export.h ] || grep -qF "\"gonio/$name\"" "$include/gonio/gonio.h" || lacking="$lacking $name"
done
if [ -z "$lacking" ]; then pass "gonio.h includes every header"; else fail "gonio.h includes every header" "$lacking"; fi

# ---- version ----
cat >"$work/version.c" <<'C'
#include <gonio/version.h>
#include <stdio.h>
int main(void) { return puts(gonio_version()) < 0; }
C
build "$work/version.c" "$work/version" gonio-eval 2>"$work/log"
version=$("$work/version")
if [ -n "$version" ] && [ "gonio $version" = "$("$GONIO" --version)" ] && [ "$version" = "$(flags --modversion gonio)" ] &&
    [ "$version" = "$(flags --modversion gonio-eval)" ]; then
    pass "one version in library, program and pkg-config"
else
    fail "one version in library, program and pkg-config" "library '$version', $("$GONIO" --version), $(flags --modversion gonio)"
fi

# ---- examples ----
check "docs/examples/measure.c builds" build docs/examples/measure.c "$work/measure" gonio
check "and measures a simulated sample" "$work/measure" "$work/session"
"$GONIO" measure --sample ward:rho_d=0.3,rho_s=0.2,alpha=0.15 --plan nusselt:40 "$work/same" >/dev/null 2>&1
"$GONIO" samples "$work/same" -o "$work/same.csv" >/dev/null 2>&1
check "its samples are those of gonio measure" cmp "$work/session/samples.csv" "$work/same.csv"
check "its model too" cmp "$work/session/model.gonio" "$work/same/model.gonio"
check "gonio replay finds them again" "$GONIO" replay "$work/session"
printf '[rig]\nlight_distance_mm = 900.5\n[sample]\nspec = lambert:rho=0.5\n[stray]\ncolour = 3\n' >"$work/rig.ini"
"$work/measure" "$work/refused" "$work/rig.ini" 2>"$work/err"
if [ $? -eq 1 ] && grep -q "rig.ini.*colour" "$work/err" && [ ! -e "$work/refused" ]; then pass "a bad rig file is refused with its key"; else
    fail "a bad rig file is refused with its key" "$(cat "$work/err")"
fi
check "docs/examples/eval.c builds against gonio-eval alone" build docs/examples/eval.c "$work/eval" gonio-eval
check "and evaluates the model" sh -c "'$work/eval' '$work/session/model.gonio' | grep -qE '^[a-z]+ [0-9.]+ /sr$'"
awk '/^```c$/ {on = 1; next} /^```$/ {on = 0} on' README.md >"$work/readme.c"
tail -n +2 docs/examples/eval.c | cmp -s - "$work/readme.c"
ok $? "the README prints docs/examples/eval.c"
finish
