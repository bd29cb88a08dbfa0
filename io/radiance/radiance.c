// SPDX-License-Identifier: BSD-3-Clause
// BSDF files of Radiance and LBNL WINDOW: XML with Klems matrices or tensor trees (docs/formats.md), as samples and as
// a model that is constant over each cell, as Radiance evaluates them.
//
// Radiance's front (+z) is the back of the file: "Reflection Back", and "Transmission Back" for light from there.
// Colour: matrices carry CIE-X and CIE-Z beside Visible, which is Y; tensor trees the chromaticity u', v' of CIE 1976.
// It becomes r, g, b as Radiance itself has them (colour.c).
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/random.h"
#include "io/radiance/radiance.h"

static const char names[3][32] = {"r", "g", "b"};
static const char single[1][32] = {"visible"};

static bool recognise(const gonio_source *source) {
    char head[2048];
    const size_t n = source->size < sizeof head - 1 ? source->size : sizeof head - 1;
    memcpy(head, source->data, n);
    head[n] = 0;
    return strstr(head, "<WindowElement") != NULL;
}

// ---- building ----

static const gonio_radiance_block *find(const gonio_radiance_file *file, const char *quantity, const char *direction) {
    for (int k = 0; k < file->n; k++) {
        if (strcasecmp(file->blocks[k].quantity, quantity) == 0 &&
            strcasecmp(file->blocks[k].direction, direction) == 0) {
            return &file->blocks[k];
        }
    }
    return NULL;
}

// Which blocks make the model of a side ("Reflection Back").
static gonio_status choose(const gonio_radiance_file *file, const char *side, const gonio_radiance_block *chosen[3],
                           int *parts, gonio_error *error) {
    const bool is_tree = strncasecmp(file->structure, "TensorTree", 10) == 0;
    chosen[0] = find(file, "Visible", side);
    if (chosen[0] == NULL) {
        char list[400] = "";
        for (int k = 0; k < file->n; k++) {
            gonio_text_append(list, sizeof list, "%s%.30s %.30s", k > 0 ? ", " : "", file->blocks[k].quantity,
                              file->blocks[k].direction);
        }
        return gonio_radiance_fail(file, -1, error, "no table 'Visible %s'; the file holds %s", side, list);
    }
    chosen[1] = find(file, is_tree ? "CIE-u" : "CIE-X", side);
    chosen[2] = find(file, is_tree ? "CIE-v" : "CIE-Z", side);
    *parts = chosen[1] != NULL && chosen[2] != NULL ? 3 : 1;
    return GONIO_OK;
}

static gonio_status fill(const gonio_radiance_file *file, const char *side, gonio_radiance_model *m,
                         gonio_error *error) {
    static const char *const structures[] = {"Columns", "Rows", "TensorTree3", "TensorTree4"};
    bool known = false;
    for (int k = 0; k < 4; k++) {
        known = known || strcasecmp(file->structure, structures[k]) == 0;
    }
    if (!known) {
        return gonio_radiance_fail(file, file->definition != NULL ? xmlGetLineNo(file->definition) : -1, error,
                                   "IncidentDataStructure '%.40s'; expected Columns, Rows, TensorTree3 or TensorTree4",
                                   file->structure);
    }
    const gonio_radiance_block *chosen[3];
    gonio_status status = choose(file, side, chosen, &m->parts, error);
    m->is_tree = strncasecmp(file->structure, "TensorTree", 10) == 0;
    for (int k = 0; status == GONIO_OK && k < m->parts; k++) {
        status = m->is_tree ? gonio_tensor_tree_read(file, chosen[k], &m->tree[k], error)
                            : gonio_klems_read(file, chosen[k], &m->klems[k], error);
        const size_t n =
            m->is_tree ? m->tree[k].n_values : (size_t)m->klems[k].in.patches * (size_t)m->klems[k].out.patches;
        m->head.bytes += n * sizeof(double) + m->tree[k].n_nodes * sizeof(int);
        m->head.control_points = k == 0 ? n : m->head.control_points;
    }
    for (int k = 1; status == GONIO_OK && !m->is_tree && k < m->parts; k++) {
        if (memcmp(&m->klems[k].in, &m->klems[0].in, sizeof m->klems[0].in) != 0 ||
            memcmp(&m->klems[k].out, &m->klems[0].out, sizeof m->klems[0].out) != 0) {
            status = gonio_radiance_fail(file, chosen[k]->line, error, "its angle bases are not those of Visible");
        }
    }
    return status;
}

