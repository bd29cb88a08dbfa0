// SPDX-License-Identifier: BSD-3-Clause
// Response curve and exposure times from images of one scene.
//
// Reading v_ij of pixel i in image j says ln E(v_ij) = ln L_i + tau_j, tau the log exposure time. For given curve and
// times the best ln L_i is a weighted mean, so it is eliminated, and Levenberg-Marquardt (cminpack) runs over curve and
// times alone. Weights are the precision of ln E at that value, 1 / (d ln E / dv)^2, from the previous round's curve:
// fixed within a round, or the fit could gain by flattening the curve. The nominal times enter as a prior; the first
// and the last are held, since E and t are free together up to a power (Grossberg and Nayar, "Determining the camera
// response from images: what is knowable?", PAMI 2003).
#include <cminpack.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/order_statistic.h"
#include "base/statistics.h"
#include "calib/device/curve.h"
#include "calib/opencv.h"
#include "gonio/output.h"

#define PIXELS_MAX 600
#define ROUNDS 5
#define EVALUATIONS_MAX 60 // of the Jacobian in one round; the next goes on from there
#define SPLINE_KNOTS 32
// What misfits a frame (registration, scattered light, a stiff curve) misfits it in many pixels alike: however many are
// used, they tell no more of its exposure time than this number of independent ones.
#define INDEPENDENT 50.0
// An image is left out of the merge when it disagrees by this factor more than the median image does, and by 5 %.
#define REJECT_FACTOR 2
#define COMPARED 40000 // pixels, evenly spread, suffice for a median
#define REJECT_LN 0.05
#define VALUE_SIGMA 0.004 // relative value: one step of 8 bits

typedef struct problem {
    int frames, pixels;
    const double *exposure_s;
    double times_sigma, low, high;
    curve_family family;
    double value[PIXELS_MAX][GONIO_RESPONSE_FRAMES];  // relative, NaN: not used
    double weight[PIXELS_MAX][GONIO_RESPONSE_FRAMES]; // 1 / sigma of ln E
    int ends[2];                                      // the frames whose times are held
    double scale;                                     // residuals' typical size, for the prior's share
} problem;

void gonio_response_options_default(gonio_response_options *options) {
    *options = (gonio_response_options){.terms = 7, .times_sigma = 0.02, .low = 0.02, .high = 0.97};
}

static double curve_at(const double *ln_exposure, double value) {
    const double x = value * (CURVE_POINTS - 1);
    const int k = (int)fmin(floor(x), CURVE_POINTS - 2);
    return ln_exposure[k] + (ln_exposure[k + 1] - ln_exposure[k]) * (x - k);
}

static double relative_value(const gonio_image *image, int channel, size_t pixel) {
    return image->pixels[pixel * (size_t)image->channels + (size_t)channel] / (double)((1 << image->bits) - 1);
}

// Film fog and sensor pedestals: a level at which a quarter of the darkest image lies and which an exposure at least
// half as long again does not raise. Readings up to a little above it say nothing about exposure.
#define FOG_MARGIN 0.03
#define FOG_RISE 0.01

static double lower_quartile(const gonio_image *image, int channel, double *scratch) {
    const size_t n = (size_t)image->width * (size_t)image->height;
    for (size_t p = 0; p < n; p++) {
        scratch[p] = relative_value(image, channel, p);
    }
    return gonio_order_statistic(scratch, n, n / 4);
}

static gonio_status find_fog(problem *q, const gonio_image *images, int channel, gonio_error *error) {
    const int dark = q->ends[0];
    int next = -1;
    for (int j = 0; j < q->frames; j++) {
        const bool longer = q->exposure_s[j] >= 1.5 * q->exposure_s[dark];
        next = longer && (next < 0 || q->exposure_s[j] < q->exposure_s[next]) ? j : next;
    }
    double *scratch = malloc((size_t)images[0].width * (size_t)images[0].height * sizeof *scratch);
    if (scratch == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to sort an image");
    }
    if (next >= 0) {
        const double fog = lower_quartile(&images[dark], channel, scratch);
        const double raised = lower_quartile(&images[next], channel, scratch);
        if (fog >= q->low && raised - fog < FOG_RISE) {
            q->low = raised + FOG_MARGIN;
        }
    }
    free(scratch);
    return GONIO_OK;
}

