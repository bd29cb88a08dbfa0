// SPDX-License-Identifier: BSD-3-Clause
// A tensor tree whose cells are as small as the model asks for. A cell holds the model's value at its centre, so that
// what is wrong inside it is what f_r changes by across it. Uniform in each cell, that has a root mean square of
// sqrt(sum of d_k^2 / 12), d_k the difference from the cell beside it along dimension k of the same parent, which
// costs no further evaluation. Of cells of volume V whose error is proportional to their side, the L2 error of all is
// least at a given number of cells where every cell contributes the same, error^2 V: so a cell is split where this, of
// the relative error, exceeds a tolerance, which is searched for to fill the bytes.
//
// Cells on which the mirror direction lies count its value as well: a lobe narrower than a cell is not passed over.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "io/radiance/radiance.h"

enum { TOP = 2, CHILDREN_MAX = 16 }; // tasks are the cells of depth TOP

#define SAME_Y 1e-5      // cells whose values differ by no more, relatively, are one
#define SAME_COLOUR 2e-5 // of u' and v', which stand in a ratio to Y
// Exponent of the volume beside the error: 1/2 is the L2 error's; of 0.1 to 1 on lobes of alpha 0.25, 0.05 and 0.15 x
// 0.4 the 95 % errors of 0.6 are least.
#define VOLUME 0.6

struct gonio_adaptive_tree {
    int dimensions, parts;
    struct task *tasks;
    size_t n_tasks;
};

// What grows below one cell of depth TOP. nodes[i] >= 0: the first of 2^dimensions that follow one another; < 0: -1 -
// a leaf's number.
typedef struct task {
    int *nodes;
    float (*values)[3];
    size_t n_nodes, n_values, node_room, value_room;
    bool failed;
} task;

typedef struct growth {
    const gonio_model *model;
    gonio_adaptive_tree *tree;
    gonio_adaptive_options options;
} growth;

typedef struct cell {
    double low[4], side;
    int depth;
    double values[3], error;
} cell;

static bool room(void **array, size_t *have, size_t need, size_t size) {
    if (need <= *have) {
        return true;
    }
    const size_t wanted = need > 2 * *have ? need : 2 * *have;
    void *grown = realloc(*array, wanted * size);
    if (grown != NULL) {
        *array = grown;
        *have = wanted;
    }
    return grown != NULL;
}

static double sum_of(const double *v, int parts) {
    double sum = 0;
    for (int c = 0; c < parts; c++) {
        sum += fabs(v[c]);
    }
    return sum;
}

static double apart(const double *a, const double *b, int parts) {
    double sum = 0;
    for (int c = 0; c < parts; c++) {
        sum += fabs(a[c] - b[c]);
    }
    return sum;
}

// Values at the centres of n cells; zeros where no direction lies.
static void evaluate(const growth *g, cell *cells, int n) {
    gonio_vec3 wi[CHILDREN_MAX] = {{0}}, wo[CHILDREN_MAX] = {{0}};
    double values[3 * CHILDREN_MAX];
    const int parts = g->tree->parts;
    int which[CHILDREN_MAX], there = 0;
    for (int k = 0; k < n; k++) {
        double at[4];
        for (int d = 0; d < g->tree->dimensions; d++) {
            at[d] = cells[k].low[d] + cells[k].side / 2;
        }
        memset(cells[k].values, 0, sizeof cells[k].values);
        if (gonio_tensor_tree_directions(g->tree->dimensions, at, &wi[there], &wo[there])) {
            which[there++] = k;
        }
    }
    gonio_model_eval_many(g->model, (size_t)there, wi, wo, values);
    for (int k = 0; k < there; k++) {
        for (int c = 0; c < parts; c++) {
            cells[which[k]].values[c] = fmax(values[k * parts + c], 0);
        }
    }
}

// Of a cell of three dimensions on which the mirror direction lies, the value there; of four it is the centre's.
static double at_mirror(const growth *g, const cell *c, double values[3]) {
    const double first = 1 - c->low[0] - c->side, last = 1 - c->low[0]; // of dimension 1
    const double low = fmax(first, c->low[1]), high = fmin(last, c->low[1] + c->side);
    if (g->tree->dimensions == 4 || low > high || c->low[2] > 0.5 || c->low[2] + c->side < 0.5) {
        return 0;
    }
    const double at[4] = {1 - (low + high) / 2, (low + high) / 2, 0.5};
    gonio_vec3 wi, wo;
    if (!gonio_tensor_tree_directions(3, at, &wi, &wo)) {
        return 0;
    }
    gonio_model_eval(g->model, wi, wo, values);
    return sum_of(values, g->tree->parts);
}

