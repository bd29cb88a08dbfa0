// SPDX-License-Identifier: BSD-3-Clause
// The file of a learned prior (docs/formats.md): a head of 128 bytes, the models' names, then the arrays.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "brdf/checksum.h"
#include "fit/library/library.h"
#include "gonio/output.h"

#define MAGIC "GONIOPRI"
#define VERSION 1
#define ORDER 0x01020304u
#define FILE_MAX ((size_t)1 << 30)

typedef struct head {
    char magic[8];
    uint32_t version, order;
    uint64_t length, checksum;
    uint32_t level, rank, models, columns;
    double eps, explained, inflation, limit, trial_error;
    unsigned char rest[40];
} head;
_Static_assert(sizeof(head) == 128, "the head of a prior's file is 128 bytes");

static size_t array_count(const gonio_library *l) { return l->grid.count * (size_t)(3 + l->rank); }

static size_t length_of(const gonio_library *l) {
    return sizeof(head) + (size_t)l->facts.models * LIBRARY_NAME_MAX + array_count(l) * sizeof(float);
}

static uint64_t sum_of(head h, const void *names, size_t names_length, const float *arrays, size_t count) {
    gonio_checksum sum = gonio_checksum_begin();
    h.checksum = 0;
    gonio_checksum_add(&sum, &h, sizeof h);
    gonio_checksum_add(&sum, names, names_length);
    gonio_checksum_add(&sum, arrays, count * sizeof *arrays);
    return gonio_checksum_end(&sum);
}

gonio_status gonio_library_save(const gonio_library *l, const char *path, gonio_error *error) {
    const size_t count = array_count(l), names = (size_t)l->facts.models * LIBRARY_NAME_MAX;
    float *arrays = malloc(count * sizeof *arrays);
    if (arrays == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a prior's file");
    }
    for (size_t k = 0; k < count; k++) {
        arrays[k] = (float)l->mean[k];
    }
    head h = {.magic = MAGIC,
              .version = VERSION,
              .order = ORDER,
              .length = length_of(l),
              .level = LIBRARY_LEVEL,
              .rank = (uint32_t)l->rank,
              .models = (uint32_t)l->facts.models,
              .columns = (uint32_t)l->facts.columns,
              .eps = LIBRARY_EPS,
              .explained = l->facts.explained,
              .inflation = l->facts.inflation,
              .limit = l->facts.limit,
              .trial_error = l->facts.trial_error};
    memcpy(h.magic, MAGIC, sizeof h.magic);
    h.checksum = sum_of(h, l->names, names, arrays, count);
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status == GONIO_OK) {
        FILE *stream = gonio_output_stream(output);
        fwrite(&h, sizeof h, 1, stream);
        fwrite(l->names, 1, names, stream);
        fwrite(arrays, sizeof *arrays, count, stream);
    }
    free(arrays);
    return status == GONIO_OK ? gonio_output_commit(output, error) : status;
}

static gonio_status check_head(const char *path, const head *h, size_t size, gonio_error *error) {
    if (size < sizeof *h || memcmp(h->magic, MAGIC, sizeof h->magic) != 0) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 0, "not a prior that `gonio learn` wrote: expected %s",
                               MAGIC);
    }
    if (h->version != VERSION || h->order != ORDER) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 8, "a prior of version %u; this program reads version %d",
                               h->version, VERSION);
    }
    if (h->length != size) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 16, "found %zu bytes, expected %llu", size,
                               (unsigned long long)h->length);
    }
    if (h->level != LIBRARY_LEVEL || h->rank < 1 || h->rank > LIBRARY_RANK_MAX || h->models < 1 ||
        h->models > 1000000 || h->eps != LIBRARY_EPS) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 32,
                               "found level %u, %u components of %u models; expected "
                               "level %d, 1 to %d components",
                               h->level, h->rank, h->models, LIBRARY_LEVEL, LIBRARY_RANK_MAX);
    }
    return isfinite(h->inflation) && h->inflation > 0 && isfinite(h->limit) && h->limit > 0
               ? GONIO_OK
               : gonio_fail_byte(error, GONIO_E_INPUT, path, 56,
                                 "its widening of sigma or its limit is no number above 0");
}

static gonio_status read_arrays(const char *path, const char *data, const head *h, gonio_library *l,
                                gonio_error *error) {
    const size_t names = (size_t)h->models * LIBRARY_NAME_MAX, count = array_count(l);
    const char *arrays = data + sizeof *h + names;
    if (h->length != length_of(l)) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 16, "found %llu bytes, expected %zu of so many components",
                               (unsigned long long)h->length, length_of(l));
    }
    float *values = malloc(count * sizeof *values);
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a prior");
    }
    memcpy(values, arrays, count * sizeof *values);
    gonio_status status = GONIO_OK;
    if (sum_of(*h, data + sizeof *h, names, values, count) != h->checksum) {
        status =
            gonio_fail_byte(error, GONIO_E_INPUT, path, 24, "its checksum is not that of its bytes: it is damaged");
    }
    for (size_t k = 0; k < count && status == GONIO_OK; k++) {
        l->mean[k] = (double)values[k];
    }
    free(values);
    memcpy(l->names, data + sizeof *h, names);
    for (uint32_t i = 0; i < h->models; i++) {
        l->names[i][LIBRARY_NAME_MAX - 1] = 0;
    }
    return status;
}

gonio_status gonio_library_open(const char *path, gonio_library **out, gonio_error *error) {
    char *data;
    size_t size;
    head h = {0};
    *out = NULL;
    gonio_status status = gonio_file_read(path, FILE_MAX, &data, &size, error);
    if (status != GONIO_OK) {
        return status;
    }
    memcpy(&h, data, size < sizeof h ? size : sizeof h);
    status = check_head(path, &h, size, error);
    // The names are counted before they get memory.
    if (status == GONIO_OK && (size - sizeof h) / LIBRARY_NAME_MAX < h.models) {
        status = gonio_fail_byte(error, GONIO_E_INPUT, path, 40, "no room for the names of %u models", h.models);
    }
    status = status == GONIO_OK ? gonio_library_new((int)h.rank, (int)h.models, out, error) : status;
    status = status == GONIO_OK ? read_arrays(path, data, &h, *out, error) : status;
    free(data);
    if (status != GONIO_OK) {
        gonio_library_free(*out);
        *out = NULL;
        return status;
    }
    gonio_library_facts *facts = &(*out)->facts;
    facts->columns = (int)h.columns;
    facts->explained = h.explained;
    facts->inflation = h.inflation;
    facts->limit = h.limit;
    facts->trial_error = h.trial_error;
    return GONIO_OK;
}