// Is the image even about the pixel? Edges would turn the least misregistration into a wrong ratio.
static bool is_smooth(const gonio_image *image, int channel, size_t pixel) {
    const int x = (int)(pixel % (size_t)image->width), y = (int)(pixel / (size_t)image->width);
    const double v = relative_value(image, channel, pixel);
    if (x < 2 || y < 2 || x + 2 >= image->width || y + 2 >= image->height) {
        return false;
    }
    for (int k = 0; k < 25; k++) {
        const size_t near = (size_t)(y + k / 5 - 2) * (size_t)image->width + (size_t)(x + k % 5 - 2);
        if (fabs(relative_value(image, channel, near) - v) > fmax(0.015, 0.05 * v)) {
            return false;
        }
    }
    return true;
}

// Pixels spread evenly over the ranks of brightness, each seen in range at least twice.
typedef struct ranked {
    double sum;
    size_t pixel;
} ranked;

static int by_sum(const void *a, const void *b) {
    const ranked *x = a, *y = b;
    return x->sum != y->sum ? (x->sum > y->sum) - (x->sum < y->sum) : (x->pixel > y->pixel) - (x->pixel < y->pixel);
}

static gonio_status choose_pixels(problem *q, const gonio_image *images, int channel, gonio_error *error) {
    const size_t n = (size_t)images[0].width * (size_t)images[0].height;
    ranked *order = malloc(n * sizeof *order);
    size_t usable = 0;
    if (order == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to rank %zu pixels", n);
    }
    for (size_t p = 0; p < n; p++) {
        int in_range = 0;
        double sum = 0;
        for (int j = 0; j < q->frames; j++) {
            const double v = relative_value(&images[j], channel, p);
            in_range += v >= q->low && v <= q->high && is_smooth(&images[j], channel, p);
            sum += v;
        }
        if (in_range >= 2) {
            order[usable++] = (ranked){sum, p};
        }
    }
    qsort(order, usable, sizeof *order, by_sum);
    q->pixels = (int)fmin((double)usable, PIXELS_MAX);
    for (int i = 0; i < q->pixels; i++) {
        const size_t p = order[(size_t)((i + 0.5) * (double)usable / q->pixels)].pixel;
        for (int j = 0; j < q->frames; j++) {
            const double v = relative_value(&images[j], channel, p);
            q->value[i][j] = v >= q->low && v <= q->high && is_smooth(&images[j], channel, p) ? v : NAN;
        }
    }
    free(order);
    return q->pixels >= 20 ? GONIO_OK
                           : gonio_fail(error, GONIO_E_INPUT,
                                        "%d pixels are in range and evenly lit in two images; at least 20 are "
                                        "needed",
                                        q->pixels);
}

static int time_parameters(const problem *q) { return q->times_sigma > 0 ? q->frames - 2 : 0; }

static void unpack_times(const problem *q, const double *p, double *tau) {
    const double *free_times = p + q->family.parameters;
    int k = 0;
    for (int j = 0; j < q->frames; j++) {
        const bool held = j == q->ends[0] || j == q->ends[1] || q->times_sigma == 0;
        tau[j] = log(q->exposure_s[j]) + (held ? 0 : free_times[k++]);
    }
}

// Weighted residuals of ln E after each pixel's own radiance is taken out.
static int data_residuals(const problem *q, const double *ln_exposure, const double *tau, double *out) {
    int m = 0;
    for (int i = 0; i < q->pixels; i++) {
        double sum = 0, weights = 0;
        for (int j = 0; j < q->frames; j++) {
            if (!isnan(q->value[i][j])) {
                const double w = q->weight[i][j] * q->weight[i][j];
                sum += w * (curve_at(ln_exposure, q->value[i][j]) - tau[j]);
                weights += w;
            }
        }
        for (int j = 0; j < q->frames; j++) {
            const bool used = !isnan(q->value[i][j]);
            out[m++] = used ? q->weight[i][j] * (curve_at(ln_exposure, q->value[i][j]) - tau[j] - sum / weights) : 0;
        }
    }
    return m;
}

