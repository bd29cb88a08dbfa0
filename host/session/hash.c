// SHA-256, by libcrypto.
#include <errno.h>
#include <openssl/evp.h>
#include <stdio.h>
#include <string.h>

#include "gonio/io.h"
#include "gonio/session.h"

static void to_hex(const unsigned char *digest, char hex[GONIO_SHA256_HEX]) {
    for (int i = 0; i < 32; i++) {
        snprintf(hex + 2 * i, 3, "%02x", digest[i]);
    }
}

static gonio_status begin(EVP_MD_CTX **context, gonio_error *error) {
    *context = EVP_MD_CTX_new();
    if (*context == NULL || EVP_DigestInit_ex(*context, EVP_sha256(), NULL) != 1) {
        EVP_MD_CTX_free(*context);
        return gonio_fail(error, GONIO_E_FAILED, "libcrypto gives no SHA-256");
    }
    return GONIO_OK;
}

static void end(EVP_MD_CTX *context, char hex[GONIO_SHA256_HEX]) {
    unsigned char digest[EVP_MAX_MD_SIZE];
    unsigned size;
    EVP_DigestFinal_ex(context, digest, &size);
    EVP_MD_CTX_free(context);
    to_hex(digest, hex);
}

gonio_status gonio_sha256(const void *data, size_t size, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    EVP_MD_CTX *context;
    const gonio_status status = begin(&context, error);
    if (status == GONIO_OK) {
        EVP_DigestUpdate(context, data, size);
        end(context, hex);
    }
    return status;
}

gonio_status gonio_sha256_file(const char *path, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(errno));
    }
    EVP_MD_CTX *context;
    gonio_status status = begin(&context, error);
    if (status == GONIO_OK) {
        unsigned char buffer[65536];
        size_t got;
        while ((got = fread(buffer, 1, sizeof buffer, file)) > 0) {
            EVP_DigestUpdate(context, buffer, got);
        }
        end(context, hex);
        if (ferror(file)) {
            status = gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot read it: %s", strerror(errno));
        }
    }
    fclose(file);
    return status;
}

static ssize_t update(void *context, const char *data, size_t size) {
    return EVP_DigestUpdate(context, data, size) == 1 ? (ssize_t)size : 0;
}

// The CSV goes through the hash as it is written: sets of millions of samples need no buffer.
gonio_status gonio_sha256_samples(const gonio_samples *samples, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    EVP_MD_CTX *context;
    gonio_status status = begin(&context, error);
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
    end(context, hex);
    return status;
}
