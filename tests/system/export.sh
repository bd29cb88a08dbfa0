#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# What `gonio convert` writes for other programs comes with a report, or not at all.
. tests/system/lib.sh
spec=spec:ggx:rho_d=0.3/0.2/0.1,rho_s=0.5,alpha=0.3,f0=0.04
for format in rgl radiance mbsdf zemax lighttools astm ssdd speos openmaterial gltf openpbr principled; do
    exits "$format" 0 "$GONIO" convert $spec "$work/a.$format" --to $format --max-bytes 60000
    check "$format: its report" python3 -c "
import json
r = json.load(open('$work/a.$format.report.json'))
assert r['format'] == '$format' and r['quantity'] and r['convention'] and r['about'] and r['source'] == '$spec'
b = r['read_back']
assert b['pairs'] > 100 and 0 <= b['median'] <= b['p95'] <= b['largest'] and b['median'] < 0.1, b"
done
exits "an error that no table keeps to" 1 "$GONIO" convert $spec "$work/b.bsdf" --to rgl --max-error 1e-12
says "it is refused" "Nothing is written"
check "and leaves nothing" [ -z "$(ls "$work" | grep '^b\.')" ]
exits "without a report" 0 "$GONIO" convert $spec "$work/c.mbsdf" --no-report
check "there is none" [ ! -e "$work/c.mbsdf.report.json" ]
exits "an option of another format" 2 "$GONIO" convert $spec "$work/c.mbsdf" --grid-step 5
exits "an option of tables for samples" 2 "$GONIO" convert $spec "$work/c.csv" --max-error 1
# Samples go by way of the default fit, which is said and stands in the report.
"$GONIO" convert $spec "$work/s.csv" --plan nusselt:60 2>"$work/err"
exits "samples by the name of a program" 0 "$GONIO" convert "$work/s.csv" "$work/s.bsdf" --to mitsuba --max-bytes 60000
says "the fit is told" "fitted to them by the default method (auto"
check "and stands in the report" python3 -c "
import json
r = json.load(open('$work/s.bsdf.report.json'))
assert r['format'] == 'rgl' and r['fitted']['samples'] == 60 and r['fitted']['held_out']['median_rel'] < 0.05 and r['read_back']['median'] < 0.05"
exits "pbrt has spectra" 0 "$GONIO" convert $spec "$work/p.bsdf" --to pbrt --max-bytes 200000
check "in its file" grep -aq wavelengths "$work/p.bsdf"
exits "but not where they are refused" 0 "$GONIO" convert $spec "$work/p.bsdf" --to pbrt --rgl-channels rgb --max-bytes 200000
check "in no file then" sh -c "! grep -aq wavelengths '$work/p.bsdf'"
exits "samples to a model file" 0 "$GONIO" convert "$work/s.csv" "$work/s.gonio"
check "which says what it was fitted to" sh -c "'$GONIO' info '$work/s.gonio' | grep -q 60"
exits "nothing to fit" 3 "$GONIO" convert /dev/null "$work/x.mbsdf"
exits "an option of files for a spec" 2 "$GONIO" convert $spec "$work/x.mbsdf" --limit 5
check "glTF is JSON within its bounds" python3 -c "
import json
m = json.load(open('$work/a.gltf'))['materials'][0]
p = m['pbrMetallicRoughness']
assert all(0 <= v <= 1 for v in p['baseColorFactor'] + [p['metallicFactor'], p['roughnessFactor']]) and m['extensions']['KHR_materials_ior']['ior'] >= 1"
# OpenPBR's inputs, their types and bounds, and a tangent that is turned for the wider axis.
for model in $spec spec:ggx:rho_s=1,alpha_x=0.1,alpha_y=0.3,f0=0.7 spec:ggx:rho_d=0.3,rho_s=1,alpha_x=0.3,alpha_y=0.1,f0=0.04 spec:lambert:rho=0; do
    exits "OpenPBR of $model" 0 "$GONIO" convert $model "$work/m.mtlx" --no-report
    check "holds to MaterialX' definition" python3 tests/peers/openpbr.py "$work/m.mtlx"
done
sed 's/"specular_roughness"/"roughness"/' "$work/m.mtlx" >"$work/misspelt.mtlx"
sed 's/name="base_metalness" type="float"/name="base_metalness" type="color3"/' "$work/m.mtlx" >"$work/mistyped.mtlx"
for bad in misspelt mistyped; do
    check "what is $bad does not" sh -c "! python3 tests/peers/openpbr.py '$work/$bad.mtlx'"
done
# Nodes at the lower edges, through an interpolating reader.
exits "MERL" 0 "$GONIO" convert spec:ggx:rho_d=0.5,rho_s=1,alpha=0.25,f0=0.04 "$work/m.binary"
check "half the values are within 1e-4" python3 -c "import json; assert json.load(open('$work/m.binary.report.json'))['read_back']['median'] < 1e-4"
check "glTF without extensions lists none" sh -c "'$GONIO' convert spec:lambert:rho=0 '$work/black.gltf' --no-report && ! grep -q extensionsUsed '$work/black.gltf'"
# Bounds of ASAM's schema are truncated: pi/2 and 2 pi themselves are refused by it, and null is what NaN becomes.
check "OpenMATERIAL keeps to its schema" python3 -c "
import json, re
m = json.load(open('$work/a.openmaterial'))
d = m['metadata']
assert all(isinstance(d[k], str) and d[k] for k in ('name', 'license', 'sources')) and d['authors'] and d['copyrights']
assert re.fullmatch('[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}', d['uuid'])
assert all(re.fullmatch('[0-9]+[.][0-9]+[.][0-9]+', d[k]) for k in ('materialVersion', 'openMaterial3dVersion'))
rows = m['brdf']['lookupTable']
most = (17.16e-3, 1.570796, 1.570796, 6.283185, 1e9)
assert rows == sorted(rows, key=lambda r: r[:4]) and len(rows) % len(m['brdf']['wavelengths']) == 0
assert all(len(r) == 5 and all(v is not None and 0 <= v <= b for v, b in zip(r, most)) and r[0] >= 1e-9 for r in rows)"
printf '{"brdf": {"wavelengths": [9.05e-7], "lookupTable": [[9.05e-7,0.5,1.570796,6.283185,0.25],[9.05e-7,0.5,0.5,3,null]]}}' >"$work/bounds.xomb"
exits "its bounds stand for pi/2 and 2 pi, null for no value" 0 "$GONIO" convert "$work/bounds.xomb" "$work/bounds.csv"
check "which are read so" grep -q '^28.6478897565411[0-9]*,0,90,0,0.25$' "$work/bounds.csv"
# A tree in colour whose smallest value is above 0.01 / pi would lose its colour in Radiance: it stands in the scene's line.
check "the floor of a tree in colour is taken out" grep -q 'gonio floor r g b' "$work/a.radiance"
check "and told in the scene's line" grep -q 'void BSDF m 6 0 FILE.xml 0 1 0 . 0 3 0\.3' "$work/a.radiance.report.json"
finish
