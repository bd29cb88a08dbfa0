// SPDX-License-Identifier: BSD-3-Clause
// What the session's work costs, timed at the libraries that do it; and frames that are stored without compression.
#include <jansson.h>
#include <openssl/evp.h>
#include <sqlite3.h>
#include <stdbool.h>
#include <time.h>
#include <unistd.h>
#include <zlib.h>

#include "tests/durability/next.h"

static int64_t now_ns(clockid_t clock) {
    struct timespec now;
    clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static int64_t begin(void) { return now_ns(CLOCK_THREAD_CPUTIME_ID); }

static void end(int timer, int64_t begun) {
    if (shim_memory != NULL) {
        __atomic_fetch_add(&shim_memory->timers_ns[timer], now_ns(CLOCK_THREAD_CPUTIME_ID) - begun, __ATOMIC_RELAXED);
    }
}

typedef int (*update_fn)(EVP_MD_CTX *context, const void *data, size_t size);
int EVP_DigestUpdate(EVP_MD_CTX *context, const void *data, size_t size) {
    NEXT(update_fn, next, "EVP_DigestUpdate")
    const int64_t begun = begin();
    const int result = next(context, data, size);
    end(SHIM_T_HASH, begun);
    return result;
}

typedef int (*final_fn)(EVP_MD_CTX *context, unsigned char *digest, unsigned *size);
int EVP_DigestFinal_ex(EVP_MD_CTX *context, unsigned char *digest, unsigned *size) {
    NEXT(final_fn, next, "EVP_DigestFinal_ex")
    const int64_t begun = begin();
    const int result = next(context, digest, size);
    end(SHIM_T_HASH, begun);
    return result;
}

typedef int (*step_fn)(sqlite3_stmt *statement);
int sqlite3_step(sqlite3_stmt *statement) {
    NEXT(step_fn, next, "sqlite3_step")
    const char *sql = sqlite3_sql(statement);
    const bool chain = sql != NULL && (strstr(sql, "chain") != NULL || strstr(sql, "touched") != NULL);
    const int64_t begun = begin();
    const int result = next(statement);
    end(chain ? SHIM_T_CHAIN : SHIM_T_JOURNAL, begun);
    return result;
}

typedef int (*dump_fn)(const json_t *json, FILE *output, size_t flags);
int json_dumpf(const json_t *json, FILE *output, size_t flags) { // a line of the log
    NEXT(dump_fn, next, "json_dumpf")
    const int64_t begun = begin();
    const int result = next(json, output, flags);
    end(SHIM_T_CHAIN, begun);
    return result;
}

typedef int (*deflate_fn)(z_streamp stream, int flush);
int deflate(z_streamp stream, int flush) {
    NEXT(deflate_fn, next, "deflate")
    const int64_t begun = begin();
    const int result = next(stream, flush);
    end(SHIM_T_COMPRESS, begun);
    return result;
}

typedef int (*sync_fn)(int fd);
static int timed_sync(sync_fn next, int fd) {
    const int64_t begun = now_ns(CLOCK_MONOTONIC);
    const int result = next(fd);
    if (shim_memory != NULL) {
        __atomic_fetch_add(&shim_memory->timers_ns[SHIM_T_SYNC], now_ns(CLOCK_MONOTONIC) - begun, __ATOMIC_RELAXED);
    }
    return result;
}
int fsync(int fd) {
    NEXT(sync_fn, next, "fsync")
    return timed_sync(next, fd);
}
int fdatasync(int fd) {
    NEXT(sync_fn, next, "fdatasync")
    return timed_sync(next, fd);
}

typedef int (*level_fn)(z_streamp stream, int level, int method, int bits, int memory, int strategy,
                        const char *version, int size);
int deflateInit2_(z_streamp stream, int level, int method, int bits, int memory, int strategy, const char *version,
                  int size) {
    NEXT(level_fn, next, "deflateInit2_")
    const bool plain = shim_memory != NULL && shim_memory->order.plain;
    return next(stream, plain ? 0 : level, method, bits, memory, strategy, version, size);
}
