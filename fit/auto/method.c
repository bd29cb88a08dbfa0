// SPDX-License-Identifier: BSD-3-Clause
// Methods "auto" and "lsq": least-squares splines, with or without a lobe under them.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/auto/choose.h"
#include "fit/auto/iterative.h"
#include "fit/auto/tuning.h"
#include "fit/memory.h"
#include "fit/prior/extend.h"
#include "fit/prior/report.h"
#include "fit/sigma/sigma.h"

static bool mirrored(const gonio_samples *samples, const gonio_fit_options *options) {
    return options->symmetry == GONIO_SYMMETRY_AUTO ? samples->isotropic
                                                    : (options->symmetry & GONIO_SYMMETRY_MIRROR) != 0;
}

// Forced reciprocity outside half-vector coordinates: swapped copies of the samples.
static bool needs_swapped(const gonio_fit_options *options) {
    return options->symmetry != GONIO_SYMMETRY_AUTO && (options->symmetry & GONIO_SYMMETRY_RECIPROCITY) != 0;
}

static gonio_status fit_small(gonio_dataset *data, gonio_prior *prior, const gonio_samples *samples,
                              gonio_deadline *watch, bool lobes, gonio_model **out, gonio_fit_report *report,
                              gonio_error *error) {
    gonio_auto_choice choice;
    gonio_deadline_step(watch, 0.7); // the rest is for the solution and its uncertainty
    gonio_status status = lobes ? gonio_prior_extend(prior, data, error) : GONIO_OK;
    status = status == GONIO_OK ? gonio_auto_choose(data, watch, lobes, true, &choice, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_auto_trial *chosen = &choice.trials[choice.chosen];
    gonio_lobe_spline_parts parts = {0};
    const gonio_smooth_base *base = &choice.bases[chosen->base];
    status = gonio_smooth_dense_parts(choice.dense, data, base, choice.lambdas, &parts, error);
    status =
        status == GONIO_OK ? gonio_sigma_dense(choice.dense, data, base, choice.lambdas, prior, &parts, error) : status;
    if (status == GONIO_OK) {
        parts.channel_names = (const char(*)[32])samples->channel_names;
        status = gonio_lobe_spline_new(&parts, out, error);
    }
    gonio_lobe_spline_parts_release(&parts);
    if (status == GONIO_OK) {
        report->level = chosen->form.level;
        report->coordinates = chosen->form.coordinates;
        report->channels = samples->channels;
        gonio_auto_describe(&choice, watch->options, report);
    }
    gonio_auto_choice_release(&choice);
    return status;
}

// Without lobes: no base, and the grazing factors (NULL: none are allowed).
static int bare_candidates(const gonio_smooth_form *form, const gonio_lobe_base *grazing,
                           gonio_smooth_candidate *candidates) {
    int n = 0;
    candidates[n++] = (gonio_smooth_candidate){*form, NULL, 0};
    for (int k = 0; k < GONIO_SMOOTH_GRAZING && grazing != NULL; k++) {
        candidates[n++] = (gonio_smooth_candidate){*form, &grazing[k], 0};
    }
    return n;
}

// The best trial of each coordinates (one of the half-vector ones), with its base and without: a small part of a set
// does not always tell which suits all of it.
static int large_candidates(const gonio_auto_choice *choice, const gonio_lobe_base *grazing,
                            gonio_smooth_candidate *candidates) {
    const gonio_auto_trial *t = choice->trials;
    int n = 0;
    for (gonio_coordinates c = 0; c < GONIO_COORDINATES; c++) {
        int best = -1;
        for (int k = 0; k < choice->trials_n; k++) {
            if (gonio_coordinates_base(t[k].form.coordinates) == c &&
                (best < 0 || t[k].score.score < t[best].score.score)) {
                best = k;
            }
        }
        if (best >= 0) {
            const gonio_lobe_base *lobes = &choice->bases[t[best].base].lobes;
            n += bare_candidates(&t[best].form, grazing, candidates + n);
            if (lobes->lobes > 0) {
                candidates[n++] = (gonio_smooth_candidate){t[best].form, lobes, 0};
            }
        }
    }
    return n;
}

static const char *lobes_name(const gonio_lobe_base *lobes) {
    return lobes == NULL ? "none" : gonio_lobe_base_name(lobes);
}

// The best of the trials that are cheaper, or simply better, than what was chosen.
static void describe_neighbour(const gonio_iterative_choice *choice, const gonio_dataset *data, bool cheaper,
                               gonio_fit_report *report) {
    const gonio_iterative_trial *best = NULL;
    for (int t = 0; t < choice->trials_n; t++) {
        const gonio_iterative_trial *trial = &choice->trials[t];
        const bool candidate =
            cheaper ? trial->form.level < choice->form.level : trial->score.score < choice->score.score;
        if (candidate && (best == NULL || trial->score.score < best->score.score)) {
            best = trial;
        }
    }
    const size_t used = strlen(report->note), size = sizeof report->note - used;
    const char *label = cheaper ? "next cheaper" : "next better";
    if (best == NULL) {
        snprintf(report->note + used, size, "; %s: none was found", label);
        return;
    }
    const double unit = data->kind == GONIO_TRANSFORM_LINEAR ? 1.5 : 2.25;
    const size_t bytes = gonio_lattice_count(data->dims, best->form.level) * (size_t)data->channels * sizeof(float);
    snprintf(report->note + used, size, "; %s: %s level %d base %s (error %+.0f %%, %zu kB)", label,
             gonio_coordinates_name(best->form.coordinates), best->form.level, lobes_name(best->lobes),
             100 * (exp((best->score.score - choice->score.score) / unit) - 1), (bytes + 512) / 1024);
}

static void describe_large(const gonio_iterative_choice *choice, const gonio_dataset *data, double max_error,
                           gonio_fit_report *report) {
    const char *base = lobes_name(choice->lobes);
    report->level = choice->form.level;
    report->coordinates = choice->form.coordinates;
    char grazing[32] = "";
    if (choice->lobes != NULL && choice->lobes->grazing > 0) {
        snprintf(grazing, sizeof grazing, " grazing=%.2g", (double)choice->lobes->grazing);
    }
    const double *stretch = choice->form.stretch;
    snprintf(report->options, sizeof report->options,
             "base=%s%s lambda=%.2g stiffness=%g:%g:%g iterations=%d gradient=%.1e", base, grazing, choice->lambda,
             stretch[0], stretch[1], stretch[2], choice->iterations, choice->gradient);
    char cost[48] = "";
    if (choice->ns > 0) {
        snprintf(cost, sizeof cost, "; an evaluation takes %.0f ns", choice->ns);
    }
    snprintf(report->note, sizeof report->note,
             "chosen on a fifth of %zu geometries held out; error %.1f %% of the multilevel start's%s%s", data->n,
             100 * exp((choice->score.score - choice->start_score.score) /
                       (data->kind == GONIO_TRANSFORM_LINEAR ? 1.5 : 2.25)),
             choice->start_only ? ", so that is the answer" : "", cost);
    if (max_error > 0) {
        const size_t used = strlen(report->note);
        snprintf(report->note + used, sizeof report->note - used, "; held-out rmse %.3g%s", choice->score.rmse,
                 choice->score.rmse > max_error ? ", above the limit: nothing better was found" : "");
    }
    describe_neighbour(choice, data, false, report);
    describe_neighbour(choice, data, true, report);
}

static gonio_status choose_on_part(const gonio_dataset *data, const gonio_deadline *watch, bool lobes,
                                   gonio_auto_choice *choice, gonio_error *error) {
    gonio_fit_options part = *watch->options;
    gonio_deadline own = *watch;
    own.options = &part;
    gonio_deadline_step(&own, 0.25);
    part.level = GONIO_LEVEL_AUTO;
    part.lambda = -1;
    gonio_dataset thin;
    gonio_status status = gonio_dataset_thin(data, gonio_auto_tuned.part, part.seed, &thin, error);
    if (status == GONIO_OK) {
        status = gonio_auto_choose(&thin, &own, lobes, false, choice, error);
        gonio_dataset_release(&thin);
    }
    return status;
}

// The best trial in other coordinates than the chosen ones; NULL where none is close.
static const gonio_iterative_trial *second_best(const gonio_iterative_choice *choice) {
    const gonio_iterative_trial *best = NULL;
    for (int t = 0; t < choice->trials_n; t++) {
        const gonio_iterative_trial *trial = &choice->trials[t];
        if (trial->form.coordinates != choice->form.coordinates &&
            trial->score.score < choice->score.score + 2 * gonio_auto_tuned.close &&
            (best == NULL || trial->score.score < best->score.score)) {
            best = trial;
        }
    }
    return best;
}

static gonio_status keep_best(const gonio_dataset *data, gonio_deadline *watch, gonio_smooth_candidate *candidates,
                              int *n, gonio_error *error) {
    gonio_dataset part;
    gonio_status status = gonio_dataset_thin(data, gonio_auto_tuned.compared, watch->options->seed, &part, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_iterative_choice choice;
    gonio_deadline_step(watch, 0.4);
    status = gonio_iterative_choose(&part, watch, candidates, *n, true, &choice, error);
    if (status == GONIO_OK) {
        const gonio_iterative_trial *second = second_best(&choice);
        candidates[0] = (gonio_smooth_candidate){choice.form, choice.lobes, choice.lambda};
        if (second != NULL) {
            candidates[1] = (gonio_smooth_candidate){second->form, second->lobes, second->lambda};
        }
        *n = second != NULL ? 2 : 1;
    }
    gonio_dataset_release(&part);
    return status;
}

static gonio_status fit_large(gonio_dataset *data, gonio_prior *prior, const gonio_samples *samples,
                              gonio_deadline *watch, bool lobes, gonio_model **out, gonio_fit_report *report,
                              gonio_error *error) {
    const gonio_fit_options *options = watch->options;
    gonio_auto_choice small = {0};
    gonio_iterative_choice choice = {0};
    gonio_smooth_candidate candidates[GONIO_SMOOTH_CANDIDATES];
    gonio_lobe_base bases[GONIO_SMOOTH_GRAZING];
    gonio_smooth_grazing_bases(data, bases);
    const gonio_lobe_base *grazing = data->kind == GONIO_TRANSFORM_POSITIVE ? bases : NULL;
    const bool open = options->coordinates == GONIO_COORDINATES_AUTO;
    const gonio_smooth_form form =
        gonio_smooth_form_default(open ? GONIO_NUSSELT : options->coordinates, 0, data->mirror);
    int n = bare_candidates(&form, grazing, candidates);
    gonio_status status = lobes ? gonio_prior_extend(prior, data, error) : GONIO_OK;
    if (status == GONIO_OK && (lobes || open)) {
        status = choose_on_part(data, watch, lobes, &small, error);
        n = status == GONIO_OK ? large_candidates(&small, grazing, candidates) : 0;
    }
    if (status == GONIO_OK && n > 1 && data->n > 2 * gonio_auto_tuned.compared) {
        status = keep_best(data, watch, candidates, &n, error);
    }
    if (status == GONIO_OK) {
        gonio_deadline_step(watch, 0.6);
        status = gonio_iterative_choose(data, watch, candidates, n, false, &choice, error);
    }
    gonio_lobe_spline_parts parts = {0};
    if (status == GONIO_OK) {
        gonio_deadline_step(watch, 0.85);
        status = gonio_iterative_parts(data, watch, &choice, &parts, error);
    }
    if (status == GONIO_OK) {
        gonio_deadline_step(watch, 0.97);
        status = gonio_sigma_large(&choice, data, watch, prior, &parts, error);
    }
    if (status == GONIO_OK) {
        parts.channel_names = (const char(*)[32])samples->channel_names;
        status = gonio_lobe_spline_new(&parts, out, error);
        describe_large(&choice, data, options->max_error, report);
    }
    gonio_lobe_spline_parts_release(&parts);
    gonio_auto_choice_release(&small);
    return status;
}

// The direct solver's reach: number of samples, and the levels that it builds in seconds.
static bool is_small(const gonio_dataset *data, const gonio_fit_options *options) {
    const int finest = data->dims == 3 ? GONIO_SMOOTH_DENSE_LEVEL_MAX_3D : GONIO_SMOOTH_DENSE_LEVEL_MAX_4D;
    return data->n <= GONIO_SMOOTH_DENSE_MAX && options->level <= finest && options->iterations == 0;
}

static gonio_status fit_any(const gonio_samples *samples, const gonio_fit_options *options, bool lobes,
                            gonio_model **out, gonio_fit_report *report, gonio_error *error) {
    *out = NULL;
    const gonio_dataset_options how = {.mirror = mirrored(samples, options),
                                       .domain = options->domain != GONIO_DOMAIN_AUTO ? options->domain : GONIO_LOG,
                                       .reciprocal = needs_swapped(options)};
    gonio_deadline watch = gonio_deadline_begin(options);
    gonio_dataset data;
    gonio_status status = gonio_dataset_init(&data, samples, &how, error);
    if (status != GONIO_OK) {
        return status;
    }
    report->domain = data.kind == GONIO_TRANSFORM_LINEAR ? GONIO_LINEAR : GONIO_LOG;
    gonio_prior prior = {0};
    status = gonio_prior_init(&prior, &data, error);
    if (status == GONIO_OK) {
        status = (is_small(&data, options) ? fit_small : fit_large)(&data, &prior, samples, &watch, lobes, out, report,
                                                                    error);
    }
    if (status == GONIO_OK) {
        gonio_prior_report(&prior, *out, report);
    }
    gonio_prior_release(&prior);
    gonio_dataset_release(&data);
    return status;
}

static gonio_status fit_auto(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                             gonio_fit_report *report, gonio_error *error) {
    return fit_any(samples, options, true, out, report, error);
}

static gonio_status fit_lsq(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                            gonio_fit_report *report, gonio_error *error) {
    return fit_any(samples, options, false, out, report, error);
}

// ---- registration ----

static const gonio_method_option least_squares_options[] = {
    GONIO_METHOD_OPTION(level, NULL),       GONIO_METHOD_OPTION(tolerance, NULL),
    GONIO_METHOD_OPTION(coordinates, NULL), GONIO_METHOD_OPTION(domain, "log"),
    GONIO_METHOD_OPTION(symmetry, NULL),    GONIO_METHOD_OPTION(lambda, NULL),
    GONIO_METHOD_OPTION(iterations, NULL),  GONIO_METHOD_OPTION(max_error, NULL),
    GONIO_METHOD_OPTION(max_bytes, NULL),   GONIO_METHOD_OPTION(max_ns, NULL),
    GONIO_METHOD_OPTION(max_seconds, NULL), {0}};

static const gonio_method_form auto_forms[] = {GONIO_METHOD_FORM_AUTO};
static const gonio_method_form lsq_forms[] = {{GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_NUSSELT, GONIO_LINEAR, NULL},
                                              {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_NUSSELT, GONIO_LOG, NULL},
                                              {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_HALF_VECTOR, GONIO_LOG, NULL},
                                              GONIO_METHOD_FORM_AUTO};

const gonio_method gonio_method_auto = {
    .name = "auto",
    .summary = "lobes and a least-squares spline of the ratio to them, all chosen from the training data",
    .kind = "lobe-spline",
    .options = least_squares_options,
    .fit = fit_auto,
    .memory = gonio_lattice_fit_memory,
    .forms = auto_forms,
    .forms_n = sizeof auto_forms / sizeof *auto_forms,
};

const gonio_method gonio_method_lsq = {
    .name = "lsq",
    .summary = "least-squares B-spline with a second-difference penalty",
    .kind = "lobe-spline",
    .options = least_squares_options,
    .fit = fit_lsq,
    .memory = gonio_lattice_fit_memory,
    .forms = lsq_forms,
    .forms_n = sizeof lsq_forms / sizeof *lsq_forms,
};
