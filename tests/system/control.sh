#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# A running measure, seen and steered from elsewhere: status, pause, stop; signals; who may not, and who would like to
# hold it up; a disk that fills. Whatever happens on the way, the samples are those of an undisturbed measure.
set -u
. "$(dirname "$0")/lib.sh"
if ! python3 -c 'import json, socket' 2>/dev/null; then
    skip "a running measure from elsewhere" "no python3"
    finish
    exit
fi
sockets=$XDG_RUNTIME_DIR/gonio
mounted=
running=
clean_up() {
    [ -n "$running" ] && kill -9 $running 2>/dev/null
    [ -n "$mounted" ] && umount "$mounted"
    rm -rf "$work"
}
trap clean_up EXIT

sample=ward:rho_d=0.3,rho_s=0.2,alpha=0.3
quick=scan.dark_frames=4,scan.reference_frames=4
options="--sample $sample --plan nusselt:150 --set $quick --method mba --level 3 --json"
# begin VERB [OPTION ...] SESSION: in the background; its output is in SESSION.json and SESSION.log, its pid in $pid.
begin() {
    for session; do :; done
    # shellcheck disable=SC2086
    [ "$1" = resume ] && shift && set -- resume --json "$@"
    "$GONIO" "$@" >"$session.json" 2>"$session.log" &
    pid=$!
    running="$running $pid"
}
# member NAME: of the one-line JSON object on stdin.
member() { sed -n "s/.*\"$1\":\"\{0,1\}\([^,}\"]*\).*/\1/p"; }
is() { [ "$("$GONIO" status --json "$1" 2>/dev/null | member "$2")" = "$3" ]; }
# until_true COMMAND ...: a hundred times.
until_true() {
    patience=100
    until "$@" >/dev/null 2>&1; do
        patience=$((patience - 1))
        [ $patience -gt 0 ] || return 1
        sleep 0.05
    done
}
has_socket() { [ -S "$(echo "$sockets"/session-*.socket)" ]; }
poses() { "$GONIO" status --json "$1" 2>/dev/null | member poses_done; }
# Poses are being measured, and this many are there.
has() { [ "$(poses "$1")" -ge "$2" ]; }
frames() { find "$1/frames" -name '0*.png' | wc -l; }
same() { [ "$(member samples_sha256 <"$1.json")" = "$undisturbed" ]; }
ended() { # ended STATUS
    wait $pid
    [ $? -eq "$1" ]
}

"$GONIO" measure $options "$work/quiet" >"$work/quiet.json" 2>/dev/null
undisturbed=$(member samples_sha256 <"$work/quiet.json")
exits "status of a finished session" 0 "$GONIO" status --json --frame "$work/last.png" "$work/quiet"
python3 -c "
import json, struct
s = json.load(open('$work/out'))
assert s['state'] == 'finished' and s['pid'] is None and s['poses_done'] == s['poses'] == 150, s
assert s['steps_done'] == s['steps'] and s['last_event']['kind'] == 'finished' and s['last_alarm'] is None
assert 0 < s['held_out_rmse'] < 1 and s['frames'] == $(frames "$work/quiet")
head = open('$work/last.png', 'rb').read(26)
assert head[:8] == b'\x89PNG\r\n\x1a\n' and head[24] == 16 and struct.unpack('>2I', head[16:24])[0] > 8
"
ok $? "it says how far it came, how well it fits, and gives the last frame"
exits "nobody is there to be paused" 1 "$GONIO" pause "$work/quiet"
exits "nor to be stopped" 1 "$GONIO" stop "$work/quiet"
says "which names the session" "$work/quiet: no program"
for verb in status pause stop; do exits "$verb of what is no session" 3 "$GONIO" $verb "$work"; done

