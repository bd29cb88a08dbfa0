#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# No verb writes over what it reads, under whatever name, nor into a session: wrong usage, and every byte stays.
. tests/system/lib.sh

cd "$work" || exit 1
mkdir -p d s
header=theta_i,phi_i,theta_o,phi_o
"$GONIO" convert spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.3 d/data.csv --plan nusselt:40 2>"$work/err"
"$GONIO" convert spec:lambert:rho=0.5 d/m.gonio 2>"$work/err"
printf '%s\n10,0,20,180\n30,0,30,180\n' $header >d/plan.csv
printf '[rig]\nlight_distance_mm = 900\n[camera]\nflat = d/m.gonio\n' >d/rig.ini
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >d/mesh.obj
printf 'wavelength_nm,reflectance,sigma\n400,0.98,0.01\n700,0.98,0.01\n' >d/certificate.csv
printf 'file,exposure_s,light\nframe.raw,1,1\n' >d/list.csv
printf 'file,exposure_s\nframe.raw,1\n' >d/series.csv
printf 'file,object,light_theta,light_phi,camera_theta,camera_phi\nframe.raw,board,0,0,0,0\n' >d/views.csv
printf '[camera]\nwidth = 10\nheight = 10\n' >d/camera.ini
printf '[patch]\nshape = sawtooth\n' >d/patch.ini
printf '[camera a]\neye = 0/-2/3\n[mesh p]\nfile = mesh.obj\n[light l]\nkind = point\nposition = 0/0/2\nintensity = 3\n' >d/scene.ini
printf 'a b v\n30 0 1\n30 9 1\n' >d/lab.txt
printf 'columns = theta_i=a,theta_o=b\n' >d/lab.txt.gonio-map
head -c 100 /dev/urandom >d/frame.raw
cp d/data.csv d/tradeoff.csv
cp d/frame.raw d/flat.tiff
printf 'file,exposure_s,light\nflat.tiff,1,1\n' >d/flats.csv
"$GONIO" measure --rig sim --sample lambert:rho=0.5 --plan d/plan.csv s/day.session --method mba --level 2 >"$work/out" 2>&1
ok $? "a session"
ln -s ../d/data.csv s/link.csv
ln d/data.csv s/hard.csv
sums() { find d s -type f -exec sha256sum {} + | sort; }
sums >"$work/before"

