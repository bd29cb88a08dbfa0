// SPDX-License-Identifier: BSD-3-Clause
// Error against cost, drawn with cairo.
#include "host/cli/tradeoff_plot.h"

#include <cairo.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/options.h"
#include "gonio/output.h"

#define WIDTH 900
#define HEIGHT 620
#define LEFT 80
#define RIGHT 30
#define TOP 62
#define BOTTOM 60

typedef struct plot {
    cairo_t *cairo;
    cli_tradeoff_axis axis;
    double low[2], high[2]; // log10 of the ranges: cost, error
    double least;           // where an error of 0 stands: a fifth of the least above it
} plot;

static double cost_of(const gonio_tradeoff_row *row, cli_tradeoff_axis axis) {
    return axis == CLI_TRADEOFF_BYTES ? (double)row->report.bytes
           : axis == CLI_TRADEOFF_NS  ? row->eval_ns
                                      : fmax(row->report.fit_seconds, 1e-4);
}

static bool drawable(const gonio_tradeoff_row *row, cli_tradeoff_axis axis) {
    const double e = gonio_tradeoff_error(row), c = cost_of(row, axis);
    return isfinite(e) && isfinite(c) && c > 0;
}

static double error_of(const plot *p, const gonio_tradeoff_row *row) {
    return fmax(gonio_tradeoff_error(row), p->least);
}

static double least_error(const plot *p, const gonio_tradeoff_row *rows, size_t n) {
    double least = INFINITY;
    for (size_t i = 0; i < n; i++) {
        const double e = drawable(&rows[i], p->axis) ? gonio_tradeoff_error(&rows[i]) : 0;
        least = e > 1e-9 ? fmin(least, e) : least;
    }
    return isfinite(least) ? least / 5 : 1e-9;
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
            const double v[2] = {log10(cost_of(&rows[i], p->axis)), log10(error_of(p, &rows[i]))};
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

// ---- families ----

// Of methods by the kind of their models; the last one is everything else's.
static const struct {
    const char *name, *kinds[3];
    double r, g, b;
} families[] = {{"least-squares splines", {"lobe-spline"}, 0.84, 0.15, 0.16},
                {"multilevel splines", {"lattice", "cbmba", "hierarchical"}, 0.12, 0.47, 0.71},
                {"formulae", {"analytic"}, 0.58, 0.40, 0.74},
                {"linear bases", {"koenderink", "harmonics"}, 0.09, 0.60, 0.60},
                {"the samples", {"kernel"}, 0.89, 0.47, 0.10},
                {"tables", {NULL}, 0.20, 0.58, 0.17}};
#define FAMILIES (sizeof families / sizeof *families)

static size_t family_of(const char *method) {
    const gonio_method *about = gonio_method_find(&method);
    for (size_t f = 0; f < FAMILIES - 1 && about != NULL; f++) {
        for (size_t k = 0; k < 3 && families[f].kinds[k] != NULL; k++) {
            if (strcmp(families[f].kinds[k], about->kind) == 0) {
                return f;
            }
        }
    }
    return FAMILIES - 1;
}

static void set_colour(cairo_t *c, size_t family) {
    cairo_set_source_rgb(c, families[family].r, families[family].g, families[family].b);
}

static void draw_legend(const plot *p, const gonio_tradeoff_row *rows, size_t n) {
    double x = LEFT;
    for (size_t f = 0; f < FAMILIES; f++) {
        bool used = false;
        for (size_t i = 0; i < n; i++) {
            used = used || (drawable(&rows[i], p->axis) && family_of(rows[i].form.method) == f);
        }
        if (used) {
            cairo_text_extents_t extents;
            set_colour(p->cairo, f);
            cairo_arc(p->cairo, x + 5, 48, 5, 0, 2 * GONIO_PI);
            cairo_fill(p->cairo);
            text_at(p->cairo, x + 14, 52, 0, families[f].name);
            cairo_text_extents(p->cairo, families[f].name, &extents);
            x += extents.width + 34;
        }
    }
}

// ---- rows ----

// Rows that no other one beats in what this plot shows, in the order of their costs; returns how many.
static size_t find_front(const plot *p, const gonio_tradeoff_row *rows, size_t n, size_t *front) {
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        bool best = drawable(&rows[i], p->axis);
        for (size_t k = 0; k < n && best; k++) {
            const double cost[2] = {cost_of(&rows[i], p->axis), cost_of(&rows[k], p->axis)};
            const double miss[2] = {gonio_tradeoff_error(&rows[i]), gonio_tradeoff_error(&rows[k])};
            best = !drawable(&rows[k], p->axis) || k == i || cost[0] < cost[1] || miss[0] < miss[1] ||
                   (cost[0] == cost[1] && miss[0] == miss[1] && i < k);
        }
        if (best) {
            size_t at = count++;
            for (; at > 0 && cost_of(&rows[front[at - 1]], p->axis) > cost_of(&rows[i], p->axis); at--) {
                front[at] = front[at - 1];
            }
            front[at] = i;
        }
    }
    return count;
}

static void place_row(const plot *p, const gonio_tradeoff_row *row, double at[2]) {
    at[0] = place_x(p, log10(cost_of(row, p->axis)));
    at[1] = place_y(p, log10(error_of(p, row)));
}

