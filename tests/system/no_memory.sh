#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Little address space: whatever cannot be had ends in an error that names memory, never in a crash, and the program does
# end: a library's threads that try for memory for ever are not waited for.
set -u
. "$(dirname "$0")/lib.sh"
measure() { "$GONIO" measure --sample ward:rho_d=0.3,rho_s=0.2,alpha=0.3 --plan nusselt:16 --set scan.dark_frames=4,scan.reference_frames=4 "$@"; }
# Below this the loader or a library's constructor fails, before anything of ours runs.
least=200
# shellcheck disable=SC3045 # dash has it
while [ $least -lt 2000 ] && ! (ulimit -v $((least * 1024)) && "$GONIO" --version) >"$work/version" 2>&1; do least=$((least + 20)); done
if ! grep -q gonio "$work/version"; then
    skip "little memory" "the shell cannot limit it"
    finish
    exit
fi
check "a session to read" measure --method mba --level 2 "$work/s"
"$GONIO" samples "$work/s" -o "$work/s.csv" 2>/dev/null
named=0
for more in 0 20 60 140; do
    limit=$(((least + more) * 1024))
    for what in "measure $work/m$more" "replay $work/s" "fit $work/s.csv -o $work/fit.gonio"; do
        verb=${what%% *}
        [ "$verb" = measure ] && what="$what --sample ward:rho_d=0.3,rho_s=0.2,alpha=0.3 --plan nusselt:16 --set scan.dark_frames=4,scan.reference_frames=4"
        # shellcheck disable=SC2086,SC3045
        (ulimit -v $limit && exec timeout -s KILL 60 "$GONIO" $what --json) >"$work/out" 2>"$work/err"
        status=$?
        case $status in
        0) ;;
        1) if grep -qiE "memory|allocate" "$work/err" "$work/out"; then named=$((named + 1)); else
            fail "$verb in $((limit / 1024)) MB names memory" "$(head -c 300 "$work/err")"
        fi ;;
        *) fail "$verb in $((limit / 1024)) MB" "status $status" "$(head -c 300 "$work/err")" ;;
        esac
        grep -q '^{.*}$' "$work/out"
        [ $? -eq 0 ] || fail "$verb in $((limit / 1024)) MB prints its JSON" "$(head -c 300 "$work/out")"
    done
    if [ -d "$work/m$more" ] && "$GONIO" status --json "$work/m$more" | grep -q '"state":"stopped"'; then
        "$GONIO" resume "$work/m$more" >/dev/null 2>"$work/err" || fail "what was stopped in $((limit / 1024)) MB resumes" "$(head -c 300 "$work/err")"
    fi
done
[ $named -gt 0 ] && [ $failures -eq 0 ]
ok $? "$named of 12 runs in little memory ended with an error that names it, the others worked"
finish
