// SPDX-License-Identifier: BSD-3-Clause
// Building Jenkins' perfect hash (brdf/spline/perfect_hash.h): buckets by size, the fullest first, each with the first
// of 256 moves that takes all of its keys to free slots. Where a bucket finds none, or holds two keys of one slot, all
// begins anew with another salt; with two keys a bucket and 12 slots for 11 keys about every third salt is good.
#include <stdlib.h>
#include <string.h>

#include "fit/bilevel/bilevel.h"

#define SALTS 256
#define BUCKET_MAX 32 // keys; a fuller bucket takes another salt

typedef struct building {
    gonio_jenkins_hash hash;
    const uint32_t *keys;
    size_t n;
    uint32_t *slot;   // [n], before they are moved
    uint32_t *bucket; // [n]
    uint32_t *begin;  // [buckets + 1], of members
    uint32_t *member; // [n]: keys by bucket
    bool *taken;      // [slots]
    unsigned char *moves;
} building;

static size_t sort_keys(building *b) {
    const size_t buckets = b->hash.buckets;
    size_t largest = 0;
    memset(b->begin, 0, (buckets + 1) * sizeof *b->begin);
    for (size_t i = 0; i < b->n; i++) {
        b->bucket[i] = gonio_jenkins_bucket(&b->hash, b->keys[i], &b->slot[i]);
        b->begin[b->bucket[i] + 1]++;
    }
    for (size_t k = 0; k < buckets; k++) {
        largest = b->begin[k + 1] > largest ? b->begin[k + 1] : largest;
        b->begin[k + 1] += b->begin[k];
    }
    for (size_t i = b->n; i-- > 0;) {
        b->member[--b->begin[b->bucket[i] + 1]] = (uint32_t)i;
    }
    // begin[k + 1] is now where bucket k begins.
    memmove(b->begin, b->begin + 1, buckets * sizeof *b->begin);
    b->begin[buckets] = (uint32_t)b->n;
    return largest;
}

// Take the slots of a bucket under this move; false, and nothing is taken, where one of them is not free.
static bool take_slots(building *b, const uint32_t *members, size_t count, uint32_t move) {
    for (size_t k = 0; k < count; k++) {
        const uint32_t at = gonio_jenkins_moved(&b->hash, b->slot[members[k]], move);
        if (b->taken[at]) {
            for (size_t back = 0; back < k; back++) {
                b->taken[gonio_jenkins_moved(&b->hash, b->slot[members[back]], move)] = false;
            }
            return false;
        }
        b->taken[at] = true;
    }
    return true;
}

static bool place_bucket(building *b, size_t bucket) {
    const uint32_t *members = b->member + b->begin[bucket];
    for (uint32_t move = 0; move < 256; move++) {
        if (take_slots(b, members, b->begin[bucket + 1] - b->begin[bucket], move)) {
            b->moves[bucket] = (unsigned char)move;
            return true;
        }
    }
    return false;
}

static bool place_all(building *b) {
    const size_t largest = sort_keys(b);
    bool good = largest <= BUCKET_MAX;
    memset(b->taken, 0, b->hash.slots * sizeof *b->taken);
    memset(b->moves, 0, b->hash.buckets);
    for (size_t size = largest; good && size > 0; size--) {
        for (size_t k = 0; good && k < b->hash.buckets; k++) {
            good = b->begin[k + 1] - b->begin[k] != size || place_bucket(b, k);
        }
    }
    return good;
}

gonio_status gonio_bilevel_jenkins(const uint32_t *keys, size_t n, gonio_jenkins_hash *hash, unsigned char **moves,
                                   gonio_error *error) {
    if (n > GONIO_JENKINS_SLOTS_MAX / 12 * 11) {
        *moves = NULL;
        return gonio_fail(error, GONIO_E_RANGE, "%zu control points; Jenkins' table holds %u", n,
                          GONIO_JENKINS_SLOTS_MAX / 12 * 11);
    }
    building b = {
        .hash = {.slots = (uint32_t)(n + n / 11 + 1), .buckets = (uint32_t)(n / 2 + 1)}, .keys = keys, .n = n};
    b.slot = malloc((n + 1) * sizeof *b.slot);
    b.bucket = malloc((n + 1) * sizeof *b.bucket);
    b.begin = malloc(((size_t)b.hash.buckets + 1) * sizeof *b.begin);
    b.member = malloc((n + 1) * sizeof *b.member);
    b.taken = malloc(b.hash.slots * sizeof *b.taken);
    *moves = b.moves = malloc(b.hash.buckets);
    gonio_status status = GONIO_OK;
    if (b.slot == NULL || b.bucket == NULL || b.begin == NULL || b.member == NULL || b.taken == NULL ||
        b.moves == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a hash of %zu keys", n);
    }
    bool good = false;
    for (uint32_t salt = 0; status == GONIO_OK && !good && salt < SALTS; salt++) {
        b.hash.salt = salt * 0x632be5abu;
        good = place_all(&b);
    }
    if (status == GONIO_OK && !good) {
        status = gonio_fail(error, GONIO_E_FAILED, "no perfect hash of %zu keys by Jenkins' table", n);
    }
    free(b.slot);
    free(b.bucket);
    free(b.begin);
    free(b.member);
    free(b.taken);
    if (status != GONIO_OK) {
        free(b.moves);
        *moves = NULL;
    }
    b.hash.moves = *moves;
    *hash = b.hash;
    return status;
}