static int residuals(void *context, int m, int n, const double *p, double *out, int flag) {
    (void)n;
    (void)flag;
    const problem *q = context;
    double ln_exposure[CURVE_POINTS], tau[GONIO_RESPONSE_FRAMES], penalty[CURVE_PENALTIES];
    gonio_curve_make(&q->family, p, ln_exposure, penalty);
    unpack_times(q, p, tau);
    int k = data_residuals(q, ln_exposure, tau, out);
    memcpy(out + k, penalty, sizeof penalty);
    k += CURVE_PENALTIES;
    const double prior = q->scale * sqrt(fmax(q->pixels / INDEPENDENT, 1));
    for (int j = 0; j < q->frames && k < m; j++) {
        out[k++] = q->times_sigma > 0 ? prior * (tau[j] - log(q->exposure_s[j])) / q->times_sigma : 0;
    }
    return 0;
}

static void set_weights(problem *q, const double *ln_exposure) {
    for (int i = 0; i < q->pixels; i++) {
        for (int j = 0; j < q->frames; j++) {
            const double v = q->value[i][j], h = 0.01;
            if (!isnan(v)) {
                const double slope = (curve_at(ln_exposure, fmin(v + h, 1)) - curve_at(ln_exposure, fmax(v - h, 0))) /
                                     (fmin(v + h, 1) - fmax(v - h, 0));
                q->weight[i][j] = 1 / (VALUE_SIGMA * fmax(slope, 0.1));
            }
        }
    }
}

// Misregistered or moving details: Cauchy's weight, by the size of each reading's residual among all.
static gonio_status downweight_outliers(problem *q, const double *ln_exposure, const double *tau, gonio_error *error) {
    const int m = q->pixels * q->frames;
    double *r = malloc(2 * (size_t)m * sizeof *r), *sizes = r != NULL ? r + m : NULL;
    if (r == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for residuals");
    }
    size_t n = 0;
    data_residuals(q, ln_exposure, tau, r);
    for (int k = 0; k < m; k++) {
        if (r[k] != 0) {
            sizes[n++] = fabs(r[k]);
        }
    }
    const double scale =
        n > 0 ? 2.4 * fmax(1.4826 * gonio_upper_median(sizes, n), 1) : 0; // 2.4: Holland and Welsch 1977
    for (int k = 0; k < m && scale > 0; k++) {
        q->weight[k / q->frames][k % q->frames] /= sqrt(1 + r[k] * r[k] / (scale * scale));
    }
    free(r);
    return GONIO_OK;
}

static gonio_status minimise(problem *q, double *p, double *rms, gonio_error *error) {
    const int n = q->family.parameters + time_parameters(q), data = q->pixels * q->frames;
    const int m = data + CURVE_PENALTIES + q->frames;
    // lmdif's work: residuals, Jacobian, 6 vectors of n, 1 of m.
    double *f = malloc(((size_t)m * (size_t)(n + 2) + 6 * (size_t)n) * sizeof *f);
    int *pivots = malloc((size_t)n * sizeof *pivots);
    if (f == NULL || pivots == NULL) {
        free(f);
        free(pivots);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a response fit");
    }
    double *jacobian = f + m, *v = jacobian + (size_t)m * (size_t)n;
    int evaluations;
    // A change of 1e-7 in the sum of squares is far below what one more round of weights changes.
    const int info = lmdif(residuals, q, m, n, p, f, 1e-7, 1e-7, 0, EVALUATIONS_MAX * (n + 1), 1e-8, v, 1, 10, 0,
                           &evaluations, jacobian, m, pivots, v + n, v + 2 * n, v + 3 * n, v + 4 * n, v + 5 * n);
    double sum = 0;
    int used = 0;
    for (int k = 0; k < data; k++) {
        sum += f[k] * f[k];
        used += f[k] != 0;
    }
    *rms = sqrt(sum / fmax(used - n - q->pixels, 1));
    free(f);
    free(pivots);
    return info > 0 ? GONIO_OK : gonio_fail(error, GONIO_E_CONVERGENCE, "the response fit failed (lmdif %d)", info);
}

