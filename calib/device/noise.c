// SPDX-License-Identifier: BSD-3-Clause
// Sensor characterisation by photon transfer, after EMVA 1288 release 4.0: sections 6.5 (gain, dark noise), 6.6
// (saturation), 6.7 (linearity), 7 (dark current), 8 (DSNU, PRNU).
//
// Frames are grouped by exposure and light. Temporal variance comes from successive frames of a group (their means
// scaled alike, so that a lamp's flicker drops out), the gain from variance against mean over the groups below 70 % of
// saturation, weighted by how well each variance is known. EMVA's saturation point, the maximum of the variance, is
// coarse by design; here a saturated group is one that falls 15 % short of the line through the dim ones, and the level
// is where its readings pile up.
#include "base/statistics.h"
#include "gonio/characterise.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "calib/internal.h"

#define GROUPS_MAX 64
#define OUTLIER_SIGMAS 8 // see dark.c

typedef struct noise_group {
    double exposure_s;
    bool lit;
    int frames;
    uint16_t *last;
    float *sum;       // of all frames, a pixel
    double mean;      // raw DN, over pixels and frames
    double variance;  // sum over pairs of the mean squared difference / 2
    uint32_t *counts; // histogram
    bool saturated;
} noise_group;

struct gonio_noise {
    int width, height, bits, groups;
    size_t pixels;
    noise_group group[GROUPS_MAX];
    float *dsnu, *prnu;
    uint8_t *defect;
};

gonio_status gonio_noise_new(int width, int height, int bits, gonio_noise **out, gonio_error *error) {
    *out = NULL;
    if (width < 1 || height < 1 || width > 65536 || height > 65536 || bits < 8 || bits > 16) {
        return gonio_fail(error, GONIO_E_INPUT, "frames of %d x %d pixels and %d bits", width, height, bits);
    }
    gonio_noise *noise = calloc(1, sizeof *noise);
    if (noise == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a noise calibration");
    }
    noise->width = width;
    noise->height = height;
    noise->bits = bits;
    noise->pixels = (size_t)width * (size_t)height;
    noise->dsnu = calloc(noise->pixels, sizeof *noise->dsnu);
    noise->prnu = calloc(noise->pixels, sizeof *noise->prnu);
    noise->defect = calloc(noise->pixels, 1);
    if (noise->dsnu == NULL || noise->prnu == NULL || noise->defect == NULL) {
        gonio_noise_free(noise);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the maps of %d x %d pixels", width, height);
    }
    *out = noise;
    return GONIO_OK;
}

void gonio_noise_free(gonio_noise *noise) {
    if (noise == NULL) {
        return;
    }
    for (int g = 0; g < noise->groups; g++) {
        free(noise->group[g].last);
        free(noise->group[g].sum);
        free(noise->group[g].counts);
    }
    free(noise->dsnu);
    free(noise->prnu);
    free(noise->defect);
    free(noise);
}

const float *gonio_noise_dsnu_map(const gonio_noise *noise) { return noise->dsnu; }
const float *gonio_noise_prnu_map(const gonio_noise *noise) { return noise->prnu; }
const uint8_t *gonio_noise_defects(const gonio_noise *noise) { return noise->defect; }

static gonio_status find_group(gonio_noise *noise, double exposure_s, bool lit, noise_group **out, gonio_error *error) {
    for (int g = 0; g < noise->groups; g++) {
        if (noise->group[g].exposure_s == exposure_s && noise->group[g].lit == lit) {
            *out = &noise->group[g];
            return GONIO_OK;
        }
    }
    if (noise->groups == GROUPS_MAX) {
        return gonio_fail(error, GONIO_E_INPUT, "more than %d different exposures", GROUPS_MAX);
    }
    noise_group *group = &noise->group[noise->groups];
    *group = (noise_group){.exposure_s = exposure_s,
                           .lit = lit,
                           .last = malloc(noise->pixels * sizeof *group->last),
                           .sum = calloc(noise->pixels, sizeof *group->sum),
                           .counts = calloc((size_t)1 << noise->bits, sizeof *group->counts)};
    noise->groups++;
    if (group->last == NULL || group->sum == NULL || group->counts == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for exposure %d of %d x %d pixels", noise->groups,
                          noise->width, noise->height);
    }
    *out = group;
    return GONIO_OK;
}

