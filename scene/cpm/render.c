// SPDX-License-Identifier: BSD-3-Clause
// A picture by the map. Rays meet the original mesh, so silhouettes are its own; each takes the light of the texels
// around its nearest place on M_1, at the level where a texel is as large as the pixel's print on M_1 (annex C.1). A
// texel's light toward the eye is found once (eq. 12), whichever rays need it: first all rays are followed and texels
// marked, then those are evaluated, then pixels are mixed from them.
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/random.h"
#include "base/sobol.h"
#include "base/thread_pool.h"
#include "base/vector.h"
#include "scene/cpm/map.h"
#include "scene/image.h"
#include "scene/world/camera.h"
#include "scene/world/path.h"

#define SAMPLES_MAX 4096
#define EDGE_TEXELS 4
#define EDGE_RAYS 16                 // of a pixel at an edge that bring light; how much of it is covered more rays tell
#define RAYS_MAX ((size_t)256 << 20) // bytes of rays that are kept between the two passes
#define ALIKE 0.05                   // of the distance: two rays of a pixel end about as far away
#define GRAZING 0.5                  // cosine below which a pixel's print on the surface grows no further

typedef enum fate { MISSES, MAPPED, ORIGINAL } fate;
typedef struct ray {
    float s, t, level;
    unsigned char fate;
} ray;

typedef struct frame {
    const gonio_cpm *cpm;
    const gonio_scene_options *options;
    const gonio_cpm_render_options *how;
    world_camera camera;
    gonio_picture *picture;
    int samples, resolution, levels;
    unsigned char *edges;  // [pixels]: what is known of it
    unsigned char *beside; // [pixels]: an edge is near
    ray *rays;             // pixels x samples; NULL: they are followed twice
    double (*places)[2];   // of rays in a pixel
    atomic_uchar *marks;   // [texels of all levels]
    float (*light)[3];     // the same
    uint32_t *wanted;      // texels that are marked
    size_t wanted_count;
    atomic_bool stopped, damaged;
    atomic_size_t original;
    pthread_mutex_t mutex; // of progress
    size_t finished;
    size_t steps; // of progress
    double started_s;
} frame;

void gonio_cpm_render_options_default(gonio_cpm_render_options *options) {
    *options = (gonio_cpm_render_options){.fallback = 16, .edge = 64, .sky = 256, .near = 8};
}

static bool is_stopped(frame *f) {
    const gonio_scene_options *o = f->options;
    pthread_mutex_lock(&f->mutex);
    const double done = fmin(1, (double)f->finished++ / (double)f->steps);
    if (o->progress != NULL && !f->stopped &&
        !o->progress(o->progress_context, done, done / fmax(gonio_clock_s() - f->started_s, 1e-9))) {
        f->stopped = true;
    }
    pthread_mutex_unlock(&f->mutex);
    return f->stopped;
}

// ---- where a ray ends ----

// Texture per length, along and across: of a pixel's two sides laid onto M_1.
static double print_of(const frame *f, const cpm_spot *spot, gonio_vec3 direction, double distance) {
    const cpm_surface *surface = f->cpm->store.surface;
    const gonio_vec3 n = gonio_cpm_surface_normal(surface, spot->triangle);
    const double cosine = dot(n, direction), bounded = copysign(fmax(fabs(cosine), GRAZING), cosine);
    const gonio_vec3 sides[2] = {f->camera.right, f->camera.up};
    double largest = 0;
    for (int k = 0; k < 2; k++) {
        const gonio_vec3 side = scaled(sides[k], distance * f->camera.tangent);
        double ds, dt;
        gonio_cpm_surface_gradient(surface, spot, difference(side, scaled(direction, dot(side, n) / bounded)), &ds,
                                   &dt);
        largest = fmax(largest, ds * ds + dt * dt);
    }
    return sqrt(largest) * f->resolution;
}

// Texels a length of space, at the finest level.
static double density_of(const frame *f, const cpm_spot *spot) {
    const cpm_surface *surface = f->cpm->store.surface;
    const gonio_vec3 n = gonio_cpm_surface_normal(surface, spot->triangle);
    const gonio_vec3 axis = fabs(n.x) < 0.9 ? (gonio_vec3){1, 0, 0} : (gonio_vec3){0, 1, 0};
    const gonio_vec3 a = normalised(cross(n, axis)), b = cross(n, a);
    double s[2], t[2];
    gonio_cpm_surface_gradient(surface, spot, a, &s[0], &t[0]);
    gonio_cpm_surface_gradient(surface, spot, b, &s[1], &t[1]);
    return f->resolution * sqrt(fabs(s[0] * t[1] - s[1] * t[0]));
}