static gonio_status fit_family(problem *q, gonio_response_curve *curve, gonio_error *error) {
    double p[CURVE_PARAMETERS_MAX + GONIO_RESPONSE_FRAMES] = {0}, ln_exposure[CURVE_POINTS], penalty[CURVE_PENALTIES];
    double tau[GONIO_RESPONSE_FRAMES], rms = 1;
    gonio_status status = GONIO_OK;
    gonio_curve_start(&q->family, p);
    q->scale = 1;
    for (int round = 0; status == GONIO_OK && round < ROUNDS; round++) {
        gonio_curve_make(&q->family, p, ln_exposure, penalty);
        unpack_times(q, p, tau);
        set_weights(q, ln_exposure);
        status = round > 0 ? downweight_outliers(q, ln_exposure, tau, error) : GONIO_OK;
        status = status == GONIO_OK ? minimise(q, p, &rms, error) : status;
        q->scale = fmax(rms, 0.1); // the data's real noise, not one step of 8 bits, is what the prior competes with
    }
    gonio_curve_make(&q->family, p, ln_exposure, penalty);
    unpack_times(q, p, tau);
    for (int j = 0; j < CURVE_POINTS; j++) {
        curve->exposure[j] = j == 0 ? 0 : exp(ln_exposure[j] - ln_exposure[CURVE_POINTS - 1]);
    }
    for (int j = 0; j < q->frames; j++) {
        curve->exposure_s[j] = exp(tau[j]);
    }
    return status;
}

static gonio_status fit_opencv(const gonio_response_options *options, int n, const gonio_image *images, int channel,
                               const double *exposure_s, gonio_response_curve *curve, gonio_error *error) {
    double found[256];
    if (images[0].bits != 8) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "OpenCV's response fits take 8-bit images; use spline or emor");
    }
    const gonio_status status = gonio_opencv_response(options->method == GONIO_RESPONSE_ROBERTSON, n, images, channel,
                                                      exposure_s, found, error);
    double last = 0;
    for (int j = 0; status == GONIO_OK && j < CURVE_POINTS; j++) {
        const double v = fmin(j * 255.0 / (CURVE_POINTS - 1), 254.999999);
        const int k = (int)v;
        last = fmax(last, (found[k] + (found[k + 1] - found[k]) * (v - k)) / found[255]);
        curve->exposure[j] = j == 0 ? 0 : last;
    }
    return status;
}

// Root mean square of the weighted residuals in stops, whatever the method.
static double rms_stops(problem *q, const gonio_response_curve *curve) {
    double ln_exposure[CURVE_POINTS], tau[GONIO_RESPONSE_FRAMES], sum = 0, weights = 0;
    double *r = malloc((size_t)(q->pixels * q->frames) * sizeof *r);
    for (int j = 0; j < CURVE_POINTS; j++) {
        ln_exposure[j] = curve->exposure[j] > 0 ? log(curve->exposure[j]) : -14;
    }
    for (int j = 0; j < q->frames; j++) {
        tau[j] = log(curve->exposure_s[j]);
    }
    set_weights(q, ln_exposure);
    const int m = r != NULL ? data_residuals(q, ln_exposure, tau, r) : 0;
    for (int k = 0; k < m; k++) {
        sum += r[k] * r[k];
        const double w = q->weight[k / q->frames][k % q->frames];
        weights += isnan(q->value[k / q->frames][k % q->frames]) ? 0 : w * w;
    }
    free(r);
    return sqrt(sum / weights) / log(2);
}

// Median |ln E - tau - mean of the other used images' ln E - tau| of one image, over all pixels, edges too.
static double disagreement_of(const problem *q, const gonio_image *images, int channel, int j,
                              const double *ln_exposure, const gonio_response_curve *curve, double *scratch) {
    const size_t n = (size_t)images[0].width * (size_t)images[0].height, step = 1 + n / COMPARED;
    size_t m = 0;
    for (size_t p = 0; p < n; p += step) {
        const double v = relative_value(&images[j], channel, p);
        double sum = 0;
        int others = 0;
        for (int k = 0; k < q->frames && v >= q->low && v <= q->high; k++) {
            const double u = relative_value(&images[k], channel, p);
            if (k != j && !curve->rejected[k] && u >= q->low && u <= q->high) {
                sum += curve_at(ln_exposure, u) - log(curve->exposure_s[k]);
                others++;
            }
        }
        if (others > 0) {
            scratch[m++] = fabs(curve_at(ln_exposure, v) - log(curve->exposure_s[j]) - sum / others);
        }
    }
    return gonio_upper_median(scratch, m);
}

