#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# --json prints one valid JSON object whatever a path is made of: a byte that is not UTF-8 in every path of every verb,
# and in every text of a session's journal.
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
    measure) valid 3 measure --rig "$odd/none" x ;;
    rig) valid 3 rig status --rig "$odd/none" ;;
    calibrate) valid 3 calibrate camera "$odd/none.png" -o x ;;
    merge) valid 3 merge "$odd/none" "$odd/none" -o x ;;
    scene) valid 3 scene needs "$odd/none" -o x ;;
    fit | render | virtual | learn) valid 3 $verb "$odd/none" -o x ;;
    cpm) valid 3 cpm build "$odd/none" -o x ;;
    bundle) valid 3 bundle "$odd/none" x ;;
    convert) valid 3 convert "$odd/none" "$odd.2.csv" ;;
    eval | compare) valid 3 $verb "$odd/none" "$odd/none" ;;
    tradeoff) valid 3 tradeoff "$odd/none" -o x ;;
    kinds | formats | drivers) valid 2 $verb "$odd/none" ;;
    *) valid 3 "$verb" "$odd/none" ;;
    esac
done
# In every column of texts of every table of a session of either version. What no chain proves is refused or shown; a
# repair, where the bytes are told of too, ends in some way.
if python3 -c 'import sqlite3' 2>/dev/null; then
    "$GONIO" measure --sample $sample --plan nusselt:3 --method mba --level 2 --set camera.width=24,camera.height=24,scan.dark_frames=4 \
        --set scan.reference_frames=4,scan.trap_frames=2,sample.region_radius_mm=1 small >/dev/null 2>&1
    python3 - small "$GONIO" <<'PY' >told 2>&1
import json, os, shutil, sqlite3, subprocess, sys
session, gonio = os.fsencode(sys.argv[1]), sys.argv[2]
def spoil(version, table, column):
    shutil.rmtree(b'spoiled', ignore_errors=True)
    shutil.copytree(session, b'spoiled')
    db = sqlite3.connect('spoiled/session.db')
    db.text_factory = bytes
    if version == 1:
        db.executescript('DROP TABLE chain; DROP TABLE hosts; PRAGMA user_version = 1;'
            'ALTER TABLE steps DROP COLUMN utc; ALTER TABLE frames DROP COLUMN utc;'
            'ALTER TABLE frames DROP COLUMN monotonic_s; ALTER TABLE frames DROP COLUMN bytes')
        os.remove('spoiled/session.log')
    if table is None:
        return db.execute("SELECT m.name, c.name FROM sqlite_master AS m, pragma_table_info(m.name) AS c"
            " WHERE m.type = 'table' AND c.type = 'TEXT'").fetchall()
    db.execute('PRAGMA writable_schema = ON')
    db.execute(f"UPDATE {table} SET {column} = CAST(x'61ff62c328' || substr({column}, 6) AS TEXT)"
        f" WHERE {column} = (SELECT max({column}) FROM {table})")
    db.commit()
    db.close()
tried = 0
for version in (2, 1):
    for table, column in [(t.decode(), c.decode()) for t, c in spoil(version, None, None)]:
        repair = column in ('hash', 'value', 'text', 'file') # what a repair tells of
        for verb in [['doctor'], ['info']] + [['doctor', '--repair']] * repair:
            spoil(version, table, column)
            end = subprocess.run([gonio, *verb, 'spoiled', '--json'], capture_output=True)
            text = end.stdout.decode('utf-8')
            where = (version, table, column, verb, end.returncode, text[:300], end.stderr[:300])
            assert text.endswith('\n') and text.count('\n') == 1, where
            found = json.loads(text)
            assert isinstance(found, dict) and found and end.returncode in (0, 1, 3), where
            tried += 1
assert tried > 90, tried
PY
    ok $? "a journal's texts that are not UTF-8: $(tail -n 1 told | tr -cd ' -~')"
fi
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
