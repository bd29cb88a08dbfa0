// SPDX-License-Identifier: BSD-3-Clause
// What pictures ask of materials.
//
// A use of a material brings light b = w f to its pixel (per channel), w being all that f_r is multiplied by. If f_r is
// off by a small share e there, the pixel's 8-bit code c(s L) of light L at exposure s is off by s c'(s L) b e. So a
// use counts |s c'(s L) b| codes, the length being over the channels; and its share of the square of what all uses of
// the pixel would make together, (s c' b) . (s c' L), if their errors go together, as those of one light do.
//
// Beyond white c' is 0, but a lobe must stay bright enough to be white. The slope is continued as (s L)^-2 there: an
// error shows only where it is larger than what lies above white.
//
// Sums are of whole multiples of a quantum, so that they do not depend on the order in which threads add to them.
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "fit/needs/needs.h"
#include "gonio/scene_needs.h"

#define CELLS 200000
#define SHARDS 64
// 2^24 pixels of 441 codes, of as many squares, and 2^28 directions or logarithms up to 64 stay within 62 bits.
#define CODES_UNIT 0x1p26
#define SQUARES_UNIT 0x1p18
#define DIRECTION_UNIT 0x1p30
#define LOG_UNIT 0x1p26

typedef struct cell {
    uint64_t key, uses; // uses 0: no cell
    uint64_t codes, squares;
    int64_t direction[6], log_value;
} cell;

// Cells of one material whose keys' hashes begin alike: open addressing, at most half full.
typedef struct shard {
    pthread_mutex_t mutex;
    cell *table;
    size_t used, capacity;
} shard;

typedef struct collection {
    bool isotropic;
    int resolution;
    shard shards[SHARDS];
    atomic_size_t cells;
    atomic_ullong behind;
} collection;

typedef struct collector {
    const gonio_scene *scene;
    collection *materials;
    size_t limit;
    atomic_bool full, no_memory; // a material has too many cells; nowhere to put one
    float *slopes;               // of the frame's pixels, by channel: s c'(s L)
    const gonio_picture *picture;
} collector;

// ---- cells ----

static cell *slot_of(cell *table, size_t capacity, uint64_t key) {
    size_t at = (size_t)(gonio_random(key) & (capacity - 1));
    while (table[at].uses != 0 && table[at].key != key) {
        at = (at + 1) & (capacity - 1);
    }
    return &table[at];
}

static bool grow(shard *s) {
    const size_t capacity = s->capacity > 0 ? 2 * s->capacity : 64;
    cell *table = calloc(capacity, sizeof *table);
    for (size_t i = 0; table != NULL && i < s->capacity; i++) {
        if (s->table[i].uses != 0) {
            *slot_of(table, capacity, s->table[i].key) = s->table[i];
        }
    }
    if (table != NULL) {
        free(s->table);
        s->table = table;
        s->capacity = capacity;
    }
    return table != NULL;
}

static void add(collector *c, collection *m, const cell *what) {
    shard *s = &m->shards[gonio_random(what->key) >> 58];
    pthread_mutex_lock(&s->mutex);
    if (2 * s->used >= s->capacity && !grow(s)) {
        c->no_memory = true;
    } else {
        cell *to = slot_of(s->table, s->capacity, what->key);
        if (to->uses == 0) {
            s->used++;
            c->full = c->full || ++m->cells > c->limit;
        }
        to->key = what->key;
        to->uses++;
        to->codes += what->codes;
        to->squares += what->squares;
        to->log_value += what->log_value;
        for (int k = 0; k < 6; k++) {
            to->direction[k] += what->direction[k];
        }
    }
    pthread_mutex_unlock(&s->mutex);
}

static void clear(collection *m) {
    for (int k = 0; k < SHARDS; k++) {
        free(m->shards[k].table);
        m->shards[k].table = NULL;
        m->shards[k].used = m->shards[k].capacity = 0;
    }
    m->cells = 0;
    m->behind = 0;
}

// ---- uses ----

