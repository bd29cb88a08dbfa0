// SPDX-License-Identifier: BSD-3-Clause
// Radiance's tensor trees: G. Ward, M. Kurt and N. Bonneel, "A practical framework for sharing and rendering real-world
// bidirectional scattering distribution functions" (LBNL-5954E, 2012). "{ ... }" holds either 2^dimensions subtrees, of
// which the lowest bit chooses the half of dimension 0, or a uniform grid of 2^(k dimensions) numbers, dimension 0
// slowest. A value is f_r in 1/sr over its cell; there is no cosine in it.
//
// The square of a hemisphere is the concentric map of P. Shirley and K. Chiu, "A low distortion map between disk and
// square" (1997) over the projected disk. Four dimensions: the square of -wi, then that of wo. Three: (1 - sin theta_i)
// / 2, then the square of wo after a turn that brings -wi to azimuth 0.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/number.h"
#include "io/radiance/radiance.h"

enum { DEPTH_MAX = 16 };
// nodes[i]: a number >= 0 is the first of 2^dimensions nodes that follow one another; -1 - k: a grid, described at
// leaves: nodes[k] its first value, nodes[k + 1] the log2 of its side.

typedef struct parser {
    const gonio_radiance_file *file;
    const char *at;
    long long line;
    gonio_tensor_tree *tree;
    size_t node_room, value_room;
} parser;

static gonio_status grow(void **array, size_t *room, size_t need, size_t size, gonio_error *error) {
    if (need <= *room) {
        return GONIO_OK;
    }
    const size_t wanted = need > 2 * *room ? need : 2 * *room;
    void *grown = realloc(*array, wanted * size);
    if (grown == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a tensor tree");
    }
    *array = grown;
    *room = wanted;
    return GONIO_OK;
}

static gonio_status add_nodes(parser *p, size_t n, size_t *first, gonio_error *error) {
    gonio_tensor_tree *t = p->tree;
    if (t->n_nodes + n > 1u << 30) {
        return gonio_radiance_fail(p->file, p->line, error, "a tensor tree of more than 2^30 nodes");
    }
    const gonio_status status = grow((void **)&t->nodes, &p->node_room, t->n_nodes + n, sizeof *t->nodes, error);
    if (status == GONIO_OK) {
        *first = t->n_nodes;
        memset(t->nodes + *first, 0, n * sizeof *t->nodes);
        t->n_nodes += n;
    }
    return status;
}

static char next_mark(parser *p) {
    while (*p->at == ' ' || *p->at == '\t' || *p->at == '\r' || *p->at == '\n' || *p->at == ',') {
        p->line += *p->at == '\n';
        p->at++;
    }
    return *p->at;
}

// Numbers up to the closing brace: a uniform grid.
static gonio_status parse_grid(parser *p, size_t node, gonio_error *error) {
    gonio_tensor_tree *t = p->tree;
    const size_t first = t->n_values;
    while (next_mark(p) != '}') {
        double value;
        if (!gonio_radiance_number(&p->at, &p->line, &value)) {
            return gonio_radiance_fail(p->file, p->line, error, "expected a finite number or '}', found '%.12s'",
                                       p->at);
        }
        const gonio_status status =
            grow((void **)&t->values, &p->value_room, t->n_values + 1, sizeof *t->values, error);
        if (status != GONIO_OK) {
            return status;
        }
        t->values[t->n_values++] = value;
    }
    const size_t n = t->n_values - first;
    int log2 = 0;
    while (log2 < DEPTH_MAX && (size_t)1 << (log2 * t->dimensions) < n) {
        log2++;
    }
    if (n != (size_t)1 << (log2 * t->dimensions) || t->n_values > 1u << 30) {
        return gonio_radiance_fail(p->file, p->line, error, "a grid of %zu numbers; expected 2^(k %d)", n,
                                   t->dimensions);
    }
    size_t leaf;
    const gonio_status status = add_nodes(p, 2, &leaf, error);
    if (status == GONIO_OK) {
        t->nodes[leaf] = (int)first;
        t->nodes[leaf + 1] = log2;
        t->nodes[node] = -1 - (int)leaf;
    }
    return status;
}

