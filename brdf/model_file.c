// SPDX-License-Identifier: BSD-3-Clause
// Opening model files.
//
//   0   char[8]  "GONIOMDL"
//   8   u32      version, 1
//   12  u32      0x01020304 as the writer stored it: tells the byte order
//   16  char[16] kind, zero-filled
//   32  u32      channels
//   36  u32      flags: bit 0 isotropic
//   40  u64      length of the file
//   48  u64      offset of the section, a multiple of 64
//   56  u64      checksum of all bytes from 64 on, seeded with those of the head before it
//   64  char[32] a channel: its name, terminated
//
// Behind the names, from a multiple of 64 on, there may stand char[8] "GONIOABT", u64 length and a text of that length:
// what the model was made of. Readers that know nothing of it skip it, as the section's offset tells them.
//
// The file is mapped read-only and its arrays are used where they lie, so opening costs one pass for the checksum, or
// none, and nothing is copied.
#include "brdf/model_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "brdf/kind.h"
#include "gonio/sample.h"

#define MEMORY "(memory)" // in place of a path in messages
#define ABOUT_MAX ((size_t)4 << 20)

// begin: where the model file begins within the whole one, for messages.
static gonio_status check_head(const gonio_model_file_head *h, const char *path, size_t begin, size_t length,
                               gonio_error *error) {
    const long long at = (long long)begin;
    if (length < sizeof *h || memcmp(h->magic, GONIO_MODEL_FILE_MAGIC, sizeof h->magic) != 0) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, at,
                               "not a Gonio model file: it does not begin with GONIOMDL");
    }
    if (h->order != GONIO_MODEL_FILE_ORDER) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, at + 12, "byte-order mark 0x%08x; 0x%08x was expected",
                               h->order, GONIO_MODEL_FILE_ORDER);
    }
    if (h->version != GONIO_MODEL_FILE_VERSION) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, at + 8,
                               "model file version %u; this program reads version %d", h->version,
                               GONIO_MODEL_FILE_VERSION);
    }
    if (h->length != length) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, at + 40,
                               "the file has %zu bytes; its head says %llu: truncated?", length,
                               (unsigned long long)h->length);
    }
    if (h->channels < 1 || h->channels > GONIO_CHANNELS_MAX) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, at + 32, "%u channels; 1 to %d are possible", h->channels,
                               GONIO_CHANNELS_MAX);
    }
    if (h->section % GONIO_MODEL_FILE_ALIGN != 0 || h->section > length || h->section < sizeof *h + 32 * h->channels) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, at + 48, "section offset %llu in a file of %zu bytes",
                               (unsigned long long)h->section, length);
    }
    return GONIO_OK;
}

static gonio_status check_sum(const gonio_model_file_head *h, const unsigned char *base, const char *path,
                              gonio_error *error) {
    gonio_checksum sum = gonio_model_file_checksum(h);
    gonio_checksum_add(&sum, base + sizeof *h, (size_t)h->length - sizeof *h);
    // Fuzzing would never get past it (tests/fuzz); everything behind it must hold without.
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
    const bool damaged = false;
#else
    const bool damaged = gonio_checksum_end(&sum) != h->checksum;
#endif
    return !damaged ? GONIO_OK
                    : gonio_fail_byte(error, GONIO_E_INPUT, path, 56, "checksum mismatch: the file is damaged");
}

// A name goes to terminals: no control characters, those beyond ASCII in UTF-8 among them.
static bool has_control(const unsigned char *name) {
    bool found = false;
    for (; *name != 0; name++) {
        found |= *name < 0x20 || *name == 0x7f || (*name == 0xc2 && name[1] >= 0x80 && name[1] < 0xa0);
    }
    return found;
}

// base: of the whole file.
static gonio_status check_names(const gonio_model_file_head *h, const unsigned char *base, size_t begin,
                                const char *path, gonio_error *error) {
    for (uint32_t c = 0; c < h->channels; c++) {
        const size_t at = begin + sizeof *h + 32 * (size_t)c;
        if (memchr(base + at, 0, 32) == NULL) {
            return gonio_fail_byte(error, GONIO_E_INPUT, path, (long long)at, "channel %u: its name has no end", c);
        }
        if (has_control(base + at)) {
            return gonio_fail_byte(error, GONIO_E_INPUT, path, (long long)at,
                                   "channel %u: its name has a control character", c);
        }
    }
    return GONIO_OK;
}

