# SPDX-License-Identifier: BSD-3-Clause
# TAP for scripts that drive the program. Source it; then `check NAME COMMAND ...`, and `finish` at the end.
# $GONIO is the program, $work a folder that vanishes at the end.
: "${GONIO:=$PWD/build/gonio}" "${GONIO_DATA:=../shared/data}"
work=$(mktemp -d "${TMPDIR:-/tmp}/gonio-system-XXXXXX")
XDG_RUNTIME_DIR=$work # of the sockets of running measures
export XDG_RUNTIME_DIR
pids= # of what runs in the background, killed at the end
trap 'for pid in $pids; do kill "$pid" 2>/dev/null; done; rm -rf "$work"' EXIT
trap 'exit 1' INT TERM
tests=0 failures=0

pass() {
    tests=$((tests + 1))
    echo "ok $tests - $1"
}
fail() {
    tests=$((tests + 1)) failures=$((failures + 1))
    echo "not ok $tests - $1"
    shift
    for line; do echo "# $line"; done
}
# ok STATUS NAME: of the command just run, as in `ok $? "it runs"`.
ok() {
    if [ "$1" -eq 0 ]; then pass "$2"; else fail "$2"; fi
}
skip() {
    tests=$((tests + 1))
    echo "ok $tests - $1 # SKIP $2"
}
# check NAME COMMAND ...: passes where the command succeeds.
check() {
    name=$1
    shift
    if "$@" >"$work/check.log" 2>&1; then pass "$name"; else fail "$name" "$*" "$(head -c 400 "$work/check.log")"; fi
}
# exits NAME STATUS COMMAND ...: the command must end with that status; what it said is in $work/out and $work/err.
exits() {
    name=$1 wanted=$2
    shift 2
    "$@" >"$work/out" 2>"$work/err"
    got=$?
    if [ $got -eq "$wanted" ]; then pass "$name"; else
        fail "$name" "status $got, expected $wanted: $*" "$(head -c 300 "$work/out")" "$(head -c 300 "$work/err")"
    fi
}
# says NAME TEXT: the last command that `exits` ran said TEXT on stderr.
says() {
    if grep -qF -- "$2" "$work/err"; then pass "$1"; else fail "$1" "expected '$2' in: $(head -c 300 "$work/err")"; fi
}
finish() {
    echo "1..$tests"
    [ $failures -eq 0 ]
}
# tells STATUS TEXT COMMAND...: it ends with this status, and what it prints holds the text.
tells() {
    wanted=$1 text=$2
    shift 2
    "$@" >"$work/told" 2>&1
    got=$?
    cat "$work/told"
    [ $got -eq "$wanted" ] || { echo "exit status $got, expected $wanted"; return 1; }
    grep -qF -- "$text" "$work/told" || { echo "does not tell: $text"; return 1; }
}
# wait_for SECONDS COMMAND ...: until the command succeeds, no longer than so many seconds.
wait_for() {
    tries=$(($1 * 20))
    shift
    until "$@" 2>/dev/null; do
        tries=$((tries - 1))
        [ $tries -lt 0 ] && return 1
        sleep 0.05
    done
}
# interrupts NAME COMMAND ...: Ctrl-C, as soon as the program listens to it, ends it with status 4.
catches_interrupts() { grep -q '^SigCgt:.*[2367abef]$' "/proc/$1/status"; }
interrupts() {
    interrupts_name=$1
    shift
    "$@" >out 2>err &
    interrupts_pid=$!
    wait_for 60 catches_interrupts $interrupts_pid && kill -INT $interrupts_pid
    wait $interrupts_pid
    [ $? -eq 4 ]; ok $? "$interrupts_name"
}
# start_controller DESCRIPTOR NAME ARGUMENTS ...: gonio-controller in the background, its output in $work/NAME.out; it
# takes commands through the descriptor, whose end is its end. With --tcp its port is in $port. False: it is not built.
start_controller() {
    [ -x "${GONIO%/*}/gonio-controller" ] || return 1
    descriptor=$1 name=$2
    shift 2
    mkfifo "$work/$name.in"
    "${GONIO%/*}/gonio-controller" "$@" <"$work/$name.in" >"$work/$name.out" 2>&1 &
    pids="$pids $!"
    eval "exec $descriptor>\"$work/$name.in\""
    case $1 in
    --tcp) wait_for 30 grep -q '^port' "$work/$name.out" && port=$(sed -n 's/^port //p' "$work/$name.out") ;;
    --pty) wait_for 30 test -e "$2" ;;
    esac
}
# field NAME FILE: a member of a one-line JSON object, without quotes.
field() { grep -o "\"$1\":[^,}]*" "$2" | head -n 1 | cut -d: -f2- | tr -d '"'; }
# make_kind KIND: a small model of the kind as $work/model.gonio, of $work/samples.csv where it has to be fitted.
make_kind() {
    case $1 in
    analytic) "$GONIO" convert spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.3 "$work/model.gonio" ;;
    lattice) "$GONIO" fit "$work/samples.csv" -o "$work/model.gonio" --method mba --hold-out 0 ;;
    cbmba) "$GONIO" fit "$work/samples.csv" -o "$work/model.gonio" --method cbmba --hold-out 0 ;;
    lobe-spline) "$GONIO" fit "$work/samples.csv" -o "$work/model.gonio" --method lsq --level 2 --hold-out 0 ;;
    koenderink) "$GONIO" fit "$work/samples.csv" -o "$work/model.gonio" --method koenderink --hold-out 0 ;;
    harmonics) "$GONIO" fit "$work/samples.csv" -o "$work/model.gonio" --method spherical-harmonics --hold-out 0 ;;
    bvb) "$GONIO" fit "$work/samples.csv" -o "$work/model.gonio" --method bvb --table-step 5 --hold-out 0 ;;
    table | separable | wavelet | geodesic)
        "$GONIO" fit "$work/samples.csv" -o "$work/model.gonio" --method "$1" --fill kernel --hold-out 0
        ;;
    kernel | hierarchical | homomorphic) "$GONIO" fit "$work/samples.csv" -o "$work/model.gonio" --method "$1" --hold-out 0 ;;
    transformed)
        "$GONIO" convert spec:ward:rho_d=0.3,rho_s=0.2,alpha_x=0.2,alpha_y=0.4 "$work/whole.gonio" &&
            "$GONIO" check "$work/whole.gonio" --apply isotropy -o "$work/model.gonio"
        ;;
    halves) "$GONIO" convert "spec:lambert:rho=0.3|lambert:rho=0.2" "$work/model.gonio" ;;
    *) echo "no command here makes a model of kind $1" >&2 && return 1 ;;
    esac
}
