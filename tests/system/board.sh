#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# A measure whose arms are an emulated board: the cross-built firmware of the Raspberry Pi Pico (tests/board/pico.c) behind a
# serial line. Equal seeds, equal samples, as with the simulated arms alone. (QEMU's machines drop frames here whenever the
# computer is busy, because its processor goes on while the line waits for the host; the Pico's waits too.)
. tests/system/lib.sh
build=$GONIO_BUILD
if ! command -v arm-none-eabi-gcc >/dev/null; then
    skip "a measure on the emulated board" "gcc-arm-none-eabi is not installed"
    finish
    exit
fi
check "the firmware is built" make --no-print-directory "$build/firmware/pico.uf2" "$build/tests/board/pico" B="$build"
mkfifo "$work/commands"
"$build/tests/board/pico" "$build/firmware/pico.uf2" <"$work/commands" >"$work/pico.out" 2>"$work/pico.err" &
board=$!
trap 'kill $board 2>/dev/null; rm -rf "$work"' EXIT
exec 3>"$work/commands"
wait_for 10 grep -q '^line ' "$work/pico.out"
port=$(sed -n 's/^line //p' "$work/pico.out")

# Fast arms: what is shown here does not depend on how long they take. The board has no home switches.
axes() {
    for axis in light_theta light_phi camera_theta camera_phi; do
        printf '[axis %s]\nspeed_deg_per_s = 1000\nacceleration_deg_per_s2 = 10000\njerk_deg_per_s3 = 200000\n%s' $axis "$1"
    done
}
{
    printf '[rig]\ndriver = sim\n'
    axes ''
} >"$work/plain.ini"
{
    printf '[rig]\ndriver = sim\n[controller]\nport = %s\ntimeout_ms = 2000\nretries = 12\ndeadman_s = 300\n' "$port"
    printf '[stage]\ndriver = modbus\n'
    axes 'steps_per_deg = 20
home_order = 0
'
} >"$work/board.ini"
printf 'theta_i,phi_i,theta_o,phi_o\n20,0,30,180\n35,0,10,90\n' >"$work/plan.csv"
measure() {
    "$GONIO" measure --rig "$work/$1.ini" --sample ward:rho_d=0.3,rho_s=0.2,alpha=0.15 --plan "$work/plan.csv" --seed 3 --set scan.settle_s=0 \
        --method mba --json "$work/$1" 2>"$work/$1.err" | sed -n 's/.*"samples_sha256":"\([0-9a-f]*\)".*/\1/p'
}
plain=$(measure plain)
emulated=$(measure board)
if [ -n "$plain" ] && [ "$plain" = "$emulated" ]; then pass "a measure on the emulated board gives the in-process stage's samples"; else
    fail "a measure on the emulated board gives the in-process stage's samples" "in process '$plain', board '$emulated'" "$(tail -n 3 "$work/board.err")"
fi
exits "status of the board" 0 "$GONIO" rig status --rig "$work/board.ini" --sample lambert:rho=0.5 --json
check "the measure has homed it" grep -q '"homed":15' "$work/out"
exits "identity of the board" 0 "$GONIO" rig identify --rig "$work/board.ini" --sample lambert:rho=0.5 --json
check "it is the emulated one" grep -q '"board":4' "$work/out"
echo report >&3
wait_for 10 grep -q wrong "$work/pico.out"
check "the model of the chip has no objection" grep -q '"wrong":0,' "$work/pico.out"
check "its step outputs did move" grep -q '"position":\[-*[1-9]' "$work/pico.out"
finish
