// SPDX-License-Identifier: BSD-3-Clause
// Scattered samples with a Gaussian kernel, DeYoung (1996), section 3.2.1; brdf/kind/kernel.c. Which distance and how
// many neighbours he leaves open ("sufficiently large"): what predicts each sample from the others best decides, by the
// root mean square of transformed values. In large sets some thousands of samples are asked.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/thread_pool.h"
#include "brdf/kind/kernel.h"
#include "fit/method.h"
#include "fit/prepare/dataset.h"

#define ASKED 4096 // samples that judge
static const int numbers[] = {1, 2, 3, 4, 6, 8, 12, 16, GONIO_NEAREST_MAX};
#define NUMBERS (sizeof numbers / sizeof *numbers)

typedef struct trial {
    const gonio_model *model;
    size_t step;
    double misses[ASKED][NUMBERS];
} trial;

static void ask(void *context, size_t item) {
    trial *t = context;
    gonio_kernel_model_leave_one_out(t->model, item * t->step, (int)NUMBERS, numbers, t->misses[item]);
}

// The number of neighbours, or the one that was asked for, and what it misses.
static gonio_status judge(const gonio_model *model, size_t n, const gonio_fit_options *options, int *neighbours,
                          double *miss, gonio_error *error) {
    trial *t = malloc(sizeof *t);
    if (t == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to choose neighbours");
    }
    t->model = model;
    t->step = (n + ASKED - 1) / ASKED;
    const size_t asked = n > 1 ? (n + t->step - 1) / t->step : 0;
    gonio_pool_for(options->threads, asked, ask, t);
    *miss = INFINITY;
    *neighbours = 1;
    for (size_t k = 0; k < NUMBERS && asked > 0; k++) {
        double sum = 0;
        for (size_t i = 0; i < asked; i++) {
            sum += t->misses[i][k];
        }
        const double rms = sqrt(sum / (double)asked / model->channels);
        if (rms < *miss * (1 - 1e-9)) {
            *miss = rms;
            *neighbours = numbers[k];
        }
    }
    *neighbours = options->neighbours != GONIO_NEIGHBOURS_AUTO ? options->neighbours : *neighbours;
    free(t);
    return GONIO_OK;
}

static gonio_status choose(gonio_kernel_parts *parts, const gonio_fit_options *options, gonio_model **out,
                           gonio_fit_report *report, gonio_error *error) {
    double least = INFINITY;
    gonio_status status = GONIO_OK;
    for (int d = 0; d < GONIO_DISTANCES && status == GONIO_OK; d++) {
        if (options->distance != GONIO_DISTANCE_AUTO && options->distance != d) {
            continue;
        }
        gonio_model *model;
        int neighbours = 1;
        double miss = INFINITY;
        parts->distance = (gonio_distance)d;
        parts->neighbours = 1;
        status = gonio_kernel_model_new(parts, &model, error);
        status = status == GONIO_OK ? judge(model, parts->n, options, &neighbours, &miss, error) : status;
        if (status == GONIO_OK && (*out == NULL || miss < least * (1 - 1e-9))) {
            gonio_model_free(*out);
            *out = model;
            least = miss;
            gonio_kernel_model_set_neighbours(model, neighbours);
            snprintf(report->options, sizeof report->options, "%s j=%d", gonio_distance_names()[d], neighbours);
        } else {
            gonio_model_free(model);
        }
    }
    if (status != GONIO_OK) {
        gonio_model_free(*out);
        *out = NULL;
    }
    return status;
}

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    const gonio_dataset_options how = {.mirror = samples->isotropic,
                                       .domain = options->domain != GONIO_DOMAIN_AUTO ? options->domain : GONIO_LOG};
    gonio_dataset data;
    *out = NULL;
    gonio_status status = gonio_dataset_init(&data, samples, &how, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_kernel_parts parts = {.n = data.n,
                                .pairs = data.pairs,
                                .values = data.targets,
                                .isotropic = samples->isotropic,
                                .channels = data.channels,
                                .kind = data.kind,
                                .transforms = data.transforms,
                                .names = (const char(*)[32])samples->channel_names};
    status = choose(&parts, options, out, report, error);
    report->coordinates = GONIO_NUSSELT;
    report->domain = data.kind == GONIO_TRANSFORM_LINEAR ? GONIO_LINEAR : GONIO_LOG;
    snprintf(report->note, sizeof report->note, "j and distance by leave-one-out");
    gonio_dataset_release(&data);
    return status;
}

static double memory(const gonio_fit_size *size, double n) {
    return 1e6 + ASKED * NUMBERS * sizeof(double) +
           n * (64 + 8 * 3.0 * size->channels + 2 * (24 + 4.0 * size->channels));
}

static const gonio_method_option options_of_kernel[] = {GONIO_METHOD_OPTION(domain, "log"),
                                                        GONIO_METHOD_OPTION(neighbours, NULL),
                                                        GONIO_METHOD_OPTION(distance, NULL),
                                                        {0}};

static const gonio_method_form forms[] = {GONIO_METHOD_FORM_AUTO};

const gonio_method gonio_method_kernel = {
    .name = "kernel",
    .summary = "a Gaussian mean of the nearest samples",
    .kind = "kernel",
    .options = options_of_kernel,
    .fit = fit,
    .memory = memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
