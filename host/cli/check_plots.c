// SPDX-License-Identifier: BSD-3-Clause
// Lobes as polar solids, the albedo over incidence, and P_s over the number of products, drawn with cairo.
#include <cairo-svg.h>
#include <cairo.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "gonio/output.h"
#include "host/cli/check_pictures.h"

enum { WIDTH = 720, HEIGHT = 420, LEFT = 70, RIGHT = 20, TOP = 30, BOTTOM = 50, THETAS = 45, PHIS = 120, LOBE = 160 };

typedef struct plot {
    cairo_t *cairo;
    void (*draw)(const struct plot *plot);
    const gonio_check_report *report;
    const gonio_model *models[2];
    double theta_i;
} plot;

static cairo_status_t write_bytes(void *closure, const unsigned char *data, unsigned int length) {
    return fwrite(data, 1, length, closure) == length ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

static gonio_status put(plot *p, const char *path, bool svg, gonio_error *error) {
    char name[1024];
    gonio_output *output;
    snprintf(name, sizeof name, "%s.%s", path, svg ? "svg" : "png");
    const gonio_status status = gonio_output_open(name, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    cairo_surface_t *surface = svg ? cairo_svg_surface_create_for_stream(write_bytes, stream, WIDTH, HEIGHT)
                                   : cairo_image_surface_create(CAIRO_FORMAT_RGB24, WIDTH, HEIGHT);
    p->cairo = cairo_create(surface);
    cairo_set_source_rgb(p->cairo, 1, 1, 1);
    cairo_paint(p->cairo);
    cairo_select_font_face(p->cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(p->cairo, 12);
    cairo_set_line_width(p->cairo, 1);
    p->draw(p);
    cairo_status_t drawn = cairo_status(p->cairo);
    cairo_destroy(p->cairo);
    if (drawn == CAIRO_STATUS_SUCCESS && !svg) {
        drawn = cairo_surface_write_to_png_stream(surface, write_bytes, stream);
    }
    cairo_surface_finish(surface);
    drawn = drawn == CAIRO_STATUS_SUCCESS ? cairo_surface_status(surface) : drawn;
    cairo_surface_destroy(surface);
    if (drawn != CAIRO_STATUS_SUCCESS) {
        gonio_output_abandon(output);
        return gonio_fail_line(error, GONIO_E_IO, name, -1, "cannot write the picture: %s",
                               cairo_status_to_string(drawn));
    }
    return gonio_output_commit(output, error);
}

static gonio_status put_both(plot *p, const char *path, gonio_error *error) {
    const gonio_status status = put(p, path, true, error);
    return status == GONIO_OK ? put(p, path, false, error) : status;
}

static void text(cairo_t *c, double x, double y, double align, const char *words) {
    cairo_text_extents_t extents;
    cairo_text_extents(c, words, &extents);
    cairo_move_to(c, x - align * extents.width, y);
    cairo_show_text(c, words);
    cairo_new_path(c);
}

// ---- curves ----

typedef struct axes {
    double x[2], y[2]; // ranges
} axes;

static double at_x(const axes *a, double x) {
    return LEFT + (x - a->x[0]) / (a->x[1] - a->x[0]) * (WIDTH - LEFT - RIGHT);
}
static double at_y(const axes *a, double y) {
    return HEIGHT - BOTTOM - (y - a->y[0]) / (a->y[1] - a->y[0]) * (HEIGHT - TOP - BOTTOM);
}

static void draw_axes(cairo_t *c, const axes *a, int ticks_x, int ticks_y, const char *format_y, bool log_y,
                      const char *title, const char *label) {
    char words[64];
    cairo_set_source_rgb(c, 0.2, 0.2, 0.2);
    cairo_rectangle(c, LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    cairo_stroke(c);
    for (int k = 0; k <= ticks_x; k++) {
        const double x = a->x[0] + (a->x[1] - a->x[0]) * k / ticks_x;
        snprintf(words, sizeof words, "%g", x);
        text(c, at_x(a, x), HEIGHT - BOTTOM + 18, 0.5, words);
    }
    for (int k = 0; k <= ticks_y; k++) {
        const double y = a->y[0] + (a->y[1] - a->y[0]) * k / ticks_y;
        snprintf(words, sizeof words, format_y, log_y ? pow(10, y) : y);
        text(c, LEFT - 6, at_y(a, y) + 4, 1, words);
        cairo_set_source_rgba(c, 0.2, 0.2, 0.2, 0.2);
        cairo_move_to(c, LEFT, at_y(a, y));
        cairo_line_to(c, WIDTH - RIGHT, at_y(a, y));
        cairo_stroke(c);
        cairo_set_source_rgb(c, 0.2, 0.2, 0.2);
    }
    text(c, LEFT, TOP - 10, 0, title);
    text(c, (WIDTH + LEFT - RIGHT) / 2.0, HEIGHT - 12, 0.5, label);
}

static void draw_albedo(const plot *p) {
    const gonio_check_report *r = p->report;
    cairo_t *c = p->cairo;
    double top = 1.05;
    for (size_t k = 0; k < r->incidences; k++) {
        top = isfinite(r->albedos[k].largest) ? fmax(top, 1.05 * r->albedos[k].largest) : top;
    }
    const axes a = {{0, 90}, {0, top}};
    draw_axes(c, &a, 9, 5, "%.2f", false,
              "albedo (directional-hemispherical reflectance) with its standard uncertainty", "theta_i, deg");
    cairo_set_source_rgb(c, 0.8, 0.1, 0.1); // what arrives
    cairo_move_to(c, at_x(&a, 0), at_y(&a, 1));
    cairo_line_to(c, at_x(&a, 90), at_y(&a, 1));
    cairo_stroke(c);
    for (size_t k = 0; k < r->incidences; k++) {
        const gonio_check_albedo_point *q = &r->albedos[k];
        if (!isfinite(q->value)) {
            continue;
        }
        const double x = at_x(&a, gonio_degrees(q->theta_i)),
                     u = sqrt(pow(q->random, 2) + pow(q->systematic, 2) + pow(q->integration, 2));
        cairo_set_source_rgb(c, 0.1, 0.3, 0.7);
        cairo_move_to(c, x, at_y(&a, fmax(q->value - u, 0)));
        cairo_line_to(c, x, at_y(&a, fmin(q->value + u, top)));
        cairo_stroke(c);
        cairo_arc(c, x, at_y(&a, q->value), 2.5, 0, 2 * GONIO_PI);
        cairo_fill(c);
    }
}

static void draw_separability(const plot *p) {
    const gonio_check_report *r = p->report;
    cairo_t *c = p->cairo;
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < r->ranks; k++) {
        if (r->separability_range[k] > 1e-12) {
            low = fmin(low, log10(r->separability_range[k]));
            high = fmax(high, log10(r->separability_range[k]));
        }
    }
    const axes a = {{0, GONIO_CHECK_RANKS}, {isfinite(low) ? floor(low) : -1, isfinite(high) ? ceil(high + 1e-9) : 0}};
    const int decades = (int)fmax(a.y[1] - a.y[0], 1);
    draw_axes(c, &a, 8, decades, "%.0e", true, "P_s^(k) as a part of the rms of f", "k, products");
    cairo_set_source_rgb(c, 0.1, 0.3, 0.7);
    for (int k = 0; k < r->ranks; k++) {
        const double y = at_y(&a, fmax(log10(fmax(r->separability_range[k], 1e-300)), a.y[0]));
        if (k == 0) {
            cairo_move_to(c, at_x(&a, k + 1), y);
        } else {
            cairo_line_to(c, at_x(&a, k + 1), y);
        }
    }
    cairo_stroke(c);
    for (int k = 0; k < r->ranks; k++) {
        cairo_arc(c, at_x(&a, k + 1), at_y(&a, fmax(log10(fmax(r->separability_range[k], 1e-300)), a.y[0])), 3, 0,
                  2 * GONIO_PI);
        cairo_fill(c);
    }
}

// ---- lobes ----

typedef struct facet {
    double x[4], y[4], depth, light;
} facet;

static int by_depth(const void *left, const void *right) {
    const facet *a = left, *b = right;
    return (a->depth > b->depth) - (a->depth < b->depth);
}

// Lobes without bound at the horizon would leave nothing to see of the rest: the scale is of what lies above, and what
// reaches farther is cut off.
static const double scaled_to = 75 * GONIO_PI / 180, cut_at = 1.05;

static double radius(const gonio_model *m, double theta_i, double theta, double phi) {
    double values[1024], sum = 0;
    const gonio_pair p = {theta_i, 0, theta, phi};
    gonio_model_eval_pair(m, &p, values);
    for (int c = 0; c < m->channels; c++) {
        sum += values[c] / m->channels;
    }
    return fmax(sum, 0);
}

// Seen from the side and a little from above: x to the right, z up.
static const double tilt = 0.35;
static void project(gonio_vec3 v, double out[3]) {
    out[0] = v.x;
    out[1] = v.z * cos(tilt) + v.y * sin(tilt);
    out[2] = -v.y * cos(tilt) + v.z * sin(tilt); // toward the viewer
}

static size_t make_facets(const gonio_model *m, double theta_i, double scale, double x0, double y0, facet *out) {
    size_t n = 0;
    for (int t = 0; t < THETAS; t++) {
        for (int f = 0; f < PHIS; f++) {
            gonio_vec3 corner[4];
            facet *q = &out[n++];
            q->depth = 0;
            for (int k = 0; k < 4; k++) {
                const double theta = GONIO_PI / 2 * (t + (k == 1 || k == 2)) / THETAS;
                const double phi = 2 * GONIO_PI * (f + (k >= 2)) / PHIS,
                             r = fmin(radius(m, theta_i, theta, phi) * scale, cut_at * LOBE);
                const gonio_vec3 d = gonio_direction(theta, phi);
                double at[3];
                corner[k] = (gonio_vec3){r * d.x, r * d.y, r * d.z};
                project(corner[k], at);
                q->x[k] = x0 + at[0];
                q->y[k] = y0 - at[1];
                q->depth += at[2] / 4;
            }
            const gonio_vec3 a = {corner[2].x - corner[0].x, corner[2].y - corner[0].y, corner[2].z - corner[0].z};
            const gonio_vec3 b = {corner[3].x - corner[1].x, corner[3].y - corner[1].y, corner[3].z - corner[1].z};
            const gonio_vec3 normal = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
            const double length = sqrt(normal.x * normal.x + normal.y * normal.y + normal.z * normal.z);
            q->light = length > 0 ? fabs(0.4 * normal.x - 0.6 * normal.y + 0.7 * normal.z) / length : 0.5;
        }
    }
    qsort(out, n, sizeof *out, by_depth);
    return n;
}

static void draw_solid(cairo_t *c, const facet *facets, size_t n) {
    for (size_t i = 0; i < n; i++) {
        const facet *f = &facets[i];
        const double g = 0.35 + 0.6 * fmin(f->light, 1);
        cairo_set_source_rgb(c, 0.85 * g, 0.9 * g, g);
        cairo_move_to(c, f->x[0], f->y[0]);
        for (int k = 1; k < 4; k++) {
            cairo_line_to(c, f->x[k], f->y[k]);
        }
        cairo_close_path(c);
        cairo_fill_preserve(c);
        cairo_set_line_width(c, 0.4);
        cairo_stroke(c);
    }
}

static void draw_lobes(const plot *p) {
    cairo_t *c = p->cairo;
    facet *facets = malloc((size_t)THETAS * PHIS * sizeof *facets);
    double most = 0;
    char words[120];
    for (int m = 0; m < 2; m++) {
        for (int t = 0; t <= THETAS; t++) {
            for (int f = 0; f < PHIS && GONIO_PI / 2 * t / THETAS < scaled_to; f++) {
                most = fmax(most, radius(p->models[m], p->theta_i, GONIO_PI / 2 * t / THETAS, 2 * GONIO_PI * f / PHIS));
            }
        }
    }
    const double scale = most > 0 ? LOBE / most : 0;
    for (int m = 0; m < 2 && facets != NULL; m++) {
        const double x0 = WIDTH * (m == 0 ? 0.27 : 0.75), y0 = HEIGHT - 110;
        cairo_set_source_rgb(c, 0.75, 0.75, 0.75);
        cairo_set_line_width(c, 1);
        cairo_move_to(c, x0 - 165, y0);
        cairo_line_to(c, x0 + 165, y0);
        cairo_move_to(c, x0, y0);
        cairo_line_to(c, x0, y0 - 200);
        cairo_stroke(c);
        draw_solid(c, facets, make_facets(p->models[m], p->theta_i, scale, x0, y0, facets));
        const gonio_vec3 light = gonio_direction(p->theta_i, 0);
        cairo_set_source_rgb(c, 0.8, 0.1, 0.1);
        cairo_set_line_width(c, 1.5);
        cairo_move_to(c, x0 + 200 * light.x, y0 - 200 * light.z * cos(tilt));
        cairo_line_to(c, x0, y0);
        cairo_stroke(c);
        cairo_set_source_rgb(c, 0.2, 0.2, 0.2);
        text(c, x0, HEIGHT - 50, 0.5, m == 0 ? "before" : "after");
    }
    snprintf(words, sizeof words,
             "f_r for light at theta_i = %g deg (red); the farthest point up to 75 deg is %.3g 1/sr",
             gonio_degrees(p->theta_i), most);
    text(c, WIDTH / 2.0, HEIGHT - 20, 0.5, words);
    free(facets);
}

// ---- the files ----

gonio_status cli_plot_lobes(const char *path, const gonio_model *before, const gonio_model *after, double theta_i_rad,
                            gonio_error *error) {
    plot p = {.draw = draw_lobes, .models = {before, after}, .theta_i = theta_i_rad};
    return put_both(&p, path, error);
}

gonio_status cli_plot_albedo(const char *path, const gonio_check_report *report, gonio_error *error) {
    plot p = {.draw = draw_albedo, .report = report};
    return put_both(&p, path, error);
}

gonio_status cli_plot_separability(const char *path, const gonio_check_report *report, gonio_error *error) {
    plot p = {.draw = draw_separability, .report = report};
    return put_both(&p, path, error);
}
