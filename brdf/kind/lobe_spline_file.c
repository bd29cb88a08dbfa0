// SPDX-License-Identifier: BSD-3-Clause
// The file section of models of kind "lobe-spline".
//
// Section: 64 bytes of description, the lobes' shapes, their strengths, the transforms, the control points, the sigma
// lattice's points, the channels' sigma factors, the terms and the support's points, each part aligned
// (brdf/model_file.h).
#include <math.h>
#include <string.h>

#include "brdf/kind/lobe_spline_model.h"

#define NO_LEVEL UINT32_MAX
#define HAS_RANGES 1u
#define HAS_TERMS 2u   // a profile or shares: readers that do not know them refuse the file
#define HAS_SUPPORT 4u // beside sigma, in half-vector coordinates
#define FILE_POSITIVE 1u
#define FILE_GRAZING 3u // the positive transform with a grazing factor: older readers refuse it
#define GRAZING_MAX 2.0F

typedef struct description {
    uint32_t dims, level, coordinates, transform, lobes, family, sigma_level;
    float cosine_min;           // 0: none, as in files that are older than it
    uint32_t flags;             // what follows; in older files a spline is held nowhere
    uint32_t sigma_coordinates; // 0: the model's, as in older files; 1: half-vector
    float grazing;              // with FILE_GRAZING
    uint32_t profile;           // level of the profile's lattice + 1; 0: none
    uint32_t shares;            // 1: with lobes, multiples of their shares follow
    uint32_t reserved[3];
} description;
_Static_assert(sizeof(description) == 64, "the description is one block");

// The file's number of the transform: for lobe-splines 1 has always been the positive one.
static uint32_t kind_number(const gonio_lobe_spline_parts *p) {
    return p->base.grazing > 0 ? FILE_GRAZING : p->kind == GONIO_TRANSFORM_POSITIVE ? FILE_POSITIVE : (uint32_t)p->kind;
}

static gonio_transform_kind kind_of(uint32_t number) {
    return number == FILE_POSITIVE || number == FILE_GRAZING ? GONIO_TRANSFORM_POSITIVE : (gonio_transform_kind)number;
}

gonio_status gonio_lobe_spline_save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const gonio_lobe_spline_parts *p = &((const gonio_lobe_spline *)model)->parts;
    const description about = {.dims = (uint32_t)p->dims,
                               .level = p->lattice.points != NULL ? (uint32_t)p->lattice.level : NO_LEVEL,
                               .coordinates = (uint32_t)p->coordinates,
                               .transform = kind_number(p),
                               .grazing = p->base.grazing,
                               .lobes = (uint32_t)p->base.lobes,
                               .family = (uint32_t)p->base.family,
                               .cosine_min = p->base.cosine_min,
                               .flags = (p->range != NULL ? HAS_RANGES : 0) |
                                        (p->profile.points != NULL || p->shares != NULL ? HAS_TERMS : 0) |
                                        (p->support.points != NULL ? HAS_SUPPORT : 0),
                               .sigma_coordinates = p->sigma_half_vector,
                               .shares = p->shares != NULL,
                               .profile = p->profile.points != NULL ? (uint32_t)p->profile.level + 1 : 0,
                               .sigma_level = p->sigma.points != NULL ? (uint32_t)p->sigma.level : NO_LEVEL};
    double shapes[2 * GONIO_LOBES_MAX];
    memcpy(shapes, p->base.alpha, sizeof p->base.alpha);
    memcpy(shapes + GONIO_LOBES_MAX, p->base.f0, sizeof p->base.f0);
    const size_t c = (size_t)model->channels;
    gonio_file_part parts[11] = {{&about, sizeof about}, {p->transforms, c * sizeof *p->transforms}};
    int n = 2;
    if (p->base.lobes > 0) {
        parts[n++] = (gonio_file_part){shapes, sizeof shapes};
        parts[n++] = (gonio_file_part){p->base.strength, c * (1 + GONIO_LOBES_MAX) * sizeof(double)};
    }
    if (p->lattice.points != NULL) {
        parts[n++] = (gonio_file_part){p->lattice.points, p->lattice.count * c * sizeof(float)};
    }
    if (p->range != NULL) {
        parts[n++] = (gonio_file_part){p->range, 2 * c * sizeof(double)};
    }
    if (p->sigma.points != NULL) {
        parts[n++] = (gonio_file_part){p->sigma.points, p->sigma.count * sizeof(float)};
        parts[n++] = (gonio_file_part){p->sigma_factor, c * sizeof(double)};
    }
    if (p->profile.points != NULL) {
        parts[n++] = (gonio_file_part){p->profile.points, p->profile.count * c * sizeof(float)};
    }
    if (p->shares != NULL) {
        parts[n++] = (gonio_file_part){p->shares, c * (1 + GONIO_LOBES_MAX) * sizeof(double)};
    }
    if (p->support.points != NULL) {
        parts[n++] = (gonio_file_part){p->support.points, p->support.count * sizeof(float)};
    }
    return gonio_model_file_write(model, stream, parts, n, error);
}

