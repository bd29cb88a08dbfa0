// SPDX-License-Identifier: BSD-3-Clause
// The disk after a power cut: from a folder as it was, a trace of what was done to it (shim.h), and the number of
// operations that were done when power went.
//
// Strict: what POSIX promises and no more. A file's unsynced writes are there or not, in any order, torn at 512 bytes;
// a name that was made, renamed or removed is so on the disk where its folder was synced afterwards, else by chance. A
// rename is done or not as a whole.
//
// Ordered: as ext4 with data=ordered. Names and sizes reach the disk in the order in which they were changed; an fsync
// takes all that came before the file's last change with it. Unsynced data that make a file longer arrive from the
// front, page by page, and the size follows them.
#ifndef GONIO_TESTS_DURABILITY_CUTS_H
#define GONIO_TESTS_DURABILITY_CUTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct disk disk;

disk *disk_load(const char *folder); // all that is there is on the disk; before the trace begins
bool disk_trace(disk *d, const char *trace);
size_t disk_operations(const disk *d);
// Which operation, in words.
void disk_tell(const disk *d, size_t operation, char *text, size_t room);
// The number of operations done up to the last that synced a file whose name begins so, out of the first n.
size_t disk_synced(const disk *d, size_t n, const char *name);
enum { CUT_STRICT, CUT_ORDERED, CUT_NOTHING }; // NOTHING: no power cut, all that was done is there
// Make the folder, which must not exist, as the disk is after the first n operations.
void disk_build(disk *d, size_t n, int model, uint64_t seed, const char *folder);
void disk_free(disk *d);

#endif
