#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# gonio render SCENE.ini end to end: pictures, comparisons, and endings that leave nothing half-written.
set -u
. "$(dirname "$0")/lib.sh"
cd "$work" || exit 1
printf 'v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl lid\nf 1/1 2/2 3/3 4/4\n' >square.obj
cat >good.ini <<'INI'
[image]
width = 32
height = 24
samples = 4
[camera front]
eye = 0/-2/3
[camera side]
eye = 3/0/2
[material lid]
model = ggx:rho_d=0.3/0.2/0.1,rho_s=0.1,alpha=0.2
[mesh plate]
file = square.obj
[light lamp]
kind = point
position = 0/0/2
intensity = 8
[light sky]
kind = environment
intensity = 0.1
INI
exits "a scene as PNG" 0 "$GONIO" render good.ini -o a.png --ev 0
exits "as EXR, with one thread" 0 "$GONIO" render good.ini -o a.exr --threads 1
exits "as PFM, with three" 0 "$GONIO" render good.ini -o a.pfm --threads 3
exits "they hold the same light" 0 "$GONIO" render good.ini --compare a.exr --json
grep -q '"mae": *0.0,' out; ok $? "its own EXR is at distance 0"
exits "and the PNG the same codes" 0 "$GONIO" render good.ini --compare a.png --ev 0 --json
grep -q '"mae": *0.0,' out; ok $? "its own PNG is at distance 0"
exits "another camera, against it" 0 "$GONIO" render good.ini --camera side --compare a.exr --difference d.png
[ -s d.png ] && grep -q 'PSNR' out; ok $? "tells the PSNR and shows the difference"
exits "interreflection, other size and samples" 0 "$GONIO" render good.ini -o i.png --size 16 --samples 2 --interreflection --seed 3
exits "a reference of another size" 1 "$GONIO" render good.ini --compare i.png
says "a reference of another size: says both" "32 x 24 and 16 x 16"
exits "an option of models" 2 "$GONIO" render good.ini -o x.png --light-theta 30
exits "onto its own mesh" 2 "$GONIO" render good.ini -o square.obj
exits "no such camera" 3 "$GONIO" render good.ini -o x.png --camera top
# ---- a characteristic point map ----
exits "a map" 0 "$GONIO" cpm build good.ini -o map --resolution 1 --points 32 --dense 32 --pairs 64 --faces 4
exits "a picture by it" 0 "$GONIO" render good.ini --cpm map -o map.png --show levels
exits "against the original" 0 "$GONIO" cpm compare good.ini --cpm map --truth 8 --strip strip.png
grep -q 'original, equal time' out && grep -q '^gargoyle ' out; ok $? "beside the original in equal time, and the paper's table"
[ -s strip.png ]; ok $? "and the strip of pictures"
exits "no power of two" 1 "$GONIO" cpm build good.ini -o map --resolution 3
exits "a folder that holds another map" 3 "$GONIO" cpm build good.ini -o map --resolution 2
says "a folder that holds another map: says so" "another scene, or of other options"
sed 's/alpha=0.2/alpha=0.3/' good.ini >other.ini
exits "a map of another scene" 3 "$GONIO" render other.ini --cpm map -o x.png
says "a map of another scene: says so" "other meshes or materials"
# Bad input is tests/unit/test_world.c's matter, as every run of the program costs a tenth of a second; here how it ends.
sed 's/^file.*/&\nmaterial = tin/' good.ini >bad.ini
exits "a material that is not there" 3 "$GONIO" render bad.ini -o x.png
says "a material that is not there: says where" "bad.ini:11: [mesh plate]: no section [material tin]"
if [ -w /dev/full ]; then
    for ending in png exr; do
        ln -s /dev/full full.$ending
        exits "a full disk, .$ending" 1 "$GONIO" render good.ini -o full.$ending
    done
fi
interrupts "Ctrl-C: exit 4" "$GONIO" render good.ini --samples 1000000 -o x.png
[ -z "$(ls | grep '^x\.')" ]; ok $? "no failure wrote anything"
finish
