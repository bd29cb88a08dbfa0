// SPDX-License-Identifier: BSD-3-Clause
// The preview: one directional light, direct reflection and shadows, nothing else, so that what a picture shows is the
// BRDF. Radiance is f_r cos(theta_i) pi: a white diffuser that faces the light has 1.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/order_statistic.h"
#include "base/thread_pool.h"
#include "base/vector.h"
#include "gonio/render.h"
#include "gonio/sample.h"
#include "io/colour.h"
#include "scene/caster.h"
#include "scene/image.h"

#define GRID 4            // GRID x GRID rays a pixel, averaged in linear light
#define GAP_PX 4          // between the tiles of a strip
#define EYE_DISTANCE 4.0  // of the object's radius
#define MARGIN 1.06       // of the frame beyond the object's outline
#define PERCENTILE 0.99   // of the covered pixels' largest component ...
#define PERCENTILE_TO 0.9 // ... becomes this under automatic exposure
#define BACKGROUND 0.03   // linear, after exposure
#define SIDE_MIN 16
#define SIDE_MAX 8192

typedef struct pixel {
    float rgb[3], cover;
} pixel;

typedef struct tile {
    const gonio_model *model;
    const scene_caster *caster;
    const gonio_render_options *options;
    gonio_colour_weights colour;
    gonio_vec3 light;
    double tangent; // a pixel's side at distance 1
    pixel *pixels;
} tile;

void gonio_render_options_default(gonio_render_options *options) {
    *options = (gonio_render_options){
        .width = 384, .height = 384, .light_theta_deg = 40, .light_phi_deg = 120, .exposure_auto = true};
}

static gonio_status check(int n, const gonio_render_options *o, gonio_error *error) {
    if (n < 1 || n > GONIO_RENDER_MODELS_MAX) {
        return gonio_fail(error, GONIO_E_RANGE, "%d models; 1 to %d fit in a strip", n, GONIO_RENDER_MODELS_MAX);
    }
    if (o->width < SIDE_MIN || o->width > SIDE_MAX || o->height < SIDE_MIN || o->height > SIDE_MAX) {
        return gonio_fail(error, GONIO_E_RANGE, "an image of %d x %d pixels; %d to %d are possible", o->width,
                          o->height, SIDE_MIN, SIDE_MAX);
    }
    if (!(o->light_theta_deg >= 0 && o->light_theta_deg <= 180) || !(fabs(o->light_phi_deg) <= 360)) {
        return gonio_fail(error, GONIO_E_RANGE, "light at theta %g, phi %g deg; theta is 0 to 180, phi -360 to 360",
                          o->light_theta_deg, o->light_phi_deg);
    }
    if (!o->exposure_auto && !(fabs(o->exposure_ev) <= 100)) {
        return gonio_fail(error, GONIO_E_RANGE, "exposure %g EV; -100 to 100 is possible", o->exposure_ev);
    }
    return GONIO_OK;
}

static void shade(const tile *t, const scene_hit *hit, gonio_vec3 toward_eye, double rgb[3]) {
    const gonio_vec3 wi = scene_into_frame(hit, t->light), wo = scene_into_frame(hit, toward_eye);
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(wi.z > 0) || !(wo.z > 0) || dot(t->light, hit->facet) <= 0 ||
        gonio_scene_caster_shadowed(t->caster, hit, t->light)) {
        return;
    }
    double values[GONIO_CHANNELS_MAX];
    gonio_model_eval(t->model, wi, wo, values);
    gonio_colour_rgb(&t->colour, values, rgb);
    for (int k = 0; k < 3; k++) {
        rgb[k] *= GONIO_PI * wi.z;
    }
}

