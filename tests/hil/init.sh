#!/bin/busybox sh
# First process of the test machine: mount the host's files read-only, run the guest's part, switch off.
export PATH=/bin:/sbin:/usr/bin:/usr/sbin
/bin/busybox --install -s /bin
mount -t proc p /proc
mount -t sysfs s /sys
mount -t devtmpfs d /dev
for module in /modules/*; do insmod "$module"; done
mount -t 9p -o ro,cache=loose,trans=virtio,version=9p2000.L,msize=524288 root /root || poweroff -f
cd /root
for folder in tmp run mnt; do mount -t tmpfs t $folder; done
for folder in dev proc sys; do mount --bind /$folder $folder; done
mount -t tmpfs t dev/shm 2>/dev/null
vm=$(sed 's/.*gonio=\([^ ]*\).*/\1/' /proc/cmdline)
port=$(ls /dev/vport*p1)
chroot . /bin/sh "$vm/guest" >"$port" 2>&1 </dev/null
sync
poweroff -f