static bool level_possible(uint32_t level) { return level == NO_LEVEL || level <= 9; }

static bool grazing_possible(const description *about) {
    return about->transform == FILE_GRAZING
               ? about->lobes == 0 && about->cosine_min > 0 && about->grazing > 0 && about->grazing <= GRAZING_MAX
               : about->grazing == 0;
}

static bool terms_possible(const description *about) {
    const bool profile =
        about->profile == 0 || (about->profile <= 10 && about->level != NO_LEVEL && about->dims == 3 &&
                                gonio_coordinates_are_half_vector((gonio_coordinates)about->coordinates));
    const bool shares = about->shares == 0 || (about->shares == 1 && about->lobes > 0);
    const bool told = (about->flags & HAS_TERMS) != 0;
    return profile && shares && told == (about->profile > 0 || about->shares > 0);
}

static bool support_possible(const description *about) {
    return (about->flags & HAS_SUPPORT) == 0 || (about->sigma_level != NO_LEVEL && about->sigma_coordinates == 1);
}

static gonio_status check_description(const gonio_mapped *mapped, const description *about, gonio_error *error) {
    if (about == NULL) {
        return gonio_mapped_fail(mapped, 0, "the lobe-spline's description is cut short", error);
    }
    if (about->dims != (mapped->isotropic ? 3u : 4u) || !level_possible(about->level) ||
        !level_possible(about->sigma_level) || about->coordinates >= GONIO_COORDINATES ||
        about->transform > FILE_GRAZING || about->lobes > GONIO_LOBES_MAX || about->family >= GONIO_LOBE_FAMILIES ||
        about->flags > (HAS_RANGES | HAS_TERMS | HAS_SUPPORT) || !support_possible(about) ||
        about->sigma_coordinates > 1 || !(about->cosine_min >= 0 && about->cosine_min <= 1) ||
        !grazing_possible(about) || !terms_possible(about)) {
        return gonio_mapped_fail(mapped, 0, "a lobe-spline of impossible dimensions, level, lobes or domain", error);
    }
    return GONIO_OK;
}

// The model never writes to what it maps; the members are not const because the fit fills the same struct.
static void *take(const gonio_mapped *mapped, size_t *at, size_t count, size_t size, bool *complete) {
    const void *data = size == 0 || count <= SIZE_MAX / size ? gonio_mapped_take(mapped, at, count * size) : NULL;
    *complete = *complete && data != NULL;
    return (void *)(uintptr_t)data;
}

static void take_lattice(const gonio_mapped *mapped, size_t *at, uint32_t level, int dims, int channels,
                         gonio_lattice *lattice, bool *complete) {
    if (level == NO_LEVEL) {
        return;
    }
    const size_t count = gonio_lattice_count(dims, (int)level);
    *lattice = (gonio_lattice){.dims = dims,
                               .level = (int)level,
                               .channels = channels,
                               .size = gonio_bspline_size((int)level),
                               .count = count};
    lattice->points = take(mapped, at, count * (size_t)channels, sizeof(float), complete);
}

