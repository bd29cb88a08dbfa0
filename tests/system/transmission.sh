#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# A thin sheet, whose camera goes behind it: simulated, measured, scattered, fitted, evaluated: both halves close against
# the truth. What is not declared stays an error.
. tests/system/lib.sh
cd "$work" || exit 1
header=theta_i,phi_i,theta_o,phi_o
export GONIO
sheet=translucent:rho=0.2,rho_s=0.1,tau=0.3,tau_s=0.25,alpha=0.3,alpha_t=0.35
# ---- plans ----
exits "a preset with transmission" 0 "$GONIO" plan uniform:30,theta_max=60,transmission=1 -o plan.csv
check "declares it" grep -q '^# halves = reflection,transmission$' plan.csv
awk -F, '/^[0-9]/ { front += $3 < 90; behind += $3 > 90 } END { exit !(front == behind && front > 20) }' plan.csv
ok $? "as many poses behind as in front"
"$GONIO" plan plan.csv >again.csv 2>/dev/null
check "a plan file says so too" [ "$(grep -c '^[0-9]' again.csv)" = "$(grep -c '^[0-9]' plan.csv)" ]
grep -v '^#' plan.csv >undeclared.csv
exits "a plan that does not" 3 "$GONIO" plan undeclared.csv
says "says what it expected" "theta_o: expected 0 to 90 degrees"
printf '[rig]\ndriver = sim\n' >short.ini
exits "arms that do not reach behind" 1 "$GONIO" plan plan.csv --check short.ini
says "are told" "camera_theta cannot go to 120 deg"
# ---- measure ----
cat >rig.ini <<'INI'
[rig]
driver = sim
[axis camera_theta]
min_deg = -175
max_deg = 175
[camera]
width = 96
height = 80
[sample]
region_radius_mm = 3
INI
"$GONIO" plan nusselt:63,transmission=1,theta_max=75 2>/dev/null >poses.csv
echo 30,0,90.01,0 >>poses.csv # edge-on: no sample
exits "measure" 0 "$GONIO" measure --rig rig.ini --sample $sheet --plan poses.csv --method mba --level 3 s.session
exits "samples" 0 "$GONIO" samples s.session -o s.csv
check "63 samples, none edge-on" [ "$(grep -c '^[0-9]' s.csv)" = 63 ]
exits "the budget of a direction behind" 0 "$GONIO" samples s.session --budget 30,0,150,180
exits "replay" 0 "$GONIO" replay s.session
exits "against the truth" 0 "$GONIO" compare spec:$sheet s.csv --json
python3 -c 'import json,sys; e = json.load(open(sys.argv[1]))["errors"]; h = json.load(open(sys.argv[1]))["halves"]
sys.exit(not (e["median_rel"] < 2e-3 and e["rms_log"] < 5e-3 and h["reflection"]["samples"] + h["transmission"]["samples"] == 63))' out
ok $? "the samples are true to 0.2 %"
python3 - s.csv <<'PY'
import csv, math, subprocess, os, sys
rows = [r for r in csv.reader(l for l in open(sys.argv[1]) if l[0] != "#")]
names, rows = rows[0], [list(map(float, r)) for r in rows[1:]]
print("theta_i,phi_i,theta_o,phi_o", *(",".join(map(repr, r[:4])) for r in rows), sep="\n", file=open("d.csv", "w"))
truth = subprocess.run([os.environ["GONIO"], "eval", "spec:" + "translucent:rho=0.2,rho_s=0.1,tau=0.3,tau_s=0.25,alpha=0.3,alpha_t=0.35", "d.csv"], capture_output=True, text=True).stdout
true = [float(l.split(",")[4]) for l in truth.split("\n")[1:] if l]
s = names.index("sigma_value")
for half in (lambda r: r[2] < 90, lambda r: r[2] > 90):
    ratio = sorted(abs(r[4] - t) / r[s] for r, t in zip(rows, true) if half(r))
    inside = sum(x <= 2 for x in ratio) / len(ratio)
    assert len(ratio) > 25 and inside > 0.85, (len(ratio), inside, ratio[-5:])
