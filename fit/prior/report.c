// SPDX-License-Identifier: BSD-3-Clause
#include "fit/prior/report.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/prior/passive.h"
#include "fit/prior/places.h"

#define PLACES 200
#define THETA_MAX 1.4   // 80 deg
#define MUCH 20         // per cent that are worth a word
#define ALBEDO_MAX 1.05 // some per cent are the integral's error

static void append(gonio_fit_report *report, const char *text) {
    const size_t used = strlen(report->note);
    snprintf(report->note + used, sizeof report->note - used, "%s%s", used > 0 ? "; " : "", text);
}

static int unsupported_percent(gonio_prior *prior) {
    int open = 0;
    for (uint64_t i = 0; i < PLACES; i++) {
        const gonio_pair pair = gonio_prior_place(2 * i, prior->data.dims == 3, THETA_MAX);
        open += gonio_prior_support(prior, &pair) < 0.5;
    }
    return 100 * open / PLACES;
}

void gonio_prior_report(gonio_prior *prior, const gonio_model *model, gonio_fit_report *report) {
    char text[160];
    double albedo = 0, theta = 0;
    const int open = unsupported_percent(prior);
    if (open >= MUCH) {
        snprintf(text, sizeof text,
                 "of %d %% of all directions the samples say little: the values there are physics' (eval --support)",
                 open);
        append(report, text);
    }
    for (int k = 0; k <= 7 && prior->materials_n > 0; k++) {
        const double at = gonio_radians(10.0 * k), now = gonio_passive_albedo(model, at);
        theta = now > albedo ? at : theta;
        albedo = fmax(albedo, now);
    }
    if (albedo > ALBEDO_MAX) {
        snprintf(
            text, sizeof text,
            "WARNING: %.3g times the light that falls in comes out at theta_i = %.0f deg; are the values f_r in 1/sr?",
            albedo, gonio_degrees(theta));
        append(report, text);
    }
}
