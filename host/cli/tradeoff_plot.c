// SPDX-License-Identifier: BSD-3-Clause
// Error against cost, drawn with cairo.
#include "host/cli/tradeoff_plot.h"

#include <cairo.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/options.h"
#include "gonio/output.h"

#define WIDTH 900
#define HEIGHT 620
#define LEFT 80
#define RIGHT 30
#define TOP 50
#define BOTTOM 60

typedef struct plot {
    cairo_t *cairo;
    cli_tradeoff_axis axis;
    double low[2], high[2]; // log10 of the ranges: cost, error
} plot;

static double cost_of(const gonio_tradeoff_row *row, cli_tradeoff_axis axis) {
    return axis == CLI_TRADEOFF_BYTES ? (double)row->report.bytes : row->eval_ns;
}

static bool drawable(const gonio_tradeoff_row *row, cli_tradeoff_axis axis) {
    const double e = gonio_tradeoff_error(row), c = cost_of(row, axis);
    return isfinite(e) && e > 0 && isfinite(c) && c > 0;
}

static double place_x(const plot *p, double log_cost) {
    return LEFT + (log_cost - p->low[0]) / (p->high[0] - p->low[0]) * (WIDTH - LEFT - RIGHT);
}

static double place_y(const plot *p, double log_error) {
    return HEIGHT - BOTTOM - (log_error - p->low[1]) / (p->high[1] - p->low[1]) * (HEIGHT - TOP - BOTTOM);
}

static void find_ranges(plot *p, const gonio_tradeoff_row *rows, size_t n) {
    p->low[0] = p->low[1] = INFINITY;
    p->high[0] = p->high[1] = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        if (drawable(&rows[i], p->axis)) {
            const double v[2] = {log10(cost_of(&rows[i], p->axis)), log10(gonio_tradeoff_error(&rows[i]))};
            for (int k = 0; k < 2; k++) {
                p->low[k] = fmin(p->low[k], v[k]);
                p->high[k] = fmax(p->high[k], v[k]);
            }
        }
    }
    for (int k = 0; k < 2; k++) {
        if (!(p->low[k] <= p->high[k])) {
            p->low[k] = 0;
            p->high[k] = 1;
        }
        const double margin = 0.05 * (p->high[k] - p->low[k]) + 0.05;
        p->low[k] -= margin;
        p->high[k] += margin;
    }
}

static void text_at(cairo_t *c, double x, double y, double align, const char *text) {
    cairo_text_extents_t extents;
    cairo_text_extents(c, text, &extents);
    cairo_move_to(c, x - align * extents.width, y);
    cairo_show_text(c, text);
    cairo_new_path(c);
}

// Lines at 1, 2 and 5 of every decade, labels too unless they would meet.
static void draw_grid(const plot *p, int k) {
    static const double steps[3] = {1, 2, 5};
    for (int decade = (int)floor(p->low[k]); decade <= (int)ceil(p->high[k]); decade++) {
        for (int s = 0; s < 3; s++) {
            const double v = decade + log10(steps[s]);
            if (v < p->low[k] || v > p->high[k]) {
                continue;
            }
            const double x = k == 0 ? place_x(p, v) : LEFT, y = k == 0 ? HEIGHT - BOTTOM : place_y(p, v);
            cairo_set_source_rgb(p->cairo, 0.88, 0.88, 0.88);
            cairo_move_to(p->cairo, x, y);
            cairo_line_to(p->cairo, k == 0 ? x : WIDTH - RIGHT, k == 0 ? TOP : y);
            cairo_stroke(p->cairo);
            if (k == 0 && s > 0 && p->high[k] - p->low[k] > 3) {
                continue;
            }
            char label[32];
            snprintf(label, sizeof label, "%g", steps[s] * pow(10, decade));
            cairo_set_source_rgb(p->cairo, 0.2, 0.2, 0.2);
            text_at(p->cairo, k == 0 ? x : LEFT - 8, k == 0 ? y + 18 : y + 4, k == 0 ? 0.5 : 1, label);
        }
    }
}