// The coarsest level at which every point light is still far away, in texels.
static double level_of_lights(const frame *f, const cpm_spot *spot) {
    const scene_settings *s = f->cpm->scene->settings;
    double most = f->levels;
    for (int i = 0; i < s->lights; i++) {
        if (s->light[i].kind == SCENE_LIGHT_POINT) {
            const double *p = s->light[i].position;
            const gonio_vec3 way = difference((gonio_vec3){p[0], p[1], p[2]}, spot->point);
            most = fmin(most, log2(sqrt(dot(way, way)) / f->how->near * density_of(f, spot)));
        }
    }
    return most;
}

// The same places in every pixel: what is filtered already needs no others.
static gonio_vec3 direction_of(const frame *f, int pixel, int k) {
    return gonio_world_camera_ray(&f->camera, pixel % f->options->width + f->places[k][0],
                                  pixel / f->options->width + f->places[k][1]);
}

// What one ray leaves to the next one.
typedef struct walk {
    size_t near; // the triangle of M_1
    bool known;  // of this pixel: how far away the object is, and its level
    double distance, level;
} walk;

// Where the texture coordinates are the mesh's own, a pixel's rays share the level of the first that is about as far
// away, and only that one looks for its place on M_1.
static void follow_ray(const frame *f, int pixel, int k, walk *w, ray *r) {
    const gonio_scene *scene = f->cpm->scene;
    const cpm_surface *surface = f->cpm->store.surface;
    scene_hit hit;
    cpm_spot spot;
    const bool own = gonio_cpm_surface_has_file_charts(surface);
    const gonio_vec3 direction = direction_of(f, pixel, k);
    *r = (ray){.fate = MISSES};
    if (!gonio_scene_caster_find(scene->caster, f->camera.eye, direction, &hit)) {
        return;
    }
    if (!own || !w->known || !(fabs(hit.distance - w->distance) < ALIKE * hit.distance)) {
        gonio_cpm_surface_nearest(surface, hit.point, w->near, &spot);
        const double level = log2(fmax(print_of(f, &spot, direction, hit.distance), 1e-9)) + f->how->bias;
        *w = (walk){spot.triangle, true, hit.distance, fmin(fmin(level, level_of_lights(f, &spot)), f->levels - 1)};
    }
    if (own) {
        gonio_cpm_texture(scene->mesh, hit.triangle, hit.u, hit.v, &spot.s, &spot.t);
    }
    // From the finest level on, ever more of a pixel's rays see the original.
    const bool original = w->level < -(k % f->samples + 0.5) / f->samples;
    *r = (ray){(float)spot.s, (float)spot.t, (float)fmax(w->level, 0), original ? ORIGINAL : MAPPED};
}

// ---- mixing texels ----

typedef struct tap {
    uint32_t texel; // of all levels
    int level;
    double weight;
} tap;

// The four texels around a place of one level that have points.
static int taps_of(const frame *f, const ray *r, int level, double weight, tap *taps) {
    const int side = f->resolution >> level;
    const double x = (double)r->s * side - 0.5, y = (double)r->t * side - 0.5;
    const int i = (int)floor(x), j = (int)floor(y);
    const size_t start = gonio_cpm_level_start(f->resolution, level);
    int n = 0;
    double total = 0;
    for (int k = 0; k < 4; k++) {
        const int column = i + (k & 1), row = j + (k >> 1);
        if (column < 0 || row < 0 || column >= side || row >= side) {
            continue;
        }
        const double w = ((k & 1) != 0 ? x - i : 1 - x + i) * ((k >> 1) != 0 ? y - j : 1 - y + j);
        const size_t texel = start + gonio_cpm_morton((uint32_t)column, (uint32_t)row);
        if (w > 0 && f->cpm->store.entries[texel].offset != 0) {
            taps[n++] = (tap){(uint32_t)texel, level, w};
            total += w;
        }
    }
    for (int k = 0; k < n; k++) {
        taps[k].weight *= weight / total;
    }
    return n;
}

