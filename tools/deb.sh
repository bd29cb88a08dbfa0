#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Build the Debian packages from a copy of the source. usage: tools/deb.sh FOLDER     replaced: FOLDER/source, FOLDER/*.deb
set -eu
folder=$1
rm -rf "$folder/source" "$folder"/*.deb "$folder"/*.buildinfo "$folder"/*.changes
mkdir -p "$folder/source"
# What git knows where there is git, so that nothing of a build gets in.
if git rev-parse --git-dir >/dev/null 2>&1; then git ls-files -co --exclude-standard; else find . -path ./build -prune -o -type f -print; fi |
    tar -c -f - -T - | tar -x -f - -C "$folder/source"
cd "$folder/source"
DEB_BUILD_OPTIONS="${DEB_BUILD_OPTIONS:-parallel=$(nproc)}" dpkg-buildpackage -us -uc -b
cd ..
lintian --allow-root --tag-display-limit 0 --fail-on error ./*.changes
ls -l ./*.deb
