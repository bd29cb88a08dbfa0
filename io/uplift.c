// SPDX-License-Identifier: BSD-3-Clause
// Smooth spectra for a model of red, green and blue, for readers that want spectra: three smooth bands, mixed so that
// their colour (io/colour.h) is that of the model.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "io/colour.h"
#include "io/format.h"

#define UPLIFT_FIRST_NM 380
#define UPLIFT_STEP_NM 10
enum { UPLIFT_N = 36 };

typedef struct uplift_view {
    gonio_model head;
    const gonio_model *rgb;
    double basis[3][UPLIFT_N];
    char names[UPLIFT_N][32];
} uplift_view;

static void eval_uplift(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const uplift_view *v = (const uplift_view *)model;
    double rgb[3];
    gonio_model_eval(v->rgb, wi, wo, rgb);
    for (int c = 0; c < UPLIFT_N; c++) {
        values[c] = fmax(v->basis[0][c] * rgb[0] + v->basis[1][c] * rgb[1] + v->basis[2][c] * rgb[2], 0);
    }
}

static void release_uplift(gonio_model *model) { free(model); }

static const gonio_model_ops uplift_ops = {.kind = "measured", .eval = eval_uplift, .free = release_uplift};

static double step_up(double nm, double centre) { return 1 / (1 + exp((centre - nm) / 12)); }

// basis <- basis M^-1, M[i][k] the rgb i that basis k has, so that colours come back.
static void correct(uplift_view *v, double m[3][3]) {
    double inverse[3][3], old[3];
    const double det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                       m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                       m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            const int a = (k + 1) % 3, b = (k + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
            inverse[i][k] = (m[a][c] * m[b][d] - m[a][d] * m[b][c]) / det;
        }
    }
    for (int c = 0; c < UPLIFT_N; c++) {
        for (int k = 0; k < 3; k++) {
            old[k] = v->basis[k][c];
        }
        for (int k = 0; k < 3; k++) {
            v->basis[k][c] = old[0] * inverse[0][k] + old[1] * inverse[1][k] + old[2] * inverse[2][k];
        }
    }
}

gonio_status gonio_model_as_spectra(const gonio_model *rgb, gonio_model **out, gonio_error *error) {
    uplift_view *v = calloc(1, sizeof *v);
    if (v == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for spectra");
    }
    v->head = (gonio_model){.ops = &uplift_ops,
                            .channels = UPLIFT_N,
                            .isotropic = rgb->isotropic,
                            .channel_names = (const char(*)[32])v->names};
    v->rgb = rgb;
    for (int c = 0; c < UPLIFT_N; c++) {
        const double nm = UPLIFT_FIRST_NM + UPLIFT_STEP_NM * c;
        snprintf(v->names[c], sizeof v->names[c], "%gnm", nm);
        v->basis[0][c] = step_up(nm, 585);
        v->basis[2][c] = 1 - step_up(nm, 490);
        v->basis[1][c] = 1 - v->basis[0][c] - v->basis[2][c];
    }
    gonio_colour_weights weights;
    const gonio_status status = gonio_colour_new(UPLIFT_N, v->head.channel_names, &weights, error);
    if (status != GONIO_OK) {
        free(v);
        return status;
    }
    double m[3][3], column[3];
    for (int k = 0; k < 3; k++) {
        gonio_colour_rgb(&weights, v->basis[k], column);
        for (int i = 0; i < 3; i++) {
            m[i][k] = column[i];
        }
    }
    gonio_colour_free(&weights);
    correct(v, m);
    *out = &v->head;
    return GONIO_OK;
}

gonio_status gonio_model_as_wavelengths(const gonio_model *model, gonio_model **rgb, gonio_model **out,
                                        gonio_write_report *told, gonio_error *error) {
    *rgb = *out = (gonio_model *)(uintptr_t)model;
    if (model->channels == 1 || !isnan(gonio_model_wavelength_nm(model, 0))) {
        return GONIO_OK;
    }
    const gonio_status status = gonio_model_as_rgb(model, rgb, error);
    gonio_write_lost(told, "the spectra are smooth ones of the colour, not measured");
    return status == GONIO_OK ? gonio_model_as_spectra(*rgb, out, error) : status;
}
