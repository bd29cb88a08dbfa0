#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The libraries share a program's one space of names with everything else that it links: all that they define begins with
# gonio_.
set -u
. tests/system/lib.sh
: "${GONIO_BUILD:=build}"
for library in libgonio libgonio-eval; do
    nm -g --defined-only "$GONIO_BUILD/$library.a" 2>/dev/null | awk 'NF == 3 {print $3}' | sort -u >"$work/names"
    # Not names of C: what C++ mangles, and the compilers' own of exceptions (DW.ref).
    grep -vE '^(gonio_|_Z|DW\.ref\.)' "$work/names" >"$work/foreign"
    if [ -s "$work/names" ] && [ ! -s "$work/foreign" ]; then pass "$library defines gonio_ alone ($(wc -l <"$work/names") names)"; else
        fail "$library defines gonio_ alone" "$(tr '\n' ' ' <"$work/foreign" | head -c 1000)"
    fi
done
finish
