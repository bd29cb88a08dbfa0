// SPDX-License-Identifier: BSD-3-Clause
// What the kinds of model share of their files' form: writing head, names and the parts of a section; taking the parts
// back, one by one, from a mapped file.
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "brdf/model_file.h"

gonio_checksum gonio_model_file_checksum(const gonio_model_file_head *head) {
    gonio_checksum sum = gonio_checksum_begin();
    gonio_model_file_head copy = *head;
    copy.checksum = 0;
    gonio_checksum_add(&sum, &copy, sizeof copy);
    return sum;
}

static size_t aligned(size_t length) {
    return (length + GONIO_MODEL_FILE_ALIGN - 1) / GONIO_MODEL_FILE_ALIGN * GONIO_MODEL_FILE_ALIGN;
}

void gonio_mapped_release(gonio_mapped *mapped) {
    void *base = (void *)(uintptr_t)mapped->base;
    if (mapped->origin == GONIO_MAPPED_COPY) {
        free(base);
    } else if (mapped->origin == GONIO_MAPPED_FILE && base != NULL) {
        munmap(base, mapped->length);
    }
    free(mapped->path);
    *mapped = (gonio_mapped){0};
}

const void *gonio_mapped_take(const gonio_mapped *mapped, size_t *offset, size_t length) {
    if (*offset > mapped->section_length || length > mapped->section_length - *offset) {
        return NULL;
    }
    const void *data = mapped->section + *offset;
    *offset = aligned(*offset + length);
    return data;
}

#define EPS_MAX 1e6 // a channel's noise is a part of its largest value, which is about 1 in these units

bool gonio_scales_possible(const double *pairs, size_t n, bool uses_eps) {
    bool possible = true;
    for (size_t i = 0; i < n; i++) {
        const double scale = pairs[2 * i], eps = pairs[2 * i + 1];
        int exponent;
        possible = possible && isfinite(scale) && frexp(scale, &exponent) == 0.5 && eps >= 0 && eps <= EPS_MAX &&
                   (eps > 0 || !uses_eps);
    }
    return possible;
}

gonio_status gonio_mapped_fail(const gonio_mapped *mapped, size_t section_offset, const char *what,
                               gonio_error *error) {
    const size_t at = (size_t)(mapped->section - (const unsigned char *)mapped->base) + section_offset;
    return gonio_fail_byte(error, GONIO_E_INPUT, mapped->path, (long long)at, "%s", what);
}

static const unsigned char zeros[GONIO_MODEL_FILE_ALIGN];

static void write_part(FILE *stream, const gonio_file_part *part) {
    if (part->length > 0) {
        fwrite(part->data, 1, part->length, stream);
    }
    fwrite(zeros, 1, aligned(part->length) - part->length, stream);
}

// Its own head, then the text. The caller frees part->data.
static gonio_status about_part(const gonio_model *model, gonio_file_part *part, gonio_error *error) {
    const gonio_model_file_about head = {.length = model->about != NULL ? strlen(model->about) : 0};
    if (head.length == 0) {
        return GONIO_OK;
    }
    unsigned char *data = malloc(sizeof head + head.length);
    if (data == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what is known of a model");
    }
    memcpy(data, &head, sizeof head);
    memcpy(data, GONIO_MODEL_FILE_ABOUT, sizeof head.magic);
    memcpy(data + sizeof head, model->about, head.length);
    *part = (gonio_file_part){data, sizeof head + head.length};
    return GONIO_OK;
}

static gonio_model_file_head make_head(const gonio_model *model, const gonio_file_part *names,
                                       const gonio_file_part *about, const gonio_file_part *parts, int n) {
    gonio_model_file_head h = {.version = GONIO_MODEL_FILE_VERSION,
                               .order = GONIO_MODEL_FILE_ORDER,
                               .channels = (uint32_t)model->channels,
                               .flags = model->isotropic ? GONIO_MODEL_FILE_ISOTROPIC : 0};
    memcpy(h.magic, GONIO_MODEL_FILE_MAGIC, sizeof h.magic);
    strncpy(h.kind, model->ops->kind, sizeof h.kind - 1);
    h.section = sizeof h + aligned(names->length) + aligned(about->length);
    h.length = h.section;
    for (int i = 0; i < n; i++) {
        h.length += aligned(parts[i].length);
    }
    // A part that ends inside a block of 64 is summed with zeros up to the block's end, as it is written.
    gonio_checksum sum = gonio_model_file_checksum(&h);
    gonio_checksum_add(&sum, names->data, names->length);
    if (about->length > 0) {
        gonio_checksum_add(&sum, about->data, about->length);
    }
    for (int i = 0; i < n; i++) {
        gonio_checksum_add(&sum, parts[i].data, parts[i].length);
    }
    sum.length = h.length;
    h.checksum = gonio_checksum_end(&sum);
    return h;
}

gonio_status gonio_model_file_write(const gonio_model *model, FILE *stream, const gonio_file_part *parts, int n,
                                    gonio_error *error) {
    const gonio_file_part names = {model->channel_names, 32 * (size_t)model->channels};
    gonio_file_part about = {0};
    const gonio_status status = about_part(model, &about, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_model_file_head h = make_head(model, &names, &about, parts, n);
    fwrite(&h, 1, sizeof h, stream);
    write_part(stream, &names);
    write_part(stream, &about);
    free((void *)(uintptr_t)about.data);
    for (int i = 0; i < n; i++) {
        write_part(stream, &parts[i]);
    }
    return !ferror(stream) ? GONIO_OK : gonio_fail(error, GONIO_E_IO, "cannot write a model: %s", strerror(errno));
}

gonio_status gonio_model_file_bytes(const gonio_model *model, gonio_file_part *bytes, gonio_error *error) {
    *bytes = (gonio_file_part){0};
    if (model->ops->save == NULL) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "the model inside, of kind '%s', has no file form",
                          model->ops->kind);
    }
    char *data = NULL;
    FILE *stream = open_memstream(&data, &bytes->length);
    gonio_status status = stream != NULL ? model->ops->save(model, stream, error)
                                         : gonio_fail(error, GONIO_E_MEMORY, "no memory to write a model");
    if (stream != NULL && fclose(stream) != 0 && status == GONIO_OK) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to write a model");
    }
    if (status != GONIO_OK) {
        free(data);
        *bytes = (gonio_file_part){0};
        return status;
    }
    bytes->data = data;
    return GONIO_OK;
}
