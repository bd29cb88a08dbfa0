#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Bad input: the status, the message with its line, the JSON, and nothing half-written.
. tests/system/lib.sh

header=theta_i,phi_i,theta_o,phi_o
# bad NAME STATUS LINE TEXT CONTENT: a samples file that fit must refuse, for people and in JSON.
bad() {
    printf "$5" >"$work/bad.csv"
    exits "$1" "$2" "$GONIO" fit "$work/bad.csv" -o "$work/model" --method mba --level 2
    says "$1: says why" "$4"
    [ "$3" = null ] || says "$1: says where" "bad.csv:$3:"
    exits "$1: JSON" "$2" "$GONIO" fit "$work/bad.csv" -o "$work/model" --method mba --level 2 --json
    check "$1: JSON error" python3 -c "
import json
e=json.load(open('$work/out'))['error']
assert e['status']==$2 and e['line']==(None if '$3'=='null' else int('${3#null}' or 0)) and e['file'].endswith('bad.csv') and e['message'], e"
    check "$1: no model" [ ! -e "$work/model" ]
}
bad "empty file" 3 null "empty" ''
bad "blank file" 3 null "expected" '\n\n'
bad "wrong header" 3 1 "unknown text" 'a,b,c,d,e\n1,2,3,4,5\n'
bad "no header" 3 1 "unknown text" '1,2,3,4,5\n'
bad "no rows" 3 1 "no samples" "$header,r\n"
bad "too few columns" 3 3 "expected 5 columns as in the header, found 4" "$header,r\n1,2,3,4,5\n1,2,3,4\n"
bad "too many columns" 3 2 "found 6" "$header,r\n1,2,3,4,5,6\n"
bad "NaN" 3 2 "expected a finite number, found 'NaN'" "$header,r\n1,2,3,4,NaN\n"
bad "Inf" 3 2 "expected a finite number, found '-inf'" "$header,r\n1,2,3,4,-inf\n"
bad "theta beyond 90" 3 2 "expected 0 to 90 degrees" "$header,r\n1,2,91,4,1\n"
bad "theta beyond -90" 3 2 "expected 0 to 90 degrees" "$header,r\n-91,2,9,4,1\n"
bad "negative values" 3 3 "2 negative values, the first here: r = -1" "$header,r\n1,2,3,4,5\n1,2,4,4,-1\n1,2,5,4,-2\n"
bad "negative values beyond noise" 3 4 "1 negative values more than 5 sigma below 0, the first here: r = -1 with sigma 0.1" \
    "$header,r,sigma_r\n1,2,3,4,5,.1\n1,2,4,4,-.4,.1\n1,2,5,4,-1,.1\n"
printf "$header,r\n1,2,3,4,5\n1,2,4,4,-1\n1,2,5,4,2\n" >"$work/n.csv"
for policy in clamp keep; do
    exits "negatives $policy" 0 "$GONIO" convert "$work/n.csv" "$work/$policy.csv" --negatives $policy
    says "negatives $policy: tells the count and the line" "1 negative values"
done
check "clamped" grep -q '^1,2,4,4,0$' "$work/clamp.csv"
check "kept" grep -q '^1,2,4,4,-1$' "$work/keep.csv"
exits "an option of another format" 2 "$GONIO" fit "$work/n.csv" -o "$work/model" --limit 5
says "an option of another format: lists its own" "format samples; it has negatives"
exits "a text without its last line end" 0 sh -c "printf '$header,r\n1,2,3,4,5' >'$work/open.csv'; '$GONIO' convert '$work/open.csv' '$work/x.csv'"
says "a text without its last line end: says so" "no line end"
exits "an ending that no writer has" 2 "$GONIO" convert "$work/n.csv" "$work/x.dat" --negatives keep
says "an ending that no writer has: lists those there are" "samples (.csv), merl (.binary), rgl=mitsuba=pbrt (.bsdf)"
exits "a format that is not written" 2 "$GONIO" convert "$work/n.csv" "$work/x.csv" --to cornell
says "a format that is not written: lists those that are" "samples (.csv), merl (.binary), rgl=mitsuba=pbrt (.bsdf)"
exits "an option of files for a model" 2 "$GONIO" convert spec:lambert:rho=0.5 "$work/x.csv" --limit 5
exits "a plan for a table" 2 "$GONIO" convert spec:lambert:rho=0.5 "$work/x.binary" --plan nusselt:5
exits "an unknown policy" 2 "$GONIO" convert "$work/n.csv" "$work/x.csv" --negatives ignore

# ---- binaries ----
"$GONIO" convert spec:lambert:rho=0.5 "$work/t.binary"
exits "a wrong count" 2 "$GONIO" convert "$work/t.binary" "$work/x.csv" --limit many
head -c 1000000 "$work/t.binary" >"$work/cut.binary"
exits "a truncated MERL" 3 "$GONIO" fit "$work/cut.binary" -o "$work/model"
says "a truncated MERL: says the sizes" "the file has 1000000 bytes; a MERL table has 34992012"
printf '\000\000\000\177\132\000\000\000\000\000\000\177' >"$work/absurd.binary"
exits "absurd sizes" 3 "$GONIO" fit "$work/absurd.binary" -o "$work/model"
says "absurd sizes: says them" "dimensions 2130706432 x 90 x 2130706432"
truncate -s 1T "$work/sparse.csv" 2>/dev/null && {
    exits "a file larger than the machine" 3 "$GONIO" fit "$work/sparse.csv" -o "$work/model"
    says "a file larger than the machine: says so" "at most"
}
head -c 4096 /dev/zero >"$work/zeros"
exits "zeros" 3 "$GONIO" fit "$work/zeros" -o "$work/model"
"$GONIO" convert spec:lambert:rho=0.5 "$work/s.csv" --plan nusselt:50
"$GONIO" fit "$work/s.csv" -o "$work/good" --method mba --level 2 >/dev/null
size=$(wc -c <"$work/good")
for size in 7 63 64 100 $((size / 2)) $((size - 1)); do
    head -c $size "$work/good" >"$work/cut"
    exits "a model cut at $size" 3 "$GONIO" compare "$work/cut" "$work/s.csv"
