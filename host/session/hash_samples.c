// SPDX-License-Identifier: BSD-3-Clause
// SHA-256 of the CSV that a sample set writes.
#include <openssl/evp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"
#include "gonio/io.h"
#include "host/session/internal.h"

static ssize_t update(void *context, const char *data, size_t size) {
    return EVP_DigestUpdate(context, data, size) == 1 ? (ssize_t)size : 0;
}

// The CSV goes through the hash as it is written: sets of millions of samples need no buffer.
static gonio_status hash(const gonio_samples *samples, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    EVP_MD_CTX *context;
    gonio_status status = gonio_session_hash_begin(&context, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = fopencookie(context, "w", (cookie_io_functions_t){.write = update});
    if (stream == NULL) {
        EVP_MD_CTX_free(context);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a stream");
    }
    status = gonio_write_samples_stream(samples, stream, error);
    if (fclose(stream) != 0 && status == GONIO_OK) {
        status = gonio_fail(error, GONIO_E_FAILED, "cannot hash the samples");
    }
    gonio_session_hash_end(context, hex);
    return status;
}

// Equal measures have equal samples, on whichever instrument and day.
static gonio_status drop_instrument(const char *head, char **kept, gonio_error *error) {
    static const char *const dropped[] = {"instrument", "serials", "date"};
    char key[GONIO_HEAD_KEY_MAX], value[4096];
    gonio_status status = GONIO_OK;
    *kept = NULL;
    for (const char *at = head; status == GONIO_OK && gonio_head_next(&at, key, value, sizeof value);) {
        bool keep = true;
        for (size_t k = 0; k < sizeof dropped / sizeof *dropped; k++) {
            keep = keep && strcmp(key, dropped[k]) != 0;
        }
        status = keep ? gonio_head_add(kept, key, value, error) : GONIO_OK;
    }
    return status;
}

gonio_status gonio_sha256_samples(const gonio_samples *samples, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    gonio_samples plain = *samples; // borrows the arrays
    gonio_status status = drop_instrument(samples->head, &plain.head, error);
    status = status == GONIO_OK ? hash(&plain, hex, error) : status;
    free(plain.head);
    return status;
}

bool gonio_sha256_samples_is(const gonio_samples *samples, const char *expected) {
    char hex[GONIO_SHA256_HEX];
    gonio_samples plain = *samples;
    plain.head = NULL;
    return (gonio_sha256_samples(samples, hex, NULL) == GONIO_OK && strcmp(hex, expected) == 0) ||
           (hash(&plain, hex, NULL) == GONIO_OK && strcmp(hex, expected) == 0);
}
