#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Install the Debian packages named as arguments that are missing, having said which; nothing is touched when all are there.
set -eu
missing=
for package; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing="$missing $package"
done
[ -n "$missing" ] || exit 0
sudo=
if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "not root and no sudo; install by hand:$missing" >&2; exit 1; }
    sudo=sudo
fi
echo "these Debian packages are missing and will be installed now (${sudo:+sudo }apt-get install):$missing"
export DEBIAN_FRONTEND=noninteractive
$sudo apt-get update -qq
# shellcheck disable=SC2086
$sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