gonio_status gonio_noise_add(gonio_noise *noise, const uint16_t *pixels, double exposure_s, bool lit,
                             gonio_error *error) {
    const unsigned top = (1u << noise->bits) - 1;
    if (!(exposure_s > 0) || !isfinite(exposure_s)) {
        return gonio_fail(error, GONIO_E_INPUT, "exposure of %g s", exposure_s);
    }
    for (size_t p = 0; p < noise->pixels; p++) {
        if (pixels[p] > top) {
            return gonio_fail(error, GONIO_E_INPUT, "pixel %zu reads %u; %d bits end at %u", p, pixels[p], noise->bits,
                              top);
        }
    }
    noise_group *group = NULL;
    const gonio_status status = find_group(noise, exposure_s, lit, &group, error);
    if (status != GONIO_OK) {
        return status;
    }
    double sum = 0, last = 0, squares = 0;
    for (size_t p = 0; p < noise->pixels; p++) {
        sum += pixels[p];
        last += group->frames > 0 ? group->last[p] : 0;
        group->sum[p] += pixels[p];
        group->counts[pixels[p]]++;
    }
    const double n = (double)noise->pixels, offset = (sum - last) / n;
    for (size_t p = 0; p < noise->pixels && group->frames > 0; p++) {
        const double d = pixels[p] - group->last[p] - offset;
        squares += d * d;
    }
    group->variance += squares / (2 * n);
    group->mean = (group->mean * group->frames + sum / n) / (group->frames + 1);
    memcpy(group->last, pixels, noise->pixels * sizeof *pixels);
    group->frames++;
    return GONIO_OK;
}

static double group_variance(const noise_group *g) { return g->variance / (g->frames - 1); }

// A least-squares line y = a + b x and the standard error of b, of n points with weights.
typedef struct line {
    double w, x, y, xx, xy;
} line;

static void line_add(line *l, double x, double y, double weight) {
    l->w += weight;
    l->x += weight * x;
    l->y += weight * y;
    l->xx += weight * x * x;
    l->xy += weight * x * y;
}

static void line_solve(const line *l, double *a, double *b, double *b_sigma) {
    const double determinant = l->w * l->xx - l->x * l->x;
    const bool sloped = determinant > 1e-12 * l->w * l->xx;
    *b = sloped ? (l->w * l->xy - l->x * l->y) / determinant : 0;
    *a = (l->y - *b * l->x) / l->w;
    *b_sigma = sloped ? sqrt(l->w / determinant) : INFINITY;
}

static double group_quantile(const gonio_noise *noise, const noise_group *g, double q) {
    const double wanted = q * (double)noise->pixels * g->frames;
    double seen = 0;
    const unsigned top = (1u << noise->bits) - 1;
    for (unsigned v = 0; v < top; v++) {
        seen += g->counts[v];
        if (seen > wanted) {
            return v;
        }
    }
    return top;
}

// Mean of the middle 98 %: hot pixels, which saturate, would bend the line over exposure time.
static double trimmed_mean(const gonio_noise *noise, const noise_group *g) {
    const unsigned low = (unsigned)group_quantile(noise, g, 0.01), high = (unsigned)group_quantile(noise, g, 0.99);
    double sum = 0, n = 0;
    for (unsigned v = low; v <= high; v++) {
        sum += (double)v * g->counts[v];
        n += g->counts[v];
    }
    return sum / n;
}

// Black level and dark current (DN/s) from the dark means, read variance (DN^2) from the shortest dark group.
typedef struct dark_model {
    double black, rate, rate_sigma, variance;
    const noise_group *shortest;
} dark_model;

