// SPDX-License-Identifier: BSD-3-Clause
// SHA-256, by libcrypto.
#include <errno.h>
#include <openssl/evp.h>
#include <stdio.h>
#include <string.h>

#include "host/session/internal.h"

static void to_hex(const unsigned char *digest, char hex[GONIO_SHA256_HEX]) {
    static const char digits[] = "0123456789abcdef"; // the journal's chain has some hundred thousand of them
    for (int i = 0; i < 32; i++) {
        hex[2 * i] = digits[digest[i] >> 4];
        hex[2 * i + 1] = digits[digest[i] & 15];
    }
    hex[64] = 0;
}

gonio_status gonio_session_hash_begin(EVP_MD_CTX **context, gonio_error *error) {
    *context = EVP_MD_CTX_new();
    if (*context == NULL || EVP_DigestInit_ex(*context, EVP_sha256(), NULL) != 1) {
        EVP_MD_CTX_free(*context);
        return gonio_fail(error, GONIO_E_FAILED, "libcrypto gives no SHA-256");
    }
    return GONIO_OK;
}

void gonio_session_hash_end(EVP_MD_CTX *context, char hex[GONIO_SHA256_HEX]) {
    unsigned char digest[EVP_MAX_MD_SIZE];
    unsigned size;
    EVP_DigestFinal_ex(context, digest, &size);
    EVP_MD_CTX_free(context);
    to_hex(digest, hex);
}

gonio_status gonio_sha256(const void *data, size_t size, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    EVP_MD_CTX *context;
    const gonio_status status = gonio_session_hash_begin(&context, error);
    if (status == GONIO_OK) {
        EVP_DigestUpdate(context, data, size);
        gonio_session_hash_end(context, hex);
    }
    return status;
}

gonio_status gonio_sha256_file(const char *path, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(errno));
    }
    EVP_MD_CTX *context;
    gonio_status status = gonio_session_hash_begin(&context, error);
    if (status == GONIO_OK) {
        unsigned char buffer[65536];
        size_t got;
        while ((got = fread(buffer, 1, sizeof buffer, file)) > 0) {
            EVP_DigestUpdate(context, buffer, got);
        }
        gonio_session_hash_end(context, hex);
        if (ferror(file)) {
            status = gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot read it: %s", strerror(errno));
        }
    }
    fclose(file);
    return status;
}