# ---- a running one ----
begin measure $options "$work/s"
check "status while it runs" until_true has "$work/s" 3
before=$(poses "$work/s")
exits "and again" 0 "$GONIO" status --json --frame "$work/last.png" "$work/s"
python3 -c "
import json
s = json.load(open('$work/out'))
assert s['state'] == 'running' and s['pid'] == $pid and s['phase'] == 'poses', s
assert $before <= s['poses_done'] < 150 and s['rate_per_s'] > 0 and s['eta_s'] > 0, s
"
ok $? "it is running, no less far than before, with pace and ETA"
exits "pause" 0 "$GONIO" pause --json "$work/s"
check "says that it stands still" sh -c "grep -q '\"state\":\"paused\"' '$work/out'"
stands=$(frames "$work/s")
sleep 0.5
check "and it does" [ "$(frames "$work/s")" = "$stands" ]
check "status says so, too" is "$work/s" state paused
exits "a second writer is refused" 1 "$GONIO" resume "$work/s"
says "and told where to look" "gonio status"
exits "go on" 0 "$GONIO" pause --off --json "$work/s"
check "it does" until_true has "$work/s" $((before + 4))
exits "stop" 0 "$GONIO" stop --json "$work/s"
check "says that it has" sh -c "grep -q '\"state\":\"stopped\"' '$work/out'"
check "the measure ends as by Ctrl-C" ended 4
check "and said why" grep -q '"message":"stopped from another terminal' "$work/s.json"
check "what happened is in the journal" sh -c "'$GONIO' doctor '$work/s' >'$work/told' && grep -q 'paused: .*shutter closed' '$work/told' &&
    grep -q 'continued: ' '$work/told' && grep -q 'stopped: stopped from another terminal' '$work/told'"
check "no socket is left" [ -z "$(ls "$sockets")" ]
begin resume "$work/s"
check "a resumed one pauses, too" until_true "$GONIO" pause "$work/s"
exits "and can be stopped while it stands still" 0 "$GONIO" stop "$work/s"
check "with the same status" ended 4

# ---- killed: what it left behind is in nobody's way ----
begin resume "$work/s"
until_true has_socket
kill -9 $pid
wait $pid 2>/dev/null
check "a killed measure leaves its socket" has_socket
check "and counts as stopped" is "$work/s" state stopped
exits "nobody can be asked to stop" 1 "$GONIO" stop "$work/s"

# ---- whoever would like to hold it up ----
begin resume "$work/s"
check "the next one takes the name" until_true "$GONIO" pause "$work/s"
cat >"$work/hostile.py" <<'PY'
import glob, os, socket, subprocess, sys, time
gonio, session, sockets = sys.argv[1:]
path = glob.glob(sockets + '/session-*.socket')[0]
def client(data=b'', wait=False):
    s = socket.socket(socket.AF_UNIX)
    s.settimeout(3)
    try:
        s.connect(path)
        s.sendall(data)
    except (BrokenPipeError, ConnectionResetError, BlockingIOError):
        pass
    answer = b''
    try:
        while wait and (more := s.recv(65536)):
            answer += more
    except (ConnectionResetError, socket.timeout):
        pass
    return s, answer
def closed(s):
    s.settimeout(1)
    try:
        return s.recv(10) == b''
    except socket.timeout:
        return False
    except OSError:
        return True
assert b'"error"' in client(b'dance\n', True)[1]
assert b'"pid"' in client(b'status\nstop\n', True)[1]  # one word a connection
client(os.urandom(100000), True)
assert client(b's' * 31, True)[1] == b''
silent = [client()[0] for _ in range(40)] + [client(b'sta')[0] for _ in range(40)]
start = time.monotonic()
answer = subprocess.run([gonio, 'status', '--json', session], capture_output=True, text=True)
assert answer.returncode == 0 and '"state":"paused"' in answer.stdout, answer
assert time.monotonic() - start < 5
unread = []
for _ in range(200):  # who asks and does not read
    s = client(b'status\n')[0]
    unread.append(s)
time.sleep(2.5)
assert len([s for s in silent if not closed(s)]) == 0  # silence ends a connection
PY
check "garbage, silence and floods do not" timeout 60 python3 "$work/hostile.py" "$GONIO" "$work/s" "$sockets"
python=$(python3 -c 'import os, sys; print(os.path.realpath(sys.executable))')
chmod 755 "$work"
if setpriv --reuid=65534 --clear-groups "$python" -c 'import socket' 2>/dev/null; then
    cat >"$work/other.py" <<'PY'