static gonio_status solve_dark(const gonio_noise *noise, dark_model *dark, gonio_error *error) {
    line l = {0};
    for (int g = 0; g < noise->groups; g++) {
        const noise_group *group = &noise->group[g];
        if (!group->lit && group->frames >= 2) {
            const double error_of_mean = group_variance(group) / ((double)noise->pixels * group->frames) + 1e-12;
            line_add(&l, group->exposure_s, trimmed_mean(noise, group), 1 / error_of_mean);
            if (dark->shortest == NULL || group->exposure_s < dark->shortest->exposure_s) {
                dark->shortest = group;
            }
        }
    }
    if (dark->shortest == NULL) {
        return gonio_fail(error, GONIO_E_INPUT, "no two dark frames of one exposure");
    }
    line_solve(&l, &dark->black, &dark->rate, &dark->rate_sigma);
    // A reading is a whole number of DN: even a noiseless camera shows 1/12.
    dark->variance = fmax(group_variance(dark->shortest), 1.0 / 12);
    if (dark->black > 0.5 * (1 << noise->bits)) {
        return gonio_fail(error, GONIO_E_DEVICE, "dark frames not dark: black level %.0f of %d DN", dark->black,
                          (1 << noise->bits) - 1);
    }
    return GONIO_OK;
}

static double signal_of(const noise_group *g, const dark_model *dark) {
    return g->mean - dark->black - dark->rate * g->exposure_s;
}

// The group whose mean is the largest below 0.6 of the brightest: surely unsaturated, and well above noise.
static const noise_group *unsaturated(const gonio_noise *noise, const dark_model *dark) {
    const noise_group *best = NULL;
    double top = 0;
    for (int g = 0; g < noise->groups; g++) {
        top = fmax(top, noise->group[g].lit ? signal_of(&noise->group[g], dark) : 0);
    }
    for (int g = 0; g < noise->groups; g++) {
        const noise_group *group = &noise->group[g];
        const double s = signal_of(group, dark);
        if (group->lit && s <= 0.6 * top && (best == NULL || s > signal_of(best, dark))) {
            best = group;
        }
    }
    return best;
}

static gonio_status solve_saturation(gonio_noise *noise, const dark_model *dark, gonio_noise_report *report,
                                     gonio_error *error) {
    const noise_group *base = unsaturated(noise, dark);
    if (base == NULL || signal_of(base, dark) < 3 * sqrt(dark->variance)) {
        return gonio_fail(error, GONIO_E_DEVICE,
                          "the lit frames are no brighter than the dark ones, or all alike: is "
                          "the lamp on, and are there at least two exposures?");
    }
    report->saturation_dn = (1 << noise->bits) - 1;
    for (int g = 0; g < noise->groups; g++) {
        noise_group *group = &noise->group[g];
        const double predicted = signal_of(base, dark) * group->exposure_s / base->exposure_s;
        group->saturated =
            group->lit && group->exposure_s > base->exposure_s && predicted > 1.15 * signal_of(group, dark);
        // Only a frame that is predicted to saturate throughout has its low end at the level.
        if (group->saturated && predicted > 1.3 * signal_of(group, dark)) {
            report->saturation_dn = fmin(report->saturation_dn, group_quantile(noise, group, 0.01));
            report->saturation_measured = true;
        }
    }
    return GONIO_OK;
}

static gonio_status solve_gain(const gonio_noise *noise, const dark_model *dark, gonio_noise_report *report,
                               gonio_error *error) {
    const double limit = dark->black + 0.7 * (report->saturation_dn - dark->black);
    double numerator = 0, weights = 0;
    for (int g = 0; g < noise->groups; g++) {
        const noise_group *group = &noise->group[g];
        if (!group->lit || group->frames < 2 || group->saturated || group_quantile(noise, group, 0.999) > limit) {
            continue;
        }
        // Dark current's electrons make shot noise as light's do, so both variance and mean are taken above black.
        const double variance = group_variance(group), mean = group->mean - dark->black;
        const double pairs = (double)noise->pixels * (group->frames - 1) * 2 / 3 + (double)noise->pixels / 3;
        const double w = mean * mean / (2 * variance * variance / pairs);
        numerator += w * (variance - dark->variance) / mean;
        weights += w;
        report->points++;
    }
    if (report->points == 0 || !(numerator > 0)) {
        return gonio_fail(error, GONIO_E_INPUT, "no two lit frames of one exposure below 70 %% of saturation (%.0f DN)",
                          report->saturation_dn);
    }
    const double k = numerator / weights, frames = dark->shortest->frames - 1;
    report->gain_e_per_dn = 1 / k;
    report->gain_relative_sigma = sqrt(1 / weights) / k;
    report->black_dn = dark->black;
    report->read_noise_dn =
        sqrt(fmax(dark->variance - 1.0 / 12 - k * fmax(dark->rate, 0) * dark->shortest->exposure_s, 0));
    report->read_noise_e = report->read_noise_dn / k;
    report->read_noise_relative_sigma =
        hypot(sqrt(0.5 / ((double)noise->pixels * frames)), report->gain_relative_sigma);
    report->dark_e_per_s = dark->rate / k;
    report->dark_e_per_s_sigma = dark->rate_sigma / k;
    report->saturation_e = (report->saturation_dn - dark->black) / k;
    report->snr_max = sqrt(report->saturation_e);
    // EMVA: the signal of SNR 1, photon noise included, against saturation.
    const double noise_e = sqrt(dark->variance) / k, least = noise_e * noise_e;
    report->dynamic_range = report->saturation_e / (0.5 + sqrt(0.25 + least));
    return GONIO_OK;
}

