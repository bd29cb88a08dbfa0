#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# make install and uninstall: everything at its place, what pkg-config says builds a program, nothing left behind.
set -u
. "$(dirname "$0")/lib.sh"
root=$work/root
make="make --no-print-directory B=$GONIO_BUILD DESTDIR=$root PREFIX=/opt/gonio LIBDIR=/opt/gonio/lib/here"
check "make install" $make install
for file in bin/gonio lib/here/libgonio.a lib/here/libgonio-eval.a lib/here/libgonio.so.1 lib/here/libgonio-eval.so.1 \
    lib/here/libgonio.so lib/here/libgonio-eval.so include/gonio/model.h include/gonio/export.h share/man/man1/gonio.1 \
    share/man/man1/gonio-fit.1 share/bash-completion/completions/gonio lib/udev/rules.d/60-gonio.rules; do
    [ -s "$root/opt/gonio/$file" ] || fail "$file is installed"
done
ldconfig=$(PATH=$PATH:/sbin:/usr/sbin command -v ldconfig)
before=$(ls "$root/opt/gonio/lib/here")
"$ldconfig" -n "$root/opt/gonio/lib/here" && [ "$before" = "$(ls "$root/opt/gonio/lib/here")" ]
ok $? "ldconfig finds the links that it would make"
"$root/opt/gonio/bin/gonio" --version | grep -qx 'gonio [0-9][0-9.]*'
ok $? "gonio --version"

# The README's example (examples.sh holds the two together), with libgonio-eval alone, from where pkg-config says.
printf 'theta_i,phi_i,theta_o,phi_o,r,g,b\n10,0,10,180,0.25,0.5,0.75\n30,0,30,90,0.25,0.5,0.75\n60,0,20,0,0.25,0.5,0.75\n' >"$work/samples.csv"
"$GONIO" fit "$work/samples.csv" -o "$work/mine.gonio" --method mba --level 2 --hold-out 0 >/dev/null 2>&1
ok $? "a model to open"
cp docs/examples/eval.c "$work/example.c"
printf 'r 0.25 /sr\ng 0.5 /sr\nb 0.75 /sr\n' >"$work/values"
export PKG_CONFIG_PATH="$root/opt/gonio/lib/here/pkgconfig" PKG_CONFIG_SYSROOT_DIR="$root"
flags=$(pkg-config --cflags --libs gonio-eval)
# shellcheck disable=SC2086
check "the README's example links with libgonio-eval" ${CC:-cc} -std=c17 -Wall -Wextra -Werror "$work/example.c" $flags -o "$work/example"
readelf -d "$work/example" | grep NEEDED | grep -q 'libgonio\.so'
[ $? -eq 1 ] && LD_LIBRARY_PATH="$root/opt/gonio/lib/here" "$work/example" "$work/mine.gonio" | cmp -s - "$work/values"
ok $? "and evaluates, without libgonio"
# shellcheck disable=SC2046
check "so does the static library" ${CC:-cc} -std=c17 "$work/example.c" $(pkg-config --cflags gonio-eval) -Wl,-Bstatic -lgonio-eval -Wl,-Bdynamic -L"$root/opt/gonio/lib/here" -lm -o "$work/static"
"$work/static" "$work/mine.gonio" | cmp -s - "$work/values"
ok $? "and evaluates"
pkg-config --static --libs gonio | grep -q -- '-lgonio .*-lgonio-eval.*' && pkg-config --static --libs gonio | grep -q -- -lopencv_core
ok $? "pkg-config --static names what the static library needs"
unset PKG_CONFIG_SYSROOT_DIR

check "make uninstall" $make uninstall
[ -z "$(find "$root" ! -type d)" ]
ok $? "leaves nothing: $(find "$root" ! -type d | head -n 3)"
finish