static gonio_status parse_node(parser *p, size_t node, int depth, gonio_error *error) {
    if (next_mark(p) != '{' || depth > DEPTH_MAX) {
        return gonio_radiance_fail(p->file, p->line, error,
                                   depth > DEPTH_MAX ? "more than 16 levels of a tensor tree"
                                                     : "expected '{' of a tensor tree, found '%.12s'",
                                   p->at);
    }
    p->at++;
    gonio_status status = GONIO_OK;
    if (next_mark(p) != '{') {
        status = parse_grid(p, node, error);
    } else {
        const size_t n = (size_t)1 << p->tree->dimensions;
        size_t first = 0;
        status = add_nodes(p, n, &first, error);
        for (size_t k = 0; status == GONIO_OK && k < n; k++) {
            status = parse_node(p, first + k, depth + 1, error);
        }
        if (status == GONIO_OK) {
            p->tree->nodes[node] = (int)first;
        }
    }
    if (status == GONIO_OK && next_mark(p) != '}') {
        return gonio_radiance_fail(p->file, p->line, error, "expected '}', found '%.12s'", p->at);
    }
    p->at += status == GONIO_OK;
    return status;
}

gonio_status gonio_tensor_tree_read(const gonio_radiance_file *file, const gonio_radiance_block *block,
                                    gonio_tensor_tree *tree, gonio_error *error) {
    *tree = (gonio_tensor_tree){.dimensions = strcasecmp(file->structure, "TensorTree3") == 0 ? 3 : 4};
    if (strcasecmp(block->basis, "LBNL/Shirley-Chiu") != 0) {
        return gonio_radiance_fail(file, block->line, error,
                                   "angle basis '%.60s' of a tensor tree; expected LBNL/Shirley-Chiu", block->basis);
    }
    parser p = {file, block->data, block->line, tree, 0, 0};
    size_t root;
    gonio_status status = add_nodes(&p, 1, &root, error);
    status = status == GONIO_OK ? parse_node(&p, root, 0, error) : status;
    if (status == GONIO_OK && next_mark(&p) != 0) {
        return gonio_radiance_fail(file, p.line, error, "expected the end of the tensor tree, found '%.12s'", p.at);
    }
    return status;
}

void gonio_tensor_tree_free(gonio_tensor_tree *tree) {
    free(tree->nodes);
    free(tree->values);
    *tree = (gonio_tensor_tree){0};
}

// ---- the map between disk and square ----

static void to_square(double x, double y, double square[2]) {
    const double r = hypot(x, y), quarter = GONIO_PI / 4;
    double phi = atan2(y, x), a, b;
    if (phi < -quarter) {
        phi += 2 * GONIO_PI;
    }
    if (phi < quarter) {
        a = r;
        b = phi * a / quarter;
    } else if (phi < 3 * quarter) {
        b = r;
        a = -(phi - 2 * quarter) * b / quarter;
    } else if (phi < 5 * quarter) {
        a = -r;
        b = (phi - 4 * quarter) * a / quarter;
    } else {
        b = -r;
        a = -(phi - 6 * quarter) * b / quarter;
    }
    square[0] = (a + 1) / 2;
    square[1] = (b + 1) / 2;
}

static void to_disk(const double square[2], double *x, double *y) {
    const double a = 2 * square[0] - 1, b = 2 * square[1] - 1, quarter = GONIO_PI / 4;
    double r, phi;
    if (fabs(a) > fabs(b)) {
        r = a;
        phi = quarter * b / a;
    } else {
        r = b;
        phi = b != 0 ? quarter * (2 - a / b) : 0;
    }
    *x = r * cos(phi);
    *y = r * sin(phi);
}

static void coordinates(const gonio_tensor_tree *tree, gonio_vec3 wi, gonio_vec3 wo, double at[4]) {
    if (tree->dimensions == 4) {
        to_square(-wi.x, -wi.y, at);
        to_square(wo.x, wo.y, at + 2);
        return;
    }
    const double sine = hypot(wi.x, wi.y);
    const double c = sine > 0 ? -wi.x / sine : 1, s = sine > 0 ? -wi.y / sine : 0;
    at[0] = fmin((1 - sine) / 2, 0.5 - 1e-12); // normal incidence is the end of the half that is used
    at[0] = fmax(at[0], 0);
    to_square(c * wo.x + s * wo.y, c * wo.y - s * wo.x, at + 1);
}