static int all_taps(const frame *f, const ray *r, tap taps[8]) {
    const int level = (int)floorf(r->level);
    const double part = (double)r->level - level;
    int n = taps_of(f, r, level, 1 - part, taps);
    if (part > 0 && level + 1 < f->levels) {
        n += taps_of(f, r, level + 1, part, taps + n);
    }
    return n;
}

// Where a ray ends on the map; those that find no texel with points near go to the original. w NULL: it was followed
// before.
static int land(const frame *f, int pixel, int k, walk *w, ray *r, tap taps[8]) {
    const bool kept = f->rays != NULL && w == NULL && k < f->samples;
    walk own = {0};
    if (kept) {
        *r = f->rays[(size_t)pixel * (size_t)f->samples + (size_t)k];
    } else {
        follow_ray(f, pixel, k, w != NULL ? w : &own, r);
    }
    const int n = r->fate == MAPPED ? all_taps(f, r, taps) : 0;
    r->fate = r->fate == MAPPED && n == 0 ? ORIGINAL : r->fate;
    return n;
}

// Do two rays of a pixel show different things: the object and what is behind it, or places far from each other on it?
static bool are_apart(const frame *f, const ray *a, const ray *b) {
    const float texels = (float)f->resolution * exp2f(-fmaxf(a->level, b->level));
    return (a->fate == MISSES) != (b->fate == MISSES) ||
           (a->fate != MISSES && fmaxf(fabsf(a->s - b->s), fabsf(a->t - b->t)) * texels > EDGE_TEXELS);
}

// What is known of a pixel.
enum { EDGE = 1, HITS = 2, MISSES_TOO = 4 };

static int rays_of(const frame *f, int pixel) {
    const int edge = f->how->edge < EDGE_RAYS ? f->how->edge : EDGE_RAYS;
    return (f->edges[pixel] & EDGE) != 0 && edge > f->samples ? edge : f->samples;
}

static void follow_pixel(frame *f, int pixel, size_t *near) {
    walk w = {.near = *near};
    ray first, r;
    for (int k = 0; k < rays_of(f, pixel); k++) {
        tap taps[8];
        const int n = land(f, pixel, k, &w, &r, taps);
        if (f->rays != NULL && k < f->samples) {
            f->rays[(size_t)pixel * (size_t)f->samples + (size_t)k] = r;
        }
        for (int i = 0; i < n; i++) {
            atomic_store_explicit(&f->marks[taps[i].texel], 1, memory_order_relaxed);
        }
        first = k == 0 ? r : first;
        f->edges[pixel] |=
            (unsigned char)((are_apart(f, &first, &r) ? EDGE : 0) | (r.fate == MISSES ? MISSES_TOO : HITS));
    }
    *near = w.near;
}

// A pixel whose few rays all missed, or all hit, beside one where some did the other: the edge may lie within it too.
static bool is_beside_edge(const frame *f, int pixel) {
    const int width = f->options->width, height = f->options->height, x = pixel % width, y = pixel / width;
    const unsigned char other = (f->edges[pixel] & HITS) != 0 ? MISSES_TOO : HITS;
    for (int j = y > 0 ? y - 1 : 0; j <= y + 1 && j < height; j++) {
        for (int i = x > 0 ? x - 1 : 0; i <= x + 1 && i < width; i++) {
            if ((f->edges[j * width + i] & other) != 0) {
                return true;
            }
        }
    }
    return false;
}

// After all rows are followed; `beside` is set from what they found, so the order of pixels changes nothing.
static void look_beside_row(void *context, size_t y) {
    frame *f = context;
    const int width = f->options->width;
    for (int pixel = (int)y * width; pixel < (int)(y + 1) * width; pixel++) {
        f->beside[pixel] = (f->edges[pixel] & EDGE) == 0 && is_beside_edge(f, pixel);
    }
}

static void follow_beside_row(void *context, size_t y) {
    frame *f = context;
    const int width = f->options->width;
    size_t near = 0;
    for (int pixel = (int)y * width; pixel < (int)(y + 1) * width; pixel++) {
        if (f->beside[pixel] != 0) {
            f->edges[pixel] |= EDGE;
            follow_pixel(f, pixel, &near);
        }
    }
}

static void follow_row(void *context, size_t y) {
    frame *f = context;
    const int width = f->options->width;
    size_t near = 0;
    for (int x = 0; x < width && (x > 0 || !is_stopped(f)); x++) {
        follow_pixel(f, (int)y * width + x, &near);
    }
}