static void draw_row(const plot *p, const gonio_tradeoff_row *row) {
    double at[2];
    place_row(p, row, at);
    set_colour(p->cairo, family_of(row->form.method));
    cairo_new_path(p->cairo);
    cairo_arc(p->cairo, at[0], at[1], row->pareto ? 5.5 : 3, 0, 2 * GONIO_PI);
    if (row->pareto) {
        cairo_fill(p->cairo);
    } else {
        cairo_stroke(p->cairo);
    }
}

// Everything above and to the right of the stairs is beaten.
static void draw_stairs(const plot *p, const gonio_tradeoff_row *rows, const size_t *front, size_t count) {
    double at[2], last = TOP;
    cairo_set_source_rgb(p->cairo, 0.72, 0.72, 0.72);
    cairo_new_path(p->cairo);
    for (size_t k = 0; k < count; k++) {
        place_row(p, &rows[front[k]], at);
        cairo_line_to(p->cairo, at[0], last);
        cairo_line_to(p->cairo, at[0], last = at[1]);
    }
    cairo_line_to(p->cairo, WIDTH - RIGHT, last);
    cairo_stroke(p->cairo);
}

// Where a label may stand about its row without another's being there; false: nowhere.
static bool find_room(const plot *p, const double at[2], double width, double (*boxes)[4], size_t n, double box[4]) {
    static const double tries[][2] = {{8, -8},  {8, 16},   {-1, -8}, {-1, 16}, {8, -24}, {8, 32},
                                      {-1, 32}, {-1, -24}, {8, -40}, {-1, 48}, {8, 48},  {-1, -40}};
    for (size_t t = 0; t < sizeof tries / sizeof *tries; t++) {
        const double x = tries[t][0] > 0 ? at[0] + tries[t][0] : at[0] - 8 - width, y = at[1] + tries[t][1];
        bool room = x >= LEFT + 2 && x + width <= WIDTH - RIGHT - 2 && y - 12 >= TOP && y <= HEIGHT - BOTTOM - 2;
        for (size_t k = 0; k < n && room; k++) {
            room = x > boxes[k][2] || x + width < boxes[k][0] || y - 11 > boxes[k][3] || y + 3 < boxes[k][1];
        }
        if (room) {
            const double found[4] = {x, y - 11, x + width, y + 3};
            memcpy(box, found, sizeof found);
            return true;
        }
    }
    (void)p;
    return false;
}

#define LABELS 48

static void label_front(const plot *p, const gonio_tradeoff_row *rows, const size_t *front, size_t count) {
    double boxes[2 * LABELS][4];
    size_t n = 0;
    for (size_t k = 0; k < count && k < LABELS; k++, n++) { // labels stand on no point of the front
        double at[2];
        place_row(p, &rows[front[k]], at);
        const double box[4] = {at[0] - 5, at[1] - 5, at[0] + 5, at[1] + 5};
        memcpy(boxes[n], box, sizeof box);
    }
    for (size_t k = 0; k < count && k < LABELS; k++) {
        const gonio_tradeoff_row *row = &rows[front[k]];
        char label[64];
        double at[2];
        cairo_text_extents_t extents;
        snprintf(label, sizeof label, "%s", row->form.method);
        if (gonio_method_has_member(row->form.method, offsetof(gonio_fit_options, level))) {
            snprintf(label + strlen(label), sizeof label - strlen(label), " %d", row->report.level);
        }
        cairo_text_extents(p->cairo, label, &extents);
        place_row(p, row, at);
        if (find_room(p, at, extents.width, boxes, n, boxes[n])) {
            set_colour(p->cairo, family_of(row->form.method));
            text_at(p->cairo, boxes[n][0], boxes[n][3] - 3, 0, label);
            n++;
        }
    }
}

static const char *const titles[] = {[CLI_TRADEOFF_BYTES] = "model, bytes",
                                     [CLI_TRADEOFF_NS] = "one evaluation, ns (random directions)",
                                     [CLI_TRADEOFF_SECONDS] = "fit, s"};

static void draw(plot *p, const gonio_tradeoff_row *rows, size_t n) {
    cairo_t *c = p->cairo;
    size_t *front = malloc((n + 1) * sizeof *front);
    cairo_set_source_rgb(c, 1, 1, 1);
    cairo_paint(c);
    cairo_set_line_width(c, 1);
    cairo_select_font_face(c, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(c, 12);
    p->least = least_error(p, rows, n);
    find_ranges(p, rows, n);
    draw_grid(p, 0);
    draw_grid(p, 1);
    const size_t count = front != NULL ? find_front(p, rows, n, front) : 0;
    draw_stairs(p, rows, front, count);
    for (size_t i = 0; i < n; i++) {
        if (drawable(&rows[i], p->axis)) {
            draw_row(p, &rows[i]);
        }
    }
    label_front(p, rows, front, count);
    free(front);
    draw_legend(p, rows, n);
    cairo_set_source_rgb(c, 0, 0, 0);
    cairo_rectangle(c, LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    cairo_stroke(c);
    cairo_set_font_size(c, 14);
    text_at(c, WIDTH / 2.0, HEIGHT - 18, 0.5, titles[p->axis]);
    text_at(c, LEFT, 28, 0, "held-out rms log error; filled: no other row is better in error, bytes and ns");
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
