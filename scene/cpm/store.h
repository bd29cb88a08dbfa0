// SPDX-License-Identifier: BSD-3-Clause
// The map's file, and the parts that it grows from. Little-endian, as the machines are that Gonio runs on.
#ifndef GONIO_SCENE_CPM_STORE_H
#define GONIO_SCENE_CPM_STORE_H

#include "gonio/cpm.h"
#include "scene/cpm/texel.h"

#define CPM_PART 64 // texels of one part
#define CPM_VERSION 2

typedef struct cpm_head {
    char magic[8];
    uint32_t version, resolution, levels, side;
    uint64_t most_points;           // of any texel
    uint64_t fingerprint;           // of the scene and of the options that change the map
    uint64_t scene;                 // of the scene alone
    uint64_t surface, table, bytes; // offsets and the file's length
    uint64_t checksum;              // of this head (with 0 here), the surface and the table
    gonio_cpm_facts facts;
} cpm_head;

typedef struct cpm_entry {
    uint64_t offset, checksum; // of a record; offset 0: there is none
} cpm_entry;

// Of the levels before it, the finest first.
size_t gonio_cpm_level_start(int resolution, int level);
int gonio_cpm_levels(int resolution);

// A part: records (NULL: none) of up to CPM_PART texels. false: it is not there, or not whole.
bool gonio_cpm_part_read(const char *folder, int level, uint32_t first, uint64_t fingerprint, size_t n,
                         cpm_record **records);
gonio_status gonio_cpm_part_write(const char *folder, int level, uint32_t first, uint64_t fingerprint, size_t n,
                                  cpm_record *const *records, gonio_error *error);
// What the build took so far, in a file of its own, since no two builds take the same; 0 where there is none.
void gonio_cpm_seconds_read(const char *folder, cpm_seconds *seconds);
gonio_status gonio_cpm_seconds_write(const char *folder, const cpm_seconds *seconds, gonio_error *error);
void gonio_cpm_seconds_tell(const char *folder, gonio_cpm_facts *facts);
// Holds the folder against other builds until the descriptor is closed, and removes what a killed one left
// half-written. -1: another build is at work there (errno EWOULDBLOCK), or the folder cannot be opened.
int gonio_cpm_folder_hold(const char *folder);
// All parts become the map, and vanish.
gonio_status gonio_cpm_store_join(const char *folder, cpm_head *head, const cpm_surface *surface, gonio_error *error);

typedef struct cpm_store {
    const unsigned char *data; // mapped
    size_t size;
    cpm_head head;
    cpm_surface *surface;
    const cpm_entry *entries;
} cpm_store;
// GONIO_E_INPUT for damage. The caller releases it.
gonio_status gonio_cpm_store_open(const char *folder, cpm_store *store, gonio_error *error);
void gonio_cpm_store_release(cpm_store *store);
// The record of a texel, held against its checksum; NULL: there is none, or (*damaged) it is not sound.
const cpm_record *gonio_cpm_store_record(const cpm_store *store, int level, uint32_t texel, bool *damaged);

#endif
