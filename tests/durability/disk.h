// SPDX-License-Identifier: BSD-3-Clause
// Inside of cuts.h: files and names as numbered nodes, and the operations on them.
#ifndef GONIO_TESTS_DURABILITY_DISK_H
#define GONIO_TESTS_DURABILITY_DISK_H

#include "tests/durability/cuts.h"
#include "tests/durability/shim.h"
#include "tests/durability/tree.h"

// A file or a folder for as long as it lives: the kernel gives a number again, we do not.
typedef struct node {
    uint64_t inode;
    bool is_folder, mapped;
    size_t size;      // while the trace is read
    tree_bytes begun; // what it held before the trace
} node;

typedef struct entry {
    int folder, node;
    const char *name;
} entry;

typedef struct space {
    entry *entries;
    size_t n, room;
} space;

typedef struct operation {
    int kind;            // SHIM_R_*
    int node;            // that is made, written, synced, linked; that is removed; that moves
    int other;           // EXCHANGE: that comes in return
    int folder, folder2; // -1: none
    const char *name, *name2;
    const unsigned char *data;
    size_t size;
    int64_t offset;
    bool grows; // DATA beyond the end; SIZE that cuts nothing off
} operation;

struct disk {
    node *nodes;
    int n_nodes;
    space begun, now; // names before the trace; and while it is read
    operation *operations;
    size_t n;
    tree_bytes trace;
    char *names; // of begun
};

int space_find(const space *s, int folder, const char *name); // -1: nothing
void space_put(space *s, int folder, const char *name, int node);
void space_drop(space *s, int folder, const char *name, int node); // where it is this node
space space_copy(const space *s);
void space_do(space *s, const operation *o); // an operation on names

static inline bool is_name(const operation *o) {
    return o->kind == SHIM_R_MAKE || o->kind == SHIM_R_LINK || o->kind == SHIM_R_UNLINK || o->kind == SHIM_R_RENAME ||
           o->kind == SHIM_R_EXCHANGE;
}
static inline bool is_content(const operation *o) { return o->kind == SHIM_R_DATA || o->kind == SHIM_R_SIZE; }

#endif
