#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The same bits from one session and from one set of samples, whatever the threads, the processors and the variables that
# numeric libraries read; on another kind of processor the same bits, or rounding, which replay tells from change.
# Prints TAP.
set -u
. "$(dirname "$0")/lib.sh"

field() { grep -o "\"$1\":[^,}]*" "$2" | head -n 1 | cut -d: -f2- | tr -d '"'; }
seconds=${GONIO_TEST_SECONDS:-300}

# Each environment is a line: a name, and the command that runs another in it.
environments() {
    echo "one thread|env OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 GOTO_NUM_THREADS=1 MKL_NUM_THREADS=1 @ --threads 1"
    echo "three threads|env OMP_NUM_THREADS=5 OMP_DYNAMIC=true OPENBLAS_NUM_THREADS=7 OPENBLAS_MAIN_FREE=1 @ --threads 3"
    echo "a BLAS for Prescott|env OPENBLAS_CORETYPE=Prescott @"
    echo "a BLAS for Haswell, images without AVX2|env OPENBLAS_CORETYPE=Haswell OPENCV_CPU_DISABLE=AVX2,FP16,AVX512_SKX @"
    for cpu in $processors; do
        echo "processor $cpu alone|taskset -c $cpu @"
    done
}
# A core type that the processor is not would end in an illegal instruction.
runs() {
    case $1 in
    *Haswell*) grep -qw avx2 /proc/cpuinfo ;;
    *Prescott*) grep -qw pni /proc/cpuinfo ;;
    esac
}
# in_environment LINE COMMAND...: run it with the line's words before and behind it.
in_environment() {
    words=${1#*|}
    shift
    # shellcheck disable=SC2086
    timeout "$seconds" ${words%%@*} "$@" ${words#*@}
}
# in_all NAME FIELDS REFERENCE COMMAND...: in each environment the command's JSON has the reference's fields.
in_all() {
    name=$1 fields=$2 reference=$3
    shift 3
    environments >"$work/environments"
    while IFS= read -r line; do
        if ! runs "${line%%|*}"; then
            skip "$name: ${line%%|*}" "not on this processor"
            continue
        fi
        in_environment "$line" "$@" </dev/null >"$work/now.json" 2>"$work/now.log"
        differing=
        for f in $fields; do
            [ -n "$(field "$f" "$work/now.json")" ] && [ "$(field "$f" "$work/now.json")" = "$(field "$f" "$reference")" ] ||
                differing="$differing $f"
        done
        if [ -z "$differing" ]; then pass "$name: ${line%%|*}"; else
            fail "$name: ${line%%|*}" "differs:$differing" "$(head -c 300 "$work/now.log")"
        fi
    done <"$work/environments"
}
processors=
if command -v taskset >/dev/null; then
    processors=$(taskset -cp $$ | sed 's/.*: //; s/[,-].*//')
    last=$(taskset -cp $$ | sed 's/.*[:,-] *//')
    [ "$last" = "$processors" ] || processors="$processors $last"
else
    skip "affinities" "no taskset"
fi

# ---- a session ----
"$GONIO" measure --json --sample ward:rho_d=0.3,rho_s=0.2,alpha=0.3 --plan nusselt:24 \
    --set scan.dark_frames=4,scan.reference_frames=4 "$work/s" >"$work/s.json" 2>"$work/s.log"
check "measure" [ -n "$(field samples_sha256 "$work/s.json")" ]
printf '{"verdict":"identical","samples_sha256":"%s","model_sha256":"%s"}\n' "$(field samples_sha256 "$work/s.json")" \
    "$(field model_sha256 "$work/s.json")" >"$work/wanted.json"
in_all "replay" "verdict samples_sha256 model_sha256" "$work/wanted.json" "$GONIO" replay --json "$work/s"

# ---- fits ----
"$GONIO" samples "$work/s" -o "$work/s.csv" 2>/dev/null
"$GONIO" plan "nusselt:60,anisotropic=1" -o "$work/p.csv" >/dev/null 2>&1
"$GONIO" eval "spec:ward:rho_d=0.3,rho_s=0.2,alpha=0.2" "$work/p.csv" >"$work/a.csv" 2>/dev/null
cat >"$work/fit" <<END
#!/bin/sh
'$GONIO' fit "\$@" -o '$work/model' --json >/dev/null && sha256sum <'$work/model' | sed 's/ .*//; s/.*/{"model":"&"}/'
END
chmod +x "$work/fit"
for form in "s.csv --method lsq --level 3" "s.csv --method auto" "a.csv --method lsq --level 2"; do
    # shellcheck disable=SC2086
    "$work/fit" "$work/"$form >"$work/fit.json" 2>"$work/fit.log"
    # shellcheck disable=SC2086
    in_all "fit $form" model "$work/fit.json" "$work/fit" "$work/"$form
done

# ---- another C library's rounding ----
# Without FMA the mathematical functions of glibc take other ways to the last bit.
if [ "$(uname -m)" = x86_64 ] && grep -qw fma /proc/cpuinfo && getconf GNU_LIBC_VERSION >/dev/null 2>&1; then
    GLIBC_TUNABLES=glibc.cpu.hwcaps=-FMA,-AVX2 "$GONIO" replay --json "$work/s" >"$work/r.json" 2>"$work/r.log"
    check "replay without FMA ends well" [ $? -eq 0 ]
    case $(field verdict "$work/r.json") in
    rounding) pass "and calls what differs rounding" ;;
    identical) skip "and calls what differs rounding" "nothing differs with this C library" ;;
    *) fail "and calls what differs rounding" "$(cat "$work/r.json")" ;;
    esac
else
    skip "replay without FMA" "no other mathematical functions to choose here"
fi
# A journal that somebody changed is neither rounding nor a change of Gonio's: nothing is replayed.
if command -v python3 >/dev/null; then
    cp -r "$work/s" "$work/c"
    python3 - "$work/c/session.db" <<'END'
import sqlite3, sys
db = sqlite3.connect(sys.argv[1])
db.execute("UPDATE settings SET value = replace(value, substr(value, 1, 1), 'x') WHERE key = 'result.model_sha256'")
db.commit()
END
    exits "a journal that was changed is not replayed" 3 "$GONIO" replay --json "$work/c"
    check "and its row is named" grep -q 'row result.model_sha256' "$work/out"
else
    skip "change" "no python3"
fi
# ---- one way to linear algebra ----
# A BLAS or LAPACK call of the sources would bring all of this back.
root=$(dirname "$0")/../..
check "no source includes a BLAS or LAPACK" sh -c "! grep -rlE '#include *[<\"](cblas|lapacke|lapack|openblas[a-z_]*|blis|mkl[a-z_]*)[.]h' \
    '$root' --include='*.c' --include='*.h' --include='*.cpp' --exclude-dir=build"
check "nor does the program need one itself" sh -c "! readelf -d '$GONIO' | grep -E 'NEEDED.*(blas|lapack)'"
finish
