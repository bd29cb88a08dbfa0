// SPDX-License-Identifier: BSD-3-Clause
// Error against poses or the rig's minutes, a line a kind of plan; drawn with cairo, as SVG.
#include <cairo-svg.h>
#include <cairo.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "gonio/output.h"
#include "host/cli/acquire_tradeoff.h"

#define WIDTH 720
#define HEIGHT 480
#define LEFT 80
#define RIGHT 130
#define TOP 40
#define BOTTOM 60

typedef struct plot {
    cairo_t *cairo;
    bool minutes;
    double low[2], high[2]; // log10
} plot;

static void value_of(const plot *p, const cli_acquire_row *row, double v[2]) {
    v[0] = log10(fmax(p->minutes ? row->rig_min : (double)row->poses, 1e-3));
    v[1] = log10(fmax(row->errors.median_rel, 1e-6));
}

static double place(const plot *p, int k, double v) {
    const double share = (v - p->low[k]) / (p->high[k] - p->low[k]);
    return k == 0 ? LEFT + share * (WIDTH - LEFT - RIGHT) : HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM);
}

static void find_ranges(plot *p, const cli_acquire_row *rows, size_t n) {
    p->low[0] = p->low[1] = INFINITY;
    p->high[0] = p->high[1] = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        double v[2];
        value_of(p, &rows[i], v);
        for (int k = 0; k < 2 && rows[i].status == GONIO_OK; k++) {
            p->low[k] = fmin(p->low[k], v[k] - 0.1);
            p->high[k] = fmax(p->high[k], v[k] + 0.1);
        }
    }
    for (int k = 0; k < 2; k++) {
        if (!(p->low[k] < p->high[k])) {
            p->low[k] = 0;
            p->high[k] = 1;
        }
    }
}

static void label(const plot *p, double x, double y, double align, const char *text) {
    cairo_text_extents_t extents;
    cairo_text_extents(p->cairo, text, &extents);
    cairo_move_to(p->cairo, x - align * extents.width, y);
    cairo_show_text(p->cairo, text);
}

static void draw_axis(const plot *p, int k) {
    static const double steps[3] = {1, 2, 5};
    for (int decade = (int)floor(p->low[k]); decade <= (int)ceil(p->high[k]); decade++) {
        for (int s = 0; s < 3; s++) {
            const double v = decade + log10(steps[s]);
            if (v < p->low[k] || v > p->high[k]) {
                continue;
            }
            const double at = place(p, k, v);
            char text[32];
            cairo_set_source_rgb(p->cairo, 0.88, 0.88, 0.88);
            cairo_move_to(p->cairo, k == 0 ? at : LEFT, k == 0 ? HEIGHT - BOTTOM : at);
            cairo_line_to(p->cairo, k == 0 ? at : WIDTH - RIGHT, k == 0 ? TOP : at);
            cairo_stroke(p->cairo);
            snprintf(text, sizeof text, "%g", steps[s] * pow(10, decade));
            cairo_set_source_rgb(p->cairo, 0.2, 0.2, 0.2);
            label(p, k == 0 ? at : LEFT - 8, k == 0 ? HEIGHT - BOTTOM + 18 : at + 4, k == 0 ? 0.5 : 1, text);
        }
    }
}

// The rows of one kind, in their order, joined; the last one named.
static void draw_kind(const plot *p, const cli_acquire_row *rows, size_t n, const char *kind, int colour) {
    static const double colours[][3] = {
        {0.35, 0.35, 0.35}, {0.1, 0.35, 0.75}, {0.8, 0.2, 0.1}, {0.1, 0.6, 0.3}, {0.55, 0.2, 0.65}};
    double before[2] = {0}, v[2];
    bool any = false;
    cairo_set_source_rgb(p->cairo, colours[colour][0], colours[colour][1], colours[colour][2]);
    for (size_t i = 0; i < n; i++) {
        if (rows[i].status != GONIO_OK || strcmp(rows[i].kind, kind) != 0) {
            continue;
        }
        value_of(p, &rows[i], v);
        const double x = place(p, 0, v[0]), y = place(p, 1, v[1]);
        cairo_new_path(p->cairo);
        cairo_arc(p->cairo, x, y, 4, 0, 6.2832);
        cairo_fill(p->cairo);
        if (any && v[0] >= before[0]) {
            cairo_move_to(p->cairo, place(p, 0, before[0]), place(p, 1, before[1]));
            cairo_line_to(p->cairo, x, y);
            cairo_stroke(p->cairo);
        }
        memcpy(before, v, sizeof before);
        any = true;
    }
    if (any) {
        label(p, place(p, 0, before[0]) + 8, place(p, 1, before[1]) + 4, 0, kind);
    }
}

static cairo_status_t write_bytes(void *stream, const unsigned char *data, unsigned int length) {
    return fwrite(data, 1, length, stream) == length ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

gonio_status cli_acquire_plot(const cli_acquire_row *rows, size_t n, bool minutes, const char *path,
                              gonio_error *error) {
    static const char *const kinds[] = {"uniform", "nusselt", "adaptive", "scene", "prior"};
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    cairo_surface_t *surface =
        cairo_svg_surface_create_for_stream(write_bytes, gonio_output_stream(output), WIDTH, HEIGHT);
    plot p = {.cairo = cairo_create(surface), .minutes = minutes};
    cairo_set_source_rgb(p.cairo, 1, 1, 1);
    cairo_paint(p.cairo);
    cairo_select_font_face(p.cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(p.cairo, 12);
    find_ranges(&p, rows, n);
    draw_axis(&p, 0);
    draw_axis(&p, 1);
    label(&p, (LEFT + WIDTH - RIGHT) / 2.0, HEIGHT - 20, 0.5, minutes ? "minutes of the rig" : "poses");
    label(&p, LEFT, TOP - 14, 0, "median relative error at directions that nobody measured");
    for (int k = 0; k < 5; k++) {
        draw_kind(&p, rows, n, kinds[k], k);
    }
    cairo_destroy(p.cairo);
    cairo_surface_finish(surface);
    const cairo_status_t drawn = cairo_surface_status(surface);
    cairo_surface_destroy(surface);
    if (drawn != CAIRO_STATUS_SUCCESS) {
        gonio_output_abandon(output);
        return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot draw: %s", cairo_status_to_string(drawn));
    }
    return gonio_output_commit(output, error);
}