// Leave out the worst image, see how well the others then agree, and put it back unless it stands apart; so on.
static void find_disagreement(const problem *q, const gonio_image *images, int channel, double *scratch,
                              gonio_response_curve *curve) {
    double ln_exposure[CURVE_POINTS], others[GONIO_RESPONSE_FRAMES];
    for (int j = 0; j < CURVE_POINTS; j++) {
        ln_exposure[j] = curve->exposure[j] > 0 ? log(curve->exposure[j]) : -14;
    }
    for (int left = q->frames; left > 2; left--) {
        int worst = -1, n = 0;
        for (int j = 0; j < q->frames; j++) {
            curve->disagreement[j] = disagreement_of(q, images, channel, j, ln_exposure, curve, scratch);
            const bool above =
                !curve->rejected[j] && (worst < 0 || curve->disagreement[j] > curve->disagreement[worst]);
            worst = above ? j : worst;
        }
        if (worst < 0) {
            break;
        }
        curve->rejected[worst] = true;
        for (int j = 0; j < q->frames; j++) {
            if (!curve->rejected[j]) {
                others[n++] = disagreement_of(q, images, channel, j, ln_exposure, curve, scratch);
            }
        }
        if (curve->disagreement[worst] <= fmax(REJECT_FACTOR * gonio_upper_median(others, (size_t)n), REJECT_LN)) {
            curve->rejected[worst] = false;
            return;
        }
    }
}

static gonio_status check_images(int n, const gonio_image *images, int channel, const double *exposure_s,
                                 gonio_error *error) {
    if (n < 2 || n > GONIO_RESPONSE_FRAMES) {
        return gonio_fail(error, GONIO_E_INPUT, "%d images; 2 to %d are possible", n, GONIO_RESPONSE_FRAMES);
    }
    for (int j = 0; j < n; j++) {
        const gonio_image *a = &images[0], *b = &images[j];
        if (a->width != b->width || a->height != b->height || a->channels != b->channels || a->bits != b->bits) {
            return gonio_fail(error, GONIO_E_INPUT,
                              "image %d has %d x %d pixels, %d channels, %d bits; the first %d x %d, %d, %d", j + 1,
                              b->width, b->height, b->channels, b->bits, a->width, a->height, a->channels, a->bits);
        }
        if (!(exposure_s[j] > 0)) {
            return gonio_fail(error, GONIO_E_INPUT, "image %d: exposure of %g s", j + 1, exposure_s[j]);
        }
    }
    return channel >= 0 && channel < images[0].channels
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE, "channel %d of %d", channel, images[0].channels);
}

// What the readings cover, whatever the limits allowed.
static gonio_status find_cover(const problem *q, gonio_response_curve *curve, gonio_error *error) {
    double *values = malloc((size_t)q->pixels * (size_t)q->frames * sizeof *values);
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to sort %d readings", q->pixels * q->frames);
    }
    size_t n = 0;
    for (int i = 0; i < q->pixels; i++) {
        for (int j = 0; j < q->frames; j++) {
            if (!isnan(q->value[i][j])) {
                values[n++] = q->value[i][j];
            }
        }
    }
    gonio_sort(values, n); // 40 at least: choose_pixels
    const size_t low = n / 100, high = n - 1 - n / 100;
    curve->covered_low = values[low];
    curve->covered_high = values[high];
    for (size_t k = low + 1; k <= high; k++) {
        curve->covered_gap = fmax(curve->covered_gap, values[k] - values[k - 1]);
    }
    curve->pixels = q->pixels;
    free(values);
    return GONIO_OK;
}

// No monotone curve explains images whose readings are this far from it: photographs that move stay below a tenth.
#define RMS_STOPS_MAX 0.3

static gonio_status check_residuals(const gonio_response_curve *curve, gonio_error *error) {
    return curve->rms_stops <= RMS_STOPS_MAX
               ? GONIO_OK
               : gonio_fail(
                     error, GONIO_E_CONVERGENCE,
                     "residuals of %.2f stop rms, more than %g: no response explains these images; are the bits, "
                     "the exposure times and the order of the list right, and is the scene still?",
                     curve->rms_stops, RMS_STOPS_MAX);
}

static void find_ends(problem *q) {
    for (int j = 0; j < q->frames; j++) {
        q->ends[0] = q->exposure_s[j] < q->exposure_s[q->ends[0]] ? j : q->ends[0];
        q->ends[1] = q->exposure_s[j] > q->exposure_s[q->ends[1]] ? j : q->ends[1];
    }
}