// ---- a texel's light ----

static void evaluate(void *context, size_t item) {
    frame *f = context;
    const uint32_t texel = f->wanted[item];
    bool damaged;
    if ((item % 16 == 0 && is_stopped(f)) || f->stopped) {
        return;
    }
    int level = 0;
    while (gonio_cpm_level_start(f->resolution, level + 1) <= texel) {
        level++;
    }
    const uint32_t own = texel - (uint32_t)gonio_cpm_level_start(f->resolution, level);
    const cpm_record *record = gonio_cpm_store_record(&f->cpm->store, level, own, &damaged);
    if (record == NULL) {
        f->damaged = true;
        return;
    }
    double rgb[3];
    bool seen = true;
    if (f->how->show == GONIO_CPM_DENSITY) {
        rgb[0] = rgb[1] = rgb[2] = record->points / (double)f->cpm->most_points;
    } else {
        const uint64_t seed = gonio_random(f->options->seed + texel);
        seen = gonio_cpm_texel_light(f->cpm, record, f->camera.eye, f->how->sky, seed, rgb);
    }
    for (int c = 0; c < 3; c++) {
        f->light[texel][c] = seen ? (float)rgb[c] : NAN; // it then counts for no ray
    }
}

static bool list_marked(frame *f) {
    const size_t texels = gonio_cpm_level_start(f->resolution, f->levels);
    f->wanted = malloc((texels + 1) * sizeof *f->wanted);
    for (size_t t = 0; t < texels && f->wanted != NULL; t++) {
        if (f->marks[t] != 0) {
            f->wanted[f->wanted_count++] = (uint32_t)t;
        }
    }
    return f->wanted != NULL;
}

// ---- pixels ----

static void colour_of_level(double level, int levels, double rgb[3]) {
    const double hue = 5 * level / levels; // from red over yellow and green to blue
    rgb[0] = fmin(1, fmax(0, fabs(hue - 3) - 1));
    rgb[1] = fmin(1, fmax(0, 2 - fabs(hue - 2)));
    rgb[2] = fmin(1, fmax(0, 2 - fabs(hue - 4)));
}

// What the original shows there: the mean of some paths of the pixel that meet it, of which the ray's own is one.
// (Those that miss count where they are rays themselves.)
static void trace_original(frame *f, int pixel, int k, double rgb[3]) {
    const int width = f->options->width, rays = rays_of(f, pixel);
    const int paths = rays > f->samples ? 1 : f->how->fallback; // many rays are many paths
    world_path path = {.scene = f->cpm->scene,
                       .seed = gonio_random(f->options->seed ^ gonio_random((uint64_t)pixel)),
                       .pixel = pixel,
                       .scale = 1};
    double total[3] = {0};
    int met = 0;
    for (int i = 0; i < paths; i++) {
        double u[2], one[3];
        bool hit;
        path.index = (uint32_t)(k * paths + i);
        gonio_world_path_random(&path, 0, u);
        gonio_world_path_trace(&path, f->camera.eye,
                               i == 0 ? direction_of(f, pixel, k)
                                      : gonio_world_camera_ray(&f->camera, pixel % width + u[0], pixel / width + u[1]),
                               one, &hit);
        met += hit;
        for (int c = 0; c < 3 && hit; c++) {
            total[c] += one[c];
        }
    }
    for (int c = 0; c < 3 && met > 0; c++) {
        rgb[c] = total[c] / met;
    }
    atomic_fetch_add(&f->original, 1);
}

// false: none of the texels around is seen.
static bool mix_taps(const frame *f, const tap *taps, int n, double rgb[3]) {
    double total = 0;
    for (int i = 0; i < n; i++) {
        const float *light = f->light[taps[i].texel];
        for (int c = 0; c < 3 && !isnan(light[0]); c++) {
            rgb[c] += taps[i].weight * (double)light[c];
        }
        total += isnan(light[0]) ? 0 : taps[i].weight;
    }
    for (int c = 0; c < 3 && total > 0; c++) {
        rgb[c] /= total;
    }
    return total > 0;
}

// What is behind the object.
static void see_background(const frame *f, int pixel, int k, double rgb[3]) {
    const world_environment *environment = f->cpm->scene->environment;
    if (environment != NULL && gonio_world_environment_visible(environment)) {
        gonio_world_environment_radiance(environment, direction_of(f, pixel, k), rgb);
    }
}

