// SPDX-License-Identifier: BSD-3-Clause
#include "fit/needs/needs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "brdf/checksum.h"

static int dims_of(bool isotropic) { return isotropic ? 3 : 4; }

gonio_status gonio_needs_new(int materials, int frames, gonio_needs **out, gonio_error *error) {
    gonio_needs *needs = calloc(1, sizeof *needs);
    *out = needs;
    if (needs != NULL) {
        needs->material = calloc((size_t)materials + 1, sizeof *needs->material);
        needs->frame = calloc((size_t)frames + 1, sizeof *needs->frame);
    }
    if (needs == NULL || needs->material == NULL || needs->frame == NULL) {
        gonio_needs_free(needs);
        *out = NULL;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what a scene needs");
    }
    needs->materials = materials;
    needs->frames = frames;
    return GONIO_OK;
}

void gonio_needs_free(gonio_needs *needs) {
    if (needs == NULL) {
        return;
    }
    for (int m = 0; needs->material != NULL && m < needs->materials; m++) {
        free(needs->material[m].cell);
        free(needs->material[m].density);
    }
    free(needs->material);
    free(needs->frame);
    free(needs->scene);
    free(needs);
}

gonio_status gonio_needs_checksum(const char *path, uint64_t *sum, gonio_error *error) {
    char *data;
    size_t size;
    const gonio_status status = gonio_file_read(path, (size_t)1 << 20, &data, &size, error);
    if (status == GONIO_OK) {
        gonio_checksum c = gonio_checksum_begin();
        gonio_checksum_add(&c, data, size);
        *sum = gonio_checksum_end(&c);
        free(data);
    }
    return status;
}

// ---- what is asked of it ----

void gonio_needs_describe_scene(const gonio_needs *needs, gonio_needs_scene *scene) {
    *scene = (gonio_needs_scene){.path = needs->scene,
                                 .width = needs->width,
                                 .height = needs->height,
                                 .samples = needs->samples,
                                 .interreflection = needs->interreflection,
                                 .frames = needs->frames,
                                 .frame = needs->frame};
}

int gonio_needs_materials(const gonio_needs *needs) { return needs->materials; }

void gonio_needs_describe(const gonio_needs *needs, int material, gonio_needs_facts *facts) {
    const needs_material *m = &needs->material[material];
    *facts = (gonio_needs_facts){.name = m->name,
                                 .isotropic = m->isotropic,
                                 .resolution = m->resolution,
                                 .cells = m->cells,
                                 .codes = m->codes,
                                 .squares = m->squares,
                                 .behind = m->behind};
}

const gonio_need *gonio_needs_cells(const gonio_needs *needs, int material) { return needs->material[material].cell; }

gonio_status gonio_needs_material(const gonio_needs *needs, const char *name, int *material, gonio_error *error) {
    char list[1000] = "";
    int found = 0;
    for (int m = 0; m < needs->materials; m++) {
        if (name != NULL ? strcmp(needs->material[m].name, name) == 0 : needs->material[m].cells > 0) {
            *material = m;
            found++;
        }
        gonio_text_append(list, sizeof list, "%s%s", m > 0 ? ", " : "", needs->material[m].name);
    }
    if (found == 1 && needs->material[*material].cells > 0) {
        return GONIO_OK;
    }
    return found == 1 ? gonio_fail(error, GONIO_E_USAGE, "no pixel sees material '%.80s' in front of its surface", name)
           : name != NULL ? gonio_fail(error, GONIO_E_USAGE, "the scene has no material '%.80s'; it has %s", name, list)
           : found > 1    ? gonio_fail(error, GONIO_E_USAGE, "the scene has several materials, name one: %s", list)
                          : gonio_fail(error, GONIO_E_USAGE, "no pixel of the scene sees a material");
}

// ---- pairs and cells ----

void gonio_needs_normal_pair(bool isotropic, gonio_vec3 *wi, gonio_vec3 *wo) {
    const double s = hypot(wi->x, wi->y);
    if (!isotropic) {
        return;
    }
    const double c = s > 0 ? wi->x / s : 1, d = s > 0 ? wi->y / s : 0;
    *wo = (gonio_vec3){wo->x * c + wo->y * d, fabs(wo->y * c - wo->x * d), wo->z};
    *wi = (gonio_vec3){s, 0, wi->z};
    if (!(s > 0)) {
        // Of light from the normal the azimuth means nothing.
        *wo = (gonio_vec3){hypot(wo->x, wo->y), 0, wo->z};
    }
}

