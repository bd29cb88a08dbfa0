#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# One checker over many files, as many at a time as there are processors; status 1 where it objects to anything.
# usage: FLAGS=... tools/lint.sh clang|cppcheck|tidy FILE ...     FLAGS: the compiler's
set -u
checker=$1
shift
echo "$checker: $# files"
case $checker in
# Its "style" is taste (scopes of variables, pointers that could be const) and finds hundreds of those.
cppcheck)
    exec nice cppcheck --quiet --std=c11 -j "$(nproc)" --error-exitcode=1 --inline-suppr --suppressions-list=.cppcheck \
        --enable=warning,performance,portability --max-configs=1 -Iinclude -I. -D_GNU_SOURCE -DGONIO_VERSION='""' "$@"
    ;;
# FLAGS holds quotes, hence eval.
clang) one='eval "nice clang -fsyntax-only -Werror $FLAGS \"\$@\""' ;;
# It wants the flags behind the files, and counts on stderr what it does not show.
tidy) one='eval "nice clang-tidy --quiet --warnings-as-errors=* \"\$@\" -- $FLAGS" 2>/dev/null' ;;
esac
printf '%s\n' "$@" | xargs -P "$(nproc)" -n 8 sh -c "$one" -