// The text before the section, which the caller frees; NULL: there is none. base: of the whole file.
static gonio_status read_about(const gonio_model_file_head *h, const unsigned char *base, size_t begin,
                               const char *path, char **about, gonio_error *error) {
    const size_t align = GONIO_MODEL_FILE_ALIGN, names = sizeof *h + 32 * (size_t)h->channels;
    const size_t at = begin + (names + align - 1) / align * align, section = begin + (size_t)h->section;
    gonio_model_file_about head;
    *about = NULL;
    if (section <= at || section - at < sizeof head) {
        return GONIO_OK;
    }
    memcpy(&head, base + at, sizeof head);
    if (memcmp(head.magic, GONIO_MODEL_FILE_ABOUT, sizeof head.magic) != 0) {
        return GONIO_OK; // of a later version
    }
    const char *text = (const char *)base + at + sizeof head;
    if (head.length > section - at - sizeof head || memchr(text, 0, (size_t)head.length) != NULL ||
        head.length > ABOUT_MAX) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, (long long)at + 8,
                               "what it was made of: a text of %llu bytes was expected before the section",
                               (unsigned long long)head.length);
    }
    *about = strndup(text, (size_t)head.length);
    if (*about == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to open %s", path);
    }
    for (unsigned char *c = (unsigned char *)*about; *c != 0; c++) {
        *c = (*c < 0x20 && *c != '\n') || *c == 0x7f ? ' ' : *c; // it goes to terminals
    }
    return GONIO_OK;
}

static gonio_status map_file(const char *path, bool whole, gonio_mapped *mapped, gonio_error *error) {
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    struct stat info;
    if (fd < 0 || fstat(fd, &info) != 0) {
        const int why = errno;
        if (fd >= 0) {
            close(fd);
        }
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot open it: %s", strerror(why));
    }
    if (!S_ISREG(info.st_mode) || info.st_size < (off_t)sizeof(gonio_model_file_head)) {
        close(fd);
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 0, "not a Gonio model file: %lld bytes",
                               (long long)info.st_size);
    }
    mapped->length = (size_t)info.st_size;
    void *base = mmap(NULL, mapped->length, PROT_READ, MAP_PRIVATE | (whole ? MAP_POPULATE : 0), fd, 0);
    const int why = errno;
    close(fd);
    if (base == MAP_FAILED) {
        return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot map it: %s", strerror(why));
    }
    mapped->base = base;
    mapped->path = strdup(path);
    return mapped->path != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to open %s", path);
}

static gonio_status open_part(const gonio_mapped *mapped, size_t offset, size_t length, gonio_model **out,
                              gonio_error *error);

// The model file of `length` bytes that begins at byte `begin` of the mapped one. whole: its checksum too.
static gonio_status read_mapped(gonio_mapped *mapped, size_t begin, size_t length, bool whole, gonio_model **out,
                                gonio_error *error) {
    const unsigned char *base = mapped->base;
    const char *path = mapped->path;
    gonio_model_file_head h;
    memcpy(&h, base + begin, sizeof h);
    gonio_status status = check_head(&h, path, begin, length, error);
    if (status == GONIO_OK && whole) {
        status = check_sum(&h, base + begin, path, error);
    }
    if (status == GONIO_OK) {
        status = check_names(&h, base, begin, path, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    mapped->names = (const char(*)[32])(base + begin + sizeof h);
    mapped->section = base + begin + h.section;
    mapped->section_length = length - (size_t)h.section;
    mapped->channels = (int)h.channels;
    mapped->isotropic = (h.flags & GONIO_MODEL_FILE_ISOTROPIC) != 0;
    mapped->open_part = open_part;
    const gonio_kind *kind = memchr(h.kind, 0, sizeof h.kind) != NULL ? gonio_kind_find(h.kind) : NULL;
    if (kind == NULL) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, (long long)begin + 16, "a model of the unknown kind '%.16s'",
                               h.kind);
    }
    char *about = NULL;
    status = read_about(&h, base, begin, path, &about, error);
    status = status == GONIO_OK ? kind->read(mapped, out, error) : status;
    if (status != GONIO_OK) {
        free(about);
        return status;
    }
    (*out)->about = about;
    return GONIO_OK;
}