// false: it misses the object.
static bool see(frame *f, int pixel, int k, double rgb[3]) {
    ray r;
    tap taps[8];
    const int n = land(f, pixel, k, NULL, &r, taps);
    if (r.fate == MISSES) {
        see_background(f, pixel, k, rgb);
    } else if (f->how->show == GONIO_CPM_COVERAGE) {
        rgb[0] = rgb[1] = rgb[2] = 1;
    } else if (f->how->show == GONIO_CPM_LEVELS) {
        if (r.fate == MAPPED) {
            colour_of_level((double)r.level, f->levels, rgb);
        }
    } else if (r.fate == ORIGINAL || !mix_taps(f, taps, n, rgb)) {
        if (f->how->show == GONIO_CPM_LIGHT) {
            trace_original(f, pixel, k, rgb);
        }
    }
    return r.fate != MISSES;
}

// How much of a pixel at an edge is covered; *hit and *miss: a ray that does and one that does not, -1: none.
static double coverage_of(const frame *f, int pixel, int *hit, int *miss) {
    gonio_vec3 eyes[SCENE_CASTER_PACKET], directions[SCENE_CASTER_PACKET];
    int covered = 0;
    *hit = *miss = -1;
    for (int first = 0; first < f->how->edge; first += SCENE_CASTER_PACKET) {
        const int n = f->how->edge - first < SCENE_CASTER_PACKET ? f->how->edge - first : SCENE_CASTER_PACKET;
        for (int k = 0; k < n; k++) {
            eyes[k] = f->camera.eye;
            directions[k] = direction_of(f, pixel, first + k);
        }
        const unsigned stopped = gonio_scene_caster_stopped(f->cpm->scene->caster, n, eyes, directions);
        for (int k = 0; k < n; k++) {
            const bool met = (stopped >> k & 1) != 0;
            covered += met;
            *(met ? hit : miss) = first + k;
        }
    }
    return (double)covered / f->how->edge;
}

// The mean light of the rays that hit, and of those that miss, in proportion to what is covered.
static void mix_pixel(frame *f, int pixel, double rgb[3]) {
    const int rays = rays_of(f, pixel);
    double light[2][3] = {{0}};
    int count[2] = {0}, some[2] = {-1, -1}; // of the background, and of the object
    for (int k = 0; k < rays; k++) {
        double one[3] = {0};
        const int met = see(f, pixel, k, one);
        count[met]++;
        for (int c = 0; c < 3; c++) {
            light[met][c] += one[c];
        }
    }
    double covered = (double)count[1] / rays;
    if ((f->edges[pixel] & EDGE) != 0 && f->how->edge > rays) {
        covered = coverage_of(f, pixel, &some[1], &some[0]);
    }
    if (count[0] == 0 && some[0] >= 0) {
        count[0] = 1;
        see_background(f, pixel, some[0], light[0]);
    }
    if (count[1] == 0 && some[1] >= 0 && f->how->show == GONIO_CPM_LIGHT) { // a sliver that no other ray met
        count[1] = 1;
        trace_original(f, pixel, some[1], light[1]);
    }
    for (int c = 0; c < 3; c++) {
        rgb[c] = (count[1] > 0 ? covered * light[1][c] / count[1] : 0) +
                 (count[0] > 0 ? (1 - covered) * light[0][c] / count[0] : 0);
    }
}

static void mix_row(void *context, size_t y) {
    frame *f = context;
    const int width = f->options->width;
    if (is_stopped(f)) {
        return;
    }
    for (int x = 0; x < width; x++) {
        const int pixel = (int)y * width + x;
        double rgb[3];
        mix_pixel(f, pixel, rgb);
        for (int c = 0; c < 3; c++) {
            f->picture->rgb[3 * (size_t)pixel + (size_t)c] = (float)rgb[c];
        }
    }
}

// ---- all ----

