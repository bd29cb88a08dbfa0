// SPDX-License-Identifier: BSD-3-Clause
// Looking keys up in a minimal perfect hash that libcmph built (algorithm BDZ, Jenkins' hash), without libcmph.
//
// Botelho, Pagh and Ziviani, "Simple and space-efficient minimal perfect hash functions" (WADS 2007). Three hashes name
// three vertices, one in each third of the table; the sum of their 2-bit values modulo 3 tells which one belongs to the
// key; the key's number is how many vertices before it are in use, from a table of partial counts.
#ifndef GONIO_BRDF_SPLINE_PERFECT_HASH_H
#define GONIO_BRDF_SPLINE_PERFECT_HASH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct gonio_perfect_hash {
    uint32_t seed;
    uint32_t third; // vertices a third of the table
    uint32_t shift; // one rank entry for 2^shift vertices
    uint32_t ranks_count;
    const uint32_t *ranks;     // borrowed
    const unsigned char *bits; // borrowed: 2 bits a vertex, 3 where it is not in use
    size_t bits_length;
} gonio_perfect_hash;

// The number of a key in [0, keys); any number below 3 x third for what is not a key.
uint32_t gonio_perfect_hash_search(const gonio_perfect_hash *hash, uint32_t key);
// Read the layout of cmph_pack's block (length bytes at packed, 4-aligned); false where it is not a sound BDZ block
// with Jenkins' hash. The result borrows from packed.
bool gonio_perfect_hash_unpack(const void *packed, size_t length, gonio_perfect_hash *hash);

#endif
