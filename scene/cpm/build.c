// SPDX-License-Identifier: BSD-3-Clause
// A map is built part by part, each CPM_PART texels of one level; what is whole stays, so a build that ends early goes
// on.
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/random.h"
#include "base/thread_pool.h"
#include "brdf/checksum.h"
#include "scene/cpm/store.h"

#define RESOLUTION_MAX 1024
#define PIECE 8                     // texels of a part in work between two looks at whether to stop
#define DENSE_MAX ((size_t)1 << 26) // points of the whole mesh

typedef struct build {
    const gonio_scene *scene;
    const gonio_cpm_options *options;
    const char *folder;
    int held; // its descriptor, which keeps other builds out
    cpm_texel_options texel;
    cpm_surface *surface;
    cpm_points points;
    cpm_head head;
    int level;
    uint32_t first;
    cpm_record *records[CPM_PART];
    cpm_seconds texel_seconds[PIECE], seconds;
    bool no_memory; // of any texel
    size_t done, all;
    double started_s;
} build;

void gonio_cpm_options_default(gonio_cpm_options *options) {
    *options = (gonio_cpm_options){.resolution = 32,
                                   .points = 1024,
                                   .dense = 4096,
                                   .batch = 1024,
                                   .pairs = 4096,
                                   .snr_db = 30,
                                   .most = 512,
                                   .faces = 32,
                                   .keep = 0.05,
                                   .share = 0.1,
                                   .energy = 0.97,
                                   .seed = 1};
}

static bool is_power_of_two(int n) { return n > 0 && (n & (n - 1)) == 0; }

static gonio_status check(const gonio_cpm_options *o, gonio_error *error) {
    if (!is_power_of_two(o->resolution) || o->resolution > RESOLUTION_MAX) {
        return gonio_fail(error, GONIO_E_RANGE, "%d texels a side; a power of two up to %d is possible", o->resolution,
                          RESOLUTION_MAX);
    }
    if (!is_power_of_two(o->faces) || o->faces < 4 || o->faces > CPM_FACE_MAX) {
        return gonio_fail(error, GONIO_E_RANGE, "faces of %d pixels; 4, 8, 16, 32 and %d are possible", o->faces,
                          CPM_FACE_MAX);
    }
    if (o->points < 16 || o->dense < 16 || o->batch < 16 || o->batch > 16384 || o->most < 1 || o->most > 4096 ||
        o->pairs < 64 || o->pairs > 1 << 16) {
        return gonio_fail(error, GONIO_E_RANGE,
                          "%zu points, %zu dense, batches of %zu, %zu chosen, %d pairs; at least 16, 16, 16, 1 and 64, "
                          "batches up to 16384, chosen up to 4096, pairs up to 65536",
                          o->points, o->dense, o->batch, o->most, o->pairs);
    }
    if ((double)o->points * o->resolution * o->resolution > (double)DENSE_MAX) {
        return gonio_fail(error, GONIO_E_RANGE, "%g dense points; at most %zu are possible",
                          (double)o->points * o->resolution * o->resolution, DENSE_MAX);
    }
    if (!(o->snr_db > 0 && o->snr_db <= 80) || !(o->keep > 0 && o->keep <= 1) || !(o->share > 0 && o->share <= 1) ||
        !(o->energy > 0 && o->energy < 1)) {
        return gonio_fail(error, GONIO_E_RANGE,
                          "%g dB, %g of the coefficients, %g of the triangles, energy %g; 0 to 80 dB "
                          "and shares of 0 to 1 are possible",
                          o->snr_db, o->keep, o->share, o->energy);
    }
    return GONIO_OK;
}

// ---- what it is a map of ----

static void add_picture(gonio_checksum *sum, const gonio_picture *picture) {
    gonio_checksum_add(sum, picture->rgb, 3 * (size_t)picture->width * (size_t)picture->height * sizeof *picture->rgb);
}

