#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# --json prints one valid JSON object whatever a path is made of: a byte that is not UTF-8 in every path of every verb.
set -u
. "$(dirname "$0")/lib.sh"
if ! python3 -c 'import json' 2>/dev/null; then
    skip "JSON" "no python3"
    finish
    exit
fi
cd "$work" || exit 1
odd=$(printf 'caf\351')
answers=0
# valid STATUS VERB ...: it ends with that status; what it said is looked at in the end, all at once.
valid() {
    expected=$1
    shift
    answers=$((answers + 1))
    "$GONIO" "$@" --json >out.json 2>err
    got=$?
    cp out.json "answer.$answers.$got"
    if [ $got -eq "$expected" ]; then pass "$1: a path that is not UTF-8, status $got"; else
        fail "$1: a path that is not UTF-8" "status $got, expected $expected" "$(head -c 300 err | tr -cd ' -~')"
    fi
}
sample=ward:rho_d=0.3,rho_s=0.2,alpha=0.3
valid 0 measure --sample $sample --plan nusselt:12 --method mba --level 2 "$odd"
grep -q '"session":"caf�"' out.json
ok $? "the odd byte is U+FFFD"
valid 0 status "$odd" --frame "$odd.png"
valid 1 pause "$odd"
valid 1 stop "$odd"
valid 0 resume "$odd"
valid 0 replay "$odd" --model "$odd.replayed"
valid 0 samples "$odd" -o "$odd.csv"
valid 0 doctor "$odd"
valid 0 fit "$odd.csv" -o "$odd.gonio" --method mba --level 2
valid 0 plan nusselt:12 -o "$odd.plan"
valid 0 eval "$odd.gonio" "$odd.plan" -o "$odd.out.csv"
valid 0 compare "$odd.gonio" "$odd.csv"
valid 0 check "$odd.csv"
valid 0 convert "$odd.csv" "$odd.2.csv"
valid 0 render "$odd.gonio" -o "$odd.2.png" --size 16
valid 0 rig capture --rig sim -o "$odd.pgm"
valid 0 calibrate noise --rig sim -o "$odd.maps"
# A path that is not there: every verb there is.
for verb in $("$GONIO" --help | sed -nE 's/^  ([a-z-]+) .*/\1/p'); do
    case $verb in
    measure) valid 3 measure --rig "$odd/none" "$odd.x" ;;
    merge) valid 3 merge "$odd/none" "$odd/none2" -o "$odd.merged.csv" ;;
    rig) valid 3 rig status --rig "$odd/none" ;;
    calibrate) valid 3 calibrate camera "$odd/none.png" -o x ;;
    fit | render) valid 3 $verb "$odd/none" -o x ;;
    convert) valid 3 convert "$odd/none" "$odd.2.csv" ;;
    eval | compare) valid 3 $verb "$odd/none" "$odd/none" ;;
    tradeoff) valid 3 tradeoff "$odd/none" -o x ;;
    kinds | formats | drivers) valid 2 $verb "$odd/none" ;;
    *) valid 3 "$verb" "$odd/none" ;;
    esac
done
python3 - answer.* <<'PY' >told 2>&1
import json, sys
for name in sys.argv[1:]:
    text = open(name, 'rb').read().decode('utf-8')
    assert text.endswith('\n') and text.count('\n') == 1, (name, text[:200])
    found, status = json.loads(text), int(name.split('.')[2])
    assert isinstance(found, dict) and found, (name, found)
    assert status == 0 or found['error']['status'] == status and found['error']['message'], (name, found)
PY
ok $? "each of $answers answers is one JSON object: $(tail -n 1 told | tr -cd ' -~')"
finish
