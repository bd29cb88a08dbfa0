#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The Debian packages in a fresh system, as a user gets them: libgonio-eval1 with nothing but the C library, the README's
# example compiled against libgonio-eval alone, then gonio itself. Prints TAP; SKIP where no fresh system can be made.
# usage: tests/packages/run.sh BUILD_FOLDER     everything is under BUILD_FOLDER/packages; KEEP=1: the packages as they lie there
set -u
build=$1
folder=$PWD/$build/packages
root=$folder/root
skip() {
    echo "ok - packages in a fresh system # SKIP $1"
    exit 0
}
[ "$(id -u)" -eq 0 ] || skip "needs root"
tools/deps.sh debootstrap debhelper lintian || skip "debootstrap, debhelper or lintian cannot be installed"
# The mirror that this machine installs from, whatever it is.
. /etc/os-release
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' "Codename: ${VERSION_CODENAME:-}" 'Component: main' 2>/dev/null | head -n 1)
[ -n "$mirror" ] || skip "no Debian mirror is configured"
mkdir -p "$folder/cache"
[ -n "${KEEP:-}" ] && ls "$folder"/gonio_*.deb >/dev/null 2>&1 || make --no-print-directory B="$build" deb || { echo "not ok - the packages build"; exit 1; }

within() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive http_proxy="${http_proxy:-}" "$@"; }
leave() {
    umount "$root/var/cache/apt/archives" "$root/proc" 2>/dev/null
    mountpoint -q "$root/proc" || mountpoint -q "$root/var/cache/apt/archives" || rm -rf --one-file-system "$root"
}
trap leave EXIT
trap 'exit 1' INT TERM
leave
debootstrap --variant=minbase --cache-dir="$folder/cache" "$VERSION_CODENAME" "$root" "$mirror" >"$folder/debootstrap.log" 2>&1 ||
    skip "debootstrap: $(grep -v '^I: ' "$folder/debootstrap.log" | tail -n 1)"
cp /etc/resolv.conf "$root/etc/"
mount --bind "$folder/cache" "$root/var/cache/apt/archives" || skip "mount is not permitted"
echo 'Binary::apt::APT::Keep-Downloaded-Packages "true"; APT::Keep-Downloaded-Packages "true";' >"$root/etc/apt/apt.conf.d/90keep"
mount -t proc proc "$root/proc" || skip "mount is not permitted"
mkdir "$root/gonio"
cp "$folder"/*.deb "$root/gonio/"
rm -f "$root"/gonio/*-dbgsym_*.deb
cp docs/examples/eval.c "$root/gonio/example.c"
log=$folder/test.log
: >"$log"
failures=0
check() { # check NAME COMMAND ...: within the fresh system
    name=$1
    shift
    echo "# $name" >>"$log"
    if within "$@" >>"$log" 2>&1; then echo "ok - $name"; else
        failures=$((failures + 1))
        echo "not ok - $name"
        tail -n 12 "$log" | sed 's/^/# /'
    fi
}
check "libgonio-eval1 installs where there is only the base system" sh -c 'dpkg -i /gonio/libgonio-eval1_*.deb'
within apt-get update -qq >>"$log" 2>&1
check "libgonio-dev and a compiler install" sh -c 'apt-get install -y -qq --no-install-recommends gcc libc6-dev pkgconf /gonio/libgonio*.deb'
check "the README's example compiles against libgonio-eval" \
    sh -c 'cd /gonio && gcc -std=c17 -Wall -Wextra -Werror example.c $(pkg-config --cflags --libs gonio-eval) -o example'
check "and needs no other library of Gonio" sh -c 'objdump -p /gonio/example | grep -q "NEEDED *libgonio-eval.so.1" && ! objdump -p /gonio/example | grep -q "NEEDED *libgonio.so"'
check "gonio installs" sh -c 'apt-get install -y -qq --no-install-recommends /gonio/gonio_*.deb'
check "gonio --version says the package's" sh -c '[ "$(gonio --version)" = "gonio $(dpkg-query -W -f "\${Version}" gonio)" ]'
printf 'theta_i,phi_i,theta_o,phi_o,r,g,b\n10,0,10,180,0.25,0.5,0.75\n30,0,30,90,0.25,0.5,0.75\n60,0,20,0,0.25,0.5,0.75\n' >"$root/gonio/samples.csv"
check "gonio fits a model" sh -c 'cd /gonio && gonio fit samples.csv -o mine.gonio --method mba --level 2 --hold-out 0'
check "the example opens it" sh -c 'cd /gonio && [ "$(./example mine.gonio | tr "\n" " ")" = "r 0.25 /sr g 0.5 /sr b 0.75 /sr " ]'
check "the packages leave again" sh -c 'apt-get purge -y -qq gonio libgonio-dev libgonio1 libgonio-eval1 && [ -z "$(find / -xdev -path /gonio -prune -o -path /proc -prune -o -path /var/cache -prune -o -name "*gonio*" -print)" ]'
[ "$failures" -eq 0 ]