uint64_t gonio_cpm_scene_fingerprint(const gonio_scene *scene) {
    const scene_mesh *mesh = scene->mesh;
    const scene_settings *s = scene->settings;
    gonio_checksum sum = gonio_checksum_begin();
    gonio_checksum_add(&sum, mesh->positions, 3 * mesh->vertices * sizeof *mesh->positions);
    gonio_checksum_add(&sum, mesh->normals, 3 * mesh->vertices * sizeof *mesh->normals);
    gonio_checksum_add(&sum, mesh->uvs, 2 * mesh->vertices * sizeof *mesh->uvs);
    gonio_checksum_add(&sum, mesh->indices, 3 * mesh->triangles * sizeof *mesh->indices);
    gonio_checksum_add(&sum, scene->triangle_material, mesh->triangles * sizeof *scene->triangle_material);
    for (int i = 0; i < s->materials; i++) {
        const scene_material_settings *m = &s->material[i];
        gonio_checksum_add(&sum, m->model, strlen(m->model));
        gonio_checksum_add(&sum, m->albedo, sizeof m->albedo);
        if (scene->materials[i].map != NULL) {
            add_picture(&sum, scene->materials[i].map);
        }
    }
    for (int i = 0; i < s->meshes; i++) {
        const world_material_map *map = &scene->meshes[i].map;
        if (map->materials != NULL) {
            gonio_checksum_add(&sum, map->materials, (size_t)map->width * (size_t)map->height * sizeof *map->materials);
        }
    }
    return gonio_checksum_end(&sum);
}

static uint64_t fingerprint(const gonio_cpm_options *o, uint64_t scene) {
    const double values[] = {o->resolution, (double)o->points, (double)o->dense, (double)o->batch, o->pairs,
                             o->snr_db,     (double)o->most,   o->faces,         o->keep,          o->share,
                             o->own_charts, o->separate,       o->paper,         o->energy,        o->filter};
    gonio_checksum sum = gonio_checksum_begin();
    gonio_checksum_add(&sum, values, sizeof values);
    gonio_checksum_add(&sum, &o->seed, sizeof o->seed);
    gonio_checksum_add(&sum, &scene, sizeof scene);
    return gonio_checksum_end(&sum);
}

// ---- texels ----

static void make_texel(void *context, size_t item) {
    build *b = context;
    const uint32_t texel = b->first + (uint32_t)item;
    const uint64_t seed = gonio_random(b->options->seed ^ gonio_random(((uint64_t)b->level << 40) + texel));
    cpm_dense dense;
    if (!gonio_cpm_dense_new(&b->points, b->options->filter, b->level, b->options->resolution, texel, b->options->dense,
                             &dense)) {
        b->no_memory = true;
        return;
    }
    if (dense.n > 0) {
        b->records[item] = gonio_cpm_texel_make(b->scene, &dense, &b->texel, seed, &b->texel_seconds[item]);
        b->no_memory = b->no_memory || b->records[item] == NULL;
    }
    gonio_cpm_dense_free(&dense);
}

// Bytes of one texel in work: both sheets of its matrix, what is seen from their directions, and the products of chosen
// columns.
static size_t texel_bytes(const gonio_cpm_options *o) {
    const size_t columns = o->batch < o->dense ? o->batch : o->dense, pairs = (size_t)o->pairs;
    return pairs * 15 / 4 * columns * sizeof(float) + pairs * 3 / 8 * o->dense +
           (o->most + (o->paper ? 3 * columns : 0)) * columns * sizeof(double) + 4 * o->dense * sizeof(cpm_point) +
           o->dense * (sizeof(cpm_place) + sizeof(double));
}

// How many texels may be in work at a time, beside the points of the whole mesh; 0: not one.
static size_t texels_at_once(const gonio_cpm_options *o) {
    const size_t points = o->points * (size_t)o->resolution * (size_t)o->resolution * sizeof(cpm_point);
    const size_t threads = gonio_pool_threads(o->threads);
    if (o->memory == 0) {
        return threads;
    }
    const size_t fit = o->memory > points ? (o->memory - points) / texel_bytes(o) : 0;
    return fit < threads ? fit : threads;
}