// The object's outline fits into the frame: the largest tangents of its points seen from the eye, of a sphere
// tan(asin(1/distance)), against the frame's sides.
static double frame_tangent(const scene_mesh *mesh, const gonio_render_options *o) {
    const double sphere = tan(asin(1 / EYE_DISTANCE));
    double x = mesh == NULL ? sphere : 0, y = x;
    for (size_t v = 0; mesh != NULL && v < mesh->vertices; v++) {
        const float *p = mesh->positions + 3 * v;
        x = fmax(x, fabs((double)p[0]) / (EYE_DISTANCE - (double)p[2]));
        y = fmax(y, fabs((double)p[1]) / (EYE_DISTANCE - (double)p[2]));
    }
    return 2 * MARGIN * fmax(x / o->width, y / o->height);
}

static gonio_vec3 eye_ray(const tile *t, double u, double v) {
    const double x = (u - t->options->width / 2.0) * t->tangent, y = (t->options->height / 2.0 - v) * t->tangent;
    const double length = sqrt(x * x + y * y + 1);
    return (gonio_vec3){x / length, y / length, -1 / length};
}

static pixel trace_pixel(const tile *t, int column, int row) {
    const gonio_vec3 eye = {0, 0, EYE_DISTANCE};
    double sum[3] = {0}, cover = 0;
    for (int k = 0; k < GRID * GRID; k++) {
        const gonio_vec3 ray = eye_ray(t, column + (k % GRID + 0.5) / GRID, row + (k / GRID + 0.5) / GRID);
        scene_hit hit;
        if (gonio_scene_caster_hit(t->caster, eye, ray, &hit)) {
            double rgb[3];
            shade(t, &hit, (gonio_vec3){-ray.x, -ray.y, -ray.z}, rgb);
            cover += 1.0 / (GRID * GRID);
            for (int c = 0; c < 3; c++) {
                sum[c] += rgb[c] / (GRID * GRID);
            }
        }
    }
    return (pixel){{(float)sum[0], (float)sum[1], (float)sum[2]}, (float)cover};
}

static void trace_row(void *context, size_t row) {
    const tile *t = context;
    const int width = t->options->width;
    for (int column = 0; column < width; column++) {
        t->pixels[row * (size_t)width + (size_t)column] = trace_pixel(t, column, (int)row);
    }
}

// What makes PERCENTILE of the pixels that lie wholly on the object at most PERCENTILE_TO; 1 where all is black.
static gonio_status automatic_scale(const pixel *pixels, size_t n, double *scale, gonio_error *error) {
    float *levels = malloc(n * sizeof *levels);
    if (levels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to find the exposure");
    }
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        const float level = fmaxf(pixels[i].rgb[0], fmaxf(pixels[i].rgb[1], pixels[i].rgb[2]));
        if (pixels[i].cover > 0.999f && isfinite(level)) {
            levels[count++] = level;
        }
    }
    const size_t rank = count > 0 ? (size_t)(PERCENTILE * (double)(count - 1)) : 0;
    const float level = gonio_order_statistic_f32(levels, count, rank);
    *scale = level > 0 ? PERCENTILE_TO / (double)level : 1;
    free(levels);
    return GONIO_OK;
}

static void develop(const pixel *pixels, int n, const gonio_render_options *o, double scale, unsigned char *image,
                    size_t stride) {
    const size_t width = (size_t)o->width, height = (size_t)o->height;
    memset(image, 255, stride * height); // the gaps
    for (size_t k = 0; k < (size_t)n; k++) {
        for (size_t i = 0; i < width * height; i++) {
            const pixel *p = &pixels[k * width * height + i];
            unsigned char *to = image + i / width * stride + 3 * (k * (width + GAP_PX) + i % width);
            for (int c = 0; c < 3; c++) {
                to[c] = gonio_srgb_code(scale * (double)p->rgb[c] + (1 - (double)p->cover) * BACKGROUND);
            }
        }
    }
}