// The floor of a half that a file of ours tells in a comment.
static void find_floor(const gonio_radiance_file *file, const char *direction, gonio_radiance_model *m) {
    const xmlNode *root = xmlDocGetRootElement(file->doc);
    for (const xmlNode *node = root->children; node != NULL; node = node->next) {
        const char *text = node->type == XML_COMMENT_NODE ? (const char *)node->content : "";
        const char *at = strstr(text, GONIO_RADIANCE_FLOOR);
        long long line = 0;
        double floor[3];
        if (at == NULL) {
            continue;
        }
        at += sizeof GONIO_RADIANCE_FLOOR - 1;
        if (strcasecmp(direction, gonio_radiance_direction(GONIO_REFLECTION)) != 0) {
            const char *named = strstr(at, direction);
            if (named == NULL) {
                continue;
            }
            at = named + strlen(direction);
        }
        if (gonio_radiance_number(&at, &line, &floor[0]) && gonio_radiance_number(&at, &line, &floor[1]) &&
            gonio_radiance_number(&at, &line, &floor[2])) {
            memcpy(m->floor, floor, sizeof floor);
        }
    }
}

static gonio_status load_half(const gonio_radiance_file *file, const char *direction, gonio_model **out,
                              gonio_error *error) {
    gonio_radiance_model *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", file->path);
    }
    m->head = (gonio_model){.ops = &gonio_radiance_ops, .isotropic = strcasecmp(file->structure, "TensorTree3") == 0};
    const gonio_status status = fill(file, direction, m, error);
    find_floor(file, direction, m);
    m->head.channels = m->parts;
    m->head.channel_names = m->parts == 3 ? names : single;
    if (status != GONIO_OK) {
        gonio_model_free(&m->head);
        return status;
    }
    *out = &m->head;
    return GONIO_OK;
}

// Where one half has no colour, none has.
static void level_colours(gonio_model *halves[GONIO_HALVES]) {
    bool grey = false;
    for (int h = 0; h < GONIO_HALVES; h++) {
        grey = grey || (halves[h] != NULL && halves[h]->channels == 1);
    }
    for (int h = 0; h < GONIO_HALVES && grey; h++) {
        if (halves[h] != NULL) {
            ((gonio_radiance_model *)halves[h])->parts = halves[h]->channels = 1;
            halves[h]->channel_names = single;
        }
    }
}

enum { SIDE_AUTO, SIDE_FRONT, SIDE_BACK };

// Which halves to read, bits 1 << gonio_half. Of a reflection alone, which is then looked at from its own side, the
// index goes to *single_half; else -1.
static unsigned wanted(const gonio_radiance_file *file, int side, int *single_half) {
    unsigned there = 0;
    for (int h = 0; h < GONIO_HALVES; h++) {
        there |= (unsigned)(find(file, "Visible", gonio_radiance_direction((gonio_half)h)) != NULL) << h;
    }
    there = side == SIDE_FRONT || there == 0 ? 1u << GONIO_REFLECTION
            : side == SIDE_BACK              ? 1u << GONIO_REFLECTION_BACK
                                             : there;
    *single_half = there == 1u << GONIO_REFLECTION        ? GONIO_REFLECTION
                   : there == 1u << GONIO_REFLECTION_BACK ? GONIO_REFLECTION_BACK
                                                          : -1;
    return there;
}

static gonio_status load(const gonio_source *source, int side, gonio_model *halves[GONIO_HALVES], gonio_error *error) {
    gonio_radiance_file file;
    gonio_status status = gonio_radiance_open(source, &file, error);
    if (status != GONIO_OK) {
        return status;
    }
    int single_half;
    const unsigned there = wanted(&file, side, &single_half);
    for (int h = 0; status == GONIO_OK && h < GONIO_HALVES; h++) {
        if (there >> h & 1) {
            status = load_half(&file, gonio_radiance_direction((gonio_half)h),
                               &halves[single_half < 0 ? h : GONIO_REFLECTION], error);
        }
    }
    gonio_radiance_close(&file);
    level_colours(halves);
    return status;
}

static void free_halves(gonio_model *halves[GONIO_HALVES]) {
    for (int h = 0; h < GONIO_HALVES; h++) {
        gonio_model_free(halves[h]);
    }
}

static gonio_status table_radiance(const gonio_source *source, gonio_model **out, gonio_error *error) {
    gonio_model *halves[GONIO_HALVES] = {NULL};
    gonio_status status = load(source, SIDE_AUTO, halves, error);
    status = status == GONIO_OK ? gonio_model_of_halves(halves, out, error) : status;
    if (status != GONIO_OK) {
        free_halves(halves);
    }
    return status;
}

// ---- samples: the cells' centres ----

typedef struct cells {
    const gonio_radiance_model *m;
    gonio_half half;
    gonio_samples *samples;
    size_t count, n; // cells so far; in all
    double share;
    uint64_t key;
    gonio_status status;
    gonio_error *error;
} cells;

