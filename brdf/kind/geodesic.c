// SPDX-License-Identifier: BSD-3-Clause
// Adaptive geodesic spheres, Gondek, Meyer and Newman, "Wavelength dependent reflectance functions" (1994), as DeYoung
// (1996), section 3.2.6, tells of them: for each incidence the hemisphere of outgoing directions is cut into facets,
// and a facet into four whose samples differ too much. Each facet that is left holds the sample at its centre.
// "Interpolation on the four closest samples": the facet's own and those across its three sides, weighted by 1 / d^2, d
// the chord to their centres. Which facets of the base polyhedron they leave open: an octahedron's, whose edges are the
// horizon and the planes of incidence and across it.
//
// Outgoing directions are turned with the incident one to phi_i = 0. Between incidences the values are linear.
#include "brdf/kind/geodesic.h"

#include <stdlib.h>
#include <string.h>

#include "brdf/grid/grid_model.h"

typedef struct geodesic_model {
    gonio_grid_model base;
    size_t nodes, leaves;
    const uint32_t *node;
    const float *values;
} geodesic_model;

// Is w on the side of corner k of the arc that cuts the corner off?
static bool at_corner(const gonio_facet *parts_of, int k, gonio_vec3 w) {
    const gonio_facet middle = gonio_facet_part(parts_of, 3);
    const gonio_vec3 across = cross(middle.corner[(k + 1) % 3], middle.corner[(k + 2) % 3]);
    return dot(w, across) * dot(parts_of->corner[k], across) > 0;
}

// The sample of the facet that w lies in, and that facet.
static uint32_t find(const geodesic_model *m, size_t incidence, gonio_vec3 w, gonio_facet *facet) {
    const size_t roots = gonio_geodesic_roots(m->base.grid.dims);
    const size_t root = (size_t)(w.x < 0) + (roots == 4 && w.y < 0 ? 2U : 0U);
    *facet = gonio_geodesic_root(root);
    uint32_t at = m->node[incidence * roots + root];
    while ((at & GONIO_GEODESIC_LEAF) == 0) {
        int part = 0;
        while (part < 3 && !at_corner(facet, part, w)) {
            part++;
        }
        *facet = gonio_facet_part(facet, part);
        at = m->node[at + (uint32_t)part];
    }
    return at & ~GONIO_GEODESIC_LEAF;
}

static void add_sample(const geodesic_model *m, uint32_t leaf, double weight, double *sums) {
    const size_t channels = (size_t)m->base.channels.head.channels;
    for (size_t c = 0; c < channels; c++) {
        sums[c] += weight * (double)m->values[leaf * channels + c];
    }
}

static double weight_of(const gonio_facet *facet, gonio_vec3 w) {
    const gonio_vec3 apart = difference(gonio_facet_centre(facet), w);
    return 1 / (dot(apart, apart) + 1e-18);
}

// The four samples about w at one incidence.
static void add_incidence(const geodesic_model *m, size_t incidence, double weight, gonio_vec3 w, double *sums) {
    gonio_facet facet, other;
    uint32_t leaf[4];
    double weights[4], total;
    int n = 1;
    leaf[0] = find(m, incidence, w, &facet);
    total = weights[0] = weight_of(&facet, w);
    const gonio_vec3 centre = gonio_facet_centre(&facet);
    for (int k = 0; k < 3; k++) {
        const gonio_vec3 middle = gonio_facet_part(&facet, 3).corner[k];
        gonio_vec3 beyond = gonio_facet_towards(difference(scaled(middle, 2), centre)), seen = w;
        if (beyond.z < 0) {
            continue; // below the horizon
        }
        if (m->base.grid.dims == 3 && beyond.y < 0) {
            beyond.y = -beyond.y;
            seen.y = -seen.y;
        }
        leaf[n] = find(m, incidence, beyond, &other);
        total += weights[n++] = weight_of(&other, seen);
    }
    for (int k = 0; k < n; k++) {
        add_sample(m, leaf[k], weight * weights[k] / total, sums);
    }
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const geodesic_model *m = (const geodesic_model *)model;
    double x[4], weights[4], sums[model->channels];
    size_t rows[4];
    gonio_grid_locate(&m->base.grid, wi, wo, x);
    const int n = gonio_grid_rows(&m->base.grid, x, rows, weights);
    const double s = sqrt(wi.x * wi.x + wi.y * wi.y), c = s > 0 ? wi.x / s : 1, d = s > 0 ? wi.y / s : 0;
    gonio_vec3 w = {wo.x * c + wo.y * d, wo.y * c - wo.x * d, wo.z};
    w.y = m->base.grid.dims == 3 ? fabs(w.y) : w.y;
    memset(sums, 0, sizeof sums);
    for (int k = 0; k < n; k++) {
        if (weights[k] > 0) {
            add_incidence(m, rows[k], weights[k], w, sums);
        }
    }
    gonio_grid_invert(&m->base, sums, values);
}