done
exits "a model as samples" 3 "$GONIO" fit "$work/good" -o "$work/model"
says "a model as samples: says so" "fitted model"
exits "samples as a model" 3 "$GONIO" compare "$work/s.csv" "$work/s.csv"
exits "a compressed file" 3 sh -c "gzip -c '$work/s.csv' >'$work/s.gz'; '$GONIO' fit '$work/s.gz' -o '$work/model'"
says "a compressed file: says so" "gzip"
exits "no such file" 3 "$GONIO" fit "$work/nothing" -o "$work/model"
exits "a folder" 3 "$GONIO" fit "$work" -o "$work/model"
check "nothing was written by any of them" [ ! -e "$work/model" ]

# ---- directions ----
for content in '' '1,2,3,4\n' "$header\n1,2,3\n" "$header\n1,2,3,4,5\n" "$header\n1,2,90.5,4\n" "$header\n1,nan,9,4\n"; do
    printf "$content" >"$work/d.csv"
    exits "directions: $(printf "$content" | tail -n 1 | head -c 40)" 3 "$GONIO" eval spec:lambert:rho=0.5 "$work/d.csv"
done

# ---- usage ----
exits "no input" 2 "$GONIO" fit
exits "an unknown option" 2 "$GONIO" fit "$work/s.csv" --levle 3
exits "an unknown verb" 2 "$GONIO" fitt
exits "a bad number" 2 "$GONIO" fit "$work/s.csv" --level 3x
exits "a level too high" 2 "$GONIO" fit "$work/s.csv" --level 99
exits "a hold-out of 2" 2 "$GONIO" fit "$work/s.csv" --hold-out 2
exits "folds and hold-out" 2 "$GONIO" fit "$work/s.csv" --hold-out 0.1 --folds 3
exits "an unknown method" 2 "$GONIO" fit "$work/s.csv" --method magic
says "an unknown method: lists them" "mba"
exits "unknown coordinates" 2 "$GONIO" fit "$work/s.csv" --coordinates polar
exits "an unknown spec" 2 "$GONIO" eval spec:phong:n=3 "$work/d.csv"
exits "an unknown key" 2 "$GONIO" eval spec:lambert:rho=0.5,colour=3 "$work/d.csv"
says "an unknown key: lists the keys" "expected one of rho"
exits "usage errors are JSON too" 2 "$GONIO" fit "$work/s.csv" --levle 3 --json
check "with a status" python3 -c "import json; assert json.load(open('$work/out'))['error']['status']==2"

# ---- full disks ----
exits "a full device" 1 "$GONIO" convert "$work/s.csv" /dev/full --to samples
says "a full device: says so" "No space left"
exits "a full standard output" 1 sh -c "printf '$header\n1,2,3,4\n' | '$GONIO' eval spec:lambert:rho=0.5 >/dev/full"
exits "a folder that does not exist" 1 "$GONIO" fit "$work/s.csv" -o "$work/none/model" --method mba --level 2
mkdir "$work/small"
if mount -t tmpfs -o size=64k none "$work/small" 2>/dev/null; then
    exits "a disk too small for the samples" 1 "$GONIO" convert spec:lambert:rho=0.5 "$work/small/s.csv" --plan nusselt:20000
    says "a disk too small: says so" "No space left"
    exits "a disk too small for the model" 1 "$GONIO" fit "$work/s.csv" -o "$work/small/m" --method mba --level 6
    check "nothing half-written stays on it" [ -z "$(ls -A "$work/small")" ]
    "$GONIO" fit "$work/s.csv" -o "$work/small/m" --method mba --level 2 >/dev/null
    cp "$work/small/m" "$work/before"
    exits "an old model when the new one does not fit" 1 "$GONIO" fit "$work/s.csv" -o "$work/small/m" --method mba --level 6
    check "is still there" cmp "$work/small/m" "$work/before"
    umount "$work/small"
else
    skip "a small disk" "no right to mount a tmpfs"
fi

# Azimuths of 7 rad were taken from Cornell text once, and written to a samples file that could not be read again.
printf '# a\n2\n400 500\n1.5 7 0.3 0 0.1 0.5\n' >"$work/turned.brdf"
exits "a Cornell azimuth beyond a turn" 3 "$GONIO" convert "$work/turned.brdf" "$work/turned.csv"
says "with its line" "turned.brdf:4: phi: expected -2 pi to 2 pi"
printf '# a\n2\n400 500\n1.5 6.283186 0.3 0 0.1 0.5\n' >"$work/turn.brdf"
exits "a turn that six decimals round up" 0 "$GONIO" convert "$work/turn.brdf" "$work/turn.csv"
exits "comes back from the samples file" 0 "$GONIO" convert "$work/turn.csv" "$work/again.csv"

finish
