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

// Jenkins' form of a perfect hash with one table (Czech, Havas and Majewski 1997 review them; Kameya 2002, 2.4.3): a
// key hashes to a place and to a bucket, and the table says, a byte a bucket, how far all of the bucket's keys are
// moved. He combines both by an exclusive or, which needs tables of 2^n places; here they are added modulo their
// number, so that any number will do. A look-up reads one byte, which costs a fraction of BDZ's three reads and its
// rank.
typedef struct gonio_jenkins_hash {
    uint32_t slots, buckets, salt; // slots: at least as many as keys
    const unsigned char *moves;    // [buckets], borrowed
} gonio_jenkins_hash;

// The bucket of a key, and the slot that it has before it is moved.
static inline uint32_t gonio_jenkins_bucket(const gonio_jenkins_hash *h, uint32_t key, uint32_t *slot) {
    uint32_t x = (key ^ h->salt) * 0x9e3779b1u;
    x = (x ^ x >> 16) * 0x85ebca6bu;
    x ^= x >> 15;
    *slot = (uint32_t)((uint64_t)(x * 0xc2b2ae35u) * h->slots >> 32);
    return (uint32_t)((uint64_t)x * h->buckets >> 32);
}

// Moves of 0 to 255 lie evenly over the slots, of which there are fewer than 2^24.
#define GONIO_JENKINS_SLOTS_MAX 0xffffffu
static inline uint32_t gonio_jenkins_moved(const gonio_jenkins_hash *h, uint32_t slot, uint32_t move) {
    const uint32_t at = slot + (move * h->slots >> 8);
    return at >= h->slots ? at - h->slots : at;
}

// The slot of a key; any slot for what is not a key.
static inline uint32_t gonio_jenkins_search(const gonio_jenkins_hash *h, uint32_t key) {
    uint32_t slot;
    const uint32_t bucket = gonio_jenkins_bucket(h, key, &slot);
    return gonio_jenkins_moved(h, slot, h->moves[bucket]);
}

#endif
