// SPDX-License-Identifier: BSD-3-Clause
// A disc for each of up to 12 incidences, with the light's direction as a ring and each direction out as a dot, whose
// colour is the value's logarithm. Sets of more incidences show those next to 12 of them, evenly spread.
#include "host/cli/samples_picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "gonio/direction.h"
#include "host/cli/drawing.h"

enum { DISCS = 12, COLUMNS = 4, CELL = 260, RADIUS = 105, BAR = 90 };

typedef struct picture {
    const gonio_samples *samples;
    cairo_t *cairo;
    double low, high;            // ln of the values
    double incidences[DISCS][2]; // theta_i, phi_i in radians
    int discs, columns, rows;
} picture;

static double value_of(const gonio_samples *s, size_t i) { return s->values[i * (size_t)s->channels]; }

// The azimuth in the picture: isotropic sets are turned so that the light comes along phi = 0.
static double turned(const gonio_samples *s, double phi, const gonio_pair *p) {
    return s->isotropic ? phi - p->phi_i : phi;
}

static gonio_status find_range(picture *p, gonio_error *error) {
    const gonio_samples *s = p->samples;
    double *values = malloc(s->n * sizeof *values);
    size_t n = 0;
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu values", s->n);
    }
    for (size_t i = 0; i < s->n; i++) {
        if (value_of(s, i) > 0) {
            values[n++] = log(value_of(s, i));
        }
    }
    gonio_sort(values, n);
    p->low = n > 0 ? values[n / 100] : 0; // a few values near zero do not stretch the scale
    p->high = n > 0 ? values[n - 1] : 1;
    p->high = p->high > p->low ? p->high : p->low + 1e-9;
    free(values);
    return GONIO_OK;
}

#define BEHIND 5000 // in an incidence's number: the camera's side

// An incidence, and the side that it is seen from, as one number: theta_i in tenths of a degree and, where it counts,
// phi_i in degrees.
static double key_of(const gonio_samples *s, const gonio_pair *p) {
    const double phi = round(fmod(gonio_degrees(p->phi_i) + 720, 360)),
                 side = gonio_pair_raised(*p).theta_o != p->theta_o;
    return round(gonio_degrees(p->theta_i) * 10) + BEHIND * side + (s->isotropic ? 0 : 10000 * phi);
}

