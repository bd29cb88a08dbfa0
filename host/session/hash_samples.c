// SPDX-License-Identifier: BSD-3-Clause
// SHA-256 of the CSV that a sample set writes.
#include <openssl/evp.h>
#include <stdio.h>

#include "gonio/io.h"
#include "host/session/internal.h"

static ssize_t update(void *context, const char *data, size_t size) {
    return EVP_DigestUpdate(context, data, size) == 1 ? (ssize_t)size : 0;
}

// The CSV goes through the hash as it is written: sets of millions of samples need no buffer.
gonio_status gonio_sha256_samples(const gonio_samples *samples, char hex[GONIO_SHA256_HEX], gonio_error *error) {
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
