// Reading and writing model files.
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

#include "gonio/output.h"
#include "gonio/sample.h"

// A new kind of model that can be saved is one line here.
static const struct {
    const char *kind;
    gonio_model_reader read;
} readers[] = {
    {"analytic", gonio_analytic_model_read},
    {"lattice", gonio_lattice_model_read},
    {"lobe-spline", gonio_lobe_spline_read},
    {"cbmba", gonio_bilevel_model_read},
};

typedef struct head {
    char magic[8];
    uint32_t version, order;
    char kind[16];
    uint32_t channels, flags;
    uint64_t length, section, checksum;
} head;
_Static_assert(sizeof(head) == 64, "the head of a model file is 64 bytes");

static const char magic[8] = {'G', 'O', 'N', 'I', 'O', 'M', 'D', 'L'};
#define BYTE_ORDER_MARK 0x01020304u
#define FLAG_ISOTROPIC 1u

// Eight independent multiply-and-rotate lanes of 64 bits, so that a core reads at memory speed; a changed bit changes
// its lane for good, since every step is a bijection of the lane. Detects damage, not malice.
typedef struct checksum {
    uint64_t lane[8];
    uint64_t length;
} checksum;

#define CHECKSUM_FACTOR 0x9e3779b97f4a7c15u // 2^64 / golden ratio, odd

static void checksum_blocks(checksum *sum, const unsigned char *data, size_t blocks) {
    uint64_t lane[8];
    memcpy(lane, sum->lane, sizeof lane);
    for (; blocks > 0; blocks--, data += 64) {
        for (int i = 0; i < 8; i++) {
            uint64_t word;
            memcpy(&word, data + 8 * i, 8);
            const uint64_t x = (lane[i] ^ word) * CHECKSUM_FACTOR;
            lane[i] = x ^ x >> 32;
        }
    }
    memcpy(sum->lane, lane, sizeof lane);
}

static void checksum_add(checksum *sum, const void *data, size_t length) {
    checksum_blocks(sum, data, length / 64);
    const size_t rest = length % 64;
    if (rest > 0) {
        unsigned char block[64] = {0};
        memcpy(block, (const unsigned char *)data + (length - rest), rest);
        checksum_blocks(sum, block, 1);
    }
    sum->length += length;
}

static uint64_t checksum_end(const checksum *sum) {
    uint64_t result = sum->length;
    for (int i = 0; i < 8; i++) {
        result = (result ^ sum->lane[i]) * CHECKSUM_FACTOR;
        result ^= result >> 29;
    }
    return result;
}

// Seeded with the head, its checksum field taken as 0.
static checksum checksum_begin(const head *h) {
    checksum sum = {.lane = {1, 2, 3, 4, 5, 6, 7, 8}};
    head copy = *h;
    copy.checksum = 0;
    checksum_add(&sum, &copy, sizeof copy);
    return sum;
}

static size_t aligned(size_t length) {
    return (length + GONIO_MODEL_FILE_ALIGN - 1) / GONIO_MODEL_FILE_ALIGN * GONIO_MODEL_FILE_ALIGN;
}

void gonio_mapped_release(gonio_mapped *mapped) {
    if (mapped->base != NULL) {
        munmap(mapped->base, mapped->length);
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

gonio_status gonio_mapped_fail(const gonio_mapped *mapped, size_t section_offset, const char *what,
                               gonio_error *error) {
    const size_t at = (size_t)(mapped->section - (const unsigned char *)mapped->base) + section_offset;
    return gonio_fail_byte(error, GONIO_E_INPUT, mapped->path, (long long)at, "%s", what);
}

static gonio_status check_head(const head *h, const char *path, size_t length, gonio_error *error) {
    if (length < sizeof *h || memcmp(h->magic, magic, sizeof magic) != 0) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 0,
                               "not a Gonio model file: it does not begin with GONIOMDL");
    }
    if (h->order != BYTE_ORDER_MARK) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 12, "byte-order mark 0x%08x; 0x%08x was expected", h->order,
                               BYTE_ORDER_MARK);
    }
    if (h->version != GONIO_MODEL_FILE_VERSION) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 8, "model file version %u; this program reads version %d",
                               h->version, GONIO_MODEL_FILE_VERSION);
    }
    if (h->length != length) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 40, "the file has %zu bytes; its head says %llu: truncated?",
                               length, (unsigned long long)h->length);
    }
    if (h->channels < 1 || h->channels > GONIO_CHANNELS_MAX) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 32, "%u channels; 1 to %d are possible", h->channels,
                               GONIO_CHANNELS_MAX);
    }
    if (h->section % GONIO_MODEL_FILE_ALIGN != 0 || h->section > length || h->section < sizeof *h + 32 * h->channels) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 48, "section offset %llu in a file of %zu bytes",
                               (unsigned long long)h->section, length);
    }
    return GONIO_OK;
}