// Mean |deviation| of signal / exposure from its weighted mean over 5 to 95 % of saturation: a line through black.
static void solve_linearity(const gonio_noise *noise, const dark_model *dark, gonio_noise_report *report) {
    const double full = report->saturation_dn - dark->black;
    double slope = 0, sum = 0;
    int n = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int g = 0; g < noise->groups; g++) {
            const noise_group *group = &noise->group[g];
            const double s = signal_of(group, dark);
            if (!group->lit || group->saturated || s < 0.05 * full ||
                group_quantile(noise, group, 0.999) > dark->black + 0.95 * full) {
                continue;
            }
            if (pass == 0) {
                slope += s / group->exposure_s;
                n++;
            } else {
                const double deviation = fabs(s / group->exposure_s / (slope / n) - 1);
                sum += deviation;
                report->linearity_error_max = fmax(report->linearity_error_max, deviation);
            }
        }
    }
    report->linearity_error = n > 0 ? sum / n : NAN;
}

// Offsets: the averaged shortest dark frames about their median; defects beyond OUTLIER_SIGMAS in offset or dark rate.
static gonio_status solve_dsnu(gonio_noise *noise, const dark_model *dark, gonio_noise_report *report,
                               gonio_error *error) {
    const noise_group *shortest = dark->shortest, *longest = shortest;
    for (int g = 0; g < noise->groups; g++) {
        const noise_group *group = &noise->group[g];
        longest = !group->lit && group->exposure_s > longest->exposure_s ? group : longest;
    }
    double squares = 0;
    size_t sound = 0;
    for (int pass = 0; pass < 2; pass++) {
        const noise_group *group = pass == 0 ? longest : shortest;
        double median, sigma;
        for (size_t p = 0; p < noise->pixels; p++) {
            noise->dsnu[p] = group->sum[p] / (float)group->frames;
        }
        const gonio_status status = gonio_median_mad_f32(noise->dsnu, noise->pixels, &median, &sigma, error);
        if (status != GONIO_OK) {
            return status;
        }
        sigma = fmax(sigma, sqrt(dark->variance / group->frames));
        for (size_t p = 0; p < noise->pixels; p++) {
            noise->dsnu[p] -= (float)median;
            if (!noise->defect[p] && fabs(noise->dsnu[p]) > OUTLIER_SIGMAS * sigma) {
                noise->defect[p] = 1;
                report->hot++;
            }
        }
    }
    for (size_t p = 0; p < noise->pixels; p++) {
        squares += noise->defect[p] ? 0 : (double)noise->dsnu[p] * noise->dsnu[p];
        sound += !noise->defect[p];
    }
    const double spatial = squares / (double)sound - group_variance(shortest) / shortest->frames;
    report->dsnu_e = sqrt(fmax(spatial, 0)) * report->gain_e_per_dn;
    return GONIO_OK;
}

#define TERMS 15 // 2-D polynomial of degree 4

static void polynomial_terms(const gonio_noise *noise, size_t p, double t[TERMS]) {
    const double x = 2.0 * (double)(p % (size_t)noise->width) / noise->width - 1;
    const double y = 2.0 * (double)(p / (size_t)noise->width) / noise->height - 1;
    int k = 0;
    for (int i = 0; i <= 4; i++) {
        for (int j = 0; i + j <= 4; j++) {
            t[k++] = pow(x, i) * pow(y, j);
        }
    }
}