PY
ok $? "and lie within 2 sigma of it, in either half"
# ---- fit ----
exits "fit" 0 "$GONIO" fit s.csv -o fit.gonio --method lsq --level 3 --json
python3 - out <<'PY'
import json, sys
r = json.load(open(sys.argv[1]))
halves = {h["half"]: h for h in r["halves"]}
assert set(halves) == {"reflection", "transmission"}
assert sum(h["samples"] for h in halves.values()) == r["samples"] == 63
assert all(h["held_out"]["samples"] > 3 and h["held_out"]["rms_log"] < 0.2 for h in halves.values())
PY
ok $? "each half has its held-out error"
"$GONIO" convert spec:$sheet truth.csv --plan nusselt:600,transmission=1,theta_max=75 >/dev/null 2>&1
exits "against the truth where nothing was measured" 0 "$GONIO" compare fit.gonio truth.csv --json
python3 -c 'import json,sys
sys.exit(not all(h["samples"] == 300 and h["median_rel"] < 0.02 and h["rms_log"] < 0.07
                 for h in json.load(open("out"))["halves"].values()))'
ok $? "reflected and transmitted light is known to 2 %"
exits "info" 0 "$GONIO" info fit.gonio
check "tells the halves" grep -q '^transmission  *lobe-spline' out
exits "check" 0 "$GONIO" check fit.gonio --json
python3 - out <<'PY'
import json, sys
r = json.load(open(sys.argv[1]))
first = r["albedos"][0]
assert abs(first["reflected"] - 0.29) < 0.02 and abs(first["transmitted"] - 0.51) < 0.04, first
assert all(abs(a["reflected"] + a["transmitted"] - a["albedo"]) < 1e-12 for a in r["albedos"])
assert r["half"] == "reflection" and max(a["largest"] for a in r["albedos"]) == r["energy"], r
PY
ok $? "energy is what is reflected and what is transmitted"
exits "a change" 0 "$GONIO" check fit.gonio --apply reciprocity,energy -o changed.gonio
exits "of both halves" 0 "$GONIO" check changed.gonio --json
check "which stay" grep -q '"transmitted":0\.[0-9]*[1-9]' out
# ---- tables: every half is written or told as lost; transmission alone is written where there is a place for it ----
cat >halves.py <<'PY'
import json, sys
r = json.load(open(sys.argv[1] + ".report.json"))
told = r["lost"] or ""
for half in sys.argv[2:]:
    assert (half in r["halves"]) != (half in told.split("the halves ")[-1].split(";")[0].split(", ")), (half, r["halves"], told)
b = r["read_back"]
assert b["pairs"] > 100 and b["median"] < 0.05, b
PY
agrees() { # agrees SPEC FILE OPTION...: what is read from the file is the spec's
    "$GONIO" compare "$@" --json >compared 2>compared.log && python3 -c '
import json, sys
e = json.load(open("compared"))["errors"]
assert e["samples"] > 0 and e["max_rel"] < 0.011, e'
}
for format in $("$GONIO" formats --json | python3 -c 'import json, sys
print(*[f["name"] for f in json.load(sys.stdin)["formats"] if f.get("writes_table")])'); do
    written="$written $format"
    exits "$format of a sheet" 0 "$GONIO" convert "spec:lambert:rho=0.4|lambert:rho=0.5" table --to $format --max-bytes 100k
    check "$format tells what becomes of each half" python3 halves.py table reflection transmission
    case $format in
    radiance | zemax | lighttools | ssdd | astm | mbsdf | speos)
        exits "$format of transmission alone" 0 "$GONIO" convert "spec:|lambert:rho=0.5" through --to $format --max-bytes 100k
        check "$format gives it back" agrees "spec:|lambert:rho=0.5" through
        case $format in zemax | astm | speos)
            exits "$format of a sheet's transmission" 0 "$GONIO" convert "spec:lambert:rho=0.4|lambert:rho=0.5" one --to $format --half transmission
            check "$format holds that" agrees "spec:|lambert:rho=0.5" one
            ;;
        esac
        ;;
    *)
        exits "$format of transmission alone" 1 "$GONIO" convert "spec:|lambert:rho=0.5" none --to $format
        check "$format is not written" [ ! -e none ]
        ;;
    esac