static bool count_cell(void *context, const gonio_pair *pair) {
    (void)pair;
    ((cells *)context)->n++;
    return true;
}

static bool add_cell(void *context, const gonio_pair *pair) {
    cells *c = context;
    const uint64_t number = c->count++;
    if (c->share < 1 && gonio_random_uniform((c->key ^ number * GONIO_RANDOM_STEP) - GONIO_RANDOM_STEP) >= c->share) {
        return true;
    }
    double values[3];
    gonio_radiance_ops.eval(&c->m->head, gonio_direction(pair->theta_i, pair->phi_i),
                            gonio_direction(pair->theta_o, pair->phi_o), values);
    const gonio_pair lowered = gonio_pair_lowered(*pair, c->half);
    c->status = gonio_samples_add(c->samples, &lowered, values, NULL, NULL, c->error);
    return c->status == GONIO_OK;
}

static void for_cells(const gonio_radiance_model *m, gonio_tensor_tree_fn call, cells *c) {
    if (m->is_tree) {
        gonio_tensor_tree_cells(&m->tree[0], call, c);
        return;
    }
    const gonio_klems *k = &m->klems[0];
    for (int in = 0; in < k->in.patches; in++) {
        for (int out = 0; out < k->out.patches; out++) {
            const gonio_pair pair = gonio_klems_centre(k, in, out);
            if (!call(c, &pair)) {
                return;
            }
        }
    }
}

// Every half's cells, or all of them counted.
static void for_halves(gonio_model *halves[GONIO_HALVES], gonio_tensor_tree_fn call, cells *c) {
    for (int h = 0; h < GONIO_HALVES && c->status == GONIO_OK; h++) {
        if (halves[h] != NULL) {
            c->m = (const gonio_radiance_model *)halves[h];
            c->half = (gonio_half)h;
            for_cells(c->m, call, c);
        }
    }
}

static gonio_status sample(gonio_model *halves[GONIO_HALVES], const gonio_format_values *values, gonio_samples **out,
                           gonio_error *error) {
    int first = 0;
    while (halves[first] == NULL) {
        first++;
    }
    const gonio_model *head = halves[first];
    cells c = {.key = gonio_random(values->seed), .error = error};
    c.status = gonio_samples_new(head->channels, false, &c.samples, error);
    if (c.status == GONIO_OK) {
        c.samples->isotropic = head->isotropic;
        c.samples->transmission = halves[GONIO_TRANSMISSION] != NULL || halves[GONIO_REFLECTION_BACK] != NULL ||
                                  halves[GONIO_TRANSMISSION_BACK] != NULL;
        memcpy(c.samples->channel_names, head->channel_names,
               (size_t)head->channels * sizeof *c.samples->channel_names);
        for_halves(halves, count_cell, &c);
        c.share = values->at[0].count > 0 ? (double)values->at[0].count / (double)c.n : 1;
        for_halves(halves, add_cell, &c);
    }
    *out = c.samples;
    return c.status;
}

static gonio_status read_radiance(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                                  gonio_read_report *report, gonio_error *error) {
    gonio_model *halves[GONIO_HALVES] = {NULL};
    *out = NULL;
    gonio_status status = load(source, values->at[1].choice, halves, error);
    status = status == GONIO_OK ? sample(halves, values, out, error) : status;
    free_halves(halves);
    if (status == GONIO_OK && report != NULL) {
        *report = (gonio_read_report){.format = "radiance", .rows = (*out)->n, .first_negative_line = -1};
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}

static const gonio_format_option options[] = {
    {"limit", GONIO_FORMAT_COUNT, "N", "100k", "at most about N samples of a table"},
    {"side", GONIO_FORMAT_CHOICE, "auto|front|back", "auto",
     "one reflection alone: front (+z, 'Reflection Back' of the file) or back; else every half that is there"},
    {0}};

const gonio_format gonio_format_radiance = {.name = "radiance",
                                            .summary = "Radiance/WINDOW BSDF XML",
                                            .extensions = ".xml",
                                            .recognise = recognise,
                                            .read = read_radiance,
                                            .table = table_radiance,
                                            .write_table = gonio_radiance_write,
                                            .halves = (1u << GONIO_HALVES) - 1,
                                            .write_options = gonio_radiance_write_options,
                                            .quantity = "f_r, 1/sr: Visible is Y; CIE-u, CIE-v (trees) or CIE-X, CIE-Z",
                                            .convention = "Radiance's front is Reflection Back; incident squares and "
                                                          "patches are turned by 180 deg",
                                            .precision = 5e-5,
                                            .options = options};
