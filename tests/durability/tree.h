// SPDX-License-Identifier: BSD-3-Clause
// Folders of sessions: copy, remove, and the list of every file in them with what it holds.
#ifndef GONIO_TESTS_DURABILITY_TREE_H
#define GONIO_TESTS_DURABILITY_TREE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// A random number generator of its own state; the same seed, the same numbers.
uint32_t tree_random(uint64_t *state);
uint32_t tree_below(uint64_t *state, uint32_t n); // 0..n-1
bool tree_chance(uint64_t *state, uint32_t one_in);

void tree_remove(const char *path);
void tree_copy(const char *from, const char *to);      // ends the program where it fails: a disk of the harness is full
void tree_copy_live(const char *from, const char *to); // while somebody writes there: what vanishes is left out
typedef struct tree_bytes {
    unsigned char *data;
    size_t size;
} tree_bytes;
tree_bytes tree_read(const char *path); // data NULL: there is none
void tree_write(const char *path, const void *data, size_t size);
uint64_t tree_hash(const void *data, size_t size);

// A 16-bit grey picture's pixels as a hash; 0 where the bytes are no whole picture.
uint64_t tree_pixels(const tree_bytes *file);
typedef struct tree_file {
    char *path; // relative to the folder
    uint64_t inode, content, pixels;
    size_t size;
} tree_file;
typedef struct tree_list {
    tree_file *files;
    size_t n;
} tree_list;
tree_list tree_files(const char *folder);
void tree_files_free(tree_list *list);
bool tree_has_pixels(const tree_list *list, uint64_t pixels);
// How many whole pictures of before are not there any more: the same file with the same pixels, wherever it is now.
// by_pixels: the file may be another one. The first one's path is put into lost.
size_t tree_lost(const tree_list *before, const tree_list *after, bool by_pixels, char *lost, size_t room);
// Files of before, of any kind, whose content is nowhere any more.
size_t tree_content_lost(const tree_list *before, const tree_list *after, char *lost, size_t room);

#endif
