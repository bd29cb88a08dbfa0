// SPDX-License-Identifier: BSD-3-Clause
// Adaptive geodesic hemispheres, Gondek, Meyer and Newman (1994); brdf/kind/geodesic.c.
//
// A facet is cut into four where the root mean square difference of their four samples from their mean, over the
// channels, exceeds a tolerance of the transformed values; the four are its samples then. Facets wider than 11 deg are
// always cut, and so is the one that holds the mirror direction, lest a narrow lobe lie between the first samples.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/kind/geodesic.h"
#include "fit/tables/fill.h"

static const int depth_usual[2] = {6, 5};     // facets of 1.4 and 2.8 deg
static const int incidence_level[2] = {5, 3}; // 33 tilts; 9 x 16 in four dimensions
#define ALWAYS 3
#define TOLERANCE 0.05        // log domain: 5 %
#define TOLERANCE_LINEAR 5e-3 // of the largest value

typedef struct facet {
    gonio_facet shape;
    uint32_t incidence, node;
} facet;

typedef struct tree {
    const gonio_fill *fill;
    gonio_grid grid;
    size_t channels;
    double tolerance;
    uint32_t *node;
    float *values; // of the leaves
    size_t nodes, node_room, leaves, leaf_room;
    // The facets of one depth, and the values at their centres.
    facet *facets;
    double *own;
    size_t n;
} tree;

static gonio_vec3 incident(const tree *t, uint32_t incidence) {
    gonio_vec3 wi, wo;
    gonio_grid_node(&t->grid, incidence * gonio_grid_columns_n(&t->grid), &wi, &wo);
    return wi;
}

// The pair of the centre of a facet, turned to where its incidence is.
static void place(const tree *t, const gonio_facet *shape, uint32_t incidence, gonio_vec3 *wi, gonio_vec3 *wo) {
    const gonio_vec3 w = gonio_facet_centre(shape);
    *wi = incident(t, incidence);
    const double s = hypot(wi->x, wi->y);
    // At the pole the azimuth is still the node's.
    const double steps = t->grid.dims == 4 ? (double)(incidence % t->grid.size[1]) / (double)t->grid.size[1] : 0;
    const double c = s > 0 ? wi->x / s : cos(2 * GONIO_PI * steps), d = s > 0 ? wi->y / s : sin(2 * GONIO_PI * steps);
    *wo = (gonio_vec3){w.x * c - w.y * d, w.y * c + w.x * d, w.z};
}

static void place_own(const void *context, size_t item, gonio_vec3 *wi, gonio_vec3 *wo) {
    const tree *t = context;
    place(t, &t->facets[item].shape, t->facets[item].incidence, wi, wo);
}

static void place_part(const void *context, size_t item, gonio_vec3 *wi, gonio_vec3 *wo) {
    const tree *t = context;
    const gonio_facet part = gonio_facet_part(&t->facets[item / 4].shape, (int)(item % 4));
    place(t, &part, t->facets[item / 4].incidence, wi, wo);
}

static bool holds_mirror(const tree *t, const facet *f) {
    const gonio_vec3 wi = incident(t, f->incidence);
    const gonio_vec3 mirror = {-hypot(wi.x, wi.y), 0, wi.z}, centre = gonio_facet_centre(&f->shape);
    const gonio_vec3 far = difference(centre, f->shape.corner[0]), there = difference(centre, mirror);
    return dot(there, there) <= dot(far, far);
}

// Do the samples of its four parts ask for them?
static bool asks(const tree *t, const facet *f, const double *parts, int depth) {
    double sum = 0;
    for (size_t c = 0; c < t->channels; c++) {
        const double mean =
            (parts[c] + parts[t->channels + c] + parts[2 * t->channels + c] + parts[3 * t->channels + c]) / 4;
        for (size_t k = 0; k < 4; k++) {
            sum += (parts[k * t->channels + c] - mean) * (parts[k * t->channels + c] - mean);
        }
    }
    return depth < ALWAYS || sqrt(sum / (4 * (double)t->channels)) > t->tolerance || holds_mirror(t, f);
}

static bool grow(void **array, size_t size, size_t wanted, size_t *room) {
    if (wanted > *room) {
        void *larger = realloc(*array, 2 * wanted * size);
        *array = larger != NULL ? larger : *array;
        *room = larger != NULL ? 2 * wanted : *room;
    }
    return wanted <= *room;
}

static bool add_leaf(tree *t, uint32_t node, const double *value) {
    void *values = t->values;
    const bool enough = grow(&values, t->channels * sizeof(float), t->leaves + 1, &t->leaf_room);
    t->values = values;
    for (size_t c = 0; enough && c < t->channels; c++) {
        t->values[t->leaves * t->channels + c] = (float)value[c];
    }
    t->node[node] = GONIO_GEODESIC_LEAF | (uint32_t)t->leaves;
    t->leaves += enough;
    return enough;
}

// Four new nodes in place of one; the facets of the next depth go behind each other to next, their values to own.
static bool cut(tree *t, const facet *f, const double *parts, facet *next, double *own, size_t *n) {
    void *node = t->node;
    const bool enough = grow(&node, sizeof(uint32_t), t->nodes + 4, &t->node_room);
    t->node = node;
    for (int k = 0; k < 4 && enough; k++) {
        next[*n] = (facet){gonio_facet_part(&f->shape, k), f->incidence, (uint32_t)t->nodes + (uint32_t)k};
        memcpy(own + *n * t->channels, parts + (size_t)k * t->channels, t->channels * sizeof *own);
        (*n)++;
    }
    if (enough) {
        t->node[f->node] = (uint32_t)t->nodes;
        t->nodes += 4;
    }
    return enough;
}

