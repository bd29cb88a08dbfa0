#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# gonio render as users meet it: the picture, the JSON, exit statuses, and that nothing half-written stays. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
n=0
check() { # check DESCRIPTION COMMAND...: ok where the command succeeds
    n=$((n + 1))
    text=$1
    shift
    if "$@" >"$work/.log" 2>&1; then echo "ok $n - $text"; else
        echo "not ok $n - $text"
        sed 's/^/# /' "$work/.log"
    fi
}
status_is() { # status_is STATUS COMMAND...
    want=$1
    shift
    timeout 60 "$@"
    got=$?
    [ $got -eq "$want" ] || { echo "exit status $got, expected $want"; return 1; }
}
is_png() { [ "$(head -c 8 "$1" | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ]; }
ward='spec:ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.15'

check "one model" "$GONIO" render "$ward" -o "$work/a.png" --size 64 --threads 1
check "the file is a PNG" is_png "$work/a.png"
check "another thread count" "$GONIO" render "$ward" -o "$work/b.png" --size 64 --threads 2
check "gives the same bytes" cmp "$work/a.png" "$work/b.png"

"$GONIO" render "$ward" spec:lambert:rho=0.5 -o "$work/c.png" --size 80x60 --json >"$work/c.json" 2>/dev/null
check "JSON names image, size and models" grep -qE \
    '^\{"image":".*/c.png","width":164,"height":60,"ev":-?[0-9.]+,"models":\["spec:ward.*","spec:lambert:rho=0.5"\]\}$' \
    "$work/c.json"

"$GONIO" render "$ward" -o "$work/e.png" --size 64 --light-theta 70 --ev 0 >/dev/null
check "light and exposure change it" sh -c '! cmp -s "$1" "$2"' - "$work/a.png" "$work/e.png"

check "no output named: usage" status_is 2 "$GONIO" render "$ward"
check "a bad size: usage" status_is 2 "$GONIO" render "$ward" -o "$work/x.png" --size big
check "no such model: bad input" status_is 3 "$GONIO" render "$work/none.model" -o "$work/x.png"
printf 'ply\nformat ascii 1.0\nelement vertex 9\n' >"$work/cut.ply"
check "a mesh cut off: bad input" status_is 3 "$GONIO" render "$ward" --mesh "$work/cut.ply" -o "$work/x.png"
check "an error names the file" sh -c '"$GONIO" render "$1" --mesh "$2" -o "$3" 2>&1 | grep -q "cut.ply: "' - \
    "$ward" "$work/cut.ply" "$work/x.png"
check "a folder that is not there: failed" status_is 1 "$GONIO" render "$ward" -o "$work/none/x.png" --size 64
if [ -w /dev/full ]; then
    check "a full disk: failed" status_is 1 "$GONIO" render "$ward" -o /dev/full --size 64
fi
check "failures leave nothing behind" sh -c '[ -z "$(ls "$1" | grep x.png)" ]' - "$work"

bunny=${GONIO_DATA:-../shared/data}/meshes/bun_zipper_res4.ply
if [ -r "$bunny" ]; then
    check "a scanned mesh" "$GONIO" render "$ward" --mesh "$bunny" -o "$work/d.png" --size 64
    check "does not look like the sphere" sh -c '! cmp -s "$1" "$2"' - "$work/a.png" "$work/d.png"
else
    n=$((n + 1))
    echo "ok $n - a scanned mesh # SKIP no data"
fi
echo "1..$n"
