// SPDX-License-Identifier: BSD-3-Clause
// SHA-256, by libcrypto.
#include <errno.h>
#include <fcntl.h>
#include <openssl/evp.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

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

static gonio_status hash_all(int fd, const char *path, EVP_MD_CTX *context, gonio_error *error) {
    unsigned char buffer[65536];
    ssize_t got;
    while ((got = read(fd, buffer, sizeof buffer)) != 0) {
        if (got < 0 && errno != EINTR) {
            return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot read it: %s", strerror(errno));
        }
        EVP_DigestUpdate(context, buffer, got > 0 ? (size_t)got : 0);
    }
    return GONIO_OK;
}

// No model is as large; a file of holes can be of any size.
#define FILE_MAX ((int64_t)1 << 33)

// A path may come from a session: a pipe is not waited for, and a device, which has no end, is not read.
static gonio_status open_to_hash(const char *path, int *fd, gonio_error *error) {
    struct stat info;
    *fd = open(path, O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (*fd < 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(errno));
    }
    const bool plain = fstat(*fd, &info) == 0 && S_ISREG(info.st_mode);
    if (plain && info.st_size <= FILE_MAX) {
        return GONIO_OK;
    }
    close(*fd);
    if (plain) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "found %lld bytes, expected at most %lld",
                               (long long)info.st_size, (long long)FILE_MAX);
    }
    return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "found a folder, a pipe or a device, expected a file");
}

gonio_status gonio_sha256_file(const char *path, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    int fd;
    gonio_status status = open_to_hash(path, &fd, error);
    if (status != GONIO_OK) {
        return status;
    }
    EVP_MD_CTX *context;
    status = gonio_session_hash_begin(&context, error);
    if (status == GONIO_OK) {
        status = hash_all(fd, path, context, error);
        gonio_session_hash_end(context, hex);
    }
    close(fd);
    return status;
}
