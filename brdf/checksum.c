// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/checksum.h"

#include <string.h>

#define CHECKSUM_FACTOR 0x9e3779b97f4a7c15u // 2^64 / golden ratio, odd

gonio_checksum gonio_checksum_begin(void) { return (gonio_checksum){.lane = {1, 2, 3, 4, 5, 6, 7, 8}}; }

static void checksum_blocks(gonio_checksum *sum, const unsigned char *data, size_t blocks) {
    uint64_t lane[8];
    memcpy(lane, sum->lane, sizeof lane);
    for (; blocks > 0; blocks--, data += 64) {
        for (int i = 0; i < 8; i++) {
            uint64_t word;
            memcpy(&word, data + 8 * i, 8);
            const uint64_t x = (lane[i] ^ word) * CHECKSUM_FACTOR;
            lane[i] = x ^ x >> 32;
        }
    }
    memcpy(sum->lane, lane, sizeof lane);
}

void gonio_checksum_add(gonio_checksum *sum, const void *data, size_t length) {
    checksum_blocks(sum, data, length / 64);
    const size_t rest = length % 64;
    if (rest > 0) {
        unsigned char block[64] = {0};
        memcpy(block, (const unsigned char *)data + (length - rest), rest);
        checksum_blocks(sum, block, 1);
    }
    sum->length += length;
}

uint64_t gonio_checksum_end(const gonio_checksum *sum) {
    uint64_t result = sum->length;
    for (int i = 0; i < 8; i++) {
        result = (result ^ sum->lane[i]) * CHECKSUM_FACTOR;
        result ^= result >> 29;
    }
    return result;
}
