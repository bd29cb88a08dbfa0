// SPDX-License-Identifier: BSD-3-Clause
// What the harness and the library that it preloads into the program agree on: memory that both see, and the records of
// a trace.
//
// The preloaded program does not run at once: it waits with all its libraries loaded and forks for every command, so
// that a run costs what the verb costs and not what loading 160 libraries costs. In the fork a seccomp filter sends
// every system call on files to a handler, whoever makes it: SQLite, stdio, libpng or Gonio itself.
#ifndef GONIO_TESTS_DURABILITY_SHIM_H
#define GONIO_TESTS_DURABILITY_SHIM_H

#include <stdint.h>
#include <sys/resource.h>

// Kinds of system calls, for what an order is about.
enum {
    SHIM_OPEN = 1,      // of a file that is there
    SHIM_CREATE = 2,    // an open that may make one
    SHIM_READ = 4,      // also of a folder's list
    SHIM_WRITE = 8,     //
    SHIM_TRUNCATE = 16, //
    SHIM_SYNC = 32,     // fsync, fdatasync, sync_file_range
    SHIM_NAME = 64,     // mkdir, rmdir, rename, link, symlink, unlink
    SHIM_CLOSE = 128,   //
    SHIM_LOCK = 256,    // flock
    SHIM_LOOK = 512,    // stat, access
    SHIM_MAP = 1024,    // mmap of a file to write
    SHIM_CHANGES = SHIM_CREATE | SHIM_WRITE | SHIM_TRUNCATE | SHIM_SYNC | SHIM_NAME,
    SHIM_ALL = 2047
};

enum shim_mode { SHIM_OFF, SHIM_PASS, SHIM_TRACE, SHIM_FAIL, SHIM_KILL };
// What is timed: hashing, the chain of hashes and its log, the journal's other statements, compressing frames (seconds
// of a processor); waiting for the disk (of the wall clock).
enum shim_timer { SHIM_T_HASH, SHIM_T_CHAIN, SHIM_T_JOURNAL, SHIM_T_COMPRESS, SHIM_T_SYNC, SHIM_TIMERS };
enum shim_part { SHIM_BEFORE, SHIM_WITHIN, SHIM_AFTER }; // when the process dies; within: half of a write is done

enum { SHIM_PATH = 1024, SHIM_ARGUMENTS = 48, SHIM_TEXT = 8192, SHIM_NAME_MAX = 256 };

// What is to happen in one run.
typedef struct shim_order {
    int mode, part;
    int error;         // FAIL: the errno; 0: a short transfer
    unsigned kinds;    // of the calls that count, SHIM_* above
    int64_t at, times; // FAIL: the calls at..at+times-1 of these kinds fail; KILL: at
    uint64_t random;
    int plain;        // zlib stores and does not compress: frames as a burst writes them
    int64_t clock_at; // the wall clock jumps at this change; 0: never
    int64_t clock_jump_s;
    char watched[SHIM_PATH]; // a folder; calls elsewhere never count
    char trace[SHIM_PATH];   // a file
} shim_order;

typedef struct shim_shared {
    shim_order order;
    // The command.
    int argc;
    unsigned arguments[SHIM_ARGUMENTS]; // offsets into text
    char text[SHIM_TEXT];
    char out[SHIM_PATH], err[SHIM_PATH], folder[SHIM_PATH]; // folder: to run in
    int64_t memory_bytes;                                   // limit of the address space; 0: none
    // What came of it.
    int64_t calls; // of the order's kinds
    int64_t hits;  // calls that failed, were cut short, or were the process' last
    char hit[SHIM_PATH + 64];
    int64_t timers_ns[SHIM_TIMERS];
    struct rusage usage;
} shim_shared;

// The environment of a waiting program: the file of the shared memory, and the descriptors of requests and replies.
#define SHIM_ENVIRONMENT "GONIO_DURABILITY"
// Replies: a pid_t when the command has begun, an int, as waitpid tells it, at its end.

// A record of the trace; name, name2 and data follow it, the names with their ends.
enum shim_record_kind {
    SHIM_R_MAKE,     // inode was made; in folder under name, unless name is empty
    SHIM_R_DATA,     // inode has data at offset
    SHIM_R_SIZE,     // inode has the size offset
    SHIM_R_SYNC,     // inode's content, or a folder's names, are on the disk
    SHIM_R_LINK,     // folder has inode under name
    SHIM_R_UNLINK,   // folder has nothing under name any more
    SHIM_R_RENAME,   // folder's name is folder2's name2; what stood there is gone
    SHIM_R_EXCHANGE, // both change places
    SHIM_R_MAPPED,   // inode is written to through memory, unseen
    SHIM_R_SYNC_ALL  // sync, syncfs
};

typedef struct shim_record {
    uint32_t size; // with all that follows
    uint16_t kind;
    uint16_t is_folder; // MAKE: a folder was made
    uint16_t name_size, name2_size;
    uint32_t data_size;
    uint64_t inode, folder, folder2;
    int64_t offset;
} shim_record;

#endif