static void measure(const growth *g, cell *children) {
    const int n = 1 << g->tree->dimensions, parts = g->tree->parts;
    for (int k = 0; k < n; k++) {
        double square = 0, mirror[3], most = sum_of(children[k].values, parts);
        for (int d = 0; d < g->tree->dimensions; d++) {
            const double *beside = children[k ^ 1 << d].values, off = apart(children[k].values, beside, parts);
            square += off * off / 12;
        }
        if (at_mirror(g, &children[k], mirror) > most) {
            const double off = apart(children[k].values, mirror, parts);
            square += off * off;
        }
        children[k].error = sqrt(square) / fmax(most, g->options.dark);
    }
}

static bool splits(const growth *g, const cell *c) {
    return c->depth < g->options.least_depth ||
           (c->depth < g->options.deepest &&
            c->error * pow(c->side, VOLUME * g->tree->dimensions) > g->options.tolerance);
}

static void children_of(const growth *g, const cell *c, cell *children) {
    for (int k = 0; k < 1 << g->tree->dimensions; k++) { // the lowest bit is dimension 0
        children[k] = (cell){.side = c->side / 2, .depth = c->depth + 1};
        for (int d = 0; d < g->tree->dimensions; d++) {
            children[k].low[d] = c->low[d] + (k >> d & 1 ? c->side / 2 : 0);
        }
    }
    evaluate(g, children, 1 << g->tree->dimensions);
    measure(g, children);
}

static void grow(const growth *g, task *t, const cell *c, size_t node) {
    const size_t n = (size_t)1 << g->tree->dimensions;
    const bool empty = g->tree->dimensions == 3 && c->low[0] >= 0.5; // no light comes from there
    if (t->failed || empty || !splits(g, c)) {
        t->failed = t->failed || !room((void **)&t->values, &t->value_room, t->n_values + 1, sizeof *t->values);
        if (!t->failed) {
            for (int part = 0; part < 3; part++) {
                t->values[t->n_values][part] = (float)c->values[part];
            }
            t->nodes[node] = -1 - (int)t->n_values++;
        }
        return;
    }
    const size_t first = t->n_nodes;
    t->failed =
        t->n_nodes + n > (size_t)1 << 30 || !room((void **)&t->nodes, &t->node_room, t->n_nodes + n, sizeof *t->nodes);
    if (t->failed) {
        return;
    }
    cell children[CHILDREN_MAX];
    t->n_nodes += n;
    t->nodes[node] = (int)first;
    children_of(g, c, children);
    for (size_t k = 0; k < n; k++) {
        grow(g, t, &children[k], first + k);
    }
}

// Task k of depth TOP: dimension 0 of level 1 is the lowest bit, level 2 follows.
static cell task_cell(const growth *g, size_t k) {
    cell c = {.side = 1};
    for (int level = 0; level < TOP; level++) {
        const size_t child = k >> (level * g->tree->dimensions);
        c.side /= 2;
        for (int d = 0; d < g->tree->dimensions; d++) {
            c.low[d] += (double)(child >> d & 1) * c.side;
        }
    }
    c.depth = TOP;
    c.error = INFINITY;
    return c;
}

static void grow_task(void *context, size_t k) {
    const growth *g = context;
    task *t = &g->tree->tasks[k];
    cell c = task_cell(g, k);
    t->failed = !room((void **)&t->nodes, &t->node_room, 1, sizeof *t->nodes);
    if (!t->failed) {
        t->n_nodes = 1;
        evaluate(g, &c, 1);
        grow(g, t, &c, 0);
    }
}