// Facets become leaves or are cut; the facets of the next depth take their place.
static gonio_status descend(tree *t, int depth, gonio_error *error) {
    double *parts = malloc(4 * t->n * t->channels * sizeof *parts), *own = malloc(4 * t->n * t->channels * sizeof *own);
    facet *next = malloc(4 * t->n * sizeof *next);
    gonio_status status = parts != NULL && own != NULL && next != NULL
                              ? gonio_fill_values(t->fill, 4 * t->n, place_part, t, parts, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu facets", 4 * t->n);
    size_t n = 0;
    for (size_t i = 0; i < t->n && status == GONIO_OK; i++) {
        const double *four = parts + 4 * i * t->channels;
        const bool enough = asks(t, &t->facets[i], four, depth)
                                ? cut(t, &t->facets[i], four, next, own, &n)
                                : add_leaf(t, t->facets[i].node, t->own + i * t->channels);
        status = enough ? status : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu facets", t->nodes);
    }
    free(parts);
    free(t->facets);
    free(t->own);
    t->facets = next;
    t->own = own;
    t->n = n;
    return status;
}

static gonio_status begin(tree *t, gonio_error *error) {
    const size_t roots = gonio_geodesic_roots(t->grid.dims),
                 incidences = t->grid.count / gonio_grid_columns_n(&t->grid);
    t->n = t->nodes = t->node_room = roots * incidences;
    t->node = calloc(t->nodes, sizeof *t->node);
    t->facets = malloc(t->n * sizeof *t->facets);
    t->own = malloc(t->n * t->channels * sizeof *t->own);
    if (t->node == NULL || t->facets == NULL || t->own == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu facets", t->n);
    }
    for (size_t i = 0; i < t->n; i++) {
        t->facets[i] = (facet){gonio_geodesic_root(i % roots), (uint32_t)(i / roots), (uint32_t)i};
    }
    return gonio_fill_values(t->fill, t->n, place_own, t, t->own, error);
}

static gonio_status build(tree *t, int depth, gonio_error *error) {
    gonio_status status = begin(t, error);
    for (int d = 0; d < depth && status == GONIO_OK; d++) {
        status = descend(t, d, error);
    }
    for (size_t i = 0; i < t->n && status == GONIO_OK; i++) {
        status = add_leaf(t, t->facets[i].node, t->own + i * t->channels)
                     ? status
                     : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", t->leaves);
    }
    return status;
}

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    const int dims = samples->isotropic ? 3 : 4;
    const int depth = options->level != GONIO_LEVEL_AUTO ? options->level : depth_usual[dims - 3];
    const int level = depth < incidence_level[dims - 3] ? depth : incidence_level[dims - 3];
    gonio_fill fill;
    *out = NULL;
    gonio_status status = gonio_fill_init(&fill, samples, options, error);
    if (status != GONIO_OK) {
        return status;
    }
    tree t = {.fill = &fill,
              .grid = gonio_grid_of(GONIO_GRID_ANGLES, dims, level),
              .channels = (size_t)samples->channels,
              .tolerance = fill.data.kind == GONIO_TRANSFORM_LINEAR ? TOLERANCE_LINEAR : TOLERANCE};
    status = build(&t, depth, error);
    const gonio_geodesic_parts parts = {.grid = t.grid,
                                        .channels = samples->channels,
                                        .kind = fill.data.kind,
                                        .transforms = fill.data.transforms,
                                        .names = (const char(*)[32])samples->channel_names,
                                        .nodes = t.nodes,
                                        .leaves = t.leaves,
                                        .node = t.node,
                                        .values = t.values};
    status = status == GONIO_OK ? gonio_geodesic_new(&parts, out, error) : status;
    report->level = depth;
    report->fill_seconds = fill.seconds;
    report->coordinates = GONIO_NUSSELT;
    report->domain = fill.data.kind == GONIO_TRANSFORM_LINEAR ? GONIO_LINEAR : GONIO_LOG;
    snprintf(report->options, sizeof report->options, "%s fill=%s incidences=%zu facets=%zu",
             gonio_domain_name(report->domain), fill.method, t.grid.count / gonio_grid_columns_n(&t.grid), t.leaves);
    free(t.node);
    free(t.values);
    free(t.facets);
    free(t.own);
    gonio_fill_release(&fill);
    return status;
}

// Never more than all facets cut.
static double memory(const gonio_fit_size *size, double n) {
    const int level = size->level < incidence_level[size->dims - 3] ? size->level : incidence_level[size->dims - 3];
    const gonio_grid grid = gonio_grid_of(GONIO_GRID_ANGLES, size->dims, level);
    const double facets =
        (double)(grid.count / gonio_grid_columns_n(&grid) * gonio_geodesic_roots(size->dims)) * pow(4, size->level);
    return gonio_fill_memory(size, n) + facets * (100 + 30.0 * size->channels);
}

static const gonio_method_option options_of_geodesic[] = {
    GONIO_METHOD_OPTION(level, "times that a facet is cut at most (6; 5 in 4-D)"),
    GONIO_METHOD_OPTION(domain, "log"),
    GONIO_METHOD_OPTION(fill, NULL),
    {0}};

static const gonio_method_form forms[] = {GONIO_METHOD_FORM_AUTO};

const gonio_method gonio_method_geodesic = {
    .name = "geodesic",
    .summary = "adaptive geodesic hemispheres of samples, one an incidence",
    .kind = "geodesic",
    .options = options_of_geodesic,
    .fit = fit,
    .memory = memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
