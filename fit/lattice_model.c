// Models of kind "lattice": evaluation, gradient, file section.
//
// Section: 64 bytes of description, the transforms, the control points, each part aligned (fit/model_file.h).
#include "fit/lattice_model.h"

#include <stdlib.h>
#include <string.h>

#include "fit/model_file.h"

typedef struct lattice_model {
    gonio_model head;
    gonio_lattice lattice;
    gonio_coordinates coordinates;
    gonio_transform_kind kind;
    gonio_transform *transforms; // [channels]
    char (*names)[32];           // [channels]; NULL when they lie in the file
    gonio_mapped mapped;         // base NULL: the points are our own
} lattice_model;

typedef struct description {
    uint32_t dims, level, coordinates, kind;
    uint32_t reserved[12];
} description;
_Static_assert(sizeof(description) == 64, "the description is one block");

static void locate(const lattice_model *m, gonio_vec3 wi, gonio_vec3 wo, double x[4]) {
    if (m->lattice.dims == 3) {
        gonio_coordinates_isotropic(m->coordinates, wi, wo, x);
    } else {
        gonio_coordinates_anisotropic(m->coordinates, wi, wo, x);
    }
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const lattice_model *m = (const lattice_model *)model;
    double x[4];
    locate(m, wi, wo, x);
    gonio_lattice_eval(&m->lattice, x, values);
    for (int c = 0; c < model->channels; c++) {
        values[c] = gonio_transform_invert(m->kind, &m->transforms[c], values[c]);
    }
}

static void release(gonio_model *model) {
    lattice_model *m = (lattice_model *)model;
    if (m->mapped.base == NULL) {
        gonio_lattice_release(&m->lattice);
    }
    gonio_mapped_release(&m->mapped);
    free(m->transforms);
    free(m->names);
    free(m);
}

static gonio_status save(const gonio_model *model, const char *path, gonio_error *error) {
    const lattice_model *m = (const lattice_model *)model;
    const description about = {.dims = (uint32_t)m->lattice.dims,
                               .level = (uint32_t)m->lattice.level,
                               .coordinates = (uint32_t)m->coordinates,
                               .kind = (uint32_t)m->kind};
    const size_t c = (size_t)model->channels;
    const gonio_file_part parts[] = {
        {&about, sizeof about},
        {m->transforms, c * sizeof *m->transforms},
        {m->lattice.points, m->lattice.count * c * sizeof(float)},
    };
    return gonio_model_file_write(model, path, parts, 3, error);
}

static const gonio_model_ops lattice_ops = {
    .api_version = GONIO_MODEL_API_VERSION,
    .kind = "lattice",
    .eval = eval,
    .save = save,
    .free = release,
};

static void fill_head(lattice_model *m) {
    m->head.ops = &lattice_ops;
    m->head.channels = m->lattice.channels;
    m->head.isotropic = m->lattice.dims == 3;
    m->head.control_points = m->lattice.count;
    m->head.bytes =
        (m->lattice.count * sizeof(float) + sizeof *m->transforms) * (size_t)m->lattice.channels + sizeof *m;
}

gonio_status gonio_lattice_model_new(gonio_lattice *lattice, gonio_coordinates coordinates, gonio_transform_kind kind,
                                     const gonio_transform *transforms, const char (*channel_names)[32],
                                     gonio_model **out, gonio_error *error) {
    *out = NULL;
    const size_t c = (size_t)lattice->channels;
    lattice_model *m = calloc(1, sizeof *m);
    if (m == NULL || (m->transforms = malloc(c * sizeof *transforms)) == NULL ||
        (m->names = malloc(c * sizeof *m->names)) == NULL) {
        if (m != NULL) {
            free(m->transforms);
        }
        free(m);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu channels", c);
    }
    memcpy(m->transforms, transforms, c * sizeof *transforms);
    memcpy(m->names, channel_names, c * sizeof *m->names);
    m->head.channel_names = (const char(*)[32])m->names;
    m->coordinates = coordinates;
    m->kind = kind;
    m->lattice = *lattice;
    lattice->points = NULL;
    fill_head(m);
    *out = &m->head;
    return GONIO_OK;
}

static gonio_status check_description(const gonio_mapped *mapped, const description *about, gonio_error *error) {
    if (about == NULL) {
        return gonio_mapped_fail(mapped, 0, "the lattice's description is cut short", error);
    }
    if (about->dims != (mapped->isotropic ? 3u : 4u) || about->level > 9 || about->coordinates > GONIO_REFLECTED ||
        about->kind > GONIO_TRANSFORM_ASINH) {
        return gonio_mapped_fail(mapped, 0, "a lattice of impossible dimensions, level, coordinates or domain", error);
    }
    return GONIO_OK;
}

gonio_status gonio_lattice_model_read(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    size_t at = 0;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    const gonio_status status = check_description(mapped, about, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t c = (size_t)mapped->channels, transforms_at = at;
    const gonio_transform *transforms = gonio_mapped_take(mapped, &at, c * sizeof *transforms);
    const size_t points_at = at, count = gonio_lattice_count((int)about->dims, (int)about->level);
    const float *points = transforms != NULL && count <= SIZE_MAX / sizeof(float) / c
                              ? gonio_mapped_take(mapped, &at, count * c * sizeof(float))
                              : NULL;
    if (points == NULL) {
        return gonio_mapped_fail(mapped, transforms == NULL ? transforms_at : points_at,
                                 "fewer control points than its level and channels need", error);
    }
    lattice_model *m = calloc(1, sizeof *m);
    if (m == NULL || (m->transforms = malloc(c * sizeof *transforms)) == NULL) {
        free(m);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu channels", c);
    }
    memcpy(m->transforms, transforms, c * sizeof *transforms);
    m->lattice = (gonio_lattice){.dims = (int)about->dims,
                                 .level = (int)about->level,
                                 .channels = mapped->channels,
                                 .size = gonio_bspline_size((int)about->level),
                                 .count = count,
                                 .points = (float *)(uintptr_t)points}; // never written: models are immutable
    m->coordinates = (gonio_coordinates)about->coordinates;
    m->kind = (gonio_transform_kind)about->kind;
    m->mapped = *mapped;
    *mapped = (gonio_mapped){0};
    m->head.channel_names = m->mapped.names;
    fill_head(m);
    *out = &m->head;
    return GONIO_OK;
}

const gonio_lattice *gonio_lattice_model_lattice(const gonio_model *model) {
    return model->ops == &lattice_ops ? &((const lattice_model *)model)->lattice : NULL;
}

void gonio_lattice_model_about(const gonio_model *model, gonio_coordinates *coordinates, gonio_transform_kind *kind,
                               const gonio_transform **transforms) {
    const lattice_model *m = (const lattice_model *)model;
    if (coordinates != NULL) {
        *coordinates = m->coordinates;
    }
    if (kind != NULL) {
        *kind = m->kind;
    }
    if (transforms != NULL) {
        *transforms = m->transforms;
    }
}