static gonio_status trace_strip(const gonio_model *const *models, int n, const gonio_render_options *o, pixel *pixels,
                                gonio_error *error) {
    scene_mesh *mesh = NULL;
    scene_caster *caster = NULL;
    gonio_status status = o->mesh != NULL ? gonio_scene_mesh_read(o->mesh, o->mesh_z_up, &mesh, error) : GONIO_OK;
    status = status == GONIO_OK ? gonio_scene_caster_new(mesh, &caster, error) : status;
    const size_t size = (size_t)o->width * (size_t)o->height;
    for (int k = 0; k < n && status == GONIO_OK; k++) {
        tile t = {.model = models[k],
                  .caster = caster,
                  .options = o,
                  .light = gonio_direction(gonio_radians(o->light_theta_deg), gonio_radians(o->light_phi_deg)),
                  .tangent = frame_tangent(mesh, o),
                  .pixels = pixels + (size_t)k * size};
        status = gonio_colour_new(models[k]->channels, models[k]->channel_names, &t.colour, error);
        if (status == GONIO_OK) {
            gonio_pool_for(o->threads, (size_t)o->height, trace_row, &t);
            gonio_colour_free(&t.colour);
        }
    }
    gonio_scene_caster_free(caster);
    gonio_scene_mesh_free(mesh);
    return status;
}

gonio_status gonio_render(const gonio_model *const *models, int n, const gonio_render_options *options,
                          const char *path, gonio_render_result *result, gonio_error *error) {
    gonio_status status = check(n, options, error);
    if (status != GONIO_OK) {
        return status;
    }
    const int width = n * options->width + (n - 1) * GAP_PX, height = options->height;
    const size_t size = (size_t)options->width * (size_t)height * (size_t)n, stride = 3 * (size_t)width;
    pixel *pixels = malloc(size * sizeof *pixels);
    unsigned char *image = malloc(stride * (size_t)height);
    double scale = exp2(options->exposure_ev);
    if (pixels == NULL || image == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for an image of %d x %d (%.3g MB)", width, height,
                            (double)(size * sizeof *pixels + stride * (size_t)height) / 1e6);
    }
    status = status == GONIO_OK ? trace_strip(models, n, options, pixels, error) : status;
    status = status == GONIO_OK && options->exposure_auto ? automatic_scale(pixels, size, &scale, error) : status;
    if (status == GONIO_OK) {
        develop(pixels, n, options, scale, image, stride);
        status = gonio_scene_codes_write(image, width, height, path, error);
    }
    if (status == GONIO_OK && result != NULL) {
        *result = (gonio_render_result){width, height, log2(scale)};
    }
    free(pixels);
    free(image);
    return status;
}

gonio_status gonio_render_difference(const gonio_model *a, const gonio_model *b, const gonio_render_options *options,
                                     double *mean, gonio_error *error) {
    gonio_status status = check(2, options, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t tile = (size_t)options->width * (size_t)options->height;
    const size_t stride = 3 * (2 * (size_t)options->width + GAP_PX), half = 3 * ((size_t)options->width + GAP_PX);
    pixel *pixels = malloc(2 * tile * sizeof *pixels);
    unsigned char *image = malloc(stride * (size_t)options->height);
    double scale = exp2(options->exposure_ev);
    if (pixels == NULL || image == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for two images of %zu pixels", tile);
    }
    const gonio_model *const models[2] = {a, b};
    status = status == GONIO_OK ? trace_strip(models, 2, options, pixels, error) : status;
    status = status == GONIO_OK && options->exposure_auto ? automatic_scale(pixels, 2 * tile, &scale, error) : status;
    if (status == GONIO_OK) {
        develop(pixels, 2, options, scale, image, stride);
        double sum = 0, covered = 0;
        for (size_t i = 0; i < tile; i++) {
            const size_t at = i / (size_t)options->width * stride + 3 * (i % (size_t)options->width);
            for (size_t c = 0; c < 3 && pixels[i].cover > 0; c++) {
                sum += abs(image[at + c] - image[at + half + c]);
                covered++;
            }
        }
        *mean = covered > 0 ? sum / covered : 0;
    }
    free(pixels);
    free(image);
    return status;
}
