#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# `gonio kinds` lists every kind and formula; docs/kinds.md is its page; a formula's parameters as listed make a SPEC.
. tests/system/lib.sh
exits "kinds lists them" 0 "$GONIO" kinds
cp "$work/out" "$work/page"
check "docs/kinds.md is that page (build/gonio kinds > docs/kinds.md)" diff "$work/page" docs/kinds.md
exits "as JSON" 0 "$GONIO" kinds --json
python3 - "$work/out" >"$work/specs" <<'PY'
import json, sys
page = json.load(open(sys.argv[1]))
assert len(page["kinds"]) >= 4 and len(page["formulae"]) >= 6
assert all(k["name"] and k["summary"] and k["save"] for k in page["kinds"])
formats = open("docs/formats.md").read()
for k in page["kinds"]:
    assert f"### Section of kind `{k['name']}`" in formats, f"docs/formats.md does not say what a section of kind {k['name']} holds"
for f in page["formulae"]:
    keys = [f"{p['name']}={min(max(0.3, p['minimum']), p['maximum'])}" for p in f["parameters"] if p["initial"] is None]
    print(f"spec:{f['name']}:{','.join(keys)}")
PY
ok $? "every kind and formula says what it is, docs/formats.md what the kind's section holds"
printf 'theta_i,phi_i,theta_o,phi_o\n30,0,30,180\n' >"$work/directions.csv"
while read -r spec; do
    check "$spec" "$GONIO" eval "$spec" "$work/directions.csv"
done <"$work/specs"
finish