static void set_colour(cairo_t *c, const char *method) {
    // Of a method, or of all that make a kind.
    static const struct {
        const char *name;
        double r, g, b;
    } colours[] = {{"mba", 0.12, 0.47, 0.71},      {"cbmba", 0.20, 0.63, 0.17},    {"lsq", 0.89, 0.47, 0.10},
                   {"auto", 0.84, 0.15, 0.16},     {"analytic", 0.58, 0.40, 0.74}, {"koenderink", 0.09, 0.60, 0.60},
                   {"harmonics", 0.09, 0.60, 0.60}};
    const gonio_method *about = gonio_method_find(&method);
    for (size_t i = 0; i < sizeof colours / sizeof *colours; i++) {
        if (strcmp(colours[i].name, method) == 0 || (about != NULL && strcmp(colours[i].name, about->kind) == 0)) {
            cairo_set_source_rgb(c, colours[i].r, colours[i].g, colours[i].b);
            return;
        }
    }
    cairo_set_source_rgb(c, 0.4, 0.4, 0.4);
}

static void draw_row(const plot *p, const gonio_tradeoff_row *row) {
    const double x = place_x(p, log10(cost_of(row, p->axis))), y = place_y(p, log10(gonio_tradeoff_error(row)));
    set_colour(p->cairo, row->form.method);
    cairo_new_path(p->cairo);
    cairo_arc(p->cairo, x, y, row->pareto ? 6 : 3.5, 0, 2 * GONIO_PI);
    if (row->pareto) {
        cairo_fill(p->cairo);
        char label[64];
        snprintf(label, sizeof label, "%s", row->form.method);
        if (gonio_method_has_member(row->form.method, offsetof(gonio_fit_options, level))) {
            snprintf(label + strlen(label), sizeof label - strlen(label), " %d", row->report.level);
        }
        text_at(p->cairo, x + 8, y - 6, x > WIDTH - 150 ? 1.1 : 0, label);
    } else {
        cairo_stroke(p->cairo);
    }
}

static void draw(plot *p, const gonio_tradeoff_row *rows, size_t n) {
    cairo_t *c = p->cairo;
    cairo_set_source_rgb(c, 1, 1, 1);
    cairo_paint(c);
    cairo_set_line_width(c, 1);
    cairo_select_font_face(c, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(c, 12);
    find_ranges(p, rows, n);
    draw_grid(p, 0);
    draw_grid(p, 1);
    for (size_t i = 0; i < n; i++) {
        if (drawable(&rows[i], p->axis)) {
            draw_row(p, &rows[i]);
        }
    }
    cairo_set_source_rgb(c, 0, 0, 0);
    cairo_rectangle(c, LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    cairo_stroke(c);
    cairo_set_font_size(c, 14);
    text_at(c, WIDTH / 2.0, HEIGHT - 18, 0.5,
            p->axis == CLI_TRADEOFF_BYTES ? "model, bytes" : "one evaluation, ns (random directions)");
    text_at(c, LEFT, 32, 0, "held-out rms log error; filled: no other method is better in error, bytes and ns");
}

static cairo_status_t write_bytes(void *closure, const unsigned char *data, unsigned int length) {
    return fwrite(data, 1, length, closure) == length ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

gonio_status cli_tradeoff_plot(const gonio_tradeoff_row *rows, size_t n, cli_tradeoff_axis axis, const char *path,
                               gonio_error *error) {
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    cairo_surface_t *surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, WIDTH, HEIGHT);
    plot p = {.cairo = cairo_create(surface), .axis = axis};
    draw(&p, rows, n);
    cairo_destroy(p.cairo);
    const cairo_status_t written = cairo_surface_write_to_png_stream(surface, write_bytes, gonio_output_stream(output));
    cairo_surface_destroy(surface);
    if (written != CAIRO_STATUS_SUCCESS) {
        gonio_output_abandon(output);
        return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write the plot: %s",
                               cairo_status_to_string(written));
    }
    return gonio_output_commit(output, error);
}