static void take_use(void *context, const gonio_scene_use *use) {
    collector *c = context;
    collection *m = &c->materials[use->material];
    const float *slope = c->slopes + 3 * (size_t)use->pixel, *light = c->picture->rgb + 3 * (size_t)use->pixel;
    double codes2 = 0, squares = 0, value = 0;
    if (c->full || c->no_memory) {
        return;
    }
    for (int k = 0; k < 3; k++) {
        const double now = (double)slope[k] * use->light[k];
        codes2 += now * now;
        squares += now * (double)slope[k] * (double)light[k];
        value += use->weight[k] > 0 ? use->light[k] / use->weight[k] / 3 : 0;
    }
    const uint64_t codes = (uint64_t)llround(fmin(sqrt(codes2), 1e6) * CODES_UNIT);
    if (use->wi.z < 0 || use->wo.z < 0) {
        m->behind += codes;
        return;
    }
    gonio_vec3 wi = use->wi, wo = use->wo;
    gonio_needs_normal_pair(m->isotropic, &wi, &wo);
    const double v[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
    cell what = {.key = gonio_needs_key(m->isotropic, m->resolution, wi, wo),
                 .codes = codes,
                 .squares = (uint64_t)llround(fmin(squares, 1e6) * SQUARES_UNIT),
                 .log_value = llround(log(fmin(fmax(value, 1e-27), 1e27)) * LOG_UNIT)};
    for (int k = 0; k < 6; k++) {
        what.direction[k] = llround(v[k] * DIRECTION_UNIT);
    }
    add(c, m, &what);
}

// d code / d linear, of codes that are not rounded.
static double slope_of(double linear) {
    const double v = fmax(linear, 0);
    return v > 1 ? 255 * 1.055 / 2.4 / (v * v) : v <= 0.0031308 ? 255 * 12.92 : 255 * 1.055 / 2.4 * pow(v, 1 / 2.4 - 1);
}

static gonio_scene_options options_of(const gonio_scene_options *render, const gonio_needs_frame *frame) {
    gonio_scene_options o = *render;
    o.camera = frame->camera[0] != 0 ? frame->camera : NULL;
    o.light = frame->light[0] != 0 ? frame->light : NULL;
    o.turn_deg = frame->turn_deg;
    o.use = NULL;
    return o;
}

// A picture of the frame, then the same paths once more, each of their uses at the slope of its pixel.
static gonio_status collect_frame(collector *c, const gonio_scene_options *render, gonio_needs_frame *frame,
                                  gonio_error *error) {
    gonio_scene_options o = options_of(render, frame);
    gonio_picture *picture = NULL, *again = NULL;
    gonio_status status = gonio_scene_render(c->scene, &o, &picture, NULL, error);
    status = status == GONIO_OK && !(frame->exposure > 0) ? gonio_picture_exposure(picture, &frame->exposure, error)
                                                          : status;
    const size_t values = 3 * (size_t)o.width * (size_t)o.height;
    c->slopes = malloc(values * sizeof *c->slopes);
    c->picture = picture;
    if (status == GONIO_OK && c->slopes == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a picture's slopes");
    }
    if (status == GONIO_OK) {
        for (size_t i = 0; i < values; i++) {
            c->slopes[i] = (float)(frame->exposure * slope_of(frame->exposure * (double)picture->rgb[i]));
        }
        o.use = take_use;
        o.use_context = c;
        status = gonio_scene_render(c->scene, &o, &again, NULL, error);
    }
    free(c->slopes);
    gonio_picture_free(picture);
    gonio_picture_free(again);
    return status == GONIO_OK && c->no_memory ? gonio_fail(error, GONIO_E_MEMORY, "no memory for what a scene needs")
                                              : status;
}

// Again with coarser cells until every material has few enough.
static gonio_status collect(collector *c, int materials, const gonio_scene_options *render, gonio_needs_frame *frames,
                            int n, gonio_error *error) {
    gonio_status status = GONIO_OK;
    do {
        c->full = false;
        for (int f = 0; f < n && status == GONIO_OK && !c->full; f++) {
            status = collect_frame(c, render, &frames[f], error);
        }
        for (int m = 0; m < materials && c->full && status == GONIO_OK; m++) {
            c->materials[m].resolution =
                c->materials[m].cells > c->limit ? c->materials[m].resolution / 2 : c->materials[m].resolution;
            clear(&c->materials[m]);
        }
    } while (c->full && status == GONIO_OK);
    return status;
}

// ---- what comes of it ----

static int by_key(const void *left, const void *right) {
    const uint64_t a = ((const cell *)left)->key, b = ((const cell *)right)->key;
    return (a > b) - (a < b);
}

static gonio_vec3 unit(const int64_t v[3]) {
    const double x = (double)v[0], y = (double)v[1], z = (double)v[2], length = sqrt(x * x + y * y + z * z);
    return length > 0 ? (gonio_vec3){x / length, y / length, z / length} : (gonio_vec3){0, 0, 1};
}

static gonio_need need_of(const cell *c, double pixels) {
    gonio_need need = {.wi = unit(c->direction),
                       .wo = unit(c->direction + 3),
                       .codes = (double)c->codes / CODES_UNIT / pixels,
                       .squares = (double)c->squares / SQUARES_UNIT / pixels,
                       .value = exp((double)c->log_value / LOG_UNIT / (double)c->uses)};
    return need;
}

// The cells that count, by key.
static gonio_status take_cells(collection *from, double pixels, needs_material *m, gonio_error *error) {
    cell *all = malloc((from->cells + 1) * sizeof *all);
    m->cell = malloc((from->cells + 1) * sizeof *m->cell);
    if (all == NULL || m->cell == NULL) {
        free(all);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what a scene needs");
    }
    size_t n = 0;
    for (int k = 0; k < SHARDS; k++) {
        for (size_t i = 0; i < from->shards[k].capacity; i++) {
            if (from->shards[k].table[i].uses != 0 && from->shards[k].table[i].codes != 0) {
                all[n++] = from->shards[k].table[i];
            }
        }
    }
    qsort(all, n, sizeof *all, by_key);
    for (size_t i = 0; i < n; i++) {
        m->cell[i] = need_of(&all[i], pixels);
        gonio_needs_normal_pair(m->isotropic, &m->cell[i].wi, &m->cell[i].wo);
    }
    m->cells = n;
    m->behind = (double)from->behind / CODES_UNIT / pixels;
    free(all);
    return GONIO_OK;
}

static gonio_status fill(const gonio_scene *scene, collection *collections, const char *path,
                         const gonio_scene_options *render, const gonio_needs_frame *frames, int n, gonio_needs *needs,
                         gonio_error *error) {
    const double pixels = (double)render->width * render->height * n;
    gonio_status status = gonio_needs_checksum(path, &needs->scene_checksum, error);
    for (int m = 0; m < needs->materials && status == GONIO_OK; m++) {
        strcpy(needs->material[m].name, gonio_scene_material_name(scene, m));
        needs->material[m].isotropic = collections[m].isotropic;
        needs->material[m].resolution = collections[m].resolution;
        status = take_cells(&collections[m], pixels, &needs->material[m], error);
    }
    memcpy(needs->frame, frames, (size_t)n * sizeof *frames);
    needs->width = render->width;
    needs->height = render->height;
    needs->samples = render->samples;
    needs->interreflection = render->interreflection;
    needs->scene = strdup(path);
    if (status == GONIO_OK && needs->scene == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for what a scene needs");
    }
    return status == GONIO_OK ? gonio_needs_finish(needs, error) : status;
}

static collection *collections_new(const gonio_scene *scene, int materials) {
    collection *all = calloc((size_t)materials, sizeof *all);
    for (int m = 0; all != NULL && m < materials; m++) {
        all[m].isotropic = gonio_scene_material_model(scene, m)->isotropic;
        all[m].resolution = all[m].isotropic ? 256 : 64;
        for (int k = 0; k < SHARDS; k++) {
            pthread_mutex_init(&all[m].shards[k].mutex, NULL);
        }
    }
    return all;
}

static void collections_free(collection *all, int materials) {
    for (int m = 0; all != NULL && m < materials; m++) {
        clear(&all[m]);
        for (int k = 0; k < SHARDS; k++) {
            pthread_mutex_destroy(&all[m].shards[k].mutex);
        }
    }
    free(all);
}

gonio_status gonio_scene_needs(const gonio_scene *scene, const char *path, const gonio_scene_needs_options *options,
                               const gonio_needs_frame *frames, int n, gonio_needs **out, gonio_error *error) {
    gonio_scene_facts facts;
    gonio_scene_describe(scene, &facts);
    *out = NULL;
    gonio_needs *needs = NULL;
    collector c = {.scene = scene,
                   .materials = collections_new(scene, facts.materials),
                   .limit = options->cells > 0 ? options->cells : CELLS};
    gonio_needs_frame *mine = malloc((size_t)n * sizeof *mine);
    gonio_status status = c.materials != NULL && mine != NULL
                              ? gonio_needs_new(facts.materials, n, &needs, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for what a scene needs");
    if (status == GONIO_OK) {
        memcpy(mine, frames, (size_t)n * sizeof *mine);
        status = collect(&c, facts.materials, &options->render, mine, n, error);
    }
    status = status == GONIO_OK ? fill(scene, c.materials, path, &options->render, mine, n, needs, error) : status;
    collections_free(c.materials, facts.materials);
    free(mine);
    if (status != GONIO_OK) {
        gonio_needs_free(needs);
        return status;
    }
    *out = needs;
    return GONIO_OK;
}