static void take_base(const gonio_mapped *mapped, size_t *at, gonio_lobe_base *base, bool *complete) {
    const double *shapes = take(mapped, at, 2 * GONIO_LOBES_MAX, sizeof(double), complete);
    if (shapes != NULL) {
        memcpy(base->alpha, shapes, sizeof base->alpha);
        memcpy(base->f0, shapes + GONIO_LOBES_MAX, sizeof base->f0);
    }
    base->strength = take(mapped, at, (size_t)mapped->channels * (1 + GONIO_LOBES_MAX), sizeof(double), complete);
}

// False where the section ends early.
static bool take_parts(const gonio_mapped *mapped, const description *about, size_t at, gonio_lobe_spline_parts *p) {
    const size_t c = (size_t)mapped->channels;
    const int dims = (int)about->dims;
    bool complete = true;
    p->transforms = take(mapped, &at, c, sizeof *p->transforms, &complete);
    if (p->base.lobes > 0) {
        take_base(mapped, &at, &p->base, &complete);
    }
    take_lattice(mapped, &at, about->level, dims, mapped->channels, &p->lattice, &complete);
    if ((about->flags & HAS_RANGES) != 0) {
        p->range = take(mapped, &at, 2 * c, sizeof *p->range, &complete);
    }
    take_lattice(mapped, &at, about->sigma_level, dims, 1, &p->sigma, &complete);
    if (about->sigma_level != NO_LEVEL) {
        p->sigma_factor = take(mapped, &at, c, sizeof(double), &complete);
    }
    take_lattice(mapped, &at, about->profile > 0 ? about->profile - 1 : NO_LEVEL, 2, mapped->channels, &p->profile,
                 &complete);
    if (about->shares == 1) {
        p->shares = take(mapped, &at, c * (1 + GONIO_LOBES_MAX), sizeof *p->shares, &complete);
    }
    if ((about->flags & HAS_SUPPORT) != 0) {
        take_lattice(mapped, &at, about->sigma_level, dims, 1, &p->support, &complete);
    }
    return complete;
}

static bool all_finite(const double *numbers, size_t n) {
    bool finite = true;
    for (size_t i = 0; numbers != NULL && i < n; i++) {
        finite = finite && isfinite(numbers[i]);
    }
    return finite;
}

// The numbers of which there are few; control points are not looked at.
static bool numbers_possible(const gonio_lobe_spline_parts *p) {
    const size_t c = (size_t)p->channels, row = 1 + GONIO_LOBES_MAX;
    bool possible = gonio_scales_possible(&p->transforms->scale, c, p->kind != GONIO_TRANSFORM_LINEAR) &&
                    all_finite(p->base.strength, c * row) && all_finite(p->range, 2 * c) &&
                    all_finite(p->sigma_factor, c) && all_finite(p->shares, c * row);
    for (int j = 0; j < p->base.lobes; j++) {
        possible =
            possible && p->base.alpha[j] > 0 && isfinite(p->base.alpha[j]) && p->base.f0[j] >= 0 && p->base.f0[j] <= 1;
    }
    return possible;
}

gonio_status gonio_lobe_spline_read_parts(gonio_mapped *mapped, gonio_lobe_spline_parts *parts, gonio_error *error) {
    size_t at = 0;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    const gonio_status status = check_description(mapped, about, error);
    if (status != GONIO_OK) {
        return status;
    }
    *parts = (gonio_lobe_spline_parts){.channels = mapped->channels,
                                       .dims = (int)about->dims,
                                       .coordinates = (gonio_coordinates)about->coordinates,
                                       .kind = kind_of(about->transform),
                                       .base = {.lobes = (int)about->lobes,
                                                .family = (gonio_lobe_family)about->family,
                                                .cosine_min = about->cosine_min,
                                                .grazing = about->grazing},
                                       .sigma_half_vector = about->sigma_coordinates == 1,
                                       .channel_names = mapped->names};
    if (!take_parts(mapped, about, at, parts)) {
        return gonio_mapped_fail(mapped, 0, "the section is shorter than its level, lobes and channels need", error);
    }
    return numbers_possible(parts)
               ? GONIO_OK
               : gonio_mapped_fail(mapped, sizeof *about, "scales, strengths or shapes that no fit makes", error);
}