static void place(gonio_coordinates system, bool isotropic, gonio_vec3 wi, gonio_vec3 wo, double x[4]) {
    if (isotropic) {
        gonio_coordinates_isotropic(system, wi, wo, x);
    } else {
        gonio_coordinates_anisotropic(system, wi, wo, x);
    }
}

uint64_t gonio_needs_key(bool isotropic, int resolution, gonio_vec3 wi, gonio_vec3 wo) {
    double x[4];
    uint64_t key = 0;
    place(GONIO_HALF_VECTOR_NARROW, isotropic, wi, wo, x);
    for (int d = 0; d < dims_of(isotropic); d++) {
        const int cell = (int)(x[d] * resolution);
        key = key * (uint64_t)resolution + (uint64_t)(cell < resolution ? cell : resolution - 1);
    }
    return key;
}

// ---- the density ----

// Nodes about a place and their weights: the two nearest along each axis.
static void tents(bool isotropic, const double *x, size_t at[16], double weight[16]) {
    const int nodes = GONIO_NEEDS_NODES(isotropic), dims = dims_of(isotropic);
    for (int k = 0; k < 1 << dims; k++) {
        at[k] = 0;
        weight[k] = 1;
        for (int d = 0; d < dims; d++) {
            const double place = fmin(fmax(x[d], 0), 1) * (nodes - 1);
            const int low = place < nodes - 1 ? (int)place : nodes - 2;
            const bool high = k >> d & 1;
            at[k] = at[k] * (size_t)nodes + (size_t)(low + high);
            weight[k] *= high ? place - low : 1 - (place - low);
        }
    }
}

static double density_at(const needs_material *m, const double *x) {
    size_t at[16];
    double weight[16], sum = 0;
    tents(m->isotropic, x, at, weight);
    for (int k = 0; k < 1 << dims_of(m->isotropic); k++) {
        sum += weight[k] * m->density[at[k]];
    }
    return sum;
}

static void spread(needs_material *m, const double *x, double squares) {
    size_t at[16];
    double weight[16];
    tents(m->isotropic, x, at, weight);
    for (int k = 0; k < 1 << dims_of(m->isotropic); k++) {
        m->density[at[k]] += weight[k] * squares;
    }
}

// Each cell and, of isotropic materials, its mirror image.
static void spread_all(needs_material *m) {
    double x[4];
    for (size_t i = 0; i < m->cells; i++) {
        place(GONIO_HALF_VECTOR, m->isotropic, m->cell[i].wi, m->cell[i].wo, x);
        spread(m, x, m->cell[i].squares);
        if (m->isotropic) {
            x[1] = 1 - x[1];
            spread(m, x, m->cell[i].squares);
        }
    }
}

static gonio_status finish_material(needs_material *m, gonio_error *error) {
    const size_t nodes = (size_t)GONIO_NEEDS_NODES(m->isotropic);
    const size_t count = nodes * nodes * nodes * (m->isotropic ? 1 : nodes);
    m->codes = m->squares = 0;
    m->density = calloc(count, sizeof *m->density);
    if (m->density == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what a scene needs");
    }
    for (size_t i = 0; i < m->cells; i++) {
        m->codes += m->cell[i].codes;
        m->squares += m->cell[i].squares;
    }
    spread_all(m);
    double mean = 0;
    for (size_t i = 0; i < m->cells; i++) {
        double x[4];
        place(GONIO_HALF_VECTOR, m->isotropic, m->cell[i].wi, m->cell[i].wo, x);
        mean += m->cell[i].squares * density_at(m, x);
    }
    for (size_t i = 0; i < count && mean > 0; i++) {
        m->density[i] *= m->squares / mean;
    }
    return GONIO_OK;
}

gonio_status gonio_needs_finish(gonio_needs *needs, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int m = 0; m < needs->materials && status == GONIO_OK; m++) {
        status = finish_material(&needs->material[m], error);
    }
    return status;
}

double gonio_needs_weight(const gonio_needs *needs, int material, gonio_vec3 wi, gonio_vec3 wo) {
    const needs_material *m = &needs->material[material];
    double x[4];
    if (!(wi.z >= 0 && wo.z >= 0)) {
        return 0;
    }
    place(GONIO_HALF_VECTOR, m->isotropic, wi, wo, x);
    return density_at(m, x);
}
