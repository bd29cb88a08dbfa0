#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# What doctor, resume and measure do with a session that is damaged, unreadable or not all there: nothing intact is ever
# lost, and the exit status says how it stands. Prints TAP.
set -u
. "$(dirname "$0")/lib.sh"

trace() { (cd "$1" && find . -printf '%p %s %m %T@ %C@ %i\n' | sort); }
hashes() { find "$@" -type f -name '0*.png*' -exec sha256sum {} + | cut -d' ' -f1 | sort; }
# lost INVENTORY SESSION: frames by content that are neither in its frames/ nor its lost+found/.
lost() {
    hashes "$2/frames" "$2/lost+found" 2>/dev/null >"$work/there"
    comm -23 "$1" "$work/there" | wc -l
}
none_lost() { [ "$(lost "$work/frames" "$1")" -eq 0 ]; }
# unchanged NAME COMMAND...: passes where the command changes nothing at all in $work/s.
unchanged() {
    name=$1
    shift
    trace "$work/s" >"$work/trace"
    "$@" >"$work/told" 2>&1
    trace "$work/s" >"$work/trace2"
    check "$name" cmp "$work/trace" "$work/trace2"
}
fresh() {
    rm -rf "$work"/s "$work"/s.*
    cp -a "$work/good" "$work/s"
    hashes "$work/s/frames" >"$work/frames"
}
field() { sed -n "s/.*\"$1\":\([^,}]*\).*/\1/p" "$work/told" | head -n 1; }

small=scan.dark_frames=4,scan.reference_frames=4,scan.trap_frames=2,camera.width=48,camera.height=48,sample.region_radius_mm=1
"$GONIO" measure --sample ward:rho_d=0.3,rho_s=0.2,alpha=0.3 --plan nusselt:12 --set $small --method mba --level 2 "$work/good" >"$work/measure.log" 2>&1
ok $? "measure"

# ---- sound ----
fresh
unchanged "doctor changes nothing" "$GONIO" doctor "$work/s"
unchanged "nor does doctor --repair of a sound session" "$GONIO" doctor --repair "$work/s"
unchanged "nor samples" "$GONIO" samples "$work/s"
echo mine >"$work/s/frames/notes.txt"
mkdir "$work/s/frames/mine"
unchanged "nor resume of a finished session, with a user's file and folder in frames/" "$GONIO" resume "$work/s"
check "which says so" tells 0 "nothing is left to do" "$GONIO" resume "$work/s"
check "and in JSON" tells 0 '"finished":true' "$GONIO" resume --json "$work/s"
check "resume fits anew where that is asked for" "$GONIO" resume --model "$work/again.gonio" "$work/s"
check "to the same model" cmp "$work/again.gonio" "$work/s/model.gonio"

# ---- damage ----
fresh
truncate -s 100 "$work/s/frames/000005-00.png"
hashes "$work/s/frames" >"$work/frames"
check "doctor tells" tells 1 "000005-00.png" "$GONIO" doctor "$work/s"
check "doctor --repair puts a session of what is intact there" tells 0 "s.damaged-1" "$GONIO" doctor --repair "$work/s"
check "with every frame" none_lost "$work/s"
check "by hard links" [ "$work/s/frames/000006-00.png" -ef "$work/s.damaged-1/frames/000006-00.png" ]
check "and a list of what was set aside" grep -q "000005-00.png" "$work/s/lost+found/LIST"
check "resume measures the rest" "$GONIO" resume "$work/s"
check "to the same model" cmp "$work/s/model.gonio" "$work/good/model.gonio"
rm "$work/s/session.db"
tells 0 '"damaged_path":' "$GONIO" doctor --repair --json "$work/s" >/dev/null
ok $? "a lost journal is made anew"
check "nothing of it is lost" [ "$(field rows_lost)$(field steps_missing)$(field steps_lost)" = 000 ]
check "the earlier journal is still there" [ -e "$work/s.damaged-1/session.db" ]
check "and the session is sound" "$GONIO" doctor "$work/s"

# A model whose head is damaged is no model to look at: the session's own goes to lost+found/ all the same.
for repair in yes no; do
    fresh
    printf spoiled | dd of="$work/s/model.gonio" conv=notrunc 2>/dev/null
    cp "$work/s/model.gonio" "$work/spoiled"
    check "doctor tells a model with a damaged head" tells 1 "not the model" "$GONIO" doctor "$work/s"
    if [ $repair = yes ]; then check "doctor --repair calls its results gone" "$GONIO" doctor --repair "$work/s"; fi
    check "resume fits it anew" "$GONIO" resume "$work/s"
    check "to the same model" cmp "$work/s/model.gonio" "$work/good/model.gonio"
    check "and keeps the damaged one" cmp "$work/s/lost+found/model.gonio" "$work/spoiled"
    check "then it is sound" "$GONIO" doctor "$work/s"
done

