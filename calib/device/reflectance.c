// SPDX-License-Identifier: BSD-3-Clause
// A white standard's certificate -> what a camera channel sees of it.
//
// The certificate tabulates reflectance and its standard uncertainty over wavelength. A channel of responsivity s
// (camera times lamp) sees the mean of the reflectance weighted by s. The uncertainties at neighbouring wavelengths
// come from one calibration and are taken as fully correlated: the mean's uncertainty is the mean uncertainty.
//
// A certificate for 8 deg incidence and hemispherical collection tells the directional-hemispherical reflectance
// rho(8 deg) = integral of f_r cos(theta_o) over the outgoing hemisphere; the radiance factor at the reference geometry
// is pi f_r(45/0), and the ratio of both is a property of the BRDF's shape alone.
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "gonio/characterise.h"
#include "gonio/session_calibration.h"

#define ROWS_MAX 100000

static gonio_status add_row(gonio_reflectance *r, const gonio_text *text, char *line, gonio_error *error) {
    static const char *const names[3] = {"wavelength in nm", "reflectance", "sigma"};
    char *fields[3];
    double v[3];
    const int n = gonio_text_split(line, ',', fields, 3);
    if (n != 3) {
        return gonio_text_fail(text, error, "expected nm,reflectance,sigma, found %d columns", n);
    }
    for (int k = 0; k < 3; k++) {
        const gonio_status status = gonio_text_number(text, fields[k], names[k], &v[k], error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    if (!(v[0] > 0 && v[0] < 1e5 && v[1] > 0 && v[1] <= 2 && v[2] >= 0 && v[2] <= v[1])) {
        return gonio_text_fail(text, error,
                               "%g,%g,%g: expected a wavelength in nm, a reflectance of 0 to 2 and an uncertainty no "
                               "larger than it",
                               v[0], v[1], v[2]);
    }
    if (r->n > 0 && v[0] <= r->row[r->n - 1][0]) {
        return gonio_text_fail(text, error, "%g nm does not rise above the row before", v[0]);
    }
    if (r->n == ROWS_MAX) {
        return gonio_text_fail(text, error, "more than %d rows", ROWS_MAX);
    }
    if ((r->n & (r->n - 1)) == 0) { // full at every power of two
        double(*larger)[3] = realloc(r->row, (size_t)(r->n > 0 ? 2 * r->n : 1) * sizeof *larger);
        if (larger == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of reflectances");
        }
        r->row = larger;
    }
    memcpy(r->row[r->n++], v, sizeof v);
    return GONIO_OK;
}

// What a header says that these columns are not: percent, um, twice the standard uncertainty.
static gonio_status check_header(const gonio_text *text, char *line, gonio_error *error) {
    static const char *const foreign[] = {"%",       "percent", "pct",    "um",     "\xc2\xb5m", "micro",
                                          "k=2",     "k2",      "u95",    "2sigma", "2 sigma",   "expanded",
                                          "density", "absor",   "transm", NULL};
    char *fields[3];
    const int n = gonio_text_split(line, ',', fields, 3);
    for (int k = 0; k < n && k < 3; k++) {
        for (int f = 0; foreign[f] != NULL; f++) {
            if (strcasestr(fields[k], foreign[f]) != NULL) {
                return gonio_text_fail(text, error,
                                       "column %d is '%.60s'; expected nm, reflectance (1: all) and its standard "
                                       "uncertainty (k = 1)",
                                       k + 1, fields[k]);
            }
        }
    }
    return GONIO_OK;
}

gonio_status gonio_reflectance_read(const char *path, gonio_reflectance *out, gonio_error *error) {
    *out = (gonio_reflectance){0};
    gonio_text text;
    gonio_status status = gonio_text_open(path, 0, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    for (char *line; status == GONIO_OK && (line = gonio_text_row(&text)) != NULL;) {
        const bool header = out->n == 0 && isalpha((unsigned char)*line);
        status = header ? check_header(&text, line, error) : add_row(out, &text, line, error);
    }
    gonio_text_free(&text);
    if (status == GONIO_OK && out->n == 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "no rows; expected nm,reflectance,sigma");
    }
    if (status != GONIO_OK) {
        gonio_reflectance_free(out);
    }
    return status;
}

void gonio_reflectance_free(gonio_reflectance *reflectance) {
    free(reflectance->row);
    *reflectance = (gonio_reflectance){0};
}

// Column k, linearly between rows; nm lies inside the table.
static double interpolated(const gonio_reflectance *r, double nm, int k) {
    int low = 0, high = r->n - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (r->row[middle][0] <= nm) {
            low = middle;
        } else {
            high = middle;
        }
    }
    const double *a = r->row[low], *b = r->row[high];
    return high == low ? a[k] : a[k] + (nm - a[0]) / (b[0] - a[0]) * (b[k] - a[k]);
}

// Where a band's tails end: beyond one FWHM from the centre a Gaussian has 1.9 % of its area.
#define BAND_STEPS 200

gonio_status gonio_reflectance_band(const gonio_reflectance *r, double centre_nm, double fwhm_nm, double *value,
                                    double *sigma, gonio_error *error) {
    const double low = centre_nm - fwhm_nm, high = centre_nm + fwhm_nm;
    if (!(centre_nm > 0 && fwhm_nm >= 0) || low < r->row[0][0] || high > r->row[r->n - 1][0]) {
        return gonio_fail(error, GONIO_E_INPUT,
                          "the band %g:%g nm reaches from %g to %g nm; the table from %g to %g nm", centre_nm, fwhm_nm,
                          low, high, r->row[0][0], r->row[r->n - 1][0]);
    }
    double sum = 0, weighted[2] = {0};
    for (int i = 0; i <= BAND_STEPS; i++) {
        const double x = 2.0 * i / BAND_STEPS - 1; // in FWHM
        const double weight = exp2(-4 * x * x);    // 1/2 at x = 1/2
        sum += weight;
        weighted[0] += weight * interpolated(r, centre_nm + x * fwhm_nm, 1);
        weighted[1] += weight * interpolated(r, centre_nm + x * fwhm_nm, 2);
    }
    *value = weighted[0] / sum;
    *sigma = weighted[1] / sum;
    return GONIO_OK;
}

// Directional-hemispherical reflectance by a product rule: Gauss-Legendre in cos^2(theta_o), in which the
// cosine-weighted hemisphere is uniform, and the trapezoid rule in phi_o, exact for smooth periodic functions.
static double hemispherical(const gonio_model *brdf, int channel, double theta_i) {
    static const double node[8] = {0.0198550717512319, 0.1016667612931866, 0.2372337950418355, 0.4082826787521751,
                                   0.5917173212478249, 0.7627662049581645, 0.8983332387068134, 0.9801449282487681};
    static const double weight[8] = {0.0506142681451881, 0.1111905172266872, 0.1568533229389437, 0.1813418916891810,
                                     0.1813418916891810, 0.1568533229389437, 0.1111905172266872, 0.0506142681451881};
    enum { TURNS = 72 };
    const gonio_vec3 wi = gonio_direction(theta_i, 0);
    double sum = 0;
    for (int k = 0; k < 8; k++) {
        for (int j = 0; j < TURNS; j++) {
            const gonio_vec3 wo = gonio_direction(acos(sqrt(node[k])), (j + 0.5) * 2 * GONIO_PI / TURNS);
            sum += weight[k] * gonio_model_eval_channel(brdf, wi, wo, channel) / TURNS;
        }
    }
    return GONIO_PI * sum;
}

double gonio_reflectance_factor(const gonio_model *brdf, int channel, double theta_i_deg) {
    const gonio_vec3 wi = gonio_direction(gonio_radians(GONIO_REFERENCE_THETA_I_DEG), 0), wo = {0, 0, 1};
    return GONIO_PI * gonio_model_eval_channel(brdf, wi, wo, channel) /
           hemispherical(brdf, channel, gonio_radians(theta_i_deg));
}
