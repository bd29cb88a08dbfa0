#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# One folder for colleagues, of every kind of model, one, three and many channels, or of samples; whole or not at all.
. tests/system/lib.sh
sheet='spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.3|lambert:rho=0.2'
colour=spec:ggx:rho_d=0.3/0.2/0.1,rho_s=0.5,alpha=0.3,f0=0.04
quick=astm
bundle() { # bundle NAME INPUT OPTION...
    name=$1 input=$2
    shift 2
    exits "$name" 0 "$GONIO" bundle "$input" "$work/$name" --size 32 "$@"
}
# What the README and the report name is there, and nothing of the making stays.
cat >"$work/look.py" <<'PY'
import json, os, re, sys
import xml.dom.minidom
folder = sys.argv[1]
report = json.load(open(folder + "/report.json"))
readme = open(folder + "/README.md").read()
written = [f for f in report["formats"] if f["written"]]
assert written, report
for f in report["formats"]:
    assert f["file"] in readme, f
    assert os.path.exists(folder + "/formats/" + f["file"]) == f["written"], f
    assert f["written"] or f["refused"]
for f in written:
    assert f["report"] == json.load(open(folder + "/formats/" + f["file"] + ".report.json")), f
for link in re.findall(r"\]\(([^)#:]+)\)", readme):
    assert os.path.exists(os.path.join(folder, link)), link
xml.dom.minidom.parse(folder + "/frame.svg")
for scene in os.listdir(folder + "/scenes"):
    text = open(folder + "/scenes/" + scene).read()
    for table in re.findall(r"\.\./formats/([a-z.-]+[a-z])", text):
        assert os.path.exists(folder + "/formats/" + table), (scene, table)
    if scene.endswith(".py"):
        compile(text, scene, "exec")
assert os.path.exists(folder + "/model.gonio") == report["model_file"]
rows = [l for l in open(folder + "/samples.csv") if l[0].isdigit()]
assert len(rows) == report["samples"] > 0, len(rows)
assert sys.argv[2] == "" or sys.argv[2] in readme, readme
PY
whole() { check "$1: it is whole" python3 "$work/look.py" "$work/$1" "$2"; }

# ---- every format ----
bundle every $colour --max-bytes 300k --formats rgl,mdl,zemax,lighttools,ssdd,astm,speos,gltf,openpbr,principled
whole every '| `zemax.bsdf` |'
check "scenes of the formats that are there" sh -c "ls '$work/every/scenes' | tr '\n' ' ' | grep -qx 'blender.py mitsuba.xml pbrt.pbrt three.html '"
check "pbrt's has spectra" grep -aq wavelengths "$work/every/formats/rgl-spectra.bsdf"
check "Mitsuba's has none" sh -c "! grep -aq wavelengths '$work/every/formats/rgl-rgb.bsdf'"
check "the scene is XML" python3 -c "import sys, xml.dom.minidom; xml.dom.minidom.parse(sys.argv[1])" "$work/every/scenes/mitsuba.xml"
check "nothing of the making stays" sh -c "! ls -A '$work' | grep -q '\.new$'"
check "others may read it" sh -c "[ \"\$(stat -c %a '$work/every')\" = \"\$(printf '%o' \$((0777 & ~\$(umask))))\" ]"
check "the model is the spec's" sh -c "printf 'theta_i,phi_i,theta_o,phi_o\n30,0,30,180\n' >'$work/d.csv' && [ \"\$('$GONIO' eval '$work/every/model.gonio' '$work/d.csv')\" = \"\$('$GONIO' eval $colour '$work/d.csv')\" ]"

# ---- every kind ----
"$GONIO" convert spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.3 "$work/samples.csv" --plan nusselt:60 2>"$work/err"
"$GONIO" kinds --json | python3 -c 'import json, sys; print(*(k["name"] for k in json.load(sys.stdin)["kinds"]), sep="\n")' >"$work/kinds"
while read -r kind; do
    rm -f "$work/model.gonio"
    make_kind "$kind" >"$work/log" 2>&1
    bundle "$kind" "$work/model.gonio" --formats $quick
    whole "$kind" "$kind"
done <"$work/kinds"
check "there are kinds" [ "$(wc -l <"$work/kinds")" -gt 5 ]

# ---- channels, samples, tables ----
python3 - "$work/spectral.csv" <<'PY'
import math, sys
with open(sys.argv[1], "w") as out:
    out.write("# sample = a painted panel\ntheta_i,phi_i,theta_o,phi_o," + ",".join(f"{400 + 10 * k}nm" for k in range(31)) + "\n")
    for n in range(80):
        i, o, p = 5 + 37 * n % 80, 3 + 23 * n % 80, 47 * n % 180
        out.write(f"{i},0,{o},{p}," + ",".join(f"{(1 + k / 60) * (0.1 + 0.05 * math.cos(math.radians(o))):.6f}" for k in range(31)) + "\n")
PY
"$GONIO" fit "$work/spectral.csv" -o "$work/spectral.gonio" --method mba --level 2 --hold-out 0 >"$work/log" 2>&1
bundle spectral "$work/spectral.gonio" --formats ssdd,blender
whole spectral "a painted panel"
bundle samples "$work/samples.csv" --formats $quick
whole samples 'fitted to 60 samples by the default method'
check "samples are those that were given" sh -c "grep '^[0-9]' '$work/samples.csv' >'$work/given' && grep '^[0-9]' '$work/samples/samples.csv' | cmp - '$work/given'"
bundle sheet "$sheet" --formats $quick
whole sheet halves
bundle aniso spec:ward:rho_d=0.3,rho_s=0.2,alpha_x=0.2,alpha_y=0.5 --formats mbsdf,gltf
whole aniso "Not written"
"$GONIO" convert $colour "$work/t.bsdf" --to rgl --max-bytes 60000 2>"$work/err"
bundle measured "$work/t.bsdf" --formats $quick
whole measured ""
check "a table is no model file" [ ! -e "$work/measured/model.gonio" ]

# ---- whole or not at all ----
exits "a folder that is there" 2 "$GONIO" bundle $colour "$work/every"
says "is not touched" "is there already"
exits "a format that is not written" 2 "$GONIO" bundle $colour "$work/no" --formats gltf,cornell
says "those that are written are listed" "merl, rgl"
exits "no picture" 2 "$GONIO" bundle $colour "$work/no" --size 3
exits "no such input" 3 "$GONIO" bundle "$work/none.csv" "$work/no"
exits "no such parent" 1 "$GONIO" bundle $colour "$work/none/no" --formats gltf
ulimit -f 16 # 8 kB: a file that does not fit ends the work
exits "a full disk" 1 sh -c "trap '' XFSZ; '$GONIO' bundle $colour '$work/no' --formats gltf,zemax"
check "leaves nothing" sh -c "! ls -A '$work' | grep -qE '^no$|\.new$'"
finish