static void release(gonio_model *model) {
    geodesic_model *m = (geodesic_model *)model;
    if (m->base.channels.mapped.base == NULL) {
        free((void *)(uintptr_t)m->node);
        free((void *)(uintptr_t)m->values);
    }
    gonio_channels_free(&m->base.channels);
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const geodesic_model *m = (const geodesic_model *)model;
    const size_t channels = (size_t)model->channels;
    gonio_grid_description about = gonio_grid_describe(&m->base);
    about.own[0] = (uint32_t)m->nodes;
    about.own[1] = (uint32_t)m->leaves;
    const gonio_file_part parts[] = {{&about, sizeof about},
                                     {m->base.channels.transforms, channels * sizeof(gonio_transform)},
                                     {m->node, m->nodes * sizeof *m->node},
                                     {m->values, m->leaves * channels * sizeof *m->values}};
    return gonio_model_file_write(model, stream, parts, 4, error);
}

static const gonio_model_ops ops = {.kind = "geodesic", .eval = eval, .save = save, .free = release};

static void finish(geodesic_model *m, size_t nodes, const uint32_t *node, size_t leaves, const float *values) {
    gonio_model *head = &m->base.channels.head;
    m->nodes = nodes;
    m->leaves = leaves;
    m->node = node;
    m->values = values;
    head->control_points = leaves;
    head->bytes += nodes * sizeof *node + leaves * (size_t)head->channels * sizeof *values;
}

gonio_status gonio_geodesic_new(const gonio_geodesic_parts *p, gonio_model **out, gonio_error *error) {
    const size_t value_bytes = p->leaves * (size_t)p->channels * sizeof(float);
    uint32_t *node = malloc(p->nodes * sizeof *node);
    float *values = malloc(value_bytes);
    void *model;
    const gonio_status status = node != NULL && values != NULL
                                    ? gonio_grid_model_new(sizeof(geodesic_model), &ops, &p->grid, p->channels, p->kind,
                                                           p->transforms, p->names, &model, error)
                                    : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu facets", p->nodes);
    *out = NULL;
    if (status != GONIO_OK) {
        free(node);
        free(values);
        return status;
    }
    memcpy(node, p->node, p->nodes * sizeof *node);
    memcpy(values, p->values, value_bytes);
    finish(model, p->nodes, node, p->leaves, values);
    *out = model;
    return GONIO_OK;
}

// Parts stand behind their facet, so every way down ends.
static bool nodes_possible(const uint32_t *node, size_t nodes, size_t leaves) {
    bool possible = true;
    for (size_t k = 0; k < nodes; k++) {
        const bool leaf = (node[k] & GONIO_GEODESIC_LEAF) != 0;
        possible =
            possible && (leaf ? (node[k] & ~GONIO_GEODESIC_LEAF) < leaves : node[k] > k && (size_t)node[k] + 3 < nodes);
    }
    return possible;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    const gonio_grid_description *about;
    void *model;
    size_t at = 0;
    gonio_status status = gonio_grid_model_read(mapped, sizeof(geodesic_model), &ops, &at, &about, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    geodesic_model *m = model;
    const gonio_grid *grid = &m->base.grid;
    const size_t nodes = about->own[0], leaves = about->own[1], nodes_at = at;
    const size_t roots = grid->count / gonio_grid_columns_n(grid) * gonio_geodesic_roots(grid->dims);
    const uint32_t *node = gonio_mapped_take(mapped, &at, nodes * sizeof *node);
    const float *values =
        node != NULL ? gonio_mapped_take(mapped, &at, leaves * (size_t)mapped->channels * sizeof *values) : NULL;
    if (grid->system != GONIO_GRID_ANGLES || nodes < roots) {
        status = gonio_mapped_fail(mapped, 0, "fewer facets than incidences need, or not of angles", error);
    } else if (values == NULL || !nodes_possible(node, nodes, leaves)) {
        status =
            gonio_mapped_fail(mapped, nodes_at, "fewer facets than it says, or facets in an impossible order", error);
    }
    if (status != GONIO_OK) {
        gonio_channels_free(&m->base.channels);
        return status;
    }
    finish(m, nodes, node, leaves, values);
    gonio_channels_adopt(&m->base.channels, mapped);
    *out = &m->base.channels.head;
    return GONIO_OK;
}

const gonio_kind gonio_kind_geodesic = {
    .name = "geodesic",
    .summary = "for each incidence an adaptive geodesic hemisphere of samples",
    .ops = &ops,
    .read = read_model,
};
