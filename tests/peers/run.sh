#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# What independent programs make of the files that Gonio writes, held against the models that they were written of. Each program is looked for on PATH,
# in PEERS_DIR and PEERS_DIR/bin, npm's packages under BUILD/peers; what is absent says SKIP. Prints TAP.
# usage: tests/peers/run.sh BUILD_FOLDER [PART ...]     parts: see the end
# Expected, where it is not said otherwise: blender, node and chromium as of `make deps-peers`; testBSDF, bsdfquery, oconv, rpict and pvalue of Radiance;
# lbconv of libbsdf; pbrt; mitsuba; powitacq_eval FILE, which prints f_r cos(theta_o) of each line "theta_i phi_i theta_o phi_o" (deg) of its input, by
# the published loader; mxvalidate.py of MaterialX; material_brdf_schema.json of ASAM OpenMATERIAL 3D with Debian's python3-jsonschema.
set -u
build=$1
shift
GONIO=$PWD/$build/gonio
here=$PWD/tests/peers
NODE_PATH=$PWD/$build/peers/node_modules
PATH=${PEERS_DIR:+$PEERS_DIR:$PEERS_DIR/bin:}$PATH
RAYPATH=${RAYPATH:-.${PEERS_DIR:+:$PEERS_DIR/lib}} # Radiance's library
export NODE_PATH PATH RAYPATH
. tests/system/lib.sh

needs() { # needs PROGRAM ...: of a part; names it
    for program; do
        command -v "$program" >/dev/null || {
            skip "$part" "$program is not there"
            return 1
        }
    done
}
# values NAME MODEL SAMPLES.csv MEDIAN P95: relative errors of the sum over the channels, half and 95 % of them
values() {
    cut -d, -f1-4 "$3" >"$work/places.csv"
    "$GONIO" eval "$2" "$work/places.csv" 2>"$work/err" | paste -d, - "$3" | awk -F, 'NR > 1 {
        off = all = 0
        for (c = 5; c <= NF - 7; c++) { d = $c - $(NF - 7 + c); off += d < 0 ? -d : d; all += $c }
        print off / all }' | sort -g >"$work/errors"
    found=$(awk '{ v[NR] = $1 } END { if (NR > 0) printf "%.2g %.2g", v[int((NR + 1) / 2)], v[int(NR * 0.95) + (NR < 2)] }' "$work/errors")
    if echo "$found" | awk -v median="$4" -v p95="$5" '{ exit !(NF == 2 && $1 <= median && $2 <= p95) }'; then
        pass "$1: median and p95 $found, at most $4 $5"
    else
        fail "$1: median and p95 '$found', at most $4 $5" "$(head -c 300 "$work/err")"
    fi
}
convert() { # convert MODEL FILE OPTION...
    "$GONIO" convert "$@" >"$work/log" 2>&1 || { fail "$part: $*" "$(tail -n 3 "$work/log")"; return 1; }
}
# directions N THETA_MAX [anisotropic]: a CSV, evenly over both angles and, of a few, a third about the mirror direction
directions() {
    awk -v n="$1" -v most="$2" -v turn="${3:-}" 'BEGIN {
        print "theta_i,phi_i,theta_o,phi_o"
        for (k = 1; k <= n; k++) {
            a = (k * 0.754877666) % 1; b = (k * 0.569840291) % 1; c = (k * 0.328160000) % 1; d = (k * 0.819172513) % 1
            near = n < 100 && k % 3 == 0
            phi = turn == "" ? 0 : 360 * d
            printf "%.6f,%.6f,%.6f,%.6f\n", most * a, phi, near ? most * a : most * b, near ? phi + 180 + 20 * (c - .5) : 360 * c
        }
    }'
}

smooth=spec:ggx:rho_d=0.5/0.2/0.05,rho_s=1,alpha=0.25,f0=0.04
sharp=spec:ggx:rho_d=0.2/0.2/0.2,rho_s=1,alpha=0.05,f0=0.04
stretched=spec:ggx:rho_d=0.3/0.3/0.3,rho_s=1,alpha_x=0.15,alpha_y=0.4,f0=0.04

