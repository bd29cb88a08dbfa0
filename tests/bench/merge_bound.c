// SPDX-License-Identifier: BSD-3-Clause
// Variance of the merge over the Cramer-Rao bound (exact, Poisson + Gaussian + rounding) and its bias, over five
// decades of radiance above SNR 1, beside the classical hat-weight merge of the observed values (Debevec and Malik
// 1997, linear form). As many pixels a point as bring the mean's standard error to 0.03 %.
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "tests/pixel.h"

#define TRIALS_MAX 12000000

static double hat_merge(const pixel_camera *c, int n, const merge_term *terms) {
    double sum = 0, weights = 0;
    for (int j = 0; j < n; j++) {
        const double z = terms[j].signal / (c->full_dn - c->bias_dn), w = terms[j].clipped ? 0 : fmin(z, 1 - z);
        sum += fmax(w, 0) * terms[j].signal / terms[j].scale;
        weights += fmax(w, 0);
    }
    return weights > 0 ? sum / weights : 0;
}

typedef struct moments {
    double sum, squares;
} moments;

static void add(moments *m, double x) {
    m->sum += x;
    m->squares += x * x;
}

static double variance_of(const moments *m, double trials) {
    return m->squares / trials - m->sum / trials * (m->sum / trials);
}

// Worst of the merge's figures so far.
typedef struct worst {
    double ratio, bias, error;
} worst;

static void measure(const pixel_camera *camera, const merge_noise *noise, double rate, double snr, double bound,
                    worst *w) {
    const double wanted = 1 / (snr * snr * 3e-4 * 3e-4);
    const int trials = (int)fmin(fmax(wanted, 100000), TRIALS_MAX);
    uint64_t random = (uint64_t)(rate * 1e9);
    moments merged = {0}, hat = {0};
    for (int i = 0; i < trials; i++) {
        merge_term terms[PIXEL_EXPOSURES];
        merge_result r;
        for (int j = 0; j < camera->n; j++) {
            terms[j] = pixel_expose(camera, &random, rate, camera->exposure_s[j]);
        }
        gonio_merge_pixel(noise, camera->n, terms, &r);
        add(&merged, r.value / rate - 1);
        add(&hat, hat_merge(camera, camera->n, terms) / rate - 1);
    }
    const double v = variance_of(&merged, trials), h = variance_of(&hat, trials), b = bound / (rate * rate);
    const double bias = merged.sum / trials, error = sqrt(v / trials);
    printf("%11.4g %10.1f %12.4f %+9.4f +- %.4f %12.3f %+9.3f %10d\n", rate, snr, v / b, 100 * bias, 100 * error, h / b,
           100 * hat.sum / trials, trials);
    w->ratio = fmax(w->ratio, v / b);
    w->bias = fmax(w->bias, fabs(bias));
    w->error = fmax(w->error, error);
}

// Near a ceiling the choice itself is random, so only the bias is judged.
static void merge_bias_at(const pixel_camera *camera, const merge_noise *noise, double rate, double snr, worst *w) {
    worst here = {0};
    measure(camera, noise, rate, snr, rate * rate / (snr * snr), &here);
    w->bias = fmax(w->bias, here.bias);
    w->error = fmax(w->error, here.error);
}

int main(int argc, char **argv) {
    const double step = argc > 1 ? atof(argv[1]) : 3.1622776;
    const pixel_camera camera = pixel_camera_make(2.5, 2, 9);
    const merge_noise noise = pixel_noise(&camera);
    worst w = {0};
    printf("12 bit, 2.5 e-/DN, read noise 2 DN, 9 exposures 4 x apart, chosen by the predicted value\n");
    printf("%11s %10s %12s %20s %12s %10s %10s\n", "DN/s", "SNR", "var/bound", "bias %", "hat: var/b", "bias %",
           "pixels");
    double lowest = 0;
    for (double rate = 1e-5; rate < 1e4 && (lowest == 0 || rate <= 1.05e5 * lowest);
         rate *= lowest == 0 ? 1.02 : step) {
        double information = 0;
        for (int j = 0; j < camera.n; j++) {
            const bool usable = rate * camera.exposure_s[j] <= noise.ceiling;
            information += usable ? pixel_fisher(&camera, rate, camera.exposure_s[j]) : 0;
        }
        const double snr = rate * sqrt(information);
        if (snr >= 1 && lowest == 0) {
            lowest = rate;
        }
        if (lowest > 0) {
            measure(&camera, &noise, rate, snr, 1 / information, &w);
        }
    }
    // Where an exposure is just given up: choosing by noisy values would bias here most.
    for (int k = 0; k < 6; k++) {
        const double rate = noise.ceiling / camera.exposure_s[4] * (0.97 + 0.012 * k);
        double information = 0;
        for (int j = 0; j < camera.n; j++) {
            const bool usable = rate * camera.exposure_s[j] <= noise.ceiling;
            information += usable ? pixel_fisher(&camera, rate, camera.exposure_s[j]) : 0;
        }
        merge_bias_at(&camera, &noise, rate, rate * sqrt(information), &w);
    }
    printf("worst: variance %.3f x bound (asked: <= 1.1), bias %.3f %% (<= 0.1), standard error %.3f %% (<= 0.03)\n",
           w.ratio, 100 * w.bias, 100 * w.error);
    return 0;
}