# refused NAME ARGUMENTS: status 2, in words, with nothing changed anywhere.
refused() {
    name=$1
    shift
    exits "$name" 2 "$GONIO" "$@"
    if grep -qE 'would be written (over|into)' err; then pass "$name: says so"; else fail "$name: says so" "$(head -c 300 err)"; fi
    sums >after
    check "$name: every byte stays" cmp -s before after
}
# Every verb that has a target, with each kind of input as that target.
cases=$(cat <<'CASES'
fit d/data.csv -o d/data.csv
fit s/link.csv -o d/data.csv
fit d/data.csv -o s/link.csv
fit d/data.csv -o s/hard.csv
fit d/data.csv -o ./d/../d/data.csv
fit d/data.csv --output=d/data.csv
fit d/data.csv -od/data.csv
fit s/day.session -o s/day.session/mine.gonio
fit s/day.session -o s/day.session/frames/mine.gonio
fit s/day.session -o s/day.session
fit d/data.csv -o s/day.session/session.db
convert d/data.csv d/data.csv --to samples
convert d/data.csv s/link.csv
convert spec:file:d/m.gonio d/m.gonio
convert spec:file:d/m.gonio,shape=sphere d/m.gonio
convert spec:lambert:rho=0.5 d/plan.csv --plan d/plan.csv
convert d/m.gonio d/plan.csv --plan=d/plan.csv
convert d/data.csv s/day.session/x.csv
learn d/m.gonio spec:lambert:rho=0.5 -o d/m.gonio
learn spec:lambert:rho=0.5 --list d/plan.csv -o d/plan.csv
fit d/data.csv --prior d/plan.csv -o d/plan.csv
plan prior:d/m.gonio,N=5 -o d/m.gonio
virtual d/patch.ini -o d/patch.ini
virtual sawtooth -p d/plan.csv -o d/plan.csv
virtual sawtooth -o s/day.session/session.db
render d/m.gonio -o d/m.gonio
render spec:lambert:rho=0.5 spec:file:d/m.gonio -o d/m.gonio
render d/m.gonio --mesh d/mesh.obj -o d/mesh.obj
render d/scene.ini -o d/scene.ini
render d/scene.ini -o d/mesh.obj
scene needs d/scene.ini -o d/scene.ini
scene needs d/scene.ini -o d/mesh.obj
scene needs d/scene.ini -o d/x --picture d/mesh.obj
cpm build d/scene.ini -o d/scene.ini
cpm build d/scene.ini -o d/mesh.obj
cpm build d/scene.ini -o s/day.session/x
eval d/m.gonio d/plan.csv -o d/plan.csv
eval d/m.gonio d/plan.csv -o d/m.gonio
check d/data.csv --apply mirror -o d/data.csv
look d/data.csv --picture d/data.csv
convert d/lab.txt d/lab.txt.gonio-map --to samples
convert d/lab.txt d/plan.csv --directions d/plan.csv --to samples
look d/data.csv --picture s/day.session/x.svg
samples s/day.session -o s/day.session/session.db
samples s/day.session -o s/day.session/x.csv
samples s/day.session -o s/day.session/frames/000000-00.png
tradeoff d/tradeoff.csv -o d
tradeoff s/day.session -o s/day.session
plan d/plan.csv -o d/plan.csv --sample lambert:rho=0.5
plan d/plan.csv -o d/rig.ini --rig d/rig.ini
plan d/plan.csv -o d/rig.ini --check=d/rig.ini
plan d/plan.csv -o d/m.gonio --rig d/rig.ini
plan nusselt:5 -o d/m.gonio --sample file:d/m.gonio
plan nusselt:5 -o d/m.gonio --set camera.flat=d/m.gonio,rig.notes=x
measure --rig sim --sample file:d/m.gonio --model d/m.gonio new.session
measure --rig d/rig.ini --model d/rig.ini new.session
measure --rig sim --sample lambert:rho=0.5 --plan d/plan.csv --model d/plan.csv new.session
measure --rig sim --sample lambert:rho=0.5 --plan d/plan.csv --model new.session/session.db new.session
measure --rig sim --sample lambert:rho=0.5 --plan d/plan.csv --model s/day.session/model.gonio new.session
measure --rig sim --sample lambert:rho=0.5 --plan d/plan.csv s/day.session/inner.session
resume s/day.session --model s/day.session/session.db
merge s/day.session s/day.session -o s/day.session/x.csv
replay s/day.session --model s/day.session/model.gonio
replay s/day.session --model s/day.session/session.db
rig capture --rig d/rig.ini -o d/rig.ini
rig burst 3 s/day.session/inner --rig d/rig.ini
calibrate camera d/frame.raw -o d/frame.raw
calibrate noise d/list.csv -o s/day.session
calibrate response d/series.csv -o d/series.csv
calibrate response d/series.csv -o d/frame.raw
calibrate response d/series.csv --method emor --emor d/plan.csv -o d/plan.csv
calibrate flat d/list.csv -o d/list.csv
calibrate flat d/list.csv -o d/frame.raw
calibrate flat d/flats.csv --maps d
calibrate reference d/certificate.csv -o d/certificate.csv
calibrate reference d/certificate.csv --brdf d/m.gonio -o d/m.gonio
calibrate rig d/views.csv --camera d/camera.ini -o d/views.csv
calibrate rig d/views.csv --camera d/camera.ini -o d/camera.ini
calibrate rig --save s/day.session
CASES
)
echo "$cases" >cases
# Every other case names what it reads otherwise: by ./ and .., or by a symbolic link beside it.
other_name() { # COUNT FILE
    case $1 in
    *[13579]) [ -f "$2" ] && [ "$2" != d/lab.txt ] || { echo "$2" && return; } ;;
    *) echo "$2" && return ;;
    esac
    case $1 in
    *[15]) echo "./${2%/*}/../$2" ;;
    *) ln -sf "${2##*/}" "${2%/*}/by-link-${2##*/}" && echo "${2%/*}/by-link-${2##*/}" ;;
    esac
}
count=0
while read -r verb first rest; do
    count=$((count + 1))
    # shellcheck disable=SC2086
    refused "$verb $first $rest" $verb "$(other_name $count "$first")" $rest
done <cases
# The rig of the environment is read too.
export GONIO_RIG=d/rig.ini
refused "GONIO_RIG" plan d/plan.csv -o d/rig.ini
refused "what GONIO_RIG names" plan d/plan.csv -o d/m.gonio
unset GONIO_RIG
# The list is whole: a verb whose help names a target stands in it.
for verb in $("$GONIO" --help | sed -n 's/^  \([a-z]*\) .*/\1/p') $(printf 'calibrate-%s ' camera noise response rig flat reference); do
    if "$GONIO" $(echo "$verb" | tr - ' ') --help | grep -qE '^  --(output|out|model|maps|save|picture) '; then
        check "the cases have $verb" grep -qE "^$(echo "$verb" | tr - ' ') " cases
    fi
done

# What is not the same file is written, also where its name is an input's elsewhere.
exits "a target of an input's name elsewhere" 0 "$GONIO" convert d/data.csv ./data.csv
exits "a target that is there already" 0 "$GONIO" convert d/data.csv ./data.csv
exits "a device is both" 0 sh -c "'$GONIO' eval d/m.gonio /dev/stdin -o /dev/stdout <d/plan.csv"
exits "a folder of inputs that keeps them" 0 "$GONIO" check d/data.csv --apply mirror -o d/mirrored.csv
exits "resume's own model" 0 "$GONIO" resume s/day.session --model s/day.session/model.gonio
exits "measure's own model" 0 "$GONIO" measure --rig sim --sample lambert:rho=0.5 --plan d/plan.csv --method mba --level 2 \
    --model new.session/model.gonio new.session
finish
