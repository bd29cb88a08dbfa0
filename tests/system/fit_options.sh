#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The options of a fit: measure takes what fit takes; what was asked for survives a kill, resume and replay; an option
# that the method does not have is wrong usage. Prints TAP.
set -u
. "$(dirname "$0")/lib.sh"

ward=ward:rho_d=0.3,rho_s=0.2,alpha=0.3
# From --channel to --json is how a file of samples is read, which measure has no use for.
options_of() { "$GONIO" "$1" --help | sed '/^  --channel/,/^  --json/d' | sed -n 's/^  --\([a-z-]*\).*/\1/p' | sort; }

# ---- measure takes what fit takes ----
# --physical changes what a fit has made; a session's model stays what its samples say.
options_of fit | grep -vxE 'output|physical' >"$work/fit"
options_of measure >"$work/measure"
check "there are options" [ "$(wc -l <"$work/fit")" -gt 15 ]
check "measure has every one of them" sh -c "[ -z \"\$(comm -23 '$work/fit' '$work/measure')\" ]"
"$GONIO" fit --help | sed -n '/^  --method/,/^  --distance/p' >"$work/help"
check "docs/fitting.md has them as --help prints them" sh -c \
    "awk '/^  --method/ { on = 1 } /^\`\`\`/ { on = 0 } on' docs/fitting.md | cmp - '$work/help'"

# ---- an option that the method does not have ----
exits "lambda is not mba's" 2 "$GONIO" fit none.csv --method mba --lambda 1
says "it tells what mba has" "it has --method --hold-out"
exits "though it be the default" 2 "$GONIO" fit none.csv --method ggx --coordinates auto
exits "nor measure's" 2 "$GONIO" measure --sample $ward --method cbmba --tolerance 1 "$work/x"
check "and no session is begun" [ ! -e "$work/x" ]
exits "unknown coordinates" 2 "$GONIO" fit none.csv --coordinates half
says "they are listed" "half-vector-narrow"
exits "hold-out and folds" 2 "$GONIO" fit none.csv --hold-out 0.1 --folds 3
exits "thesis in other coordinates" 2 "$GONIO" fit none.csv --thesis --coordinates reflected

# ---- what was asked for survives ----
# survives NAME OPTION...: a measure killed among its poses, resumed in another folder and replayed has the model that
# fit makes of the session's samples with these options.
survives() {
    set=$1
    shift
    rm -rf "$work/s"
    "$GONIO" measure --sample $ward --plan nusselt:30 --set scan.dark_frames=4,scan.reference_frames=4 "$@" "$work/s" \
        >"$work/log" 2>&1 &
    pid=$!
    while kill -0 $pid 2>/dev/null && [ "$(find "$work/s/frames" -name '0*.png' 2>/dev/null | wc -l)" -lt 25 ]; do
        sleep 0.01
    done
    kill -KILL $pid 2>/dev/null
    wait $pid 2>/dev/null
    check "$set: it was killed before its end" [ ! -e "$work/s/model.gonio" ]
    check "$set: resume" "$GONIO" resume "$work/s"
    check "$set: replay gives the same bits" "$GONIO" replay "$work/s"
    check "$set: fit" "$GONIO" fit "$work/s" -o "$work/model" "$@"
    check "$set: the model is the one that was asked for" cmp "$work/model" "$work/s/model.gonio"
}
survives mba --method mba --level 3 --coordinates half-vector-wide --domain log --symmetry none --folds 3 \
    --max-bytes 2G --max-memory 2G --seed 5
survives thesis --thesis --tolerance 10
survives cbmba --method cbmba --diffuse-level 1 --level 3 --drop 60 --storage half --hold-out 0
survives cbmba-limit --method cbmba --max-error 100 --storage float --symmetry reciprocity
survives lsq --method lsq --level 2 --coordinates reflected --domain linear --lambda 0.001 --iterations 5 \
    --max-error 100 --max-ns 1e6 --max-seconds 1e6 --hold-out 0.1

# ---- the model's place survives too ----
rm -rf "$work/s"
mkdir "$work/elsewhere"
check "stopped among its poses" sh -c "cd '$work/elsewhere' && '$GONIO' measure --sample $ward --plan nusselt:30 \\
    --set scan.dark_frames=4,scan.reference_frames=4,faults.camera_error=20 --method mba --level 2 --model here.gonio '$work/s'
    [ \$? -eq 1 ]"
check "resume" "$GONIO" resume --set faults.camera_error=never "$work/s"
check "writes the model where measure was told to" [ -s "$work/elsewhere/here.gonio" ]
check "and nowhere else" [ ! -e "$work/s/model.gonio" ]
finish