done
# Four different halves, and none in another's place.
four="spec:lambert:rho=0.4|lambert:rho=0.3|lambert:rho=0.2|lambert:rho=0.1"
for options in "lighttools" "radiance" "radiance --radiance-basis klems-quarter" "radiance --radiance-basis tree4 --max-bytes 100k"; do
    exits "$options of four halves" 0 "$GONIO" convert "$four" four.file --to $options
    case $options in radiance*) limit="--limit 2000" ;; *) limit= ;; esac
    # shellcheck disable=SC2086
    check "$options: all of them are its own" agrees "$four" four.file $limit
    check "$options: told" python3 halves.py four.file reflection transmission reflection-back transmission-back
done
# Radiance loses the colour of what stands beside a diffuse part in a tree of any half: each stays out, and one for both ways through.
coloured='spec:ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.3|lambert:rho=0.2/0.3/0.1|lambert:rho=0.1|lambert:rho=0.1/0.2/0.3'
exits "a sheet in colour" 0 "$GONIO" convert "$coloured" c.xml --max-bytes 500k
check "its floors stand in the scene's line" grep -q '\. 0 9 0.3 0.2 0.1 0.1 0.1 0.1 0.1 0.2 0.1"' c.xml.report.json
exits "written again" 0 "$GONIO" convert c.xml c2.xml
check "it has the same bytes" cmp c.xml c2.xml
exits "a half of another name" 2 "$GONIO" convert "$four" x.bsdf --to zemax --half back
check "tables are written" [ -n "$written" ]
# ---- what a model of reflection says ----
printf '%s\n30,0,150,180\n' $header >behind.csv
exits "a direction behind a model of reflection" 3 "$GONIO" eval spec:lambert:rho=0.5 behind.csv
exits "asked for" 0 "$GONIO" eval spec:lambert:rho=0.5 behind.csv --transmission
check "is dark" grep -q '^30,0,150,180,0$' out
for spec in 'ward:rho_d=0.3,rho_s=0.2,alpha=0.2' 'ward:rho_d=0.3,rho_s=0.2,alpha=0.2|lambert:rho=0.4'; do
    "$GONIO" render "spec:$spec" --size 48 -o "picture$((pictures = ${pictures:-0} + 1)).png" >/dev/null 2>&1
done
check "a picture shows the reflection alone" cmp picture1.png picture2.png
# ---- files ----
exits "a model's halves as samples" 0 "$GONIO" convert spec:$sheet all.csv --json
check "of all four" [ "$(awk -F, '/^[0-9]/ { print ($1 > 90) ($3 > 90) }' all.csv | sort -u | wc -l)" = 4 ]
exits "as a model file" 0 "$GONIO" convert spec:$sheet sheet.gonio
for model in sheet.gonio spec:$sheet; do "$GONIO" eval $model plan.csv >"is-${model%%:*}"; done 2>err
check "which says the same" cmp is-sheet.gonio is-spec
grep -v '^#' s.csv >undeclared.csv
exits "samples that do not declare it" 3 "$GONIO" fit undeclared.csv
says "are told" "theta_o: expected 0 to 90 degrees"
exits "look, when told" 0 "$GONIO" look undeclared.csv --transmission
check "says which halves" grep -q 'in reflection and transmission' out
exits "more light than there is" 2 "$GONIO" convert spec:translucent:rho=0.5,tau=0.6 no.gonio
says "says so" "expected at most 1"
finish