import glob, socket, sys
s = socket.socket(socket.AF_UNIX)
s.settimeout(3)
try:
    s.connect(sys.argv[1])
    s.sendall(b'stop\n')
    print('answer', s.recv(100))
except OSError as e:
    print(type(e).__name__)
PY
    socket=$(echo "$sockets"/session-*.socket)
    other() { setpriv --reuid=65534 --clear-groups "$python" "$work/other.py" "$socket"; }
    check "another user cannot reach it" [ "$(other)" = PermissionError ]
    chmod 777 "$sockets" "$socket"
    answer=$(other)
    check "nor is answered where the folder were open" sh -c "case \"$answer\" in \"answer b''\"|BrokenPipeError|ConnectionResetError) ;; *) echo \"$answer\"; exit 1 ;; esac"
    exits "an open folder is not trusted" 1 "$GONIO" pause --off "$work/s"
    check "but the lock tells that somebody writes" is "$work/s" pid $pid
    chmod 700 "$sockets"
else
    skip "another user" "needs root, setpriv and a python3 that others may run"
fi
exits "the owner goes on" 0 "$GONIO" pause --off "$work/s"
check "to the end" ended 0
check "with the undisturbed samples" same "$work/s"

# ---- signals ----
begin measure $options "$work/h"
for signal in HUP TERM PIPE INT; do
    until_true "$GONIO" pause "$work/h"
    [ $signal = PIPE ] && kill -s PIPE $pid # a pipe says it at every line
    kill -s $signal $pid
    check "SIG$signal ends it as Ctrl-C does" ended 4
    check "and the journal has it" sh -c "'$GONIO' status --json '$work/h' | grep -q '\"last_event\":{[^}]*\"kind\":\"stopped\"'"
    begin resume "$work/h"
done
until_true "$GONIO" pause "$work/h"
kill -HUP $pid
kill -HUP $pid
check "a terminal that says twice that it is gone does, too" ended 4
(trap '' HUP && exec "$GONIO" resume --json "$work/h") >"$work/h.json" 2>"$work/h.log" &
pid=$!
running="$running $pid"
until_true "$GONIO" pause "$work/h"
kill -HUP $pid
sleep 0.3
check "under nohup it goes on" "$GONIO" pause --off "$work/h"
check "to the end, too" ended 0
check "with these samples" same "$work/h"
"$GONIO" measure $options "$work/p" 2>&1 | true
check "a measure whose output nobody reads is finished, or stopped in order" sh -c "'$GONIO' status --json '$work/p' |
    grep -q '\"last_event\":{[^}]*\"kind\":\"\(finished\|stopped\)\"'"

# ---- a disk that fills ----
mkdir "$work/disk"
if mount -t tmpfs -o size=40m tmpfs "$work/disk" 2>/dev/null; then
    mounted=$work/disk
    begin measure $options "$mounted/d"
    until_true "$GONIO" pause "$mounted/d"
    head -c $(($(df --output=avail -B1 "$mounted" | tail -n 1) - 3000000)) /dev/zero >"$mounted/full"
    "$GONIO" pause --off "$mounted/d" >/dev/null
    check "a full disk lets it wait" until_true is "$mounted/d" state "waiting for room"
    stands=$(frames "$mounted/d")
    exits "nothing more is stored" 0 [ "$(frames "$mounted/d")" = "$stands" ]
    exits "it can be stopped then" 0 "$GONIO" stop "$mounted/d"
    check "with status 4" ended 4
    begin resume "$mounted/d"
    check "and resumed, to wait again" until_true is "$mounted/d" state "waiting for room"
    rm "$mounted/full"
    check "room lets it go on by itself" ended 0
    check "the operator was told" sh -c "grep -q 'waits for room on the disk: .* MB are free' '$mounted/d.log' && grep -q 'goes on after' '$mounted/d.log'"
    check "and the journal" sh -c "'$GONIO' doctor '$mounted/d' | grep -q 'no room: '"
    check "and the samples are the same" same "$mounted/d"
else
    skip "a disk that fills" "cannot mount a tmpfs"
fi
finish