static int ascending(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static gonio_status find_incidences(picture *p, gonio_error *error) {
    const gonio_samples *s = p->samples;
    double *keys = malloc(s->n * sizeof *keys);
    size_t n = 0;
    if (keys == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu incidences", s->n);
    }
    for (size_t i = 0; i < s->n; i++) {
        keys[i] = key_of(s, &s->pairs[i]);
    }
    qsort(keys, s->n, sizeof *keys, ascending);
    for (size_t i = 0; i < s->n; i++) {
        if (n == 0 || keys[i] != keys[n - 1]) {
            keys[n++] = keys[i];
        }
    }
    p->discs = n < DISCS ? (int)n : DISCS;
    for (int d = 0; d < p->discs; d++) {
        const double key = keys[p->discs > 1 ? (size_t)d * (n - 1) / (size_t)(p->discs - 1) : 0];
        const double azimuth = floor(key / 10000);
        p->incidences[d][0] = key - 10000 * azimuth;
        p->incidences[d][1] = azimuth;
    }
    free(keys);
    p->columns = p->discs < COLUMNS ? p->discs : COLUMNS;
    p->rows = (p->discs + COLUMNS - 1) / COLUMNS;
    return GONIO_OK;
}

static void centred(cairo_t *c, double x, double y, const char *text) {
    cairo_text_extents_t extents;
    cairo_text_extents(c, text, &extents);
    cairo_move_to(c, x - extents.width / 2, y);
    cairo_show_text(c, text);
    cairo_new_path(c);
}

static void draw_frame(const picture *p, int disc, double x, double y) {
    cairo_t *c = p->cairo;
    char label[64];
    cairo_set_source_rgb(c, 0.8, 0.8, 0.8);
    for (int deg = 30; deg <= 90; deg += 30) {
        cairo_arc(c, x, y, RADIUS * sin(gonio_radians(deg)), 0, 2 * GONIO_PI);
        cairo_stroke(c);
    }
    for (int k = 0; k < 2; k++) {
        cairo_move_to(c, x - (k == 0 ? RADIUS : 0), y - (k == 1 ? RADIUS : 0));
        cairo_line_to(c, x + (k == 0 ? RADIUS : 0), y + (k == 1 ? RADIUS : 0));
        cairo_stroke(c);
    }
    cairo_set_source_rgb(c, 0, 0, 0);
    const bool behind = p->incidences[disc][0] >= BEHIND;
    snprintf(label, sizeof label, p->samples->isotropic ? "theta_i %g deg" : "theta_i %g, phi_i %g deg",
             (p->incidences[disc][0] - (behind ? BEHIND : 0)) / 10, p->incidences[disc][1]);
    snprintf(label + strlen(label), sizeof label - strlen(label), "%s", behind ? ", from behind" : "");
    centred(c, x, y - RADIUS - 8, label);
}

static void draw_disc(const picture *p, int disc) {
    const gonio_samples *s = p->samples;
    cairo_t *c = p->cairo;
    const double x = CELL * (disc % COLUMNS + 0.5), y = CELL * (disc / COLUMNS + 0.5) + 10;
    draw_frame(p, disc, x, y);
    const double wanted = p->incidences[disc][0] + (s->isotropic ? 0 : 10000 * p->incidences[disc][1]);
    const gonio_pair *light = NULL;
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *q = &s->pairs[i];
        if (key_of(s, q) != wanted) {
            continue;
        }
        light = q;
        const double phi = turned(s, q->phi_o, q), r = RADIUS * sin(q->theta_o), value = value_of(s, i);
        cli_drawing_colour(c, value > 0 ? (log(value) - p->low) / (p->high - p->low) : 0);
        cairo_arc(c, x + r * cos(phi), y - r * sin(phi), 2, 0, 2 * GONIO_PI);
        cairo_fill(c);
    }
    if (light != NULL) {
        const double phi = turned(s, light->phi_i, light), r = RADIUS * sin(light->theta_i);
        cairo_set_source_rgb(c, 0.85, 0.15, 0.1);
        cairo_arc(c, x + r * cos(phi), y - r * sin(phi), 5, 0, 2 * GONIO_PI);
        cairo_stroke(c);
    }
}

static void draw_bar(const picture *p) {
    cairo_t *c = p->cairo;
    const double x = CELL * p->columns + 10, top = 50, height = 180;
    char label[64];
    for (int k = 0; k < 60; k++) {
        cli_drawing_colour(c, 1 - (k + 0.5) / 60);
        cairo_rectangle(c, x, top + height * k / 60, 14, height / 60 + 0.5);
        cairo_fill(c);
    }
    cairo_set_source_rgb(c, 0, 0, 0);
    for (int k = 0; k < 3; k++) {
        snprintf(label, sizeof label, "%.3g", exp(p->high + (p->low - p->high) * k / 2));
        cairo_move_to(c, x + 18, top + height * k / 2 + 4);
        cairo_show_text(c, label);
    }
    cairo_move_to(c, x, top - 22);
    cairo_show_text(c, p->samples->channel_names[0]);
    cairo_move_to(c, x, top - 8);
    cairo_show_text(c, "f_r, 1/sr");
    cairo_move_to(c, x, top + height + 24);
    cairo_show_text(c, "ring: light");
}

static void draw(cairo_t *cairo, void *context) {
    picture *p = context;
    p->cairo = cairo;
    for (int d = 0; d < p->discs; d++) {
        draw_disc(p, d);
    }
    draw_bar(p);
}

gonio_status cli_samples_picture(const gonio_samples *samples, const char *path, gonio_error *error) {
    picture p = {.samples = samples};
    gonio_status status = find_range(&p, error);
    status = status == GONIO_OK ? find_incidences(&p, error) : status;
    return status == GONIO_OK ? cli_drawing(path, CELL * p.columns + BAR, CELL * p.rows + 20, draw, &p, error) : status;
}
