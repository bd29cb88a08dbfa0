// Building the minimal perfect hash: libcmph, algorithm BDZ.
#include <cmph.h>
#include <stdlib.h>

#include "fit/bilevel/bilevel.h"

gonio_status gonio_bilevel_hash(const uint32_t *keys, size_t n, void **packed, size_t *length, gonio_error *error) {
    *packed = NULL;
    // libcmph reads the keys only, through a struct vector: 4 bytes at offset 0.
    cmph_io_adapter_t *source =
        cmph_io_struct_vector_adapter((void *)(uintptr_t)keys, sizeof *keys, 0, sizeof *keys, (cmph_uint32)n);
    cmph_config_t *config = source != NULL ? cmph_config_new(source) : NULL;
    cmph_t *hash = NULL;
    if (config != NULL) {
        cmph_config_set_algo(config, CMPH_BDZ);
        // libcmph draws its seeds from rand(): the same keys must give the same file.
        srand(1);
        hash = cmph_new(config);
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