// Cholesky solve of the normal equations, which are well conditioned for so few smooth terms.
static bool solve_normal(double a[TERMS][TERMS], double b[TERMS]) {
    for (int i = 0; i < TERMS; i++) {
        for (int j = 0; j <= i; j++) {
            for (int k = 0; k < j; k++) {
                a[i][j] -= a[i][k] * a[j][k];
            }
            if (i == j && !(a[i][i] > 0)) {
                return false;
            }
            a[i][j] = i == j ? sqrt(a[i][i]) : a[i][j] / a[j][j];
        }
    }
    for (int i = 0; i < TERMS; i++) {
        for (int k = 0; k < i; k++) {
            b[i] -= a[i][k] * b[k];
        }
        b[i] /= a[i][i];
    }
    for (int i = TERMS - 1; i >= 0; i--) {
        for (int k = i + 1; k < TERMS; k++) {
            b[i] -= a[k][i] * b[k];
        }
        b[i] /= a[i][i];
    }
    return true;
}

// Divide the map by its own smooth part (illumination, vignetting).
static void flatten(gonio_noise *noise) {
    double a[TERMS][TERMS] = {{0}}, b[TERMS] = {0};
    for (size_t p = 0; p < noise->pixels; p++) {
        double t[TERMS];
        polynomial_terms(noise, p, t);
        for (int i = 0; i < TERMS && !noise->defect[p]; i++) {
            b[i] += t[i] * noise->prnu[p];
            for (int j = 0; j <= i; j++) {
                a[i][j] += t[i] * t[j];
            }
        }
    }
    if (!solve_normal(a, b)) {
        return; // fewer pixels than terms: nothing smooth to take off
    }
    for (size_t p = 0; p < noise->pixels; p++) {
        double t[TERMS], smooth = 0;
        polynomial_terms(noise, p, t);
        for (int i = 0; i < TERMS; i++) {
            smooth += b[i] * t[i];
        }
        noise->prnu[p] = (float)(noise->prnu[p] / smooth);
    }
}

// The lit group nearest to half of saturation.
static const noise_group *half_group(const gonio_noise *noise, const dark_model *dark, double full) {
    const noise_group *best = NULL;
    for (int g = 0; g < noise->groups; g++) {
        const noise_group *group = &noise->group[g];
        if (group->lit && group->frames >= 2 && !group->saturated &&
            (best == NULL || fabs(signal_of(group, dark) - full / 2) < fabs(signal_of(best, dark) - full / 2))) {
            best = group;
        }
    }
    return best;
}

static void solve_prnu(gonio_noise *noise, const dark_model *dark, gonio_noise_report *report) {
    const noise_group *group = half_group(noise, dark, report->saturation_dn - dark->black);
    const double mean = signal_of(group, dark);
    for (size_t p = 0; p < noise->pixels; p++) {
        const double s =
            group->sum[p] / (double)group->frames - dark->black - noise->dsnu[p] - dark->rate * group->exposure_s;
        noise->prnu[p] = (float)(s / mean);
        if (!noise->defect[p] && (s < 0.5 * mean || s > 2 * mean)) {
            noise->defect[p] = 3;
            report->dead++;
        }
    }
    flatten(noise);
    double squares = 0;
    size_t sound = 0;
    for (size_t p = 0; p < noise->pixels; p++) {
        const double d = noise->prnu[p] - 1;
        squares += noise->defect[p] ? 0 : d * d;
        sound += !noise->defect[p];
    }
    const double temporal =
        (group_variance(group) / group->frames + dark->variance / dark->shortest->frames) / (mean * mean);
    report->prnu = sqrt(fmax(squares / (double)sound - temporal, 0));
}

gonio_status gonio_noise_solve(gonio_noise *noise, gonio_noise_report *report, gonio_error *error) {
    *report = (gonio_noise_report){0};
    dark_model dark = {0};
    gonio_status status = solve_dark(noise, &dark, error);
    status = status == GONIO_OK ? solve_saturation(noise, &dark, report, error) : status;
    status = status == GONIO_OK ? solve_gain(noise, &dark, report, error) : status;
    if (status == GONIO_OK) {
        solve_linearity(noise, &dark, report);
        status = solve_dsnu(noise, &dark, report, error);
    }
    if (status == GONIO_OK) {
        solve_prnu(noise, &dark, report);
    }
    return status;
}