# What a killed program left among the frames of a finished session.
for verb in --repair --compress; do
    fresh
    echo half >"$work/s/frames/.000005-00.png.1f0a33c8.new"
    check "doctor tells half a frame" tells 0 '"strays":1' "$GONIO" doctor --json "$work/s"
    check "doctor $verb takes it away" "$GONIO" doctor $verb "$work/s"
    check "to lost+found/" grep -q half "$work/s/lost+found/.000005-00.png.1f0a33c8.new"
    check "and leaves none" tells 0 '"strays":0' "$GONIO" doctor --json "$work/s"
    check "nor a frame less" none_lost "$work/s"
done

# Every path that measure takes can be repaired: the longest, whatever share of it is the session's name.
for base in s "$(printf '%0224d' 0)"; do
    deep=$work
    while [ $((479 - ${#base} - ${#deep})) -gt 200 ]; do deep=$deep/$(printf '%0100d' 0); done
    deep=$deep/$(printf "%0$((478 - ${#base} - ${#deep}))d" 0)
    mkdir -p "$deep"
    cp -a "$work/good" "$deep/$base"
    for damage in "rm session.db" "rm session.log" "dd if=/dev/zero of=session.db bs=4096 seek=1 count=1 conv=notrunc"; do
        (cd "$deep/$base" && $damage) 2>/dev/null
        check "a path of $((${#deep} + 1 + ${#base})) bytes, $damage: doctor --repair" "$GONIO" doctor --repair "$deep/$base"
        check "and it is sound" tells 0 '"sound":true' "$GONIO" doctor --json "$deep/$base"
        check "to the same samples" sh -c "'$GONIO' samples '$work/good' >'$work/a.csv' && '$GONIO' samples '$deep/$base' | cmp - '$work/a.csv'"
    done
    if [ "$base" = s ]; then base=m; else base=1${base#0}; fi
    check "measure takes such a path" "$GONIO" measure --sample lambert:rho=0.5 --plan nusselt:1 --set $small "$deep/$base"
    check "and not a longer one" tells 2 "at most" "$GONIO" measure --sample lambert:rho=0.5 --plan nusselt:1 "$deep/${base}1"
    check "of which nothing is made" [ ! -e "$deep/${base}1" ]
    check "nor does convert" tells 2 "at most" sh -c "'$GONIO' convert '$work/good' '$work/x.h5' && '$GONIO' convert '$work/x.h5' '$deep/${base}1'"
    rm -f "$work/x.h5"
done

# ---- not damage ----
fresh
rm "$work/s/session.db"
unchanged "measure into a folder whose journal is lost" "$GONIO" measure --sample lambert:rho=0.5 "$work/s"
check "is refused with what to do" tells 3 "doctor --repair" "$GONIO" measure --sample lambert:rho=0.5 "$work/s"
fresh
mv "$work/s/frames" "$work/away"
for verb in "doctor --repair" resume replay; do
    check "frames/ is missing: $verb" tells 3 "mounted" sh -c "'$GONIO' $verb '$work/s'"
done
ln -s "$work/away" "$work/s/frames"
for verb in "doctor --repair" resume replay; do
    check "frames/ is a link: $verb" tells 3 "a link" sh -c "'$GONIO' $verb '$work/s'"
done
rm "$work/s/frames"
mkdir "$work/s/frames"
check "frames/ is empty: doctor --repair" tells 3 "nothing was changed" "$GONIO" doctor --repair "$work/s"
check "in JSON, with what was found" tells 3 '"refused":' "$GONIO" doctor --repair --json "$work/s"
check "and resume" tells 3 "missing" "$GONIO" resume --model "$work/x.gonio" "$work/s"
rmdir "$work/s/frames"
mv "$work/away" "$work/s/frames"
check "back again, it is sound" "$GONIO" doctor "$work/s"
check "and nothing was repaired" [ ! -e "$work/s.damaged-1" ]

# ---- unreadable ----
if [ "$(id -u)" -eq 0 ] && command -v setpriv >/dev/null; then
    another="setpriv --reuid=65534 --regid=65534 --clear-groups"
else
    another=
fi
chmod 755 "$work"
chmod -R a+rwX "$work/s" && chmod 700 "$work/s/frames"/*.png
if [ "$(id -u)" -ne 0 ]; then
    chmod 000 "$work/s/frames"/*.png
fi
if [ "$(id -u)" -eq 0 ] && [ -z "$another" ]; then
    skip "another user without permission" "root without setpriv reads everything"
elif ! $another test -x "$GONIO"; then
    skip "another user without permission" "the program is where another user cannot run it"
else
    chmod 777 "$work"
    trace "$work/s" >"$work/trace"
    TMPDIR="$work" tells 1 "unreadable" $another "$GONIO" doctor --repair "$work/s" >"$work/check.log"
    ok $? "frames that a user may not read: repair is refused"
    trace "$work/s" >"$work/trace2"
    check "and changes nothing" cmp "$work/trace" "$work/trace2"
    check "nor lies anything beside it" [ "$(ls -d "$work"/s.* 2>/dev/null | wc -l)" -eq 0 ]
fi
finish