static gonio_status check_sum(const head *h, const unsigned char *base, const char *path, gonio_error *error) {
    checksum sum = checksum_begin(h);
    checksum_add(&sum, base + sizeof *h, (size_t)h->length - sizeof *h);
    // Fuzzing would never get past it (tests/fuzz); everything behind it must hold without.
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
    const bool damaged = false;
#else
    const bool damaged = checksum_end(&sum) != h->checksum;
#endif
    return !damaged ? GONIO_OK
                    : gonio_fail_byte(error, GONIO_E_INPUT, path, 56, "checksum mismatch: the file is damaged");
}

static gonio_status check_names(const head *h, const unsigned char *base, const char *path, gonio_error *error) {
    for (uint32_t c = 0; c < h->channels; c++) {
        const size_t at = sizeof *h + 32 * (size_t)c;
        if (memchr(base + at, 0, 32) == NULL) {
            return gonio_fail_byte(error, GONIO_E_INPUT, path, (long long)at, "channel %u: its name has no end", c);
        }
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
    if (!S_ISREG(info.st_mode) || info.st_size < (off_t)sizeof(head)) {
        close(fd);
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 0, "not a Gonio model file: %lld bytes",
                               (long long)info.st_size);
    }
    mapped->length = (size_t)info.st_size;
    mapped->base = mmap(NULL, mapped->length, PROT_READ, MAP_PRIVATE | (whole ? MAP_POPULATE : 0), fd, 0);
    const int why = errno;
    close(fd);
    if (mapped->base == MAP_FAILED) {
        mapped->base = NULL;
        return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot map it: %s", strerror(why));
    }
    mapped->path = strdup(path);
    return mapped->path != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to open %s", path);
}

static gonio_status read_mapped(gonio_mapped *mapped, const char *path, bool whole, gonio_model **out,
                                gonio_error *error) {
    head h;
    memcpy(&h, mapped->base, sizeof h);
    gonio_status status = check_head(&h, path, mapped->length, error);
    if (status == GONIO_OK && whole) {
        status = check_sum(&h, mapped->base, path, error);
    }
    if (status == GONIO_OK) {
        status = check_names(&h, mapped->base, path, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    const unsigned char *base = mapped->base;
    mapped->names = (const char(*)[32])(base + sizeof h);
    mapped->section = base + h.section;
    mapped->section_length = mapped->length - (size_t)h.section;
    mapped->channels = (int)h.channels;
    mapped->isotropic = (h.flags & FLAG_ISOTROPIC) != 0;
    for (size_t i = 0; i < sizeof readers / sizeof *readers; i++) {
        if (strncmp(h.kind, readers[i].kind, sizeof h.kind) == 0) {
            return readers[i].read(mapped, out, error);
        }
    }
    return gonio_fail_byte(error, GONIO_E_INPUT, path, 16, "a model of the unknown kind '%.16s'", h.kind);
}

static gonio_status open_file(const char *path, bool whole, gonio_model **out, gonio_error *error) {
    *out = NULL;
    gonio_mapped mapped = {0};
    gonio_status status = map_file(path, whole, &mapped, error);
    if (status == GONIO_OK) {
        status = read_mapped(&mapped, path, whole, out, error);
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

static const unsigned char zeros[GONIO_MODEL_FILE_ALIGN];

static void write_part(FILE *stream, const gonio_file_part *part) {
    fwrite(part->data, 1, part->length, stream);
    fwrite(zeros, 1, aligned(part->length) - part->length, stream);
}

gonio_status gonio_model_file_write(const gonio_model *model, const char *path, const gonio_file_part *parts, int n,
                                    gonio_error *error) {
    head h = {.version = GONIO_MODEL_FILE_VERSION,
              .order = BYTE_ORDER_MARK,
              .channels = (uint32_t)model->channels,
              .flags = model->isotropic ? FLAG_ISOTROPIC : 0};
    memcpy(h.magic, magic, sizeof magic);
    strncpy(h.kind, model->ops->kind, sizeof h.kind - 1);
    const gonio_file_part names = {model->channel_names, 32 * (size_t)model->channels};
    h.section = sizeof h + aligned(names.length);
    h.length = h.section;
    for (int i = 0; i < n; i++) {
        h.length += aligned(parts[i].length);
    }
    // A part that ends inside a block of 64 is summed with zeros up to the block's end, as it is written.
    checksum sum = checksum_begin(&h);
    checksum_add(&sum, names.data, names.length);
    for (int i = 0; i < n; i++) {
        checksum_add(&sum, parts[i].data, parts[i].length);
    }
    sum.length = h.length;
    h.checksum = checksum_end(&sum);
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    fwrite(&h, 1, sizeof h, stream);
    write_part(stream, &names);
    for (int i = 0; i < n; i++) {
        write_part(stream, &parts[i]);
    }
    return gonio_output_commit(output, error);
}