# ---- Blender ----
cycles() { # cycles NAME MODEL FORMAT MEDIAN P95 [anisotropic]
    convert "$2" "$work/cycles.$3" --to "$3" || return
    directions 40 60 >"$work/directions.csv"
    [ $# -lt 6 ] || directions 40 60 anisotropic >"$work/directions.csv"
    extension=py
    [ "$3" = gltf ] && extension=gltf
    mv "$work/cycles.$3" "$work/cycles.$extension" 2>/dev/null
    rm -f "$work/cycles.csv"
    timeout 200 blender -b --factory-startup -P "$here/cycles.py" -- measure "$work/cycles.$extension" "$work/directions.csv" "$work/cycles.csv" >"$work/blender.log" 2>&1
    [ -s "$work/cycles.csv" ] || { fail "$1" "$(tail -n 5 "$work/blender.log")"; return; }
    values "Cycles measures $1" "$2" "$work/cycles.csv" "$4" "$5"
}
part_cycles() {
    needs blender || return
    cycles "a diffuser" spec:lambert:rho=0.5/0.5/0.5 principled 0.02 0.05
    cycles "a metal" spec:ggx:rho_s=1/1/1,alpha=0.25,f0=0.7 principled 0.005 0.05
    cycles "a metal, stretched along x" spec:ggx:rho_s=1/1/1,alpha_x=0.4,alpha_y=0.15,f0=0.7 principled 0.005 0.05 anisotropic
    cycles "a metal, stretched along y" spec:ggx:rho_s=1/1/1,alpha_x=0.15,alpha_y=0.4,f0=0.7 principled 0.005 0.05 anisotropic
    cycles "a lacquer" "$smooth" principled 0.01 0.25
    cycles "a lacquer as glTF" "$smooth" gltf 0.06 0.25
}

# ---- npm ----
part_gltf() {
    needs node || return
    [ -d "$NODE_PATH/gltf-validator" ] || { skip "$part" "npm's gltf-validator is not there"; return; }
    set -- $smooth $stretched spec:ggx:rho_s=1,alpha=0.25,f0=0.7 spec:ggx:rho_s=1,alpha_x=0.1,alpha_y=0.3,f0=0.7 spec:lambert:rho=1 spec:lambert:rho=0
    for model; do
        convert "$model" "$work/m.gltf" && check "Khronos' validator takes the glTF of $model" node "$here/gltf.js" "$work/m.gltf"
    done
    sed 's/"roughnessFactor": [0-9.]*/"roughnessFactor": 1.2/' "$work/m.gltf" >"$work/bad.gltf"
    check "and refuses a roughness of 1.2" sh -c "! node '$here/gltf.js' '$work/bad.gltf'"
}

# A folder's page in a browser: its picture, against the same scene by Gonio.
part_three() {
    needs chromium python3 || return
    [ -d "$NODE_PATH/three" ] || { skip "$part" "npm's three is not there"; return; }
    "$GONIO" bundle $smooth "$work/folder" --size 256 --formats gltf >"$work/log" 2>&1 || { fail "$part: bundle" "$(tail -n 3 "$work/log")"; return; }
    ln -s "$NODE_PATH" "$work/folder/scenes/node_modules"
    page=$work/folder/scenes/three.html
    sed -i 's|window.rendered = true;|&document.title = renderer.domElement.toDataURL();|' "$page"
    (cd "$work/folder" && exec python3 -u -m http.server 0 --bind 127.0.0.1) >"$work/server" 2>&1 &
    pids="$pids $!"
    wait_for 20 grep -q 'port [0-9]' "$work/server"
    port=$(sed -n 's/.* port \([0-9]*\).*/\1/p' "$work/server")
    timeout 120 chromium --headless --no-sandbox --disable-gpu-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --user-data-dir="$work/chromium" \
        --virtual-time-budget=30000 --dump-dom "http://127.0.0.1:$port/scenes/three.html" >"$work/dom" 2>"$work/chromium.log"
    sed -n 's|.*<title>data:image/png;base64,\([^<]*\)</title>.*|\1|p' "$work/dom" | base64 -d >"$work/three.png"
    [ -s "$work/three.png" ] || { fail "three.js draws the page" "$(tail -n 3 "$work/chromium.log")" "$(head -c 200 "$work/dom")"; return; }
    light=$(sed -n 's/.*DirectionalLight(0xffffff, \([0-9.e+-]*\)).*/\1/p' "$page")
    python3 "$here/scene.py" "$work/scene" 256 ${smooth#spec:} lambert:rho=0
    printf '[image]\nwidth = 256\nheight = 256\nsamples = 64\n[camera c]\neye = 0/0/4\nfov = 30.615\n[material m]\nmodel = %s\n[mesh s]\nfile = scene/sphere.obj\nmove = 1/0/0\nmaterial = m\n[light l]\ntoward = -0.321394/0.556670/0.766044\nintensity = %s\n' \
        "${smooth#spec:}" "$light" >"$work/sphere.ini"
    apart "three.js' sphere" "$work/sphere.ini" "$work/three.png" 2 --ev 0
}

# ---- pictures ----
apart() { # apart NAME SCENE PICTURE MOST [OPTION...]: mean difference of 8-bit codes a channel
    name=$1 scene=$2 picture=$3 most=$4
    shift 4
    [ -z "${PICTURES:-}" ] || { mkdir -p "$PICTURES" && cp "$picture" "$PICTURES/" && set -- "$@" -o "$PICTURES/gonio.pfm"; } # for docs
    "$GONIO" render "$scene" --compare "$picture" --json "$@" >"$work/compared" 2>"$work/err"
    # The length of the difference of r, g, b over sqrt(3) is no less than the mean of the three.
    found=$(field mae "$work/compared" | awk '{ printf "%.3f", $1 / sqrt(3) }')
    if awk "BEGIN { exit !(\"$found\" != \"\" && \"$found\" + 0 <= $most) }"; then
        pass "$name: $found of 255 from Gonio's, at most $most"
    else
        fail "$name: '$found' of 255 from Gonio's, at most $most" "$(head -c 300 "$work/err")"
    fi
}
arguments() { # of the scene's line, as the report tells them
    python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["about"].split(". 0 ", 1)[1])' "$1.report.json"
}
SIZE=${SIZE:-128}
part_picture_radiance() {
    needs oconv rpict pvalue python3 || return
    python3 "$here/scene.py" "$work/scene" "$SIZE" ${smooth#spec:} ${stretched#spec:} || { fail "$part: scene"; return; }
    for basis in tree klems-full; do
        tree3=tree3 tree4=tree4 most=0.5
        [ $basis = tree ] || tree3=$basis tree4=$basis most=2
        convert $smooth "$work/a.xml" --to radiance --radiance-basis $tree3 || return
        convert $stretched "$work/b.xml" --to radiance --radiance-basis $tree4 || return
        python3 "$here/scene.py" --radiance "$work/scene" "$work/a.xml:$(arguments "$work/a.xml")" "$work/b.xml:$(arguments "$work/b.xml")"
        oconv -f "$work/scene/scene.rad" >"$work/scene.oct" 2>"$work/log" || { fail "$part: oconv" "$(head -c 300 "$work/log")"; return; }
        rpict -w -ab 1 -aa 0 -ad 256 -as 0 -av 0 0 0 -ss 16 -st 0 -lr 8 -lw 1e-6 -dj 0 -dc 1 -dt 0 -ps 1 -pj 0.9 -vtv -vp 0 0 6 -vd 0 0 -1 -vu 0 1 0 \
            -vh 38 -vv 38 -x $((4 * SIZE)) -y $((4 * SIZE)) "$work/scene.oct" 2>"$work/log" | pvalue -h -H -d >"$work/pixels"
        python3 "$here/scene.py" --mean "$SIZE" 4 "$work/pixels" "$work/radiance-$basis.pfm" || { fail "$part: $basis" "$(head -c 300 "$work/log")"; return; }
        apart "Radiance's sphere and plate ($basis)" "$work/scene/scene.ini" "$work/radiance-$basis.pfm" $most --samples 256
    done
}
part_picture_cycles() {
    needs blender python3 || return
    python3 "$here/scene.py" "$work/scene" "$SIZE" ${smooth#spec:} ${stretched#spec:} || { fail "$part: scene"; return; }
    convert $smooth "$work/a.py" --to principled && convert $stretched "$work/b.py" --to principled || return
    timeout 300 blender -b --factory-startup -P "$here/cycles.py" -- picture "$work/scene/scene.json" "$work/a.py" "$work/b.py" "$work/cycles.pfm" >"$work/blender.log" 2>&1
    [ -s "$work/cycles.pfm" ] || { fail "$part" "$(tail -n 5 "$work/blender.log")"; return; }
    apart "Cycles' sphere and plate (parametric)" "$work/scene/scene.ini" "$work/cycles.pfm" 2 --samples 256
}

# ---- Radiance: values ----
query() { # query FILE.xml DIRECTIONS.csv: the samples that testBSDF has there; $work/rows are the directions without their names
    { echo "L $1"; awk -F, 'NR > 1 { print "q", $1, $2, $3, $4 }' "$2"; } | testBSDF | awk 'NF == 3' |
        paste -d' ' - "$work/rows" | awk 'BEGIN { print "theta_i,phi_i,theta_o,phi_o,r,g,b" }
            { x = $1; y = $2; z = $3
              printf "%s,%.6g,%.6g,%.6g\n", $4, 2.565312843*x - 1.1668496158*y - 0.3984632272*z, -1.0221081721*x + 1.9782866167*y + 0.0438215555*z, 0.0747243773*x - 0.2519395672*y + 1.1772151899*z }'
}
part_radiance() {
    needs testBSDF python3 || return
    directions 2000 78 >"$work/d.csv"
    directions 2000 78 anisotropic >"$work/da.csv"
    for case in "$smooth tree3 d 0.002 0.01" "$smooth tree4 d 0.02 0.08" "$stretched tree4 da 0.01 0.05"; do
        set -- $case
        convert "$1" "$work/q.xml" --to radiance --radiance-basis "$2" || return
        tail -n +2 "$work/$3.csv" >"$work/rows"
        query "$work/q.xml" "$work/$3.csv" >"$work/plain.csv"
        floor=$(sed -n 's/.*gonio floor r g b \([^-]*\) -->.*/\1/p' "$work/q.xml")
        [ -z "$floor" ] || { # which stands in the scene's line, not in the file
            awk -F, -v OFS=, -v floor="$floor" 'BEGIN { split(floor, f, " ") } NR > 1 { for (c = 1; c <= 3; c++) $(4 + c) += f[c] } { print }' "$work/plain.csv" >"$work/summed.csv"
            mv "$work/summed.csv" "$work/plain.csv"
        }
        values "Radiance reads $2 of $1" "$1" "$work/plain.csv" "$4" "$5"
    done
}

# ---- libbsdf ----
part_libbsdf() {
    needs lbconv || return
    for format in astm zemax ssdd; do
        extension=$format
        [ $format = zemax ] && extension=bsdf
        convert $smooth "$work/in.$extension" --to $format || continue
        lbconv "$work/in.$extension" "$work/out.ssdd" >"$work/log" 2>&1 || { fail "$part: lbconv reads $format" "$(tail -n 3 "$work/log")"; continue; }
        convert "$work/out.ssdd" "$work/out.csv" && grep -v '^#' "$work/out.csv" >"$work/plain.csv"
        values "libbsdf reads $format" $smooth "$work/plain.csv" 1e-5 1e-4
    done
}

# ---- RGL's loader, pbrt, Mitsuba ----
part_rgl() {
    needs powitacq_eval || return
    directions 20000 80 >"$work/d.csv"
    directions 20000 80 anisotropic >"$work/da.csv"
    for case in "$smooth d 0.0013 0.007" "$sharp d 0.002 0.02" "$stretched da 0.005 0.03"; do
        set -- $case
        convert "$1" "$work/t.bsdf" --to rgl --rgl-channels rgb || return
        tail -n +2 "$work/$2.csv" | tr , ' ' >"$work/rows"
        powitacq_eval "$work/t.bsdf" <"$work/rows" | paste -d' ' "$work/rows" - | awk 'BEGIN { print "theta_i,phi_i,theta_o,phi_o,r,g,b" }
            { c = cos($3 * 3.14159265358979 / 180); printf "%s,%s,%s,%s,%.7g,%.7g,%.7g\n", $1, $2, $3, $4, $5 / c, $6 / c, $7 / c }' >"$work/read.csv"
        values "RGL's loader reads $1" "$1" "$work/read.csv" "$3" "$4"
    done
}
# A folder's scene in the renderer that it is for, against the same scene by Gonio.
renderer() { # renderer NAME PICTURE COMMAND...
    name=$1 picture=$2
    shift 2
    [ -d "$work/measured" ] || "$GONIO" bundle $smooth "$work/measured" --size 256 --formats rgl >"$work/log" 2>&1
    (cd "$work/measured/scenes" && timeout 400 "$@") >"$work/log" 2>&1
    [ -s "$work/measured/scenes/$picture" ] || { fail "$name makes its picture" "$(tail -n 3 "$work/log")"; return; }
    python3 "$here/scene.py" "$work/scene" 256 ${smooth#spec:} lambert:rho=0
    light=$(sed -n 's/.*"rgb L" \[\([0-9.e+-]*\) .*/\1/p' "$work/measured/scenes/pbrt.pbrt")
    printf '[image]\nwidth = 256\nheight = 256\nsamples = 64\n[camera c]\neye = 0/0/4\nfov = 30.615\n[material m]\nmodel = %s\n[mesh s]\nfile = scene/sphere.obj\nmove = 1/0/0\nmaterial = m\n[light l]\ntoward = -0.321394/0.556670/0.766044\nintensity = %s\n' \
        "${smooth#spec:}" "$light" >"$work/sphere.ini"
    apart "$name's sphere" "$work/sphere.ini" "$work/measured/scenes/$picture" 0.5 --ev 0
}
part_pbrt() {
    needs pbrt python3 && renderer pbrt pbrt.exr pbrt pbrt.pbrt
}
part_mitsuba() {
    needs mitsuba python3 && renderer Mitsuba mitsuba.exr mitsuba -m scalar_rgb mitsuba.xml
}

# ---- validators ----
part_materialx() {
    needs mxvalidate.py || return
    for model in $smooth $stretched; do
        convert "$model" "$work/m.mtlx" && check "MaterialX takes $model" mxvalidate.py --stdlib "$work/m.mtlx"
    done
}
part_openmaterial() {
    needs python3 || return
    schema=${PEERS_DIR:-.}/material_brdf_schema.json
    [ -e "$schema" ] && python3 -c 'import jsonschema' 2>/dev/null || { skip "$part" "ASAM's schema or python3-jsonschema is not there"; return; }
    convert $smooth "$work/m.xomb" --grid-step 15 && check "ASAM's schema takes it" python3 -m jsonschema -i "$work/m.xomb" "$schema"
}

all="cycles picture_cycles gltf three radiance picture_radiance libbsdf rgl pbrt mitsuba materialx openmaterial"
for part in ${*:-$all}; do
    part_"$part"
done
finish
