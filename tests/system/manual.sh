#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Every verb and every option that --help prints is in the manual pages and in the completion.
set -u
. "$(dirname "$0")/lib.sh"
manual=$GONIO_BUILD/manual
plain() { sed -E 's/\\f[BIR]//g; s/\\-/-/g; s/\\&//g' "$1"; }
options=0 missing=
# has HELP PAGE LINE_OF_COMPLETION NAME
has() {
    plain "$2" >"$work/page"
    for option in $(grep -oE '^  --[a-z0-9-]+' "$1" | tr -d ' '); do
        options=$((options + 1))
        grep -qE -- "^$option( |\$|,)" "$work/page" || missing="$missing page:$4$option"
        echo "$3" | grep -qE -- "[\" ]$option[\" ]" || missing="$missing completion:$4$option"
    done
}
verbs=$("$GONIO" --help | sed -nE 's/^  ([a-z-]+) .*/\1/p')
for verb in $verbs; do
    plain "$manual/gonio.1" | grep -q "gonio-$verb (1)" || missing="$missing gonio.1:$verb"
    grep '"1 "' "$manual/gonio.bash" | grep -qE "[\" ]$verb " || missing="$missing completion:$verb"
    "$GONIO" "$verb" --help >"$work/help"
    kinds=$(sed -nE 's/^  ([a-z-]+) .*/\1/p' "$work/help" | grep -v '^-')
    for kind in $kinds; do
        "$GONIO" "$verb" "$kind" --help >"$work/kind"
        # The page tells the kinds apart: the part of this one.
        awk -v title=".SS gonio $verb $kind" '/^\.S[SH] / { here = $0 == title } here' "$manual/gonio-$verb.1" >"$work/part"
        has "$work/kind" "$work/part" "$(grep "\" $verb $kind\"" "$manual/gonio.bash")" "$verb $kind"
    done
    [ -n "$kinds" ] || has "$work/help" "$manual/gonio-$verb.1" "$(grep "\" $verb \"" "$manual/gonio.bash")" "$verb"
done
[ "$options" -gt 100 ] && [ -z "$missing" ]
ok $? "$options options of $(echo "$verbs" | wc -l) verbs:$missing"

# The completion, as bash runs it.
complete() { bash -c '. "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _gonio; echo "${COMPREPLY[*]}"' - "$manual/gonio.bash" "$@"; }
[ "$(complete gonio rep)" = replay ] && [ "$(complete gonio fit --coord)" = --coordinates ] &&
    [ "$(complete gonio calibrate cam)" = camera ] && [ "$(complete gonio calibrate camera --squ)" = --square-mm ] &&
    [ "$(complete gonio rig iden)" = identify ] && [ -z "$(complete gonio fit sam)" ]
ok $? "completes verbs, kinds, actions and options, and leaves files to bash"
# Whatever is in the lists of methods and formats.
uncompleted=
for method in $("$GONIO" fit --help | sed -nE 's/^  --method NAME +(.*):.*/\1/p' | sed 's/ or /, /; s/,//g'); do
    complete gonio fit --method "$method" | tr ' ' '\n' | grep -qxF -- "$method" && complete gonio measure --method '' | grep -qwF -- "$method" || uncompleted="$uncompleted $method"
done
for format in $("$GONIO" formats | awk '/^[a-z].* from / { print $1 } /^ *--to / { sub(":", "", $2); print $2 }'); do
    [ "$(complete gonio convert in out --to "$format")" = "$format" ] || uncompleted="$uncompleted $format"
done
[ -n "$format" ] && [ -z "$uncompleted" ] && [ "$(complete gonio fit --coordinates half-vector-n)" = half-vector-narrow ] &&
    [ "$(complete gonio check in --negatives k)" = keep ] && [ -z "$(complete gonio fit --coordinates sam)" ]
ok $? "completes what options may be, as the lists of methods and formats have it:$uncompleted"

for tool in "mandoc -T lint -W warning" "man --warnings -E UTF-8 -l"; do
    if ! command -v "${tool%% *}" >/dev/null; then
        skip "${tool%% *} has no complaint" "not installed"
        continue
    fi
    for page in "$manual"/*.1; do $tool "$page" 2>&1 >"$work/formatted"; done >"$work/complaints"
    # mandoc tells its complaints on stdout
    case $tool in mandoc*) for page in "$manual"/*.1; do $tool "$page"; done >"$work/complaints" 2>&1 ;; esac
    [ ! -s "$work/complaints" ]
    ok $? "${tool%% *} has no complaint: $(head -n 2 "$work/complaints")"
done
finish
