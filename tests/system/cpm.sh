#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# gonio cpm build under kill -9, on a full disk and with little memory: whatever happens, the next build goes on, and the
# map is the same bytes in the end. `make cpm-kills` kills 20 times.
set -u
. "$(dirname "$0")/lib.sh"
cd "$work" || exit 1
: "${KILLS:=3}" "${RESOLUTION:=16}"
awk 'BEGIN {
    for (k = 0; k < 16; k++) {
        x = k / 8 - 1; z = k % 2 * 0.125
        printf "v %g -1 %g\nv %g -1 %g\nv %g 1 %g\nv %g 1 %g\n", x, z, x + 0.125, 0.125 - z, x + 0.125, 0.125 - z, x, z
        printf "vt %g 0\nvt %g 0\nvt %g 1\nvt %g 1\n", k / 16, (k + 1) / 16, (k + 1) / 16, k / 16
        n = 4 * k + 1
        printf "f %d/%d %d/%d %d/%d %d/%d\n", n, n, n + 1, n + 1, n + 2, n + 2, n + 3, n + 3
    }
}' >roof.obj
printf '[mesh roof]\nfile = roof.obj\nsmooth = 0\n[light sun]\ntoward = 1/0/2\n' >roof.ini
build() (
    exec "$GONIO" cpm build roof.ini -o "$1" --resolution "$RESOLUTION" --points 16 --dense 16 --pairs 64 --faces 4 --snr 10
)
parts() { find "$1" -name 'part-*[0-9]' ! -name '*.*' 2>/dev/null | wc -l; }
exits "a build that nothing disturbs" 0 build whole
killed=0
while [ $killed -lt "$KILLS" ]; do
    before=$(parts map)
    build map >out 2>err &
    pid=$!
    pids=$pid
    while kill -0 $pid 2>/dev/null && [ "$(parts map)" -le "$before" ]; do sleep 0.01; done
    kill -9 $pid 2>/dev/null
    wait $pid 2>/dev/null
    pids=
    [ -e map/map.cpm ] && break
    killed=$((killed + 1))
done
[ $((3 * killed)) -ge $((2 * KILLS)) ]; ok $? "killed $killed times before the end"
touch map/part-00-0000000.0a1b2c map/map.cpm.0a1b2c # as a kill in the middle of a file leaves them
exits "the next one goes on to the end" 0 build map
cmp -s whole/map.cpm map/map.cpm; ok $? "with the same bytes"
[ "$(find map -type f | sort | tr '\n' ' ')" = "map/map.cpm map/milliseconds " ]; ok $? "and nothing is left beside it"
# Files of at most 4 blocks: as a full disk, which no test can make everywhere.
small() { sh -c "trap '' XFSZ; ulimit -f 4; exec \"\$@\"" sh "$@"; }
exits "a disk that is full in the middle" 1 small "$GONIO" cpm build roof.ini -o full --resolution 16 --points 16 --dense 16 --pairs 64 --faces 4 --snr 10
grep -q 'full/.*cannot write it' err; ok $? "it is named"
[ -z "$(find full -name '*.??????')" ]; ok $? "nothing half-written stays"
if [ "$RESOLUTION" = 16 ]; then
    exits "once there is room" 0 build full
    cmp -s whole/map.cpm full/map.cpm; ok $? "it goes on to the same bytes"
fi
exits "too little memory" 1 "$GONIO" cpm build roof.ini -o tight --memory 1000
says "too little memory: says what takes how much" "the points of the mesh take"
[ ! -e tight ]; ok $? "and makes no folder"
finish