static gonio_status allocate(frame *f, gonio_error *error) {
    const size_t pixels = (size_t)f->options->width * (size_t)f->options->height;
    const size_t texels = gonio_cpm_level_start(f->resolution, f->levels);
    gonio_status status = gonio_scene_picture_new(f->options->width, f->options->height, &f->picture, error);
    if (status == GONIO_OK) {
        f->edges = calloc(pixels, sizeof *f->edges);
        f->beside = calloc(pixels, sizeof *f->beside);
        const size_t rays = pixels * (size_t)f->samples;
        f->rays = rays <= RAYS_MAX / sizeof *f->rays ? calloc(rays, sizeof *f->rays) : NULL;
        const int places = f->how->edge > f->samples ? f->how->edge : f->samples;
        f->places = malloc((size_t)places * sizeof *f->places);
        for (int k = 0; k < places && f->places != NULL; k++) {
            f->places[k][0] = gonio_sobol((uint32_t)k, 0, f->options->seed);
            f->places[k][1] = gonio_sobol((uint32_t)k, 1, f->options->seed);
        }
        f->marks = calloc(texels, sizeof *f->marks);
        f->light = calloc(texels, sizeof *f->light);
        if (f->edges == NULL || f->beside == NULL || f->places == NULL || f->marks == NULL || f->light == NULL) {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu pixels and %zu texels", pixels, texels);
        }
    }
    return status;
}

static gonio_status run(frame *f, gonio_error *error) {
    const size_t rows = (size_t)f->options->height;
    gonio_pool *pool = gonio_pool_new(f->options->threads);
    f->steps = 3 * rows;
    pthread_mutex_init(&f->mutex, NULL);
    gonio_pool_run(pool, rows, follow_row, f);
    gonio_pool_run(pool, rows, look_beside_row, f);
    gonio_pool_run(pool, rows, follow_beside_row, f);
    gonio_status status = list_marked(f) ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for the texels");
    if (status == GONIO_OK && f->how->show != GONIO_CPM_LEVELS && f->how->show != GONIO_CPM_COVERAGE) {
        f->steps = 2 * rows + f->wanted_count / 16;
        gonio_pool_run(pool, f->wanted_count, evaluate, f);
    }
    if (status == GONIO_OK) {
        gonio_pool_run(pool, rows, mix_row, f);
    }
    gonio_pool_free(pool);
    pthread_mutex_destroy(&f->mutex);
    if (status == GONIO_OK && f->damaged) {
        status = gonio_fail(error, GONIO_E_INPUT, "a texel of the map is damaged");
    }
    if (status == GONIO_OK && f->stopped) {
        status = gonio_fail(error, GONIO_E_INTERRUPTED, "stopped before the picture was whole");
    }
    return status;
}

static gonio_status check(const gonio_scene_options *o, const gonio_cpm_render_options *how, gonio_error *error) {
    if (o->samples < 1 || o->samples > SAMPLES_MAX || how->fallback < 1 || how->sky < 1 || !(how->near > 0) ||
        !isfinite(how->bias)) {
        return gonio_fail(error, GONIO_E_RANGE,
                          "%d rays a pixel, %d paths in place of one, %d directions of the sky; at "
                          "least 1, rays up to %d",
                          o->samples, how->fallback, how->sky, SAMPLES_MAX);
    }
    return o->interreflection ? gonio_fail(error, GONIO_E_UNSUPPORTED, "a map holds direct light only") : GONIO_OK;
}

gonio_status gonio_cpm_render(const gonio_cpm *cpm, const gonio_scene_options *options,
                              const gonio_cpm_render_options *how, gonio_picture **out, gonio_cpm_render_report *report,
                              gonio_error *error) {
    *out = NULL;
    frame f = {.cpm = cpm,
               .options = options,
               .how = how,
               .samples = options->samples,
               .resolution = (int)cpm->store.head.resolution,
               .levels = (int)cpm->store.head.levels,
               .started_s = gonio_clock_s()};
    gonio_status status = check(options, how, error);
    status = status == GONIO_OK
                 ? gonio_world_camera(cpm->scene, options, &f.camera, error)
                 : status;
    status = status == GONIO_OK ? allocate(&f, error) : status;
    status = status == GONIO_OK ? run(&f, error) : status;
    if (report != NULL) {
        *report = (gonio_cpm_render_report){.texels = f.wanted_count,
                                            .rays = (uint64_t)options->width * (uint64_t)options->height *
                                                    (uint64_t)options->samples,
                                            .original = f.original,
                                            .seconds = gonio_clock_s() - f.started_s};
    }
    free(f.edges);
    free(f.beside);
    free(f.rays);
    free(f.places);
    free(f.marks);
    free(f.light);
    free(f.wanted);
    if (status != GONIO_OK) {
        gonio_picture_free(f.picture);
        return status;
    }
    *out = f.picture;
    return GONIO_OK;
}