double gonio_tensor_tree_value(const gonio_tensor_tree *tree, gonio_vec3 wi, gonio_vec3 wo) {
    double at[4];
    coordinates(tree, wi, wo, at);
    int node = tree->nodes[0];
    while (node >= 0) {
        int child = 0;
        for (int d = 0; d < tree->dimensions; d++) {
            const bool upper = at[d] >= 0.5;
            child |= upper << d;
            at[d] = 2 * at[d] - upper;
        }
        node = tree->nodes[node + child];
    }
    const int *leaf = tree->nodes + (-1 - node);
    const int side = 1 << leaf[1];
    size_t index = 0;
    for (int d = 0; d < tree->dimensions; d++) {
        const int cell = (int)(at[d] * side);
        index = index * (size_t)side + (size_t)(cell < 0 ? 0 : cell < side ? cell : side - 1);
    }
    return tree->values[(size_t)leaf[0] + index];
}

// ---- cells ----

typedef struct walk {
    const gonio_tensor_tree *tree;
    gonio_tensor_tree_fn call;
    void *context;
} walk;

bool gonio_tensor_tree_directions(int dimensions, const double at[4], gonio_vec3 *in, gonio_vec3 *out) {
    gonio_vec3 wi = {0}, wo = {0};
    if (dimensions == 4) {
        to_disk(at, &wi.x, &wi.y);
        to_disk(at + 2, &wo.x, &wo.y);
    } else {
        if (at[0] >= 0.5) {
            return false; // no direction lies there
        }
        wi.x = 1 - 2 * at[0];
        to_disk(at + 1, &wo.x, &wo.y);
    }
    wi.x = -wi.x;
    wi.y = -wi.y;
    wi.z = sqrt(fmax(0, 1 - wi.x * wi.x - wi.y * wi.y));
    wo.z = sqrt(fmax(0, 1 - wo.x * wo.x - wo.y * wo.y));
    *in = wi;
    *out = wo;
    return true;
}

static bool tell_cell(const walk *w, const double at[4]) {
    gonio_vec3 wi, wo;
    if (!gonio_tensor_tree_directions(w->tree->dimensions, at, &wi, &wo)) {
        return true;
    }
    const gonio_pair found = gonio_pair_from_vectors(wi, wo);
    const bool turn = w->tree->dimensions == 3;
    const gonio_pair pair = {
        gonio_angle_canonical(found.theta_i), turn ? 0 : gonio_angle_canonical(found.phi_i),
        gonio_angle_canonical(found.theta_o),
        gonio_angle_canonical(turn ? remainder(found.phi_o - found.phi_i, 2 * GONIO_PI) : found.phi_o)};
    return w->call(w->context, &pair);
}

static bool walk_node(const walk *w, int node, const double low[4], double size) {
    const int dimensions = w->tree->dimensions;
    if (node >= 0) {
        for (int child = 0; child < 1 << dimensions; child++) {
            double corner[4];
            for (int d = 0; d < dimensions; d++) {
                corner[d] = low[d] + (child >> d & 1) * size / 2;
            }
            if (!walk_node(w, w->tree->nodes[node + child], corner, size / 2)) {
                return false;
            }
        }
        return true;
    }
    const int side = 1 << w->tree->nodes[-1 - node + 1];
    for (size_t k = 0; k < (size_t)1 << (w->tree->nodes[-1 - node + 1] * dimensions); k++) {
        double at[4];
        size_t rest = k;
        for (int d = dimensions - 1; d >= 0; d--, rest /= (size_t)side) {
            at[d] = low[d] + ((double)(rest % (size_t)side) + 0.5) * size / side;
        }
        if (!tell_cell(w, at)) {
            return false;
        }
    }
    return true;
}

void gonio_tensor_tree_cells(const gonio_tensor_tree *tree, gonio_tensor_tree_fn call, void *context) {
    walk_node(&(walk){tree, call, context}, tree->nodes[0], (const double[4]){0}, 1);
}