static gonio_status open_part(const gonio_mapped *mapped, size_t offset, size_t length, gonio_model **out,
                              gonio_error *error) {
    *out = NULL;
    if (offset % GONIO_MODEL_FILE_ALIGN != 0 || length < sizeof(gonio_model_file_head) ||
        offset > mapped->section_length || length > mapped->section_length - offset) {
        return gonio_mapped_fail(mapped, 0, "a model that reaches beyond the file", error);
    }
    if (mapped->depth >= GONIO_MODEL_FILE_DEPTH) { // a hostile file may hold thousands
        return gonio_mapped_fail(mapped, offset, "more models inside each other than 8", error);
    }
    gonio_mapped part = {
        .base = mapped->base, .length = mapped->length, .origin = GONIO_MAPPED_BORROWED, .depth = mapped->depth + 1};
    part.path = strdup(mapped->path);
    if (part.path == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to open a model");
    }
    const size_t begin = (size_t)(mapped->section - (const unsigned char *)mapped->base) + offset;
    const gonio_status status = read_mapped(&part, begin, length, false, out, error);
    if (status != GONIO_OK) {
        gonio_mapped_release(&part);
    }
    return status;
}

static gonio_status open_file(const char *path, bool whole, gonio_model **out, gonio_error *error) {
    *out = NULL;
    gonio_mapped mapped = {0};
    gonio_status status = map_file(path, whole, &mapped, error);
    if (status == GONIO_OK) {
        status = read_mapped(&mapped, 0, mapped.length, whole, out, error);
    }
    if (status != GONIO_OK) {
        gonio_mapped_release(&mapped);
    }
    return status;
}

gonio_status gonio_model_open(const char *path, gonio_model **out, gonio_error *error) {
    return open_file(path, true, out, error);
}

gonio_status gonio_model_map(const char *path, gonio_model **out, gonio_error *error) {
    return open_file(path, false, out, error);
}

// The bytes where they lie, or a copy where they do not lie as the arrays in them must.
static gonio_status place(const void *data, size_t length, gonio_mapped *mapped, gonio_error *error) {
    if (length < sizeof(gonio_model_file_head)) {
        return gonio_fail_byte(error, GONIO_E_INPUT, MEMORY, 0, "not a Gonio model file: %zu bytes", length);
    }
    mapped->base = data;
    mapped->length = length;
    mapped->origin = GONIO_MAPPED_BORROWED;
    if ((uintptr_t)data % GONIO_MODEL_FILE_ALIGN != 0) {
        // aligned_alloc wants a multiple of the alignment.
        const size_t whole = (length + GONIO_MODEL_FILE_ALIGN - 1) / GONIO_MODEL_FILE_ALIGN * GONIO_MODEL_FILE_ALIGN;
        void *copy = length <= SIZE_MAX / 2 ? aligned_alloc(GONIO_MODEL_FILE_ALIGN, whole) : NULL;
        mapped->base = copy;
        mapped->origin = GONIO_MAPPED_COPY;
        if (copy == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a copy of %zu bytes", length);
        }
        memcpy(copy, data, length);
    }
    mapped->path = strdup(MEMORY);
    return mapped->path != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to open a model");
}

gonio_status gonio_model_open_memory(const void *data, size_t length, gonio_model **out, gonio_error *error) {
    *out = NULL;
    gonio_mapped mapped = {0};
    gonio_status status = place(data, length, &mapped, error);
    if (status == GONIO_OK) {
        status = read_mapped(&mapped, 0, length, true, out, error);
    }
    if (status != GONIO_OK) {
        gonio_mapped_release(&mapped);
    }
    return status;
}
