#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# What a script can see in the source without compiling it: licences, the floors' order, and that lists which stand twice agree.
set -u
. "$(dirname "$0")/lib.sh"
check "every source file says its licence" tools/spdx
check "no include and no call runs up a floor, and no files call in a circle" tools/floors "${GONIO_BUILD:-build}"

version=$(awk '/define GONIO_VERSION_(MAJOR|MINOR|PATCH) /{ v = v s $3; s = "." } END { print v }' include/gonio/version.h)
[ "$("$GONIO" --version)" = "gonio $version" ] && head -n 1 debian/changelog | grep -qF "gonio ($version)" && head -n 1 NEWS | grep -qF "Gonio $version "
ok $? "header, program, packages and NEWS are of one version, $version"

# The libraries' headers that the build needs, but for those of tests.
cat ./*/files.mk ./*/*/files.mk | sed -nE 's/^deps-y *\+= *//p' | tr ' ' '\n' | grep -E '^z?lib.*-dev$' | grep -vE '^lib(cmocka|umockdev|unicorn)-dev$' | sort -u >"$work/needed"
missing=
while read -r package; do
    [ "$(grep -cE "(^|[ ,])$package(,|\$)" debian/control)" -ge 2 ] || missing="$missing $package"
done <"$work/needed"
[ -s "$work/needed" ] && [ -z "$missing" ]
ok $? "debian/control names what is linked with, to build and beside libgonio-dev:$missing"
grep -oE '^[ A-Z].*' debian/control | grep -oE 'lib[a-z0-9.+-]*-dev|zlib1g-dev' | grep -vx libgonio-dev | sort -u | comm -23 - "$work/needed" >"$work/unneeded"
[ ! -s "$work/unneeded" ]
ok $? "and nothing else: $(tr '\n' ' ' <"$work/unneeded")"
finish
