#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The controller as its hosts see it: the Linux process and the emulated boards, through pymodbus, libmodbus and mbpoll.
python=/usr/bin/python3 # Debian's, which has Debian's pymodbus
if ! $python -c 'import pymodbus, serial' 2>/dev/null; then
    echo "ok 1 - controller # SKIP python3-pymodbus is not installed"
    exit 0
fi
if ! "$GONIO_BUILD/firmware/tools/protocol" 2>/dev/null | cmp -s - docs/protocol.md; then
    echo "not ok - docs/protocol.md is not what firmware/regmap.def says: make protocol"
fi
if command -v arm-none-eabi-gcc >/dev/null && ! make --no-print-directory firmware "$GONIO_BUILD/tests/board/pico" B="$GONIO_BUILD" >&2; then
    echo "not ok - the firmware of every board is built"
fi
exec $python "$(dirname "$0")/firmware.py" "$GONIO_BUILD"