static gonio_status check_memory(const gonio_cpm_options *o, gonio_error *error) {
    const double points = (double)o->points * o->resolution * o->resolution * sizeof(cpm_point);
    return texels_at_once(o) > 0
               ? GONIO_OK
               : gonio_fail(
                     error, GONIO_E_RANGE,
                     "%.3g MB of memory; the points of the mesh take %.3g MB (less with fewer points or texels), "
                     "one texel's matrix %.3g MB (less with fewer pairs or smaller batches)",
                     (double)o->memory / 1e6, points / 1e6, (double)texel_bytes(o) / 1e6);
}

static bool goes_on(const build *b) {
    const gonio_cpm_options *o = b->options;
    const double seconds = fmax(gonio_clock_s() - b->started_s, 1e-9);
    return o->progress == NULL ||
           o->progress(o->progress_context, (double)b->done / (double)b->all, (double)b->done / seconds);
}

static gonio_status stopped(const build *b, gonio_error *error) {
    return gonio_fail(error, GONIO_E_INTERRUPTED, "stopped after %zu of %zu texels; the same command goes on", b->done,
                      b->all);
}

// The texels of a part, a few at a time, so that it can be stopped soon.
static gonio_status make_texels(build *b, gonio_pool *pool, size_t n, gonio_error *error) {
    for (size_t at = 0; at < n; at += PIECE) {
        const size_t few = n - at < PIECE ? n - at : PIECE;
        build piece = *b;
        piece.first = b->first + (uint32_t)at;
        memset(piece.records, 0, sizeof piece.records);
        memset(piece.texel_seconds, 0, sizeof piece.texel_seconds);
        gonio_pool_run(pool, few, make_texel, &piece);
        memcpy(b->records + at, piece.records, few * sizeof *b->records);
        b->done += few;
        for (size_t k = 0; k < few; k++) {
            b->seconds.area += piece.texel_seconds[k].area;
            b->seconds.reflectance += piece.texel_seconds[k].reflectance;
            b->seconds.choice += piece.texel_seconds[k].choice;
        }
        if (piece.no_memory) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a texel's matrix; --batch or --pairs less");
        }
        if (at + few < n && !goes_on(b)) {
            return stopped(b, error);
        }
    }
    const gonio_status status =
        gonio_cpm_part_write(b->folder, b->level, b->first, b->head.fingerprint, n, b->records, error);
    return status == GONIO_OK ? gonio_cpm_seconds_write(b->folder, &b->seconds, error) : status;
}

static gonio_status make_part(build *b, gonio_pool *pool, size_t n, gonio_error *error) {
    gonio_status status = GONIO_OK;
    if (gonio_cpm_part_read(b->folder, b->level, b->first, b->head.fingerprint, n, b->records)) {
        b->done += n;
    } else {
        status = make_texels(b, pool, n, error);
        status = status == GONIO_OK && !goes_on(b) ? stopped(b, error) : status;
    }
    for (size_t k = 0; k < n; k++) {
        b->head.facts.missed += b->records[k] != NULL && (double)b->records[k]->snr_db < b->options->snr_db;
        free(b->records[k]);
        b->records[k] = NULL;
    }
    return status;
}

static gonio_status make_all(build *b, gonio_error *error) {
    gonio_pool *pool = gonio_pool_new((int)texels_at_once(b->options));
    gonio_cpm_seconds_read(b->folder, &b->seconds);
    gonio_status status = GONIO_OK;
    b->all = gonio_cpm_level_start(b->options->resolution, (int)b->head.levels);
    for (b->level = 0; b->level < (int)b->head.levels && status == GONIO_OK; b->level++) {
        const size_t side = (size_t)(b->options->resolution >> b->level), texels = side * side;
        for (size_t first = 0; first < texels && status == GONIO_OK; first += CPM_PART) {
            b->first = (uint32_t)first;
            status = make_part(b, pool, texels - first < CPM_PART ? texels - first : CPM_PART, error);
        }
    }
    gonio_pool_free(pool);
    return status == GONIO_OK ? gonio_cpm_store_join(b->folder, &b->head, b->surface, error) : status;
}

// ---- all ----