gonio_status gonio_response_fit(int n, const gonio_image *images, int channel, const double *exposure_s,
                                const gonio_response_options *options, gonio_response_curve *curve,
                                gonio_error *error) {
    *curve = (gonio_response_curve){.low = options->low, .high = options->high, .frames = n};
    gonio_status status = check_images(n, images, channel, exposure_s, error);
    problem *q = calloc(1, sizeof *q);
    double *basis = NULL;
    if (status == GONIO_OK && q == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a response fit");
    }
    if (status != GONIO_OK) {
        goto done;
    }
    q->frames = n;
    q->exposure_s = exposure_s;
    q->times_sigma = n > 2 ? options->times_sigma : 0;
    q->low = options->low;
    q->high = options->high;
    q->family = (curve_family){.parameters = SPLINE_KNOTS, .low = fmax(options->low, 0.005)};
    memcpy(curve->exposure_s, exposure_s, (size_t)n * sizeof *exposure_s);
    find_ends(q);
    status = q->exposure_s[q->ends[0]] < q->exposure_s[q->ends[1]]
                 ? find_fog(q, images, channel, error)
                 : gonio_fail(error, GONIO_E_INPUT, "all images have one exposure; a response needs different ones");
    if (status == GONIO_OK) {
        status = choose_pixels(q, images, channel, error);
        status = status == GONIO_OK ? find_cover(q, curve, error) : status;
        curve->low = q->low;
        q->family.low = fmax(q->low, 0.005);
    }
    if (status == GONIO_OK && options->method == GONIO_RESPONSE_EMOR) {
        q->family.parameters = options->terms;
        status = options->terms < 1 || options->terms > 25
                     ? gonio_fail(error, GONIO_E_USAGE, "%d EMoR terms; 1 to 25 exist", options->terms)
                     : gonio_emor_read(options->emor_path, options->terms, &basis, &q->family.samples, error);
        q->family.basis = basis;
    }
    if (status == GONIO_OK) {
        const bool ours = options->method == GONIO_RESPONSE_EMOR || options->method == GONIO_RESPONSE_SPLINE;
        status = ours ? fit_family(q, curve, error) : fit_opencv(options, n, images, channel, exposure_s, curve, error);
    }
    if (status == GONIO_OK) {
        curve->rms_stops = rms_stops(q, curve);
        double *scratch = malloc((size_t)images[0].width * (size_t)images[0].height * sizeof *scratch);
        if (scratch == NULL) {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory to compare the images");
        } else {
            find_disagreement(q, images, channel, scratch, curve);
        }
        free(scratch);
        status = status == GONIO_OK ? check_residuals(curve, error) : status;
    }
done:
    free(basis);
    free(q);
    return status;
}

gonio_status gonio_response_write(const gonio_response_curve *curve, const char *path, gonio_error *error) {
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    gonio_number_write(stream, "# camera response; rests on data for relative values %.3f to %.3f\n",
                       curve->covered_low, curve->covered_high);
    fputs("relative exposure,relative value\n0,0\n", stream);
    double last = 0;
    for (int j = 1; j < CURVE_POINTS; j++) {
        if (curve->exposure[j] > last) { // a reader wants a rising curve
            last = curve->exposure[j];
            gonio_number_write(stream, "%.9g,%.9g\n", fmin(last, 1), (double)j / (CURVE_POINTS - 1));
        }
    }
    return gonio_output_commit(output, error);
}

void gonio_response_merge(int n, const gonio_image *images, int channel, const gonio_response_curve *curve,
                          float *radiance) {
    double ln_exposure[CURVE_POINTS];
    for (int j = 0; j < CURVE_POINTS; j++) {
        ln_exposure[j] = curve->exposure[j] > 0 ? log(curve->exposure[j]) : -14;
    }
    const size_t pixels = (size_t)images[0].width * (size_t)images[0].height;
    for (size_t p = 0; p < pixels; p++) {
        double sum = 0, weights = 0;
        for (int j = 0; j < n; j++) {
            const double v = relative_value(&images[j], channel, p), h = 0.01;
            if (v >= curve->low && v <= curve->high && !curve->rejected[j]) {
                const double slope = (curve_at(ln_exposure, v + h) - curve_at(ln_exposure, v - h)) / (2 * h);
                const double w = 1 / fmax(slope * slope, 0.01);
                sum += w * (curve_at(ln_exposure, v) - log(curve->exposure_s[j]));
                weights += w;
            }
        }
        radiance[p] = weights > 0 ? (float)exp(sum / weights) : NAN;
    }
}
