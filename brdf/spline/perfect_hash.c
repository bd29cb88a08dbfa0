// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/spline/perfect_hash.h"

#include <string.h>

// Bob Jenkins, "Hash functions" (Dr Dobb's Journal, 1997): the mixing step of lookup2. Called once a 4-byte key.
static void mix(uint32_t v[3]) {
    uint32_t a = v[0], b = v[1], c = v[2];
    a = (a - b - c) ^ (c >> 13);
    b = (b - c - a) ^ (a << 8);
    c = (c - a - b) ^ (b >> 13);
    a = (a - b - c) ^ (c >> 12);
    b = (b - c - a) ^ (a << 16);
    c = (c - a - b) ^ (b >> 5);
    a = (a - b - c) ^ (c >> 3);
    b = (b - c - a) ^ (a << 10);
    c = (c - a - b) ^ (b >> 15);
    v[0] = a;
    v[1] = b;
    v[2] = c;
}

#define GOLDEN_RATIO 0x9e3779b9u // lookup2's arbitrary start
#define KEY_BYTES 4

static unsigned value(const unsigned char *bits, uint32_t vertex) { return bits[vertex >> 2] >> (vertex & 3) * 2 & 3; }

#define UNUSED 3u

// Vertices in use among the four of a byte: both bits set means unused.
static uint32_t used(unsigned byte) { return 4 - (uint32_t)__builtin_popcount(byte & byte >> 1 & 0x55); }

uint32_t gonio_perfect_hash_search(const gonio_perfect_hash *hash, uint32_t key) {
    uint32_t h[3] = {GOLDEN_RATIO + key, GOLDEN_RATIO, hash->seed + KEY_BYTES};
    mix(h);
    for (uint32_t k = 0; k < 3; k++) {
        h[k] = h[k] % hash->third + k * hash->third;
    }
    const unsigned char *bits = hash->bits;
    const uint32_t vertex = h[(value(bits, h[0]) + value(bits, h[1]) + value(bits, h[2])) % 3];
    const uint32_t block = vertex >> hash->shift;
    uint32_t rank = hash->ranks[block], byte = (block << hash->shift) >> 2;
    while (byte < vertex >> 2) {
        rank += used(bits[byte++]);
    }
    for (uint32_t v = byte << 2; v < vertex; v++) {
        rank += value(bits, v) != UNUSED;
    }
    return rank;
}

bool gonio_perfect_hash_unpack(const void *packed, size_t length, gonio_perfect_hash *hash) {
    // u32 algorithm, hash function, seed, third, ranks_count; u32 ranks[]; u8 shift; u8 bits[].
    enum { BDZ = 5, JENKINS = 0, HEAD = 20 };
    uint32_t head[5];
    if (length < HEAD) {
        return false;
    }
    memcpy(head, packed, HEAD);
    const unsigned char *base = packed;
    const size_t ranks = (size_t)head[4] * 4;
    if (head[0] != BDZ || head[1] != JENKINS || head[3] == 0 || head[3] > UINT32_MAX / 3 - 4 ||
        length - HEAD < ranks + 1) {
        return false;
    }
    *hash = (gonio_perfect_hash){.seed = head[2],
                                 .third = head[3],
                                 .ranks_count = head[4],
                                 .ranks = (const uint32_t *)(const void *)(base + HEAD),
                                 .shift = base[HEAD + ranks],
                                 .bits = base + HEAD + ranks + 1};
    hash->bits_length = length - HEAD - ranks - 1;
    const uint32_t vertices = 3 * hash->third;
    return hash->shift >= 2 && hash->shift < 32 && hash->bits_length >= (vertices + 3) / 4 &&
           (uint64_t)hash->ranks_count << hash->shift >= vertices;
}