static gonio_status prepare(build *b, gonio_error *error) {
    const gonio_cpm_options *o = b->options;
    bool has_uv = true;
    for (int i = 0; i < b->scene->settings->meshes; i++) {
        has_uv = has_uv && b->scene->meshes[i].has_uv;
    }
    const cpm_surface_options surface = {o->share, o->own_charts || b->scene->settings->meshes > 1, o->resolution};
    gonio_status status = gonio_cpm_surface_new(b->scene->mesh, has_uv, &surface, &b->surface, error);
    const double wanted = (double)o->points * o->resolution * o->resolution;
    if (status == GONIO_OK) {
        status = gonio_cpm_points_new(b->scene, b->surface, (size_t)wanted, o->resolution, o->threads, o->seed,
                                      &b->points, error);
    }
    gonio_cpm_facts *facts = &b->head.facts;
    if (status == GONIO_OK) {
        facts->resolution = o->resolution;
        facts->levels = (int)b->head.levels;
        facts->triangles = b->scene->mesh->triangles;
        facts->simplified = gonio_cpm_surface_triangles(b->surface);
        facts->own_charts = !gonio_cpm_surface_has_file_charts(b->surface);
        facts->open_edges = b->scene->facts.open_edges;
    }
    return status;
}

// A folder that is not there is made; a map that is there must be this one.
static gonio_status enter(build *b, bool *finished, gonio_error *error) {
    *finished = false;
    if (mkdir(b->folder, 0777) != 0 && errno != EEXIST) {
        return gonio_fail_line(error, GONIO_E_IO, b->folder, -1, "cannot make the folder: %s", strerror(errno));
    }
    char path[4096];
    cpm_store store;
    b->held = gonio_cpm_folder_hold(b->folder);
    if (b->held < 0) {
        return gonio_fail_line(error, GONIO_E_IO, b->folder, -1, "%s",
                               errno == EWOULDBLOCK ? "another build is at work in it" : strerror(errno));
    }
    snprintf(path, sizeof path, "%s/map.cpm", b->folder);
    if (access(path, F_OK) != 0) {
        return GONIO_OK;
    }
    gonio_status status = gonio_cpm_store_open(b->folder, &store, error);
    if (status == GONIO_OK && store.head.fingerprint != b->head.fingerprint) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                                 "the folder holds the map of another scene, or of other options; name another one");
    }
    *finished = status == GONIO_OK;
    b->head.facts = status == GONIO_OK ? store.head.facts : b->head.facts;
    gonio_cpm_store_release(&store);
    return status;
}

gonio_status gonio_cpm_build(const gonio_scene *scene, const char *folder, const gonio_cpm_options *o,
                             gonio_cpm_facts *facts, gonio_error *error) {
    build *b = calloc(1, sizeof *b);
    if (b == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a map");
    }
    // Member by member: what lies between them is written too, and stays 0.
    b->scene = scene;
    b->options = o;
    b->folder = folder;
    b->held = -1;
    b->started_s = gonio_clock_s();
    b->texel = (cpm_texel_options){o->pairs, o->snr_db,   o->most,  o->batch, o->faces,
                                   o->keep,  o->separate, o->paper, o->energy};
    b->head.scene = gonio_cpm_scene_fingerprint(scene);
    b->head.fingerprint = fingerprint(o, b->head.scene);
    b->head.version = CPM_VERSION;
    b->head.resolution = (uint32_t)o->resolution;
    b->head.levels = (uint32_t)gonio_cpm_levels(o->resolution);
    b->head.side = (uint32_t)o->faces;
    bool finished = false;
    gonio_status status = check(o, error);
    status = status == GONIO_OK ? check_memory(o, error) : status;
    status = status == GONIO_OK ? enter(b, &finished, error) : status;
    if (!finished) {
        status = status == GONIO_OK ? prepare(b, error) : status;
        status = status == GONIO_OK ? make_all(b, error) : status;
    }
    if (status == GONIO_OK && facts != NULL) {
        *facts = b->head.facts;
        facts->seconds = gonio_clock_s() - b->started_s;
        gonio_cpm_seconds_tell(folder, facts);
    }
    if (b->held >= 0) {
        close(b->held);
    }
    gonio_cpm_points_free(&b->points);
    gonio_cpm_surface_free(b->surface);
    free(b);
    return status;
}
