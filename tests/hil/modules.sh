#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The stock Debian kernel, and beside it gpio-sim and v4l2loopback built from Debian's sources: the stock kernel has
# neither. Nothing of it is installed; all stays in the folder.
# usage: tests/hil/modules.sh FOLDER     says on stdout what cannot be had; status 1 where there is no kernel
set -u
mkdir -p "$1" && cd "$1" || exit 1
fetch() { # into the folder PACKAGE: the files of a package, taken apart
    for name; do
        [ -d "$name" ] && continue
        apt-get download -qq "$name" >apt.log 2>&1 && dpkg-deb -x "$name"_*.deb "$name.new" && rm -f "$name"_*.deb &&
            mv "$name.new" "$name" || return 1
    done
}
if [ ! -f version ]; then
    image=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/.*Depends: \(linux-image-[^ ]*\)$/\1/p' | head -n 1)
    if [ -z "$image" ]; then
        [ "$(id -u)" -eq 0 ] && apt-get update -qq >apt.log 2>&1
        image=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/.*Depends: \(linux-image-[^ ]*\)$/\1/p' | head -n 1)
    fi
    [ -n "$image" ] && fetch "$image" || exit 1
    depmod -b "$image" "${image#linux-image-}"
    ln -sfn "$image" linux
    echo "${image#linux-image-}" >version
fi
version=$(cat version)
[ -f built ] && exit 0

# Headers, whose makefile names the common part by an absolute path.
series=$(echo "$version" | cut -d. -f1,2)
common=linux-headers-${version%-amd64}-common
fetch "linux-headers-$version" "$common" "linux-kbuild-$series" || { echo "no kernel headers"; exit 0; }
headers=$PWD/headers
rm -rf "$headers"
mkdir headers
cp -a "linux-headers-$version/." "$common/." "linux-kbuild-$series/." headers/
echo "include $headers/usr/src/$common/Makefile" >"headers/usr/src/linux-headers-$version/Makefile"
rm -rf extra
mkdir extra
if fetch "linux-source-$series"; then
    tar -xJf "linux-source-$series/usr/src/linux-source-$series.tar.xz" --occurrence=1 --strip-components=3 -C extra \
        "linux-source-$series/drivers/gpio/gpio-sim.c" "linux-source-$series/drivers/gpio/gpiolib.h" \
        "linux-source-$series/kernel/irq/irq_sim.c"
    # Not exported to modules; this one is, and does the same under the right lock.
    sed -i 's/handle_simple_irq(irq_to_desc(\(.*\)));/generic_handle_irq_safe(\1);/' extra/irq_sim.c
    mv extra/gpio-sim.c extra/gpio-sim-main.c
    printf 'obj-m += gpio-sim.o\ngpio-sim-y := gpio-sim-main.o irq_sim.o\n' >>extra/Makefile
else
    echo "no linux-source-$series, so no gpio-sim"
fi
if fetch v4l2loopback-dkms; then
    cp v4l2loopback-dkms/usr/src/v4l2loopback-*/v4l2loopback*.[ch] extra/
    printf 'obj-m += v4l2loopback.o\n' >>extra/Makefile
else
    echo "no v4l2loopback-dkms"
fi
make -s -C "headers/usr/src/linux-headers-$version" M="$PWD/extra" modules >make.log 2>&1 && touch built ||
    echo "modules do not build (make.log)"
exit 0
