// SPDX-License-Identifier: BSD-3-Clause
// The model file: a head, the channels' names, and one section that the kind of model defines (docs/formats.md).
#ifndef GONIO_BRDF_MODEL_FILE_H
#define GONIO_BRDF_MODEL_FILE_H

#include "brdf/checksum.h"
#include "gonio/model.h"

#define GONIO_MODEL_FILE_MAGIC "GONIOMDL" // its 8 letters
#define GONIO_MODEL_FILE_VERSION 1
#define GONIO_MODEL_FILE_ORDER 0x01020304u
#define GONIO_MODEL_FILE_ISOTROPIC 1u // flags
#define GONIO_MODEL_FILE_ALIGN 64     // sections and the arrays inside them begin at multiples of it
#define GONIO_MODEL_FILE_DEPTH 7      // models inside one another, below the outermost
#define GONIO_MODEL_FILE_ABOUT "GONIOABT"

// As it stands in a file (brdf/model_file.c).
typedef struct gonio_model_file_head {
    char magic[8];
    uint32_t version, order;
    char kind[16];
    uint32_t channels, flags;
    uint64_t length, section, checksum;
} gonio_model_file_head;
_Static_assert(sizeof(gonio_model_file_head) == 64, "the head of a model file is 64 bytes");

// Behind the names, at a multiple of 64 bytes, and before the section there may stand what the model was made of: this,
// then `length` bytes of text, then zeros up to the section. A reader that does not know it skips it.
typedef struct gonio_model_file_about {
    char magic[8];
    uint64_t length;
} gonio_model_file_about;

// The sum to which everything behind the head is added; begun with the head, its own checksum taken as 0.
gonio_checksum gonio_model_file_checksum(const gonio_model_file_head *head);

// A model file in memory whose length and checksum were verified; a model made from it keeps it until it is freed.
typedef struct gonio_mapped {
    const void *base;
    size_t length;
    char *path;                   // for messages of the kind that parses it; owned
    const char (*names)[32];      // inside the mapping, terminated
    const unsigned char *section; // aligned
    size_t section_length;
    int channels;
    bool isotropic;
    uint8_t origin; // of base: GONIO_MAPPED_*
    int depth; // how many models' sections the file lies in; up to GONIO_MODEL_FILE_DEPTH
    // For kinds that hold other models: the one whose file begins at `offset` of the section, a multiple of
    // GONIO_MODEL_FILE_ALIGN, and is `length` bytes long, without its checksum. It borrows from the file, which must
    // outlive it. A pointer, since opening knows the kinds and the kinds do not know it.
    gonio_status (*open_part)(const struct gonio_mapped *mapped, size_t offset, size_t length, gonio_model **out,
                              gonio_error *error);
} gonio_mapped;
enum { GONIO_MAPPED_FILE, GONIO_MAPPED_COPY, GONIO_MAPPED_BORROWED };

void gonio_mapped_release(gonio_mapped *mapped);

// One part of a section: `length` bytes at `data`. Every part begins aligned; zeros fill the gaps.
typedef struct gonio_file_part {
    const void *data;
    size_t length;
} gonio_file_part;

// Write head, names and the parts of the section.
gonio_status gonio_model_file_write(const gonio_model *model, FILE *stream, const gonio_file_part *parts, int n,
                                    gonio_error *error);
// The bytes of the model's own file, to stand inside another; the caller frees bytes->data, which is NULL on failure.
gonio_status gonio_model_file_bytes(const gonio_model *model, gonio_file_part *bytes, gonio_error *error);

// Cursor over a section: the next `length` bytes, aligned, or NULL where the section is too short.
const void *gonio_mapped_take(const gonio_mapped *mapped, size_t *offset, size_t length);
// Are n pairs (scale, eps) what a fit can have made: scales powers of two, eps in units of the scale, above 0 where the
// domain uses it?
bool gonio_scales_possible(const double *pairs, size_t n, bool uses_eps);
// GONIO_E_INPUT that names the file and the byte within it.
gonio_status gonio_mapped_fail(const gonio_mapped *mapped, size_t section_offset, const char *what, gonio_error *error);

#endif
