// SPDX-License-Identifier: BSD-3-Clause
// Three maps of where the squares lie: the outgoing direction's projection with the light at the right, the half
// vector's plane, and theta_o over theta_i. Colours are logarithms over four decades; grey is where no directions lie.
#include "host/cli/needs_picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/needs/needs.h"
#include "host/cli/drawing.h"

enum { SIDE = 64, PIXEL = 4, MAPS = 3, STEP = SIDE * PIXEL + 40, TOP = 50, TRIES = 24 };

typedef struct picture {
    const gonio_needs *needs;
    double (*bins)[SIDE][SIDE]; // [material][map], [row from below][column]
} picture;

static const char *const titles[MAPS] = {"camera's projection, light at the right", "half vector's plane",
                                         "theta_o over theta_i, 0 to 90 deg"};

// The place of a pair in a map, each coordinate 0 to 1.
static void locate(int map, bool isotropic, gonio_vec3 wi, gonio_vec3 wo, double at[2]) {
    double x[4];
    if (map == 0) {
        // Also of anisotropic materials, turned to the light.
        gonio_coordinates_isotropic(GONIO_NUSSELT, wi, wo, x);
        at[0] = x[1];
        at[1] = x[2];
    } else if (map == 1) {
        if (isotropic) {
            gonio_coordinates_isotropic(GONIO_HALF_VECTOR, wi, wo, x);
        } else {
            gonio_coordinates_anisotropic(GONIO_HALF_VECTOR, wi, wo, x);
        }
        at[0] = x[0];
        at[1] = x[1];
    } else {
        at[0] = gonio_direction_theta(wi) / (GONIO_PI / 2);
        at[1] = gonio_direction_theta(wo) / (GONIO_PI / 2);
    }
}

static int bin_of(double x) { return x >= 1 ? SIDE - 1 : (int)(fmax(x, 0) * SIDE); }

static void fill(const picture *p, int material) {
    gonio_needs_facts facts;
    gonio_needs_describe(p->needs, material, &facts);
    const gonio_need *cells = gonio_needs_cells(p->needs, material);
    for (int map = 0; map < MAPS; map++) {
        double(*bins)[SIDE] = p->bins[material * MAPS + map];
        for (size_t i = 0; i < facts.cells; i++) {
            double at[2];
            locate(map, facts.isotropic, cells[i].wi, cells[i].wo, at);
            bins[bin_of(at[1])][bin_of(at[0])] += cells[i].squares;
            if (facts.isotropic && map < 2) {
                bins[bin_of(1 - at[1])][bin_of(at[0])] += cells[i].squares;
            }
        }
    }
}

// Is there any pair of directions in the bin?
static bool exists(int map, int row, int column) {
    gonio_vec3 wi, wo;
    const double a = (column + 0.5) / SIDE, b = (row + 0.5) / SIDE;
    bool any = map == 2 || (map == 0 && hypot(2 * a - 1, 2 * b - 1) <= 1);
    for (int k = 0; k < TRIES && map == 1 && !any; k++) {
        const double x[3] = {a, b, (double)k / TRIES};
        any = gonio_needs_pair_at(GONIO_HALF_VECTOR, true, x, &wi, &wo);
    }
    return any;
}

static void draw_map(const picture *p, cairo_t *c, int material, int map, double left, double top) {
    double(*bins)[SIDE] = p->bins[material * MAPS + map];
    double most = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        most = fmax(most, bins[i / SIDE][i % SIDE]);
    }
    for (int row = 0; row < SIDE; row++) {
        for (int column = 0; column < SIDE; column++) {
            const double share = most > 0 ? bins[row][column] / most : 0;
            if (share > 0) {
                cli_drawing_colour(c, 1 + log10(share) / 4);
            } else {
                const double grey = exists(map, row, column) ? 1 : 0.8;
                cairo_set_source_rgb(c, grey, grey, grey);
            }
            cairo_rectangle(c, left + column * PIXEL, top + (SIDE - 1 - row) * PIXEL, PIXEL, PIXEL);
            cairo_fill(c);
        }
    }
    cairo_set_source_rgb(c, 0, 0, 0);
    cairo_rectangle(c, left - 0.5, top - 0.5, SIDE * PIXEL + 1, SIDE * PIXEL + 1);
    cairo_stroke(c);
    cairo_move_to(c, left, top - 6);
    cairo_show_text(c, titles[map]);
}

static void draw(cairo_t *c, void *context) {
    const picture *p = context;
    for (int m = 0; m < gonio_needs_materials(p->needs); m++) {
        gonio_needs_facts facts;
        char title[GONIO_NEEDS_NAME_MAX + 100];
        const double top = TOP + m * (STEP + 20.0);
        gonio_needs_describe(p->needs, m, &facts);
        snprintf(title, sizeof title, "%s: squares of codes, colours over four decades; grey: no directions there",
                 facts.name);
        cairo_set_source_rgb(c, 0, 0, 0);
        cairo_move_to(c, 20, top - 24);
        cairo_show_text(c, title);
        for (int map = 0; map < MAPS; map++) {
            draw_map(p, c, m, map, 20 + map * STEP, top);
        }
    }
}

gonio_status cli_needs_picture(const gonio_needs *needs, const char *path, gonio_error *error) {
    const int materials = gonio_needs_materials(needs);
    picture p = {.needs = needs, .bins = calloc((size_t)(materials * MAPS), sizeof *p.bins)};
    if (p.bins == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a picture");
    }
    for (int m = 0; m < materials; m++) {
        fill(&p, m);
    }
    const gonio_status status = cli_drawing(path, 20 + MAPS * STEP, TOP + materials * (STEP + 20), draw, &p, error);
    free(p.bins);
    return status;
}
