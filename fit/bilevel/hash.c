// SPDX-License-Identifier: BSD-3-Clause
// Building the minimal perfect hash: libcmph, algorithm BDZ.
//
// libcmph draws its seeds from rand(), and the same keys must give the same file. So rand() gets a state of its own
// while a hash is built, and its caller's state afterwards: what a program that uses rand() draws before and after is
// as if no hash had been built. A thread that draws at that very moment would still draw from the wrong state and
// change the seeds; the hash is right with any.
#include <cmph.h>
#include <pthread.h>
#include <stdlib.h>

#include "fit/bilevel/bilevel.h"

static cmph_t *build(cmph_config_t *config) {
    static pthread_mutex_t one_at_a_time = PTHREAD_MUTEX_INITIALIZER;
    char state[128]; // the size that srand's own sequence has
    pthread_mutex_lock(&one_at_a_time);
    char *before = initstate(1, state, sizeof state);
    cmph_t *hash = cmph_new(config);
    setstate(before);
    pthread_mutex_unlock(&one_at_a_time);
    return hash;
}

gonio_status gonio_bilevel_hash(const uint32_t *keys, size_t n, void **packed, size_t *length, gonio_error *error) {
    *packed = NULL;
    // libcmph reads the keys only, through a struct vector: 4 bytes at offset 0.
    cmph_io_adapter_t *source =
        cmph_io_struct_vector_adapter((void *)(uintptr_t)keys, sizeof *keys, 0, sizeof *keys, (cmph_uint32)n);
    cmph_config_t *config = source != NULL ? cmph_config_new(source) : NULL;
    cmph_t *hash = NULL;
    if (config != NULL) {
        cmph_config_set_algo(config, CMPH_BDZ);
        hash = build(config);
    }
    if (hash != NULL) {
        *length = cmph_packed_size(hash);
        *packed = calloc(1, *length);
        if (*packed != NULL) {
            cmph_pack(hash, *packed);
        }
        cmph_destroy(hash);
    }
    if (config != NULL) {
        cmph_config_destroy(config);
    }
    if (source != NULL) {
        cmph_io_struct_vector_adapter_destroy(source);
    }
    return *packed != NULL ? GONIO_OK
                           : gonio_fail(error, GONIO_E_FAILED, "libcmph finds no perfect hash of %zu keys", n);
}