gonio_adaptive_tree *gonio_adaptive_tree_new(const gonio_model *model, int dimensions,
                                             const gonio_adaptive_options *options, int threads) {
    gonio_adaptive_tree *tree = calloc(1, sizeof *tree);
    if (tree == NULL) {
        return NULL;
    }
    *tree = (gonio_adaptive_tree){
        .dimensions = dimensions, .parts = model->channels, .n_tasks = (size_t)1 << (TOP * dimensions)};
    tree->tasks = calloc(tree->n_tasks, sizeof *tree->tasks);
    bool failed = tree->tasks == NULL;
    if (!failed) {
        gonio_pool_for(threads, tree->n_tasks, grow_task, &(growth){model, tree, *options});
    }
    for (size_t k = 0; k < tree->n_tasks && !failed; k++) {
        failed = tree->tasks[k].failed;
    }
    if (failed) {
        gonio_adaptive_tree_free(tree);
        return NULL;
    }
    return tree;
}

void gonio_adaptive_tree_free(gonio_adaptive_tree *tree) {
    for (size_t k = 0; tree != NULL && tree->tasks != NULL && k < tree->n_tasks; k++) {
        free(tree->tasks[k].nodes);
        free(tree->tasks[k].values);
    }
    if (tree != NULL) {
        free(tree->tasks);
    }
    free(tree);
}

void gonio_adaptive_tree_each(gonio_adaptive_tree *tree, void (*call)(void *context, float values[3]), void *context) {
    for (size_t k = 0; k < tree->n_tasks; k++) {
        task *t = &tree->tasks[k];
        const bool empty = tree->dimensions == 3 && (k & 1) != 0;
        for (size_t i = 0; i < t->n_values && !empty; i++) {
            call(context, t->values[i]);
        }
    }
}

// ---- text ----

typedef struct text {
    const gonio_adaptive_tree *tree;
    int part;
    FILE *stream;
} text;

static void range_of(const text *x, const task *t, int node, double *least, double *most) {
    if (node < 0) {
        const double v = (double)t->values[-1 - node][x->part];
        *least = fmin(*least, v);
        *most = fmax(*most, v);
        return;
    }
    for (int k = 0; k < 1 << x->tree->dimensions; k++) {
        range_of(x, t, t->nodes[node + k], least, most);
    }
}

static bool is_one(const text *x, double least, double most) {
    return most - least <= (x->part == 0 ? SAME_Y : SAME_COLOUR) * fabs(most);
}

// 2^dimensions leaves as one grid, dimension 0 slowest; false where some are no leaves.
static bool put_grid(const text *x, const task *t, int node) {
    const int dimensions = x->tree->dimensions;
    for (int k = 0; k < 1 << dimensions; k++) {
        if (t->nodes[node + k] >= 0) {
            return false;
        }
    }
    for (int k = 0; k < 1 << dimensions; k++) {
        int child = 0;
        for (int d = 0; d < dimensions; d++) {
            child |= (k >> (dimensions - 1 - d) & 1) << d;
        }
        fprintf(x->stream, k == 0 ? "{%.6g" : " %.6g", (double)t->values[-1 - t->nodes[node + child]][x->part]);
    }
    fputs("}\n", x->stream);
    return true;
}

static void put_node(const text *x, const task *t, int node) {
    double least = INFINITY, most = -INFINITY;
    range_of(x, t, node, &least, &most);
    if (is_one(x, least, most)) {
        fprintf(x->stream, "{%.6g}\n", 0.5 * (least + most));
        return;
    }
    if (put_grid(x, t, node)) {
        return;
    }
    fputs("{\n", x->stream);
    for (int k = 0; k < 1 << x->tree->dimensions; k++) {
        put_node(x, t, t->nodes[node + k]);
    }
    fputs("}\n", x->stream);
}

static void put_top(const text *x, int level, size_t first) {
    const size_t children = (size_t)1 << x->tree->dimensions;
    fputs("{\n", x->stream);
    for (size_t k = 0; k < children; k++) {
        const size_t number = first + (k << (level * x->tree->dimensions));
        if (level + 1 < TOP) {
            put_top(x, level + 1, number);
        } else {
            put_node(x, &x->tree->tasks[number], x->tree->tasks[number].nodes[0]);
        }
    }
    fputs("}\n", x->stream);
}

void gonio_adaptive_tree_put(const gonio_adaptive_tree *tree, int part, FILE *stream) {
    put_top(&(text){tree, part, stream}, 0, 0);
}
