#!/bin/busybox sh
# SPDX-License-Identifier: BSD-3-Clause
# First process of the test machine: everything it needs is in memory. Its results go to the second serial line.
export PATH=/tests:/bin:/sbin:/usr/bin HOME=/tmp TMPDIR=/tmp LANG=C
/bin/busybox --install -s /bin
mkdir -p /proc /sys /dev /tmp /run
mount -t proc p /proc
mount -t sysfs s /sys
mount -t devtmpfs d /dev
mkdir -p /dev/pts /dev/shm
mount -t devpts p /dev/pts
mount -t tmpfs t /dev/shm
stty -F /dev/ttyS1 raw
sh /tests/guest.sh >/dev/ttyS1 2>&1
echo finished >/dev/ttyS1
poweroff -f
