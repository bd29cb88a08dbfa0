// SPDX-License-Identifier: BSD-3-Clause
// Samples -> a sum of lobes of one formula: the data in units of order 1, the search, the model with its parameters'
// sigmas.
//
// The residuals' variance is theirs, 2 cost / (residuals - unknowns): a weight tells one sample from another, not how
// large the noise is. A model that cannot describe its data has sigmas that say so little.
#include "fit/analytic/fit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "brdf/kind/analytic.h"
#include "fit/analytic/problem.h"
#include "fit/prepare/dataset.h"

typedef struct job {
    gonio_analytic_layout layout;
    const gonio_dataset *data;
    gonio_lobe_geometry *geometry; // [data->n]
    double unit;                   // f_r = unit * y
    gonio_analytic_loss loss;
    bool weighted;
    int threads;
    bool together;                  // one search for all channels, else one each
    double *parameters, *sigmas;    // [lobes][channels][formula->n]
    gonio_analytic_detail *details; // of each search
} job;

// ---- the report's words ----

static void say(char *text, size_t size, const char *format, const char *name, double value, double sigma) {
    const size_t used = strlen(text);
    if (used + 1 < size) {
        snprintf(text + used, size - used, format, used > 0 ? " " : "", name, value, sigma);
    }
}

static void describe_shapes(const job *j, gonio_fit_report *report) {
    const gonio_analytic_layout *layout = &j->layout;
    const size_t c = (size_t)j->data->channels, n = (size_t)layout->plan->formula->n;
    for (int lobe = 0; lobe < layout->lobes; lobe++) {
        for (int v = 0; v < layout->own; v++) {
            const gonio_analytic_variable *variable = &layout->variables[v];
            if (variable->vary == GONIO_VARY_SIGN) {
                continue;
            }
            const size_t at = (size_t)lobe * c * n + (size_t)variable->first;
            const bool known = isfinite(j->sigmas[at]);
            say(report->options, sizeof report->options, known ? "%s%s=%.5g+-%.2g" : "%s%s=%.5g+-?", variable->name,
                j->parameters[at], j->sigmas[at]);
        }
    }
}

static void describe(const job *j, gonio_fit_report *report) {
    const gonio_analytic_layout *layout = &j->layout;
    const size_t c = (size_t)j->data->channels;
    say(report->options, sizeof report->options, "%sloss=%s", gonio_loss_names()[j->loss.loss], 0, 0);
    if (layout->plan->lobes_max > 1) {
        say(report->options, sizeof report->options, "%s%s=%.0f", "lobes", layout->lobes, 0);
    }
    double condition = 1;
    int stuck = 0, iterations = 0;
    const int searches = j->together ? 1 : (int)c;
    for (int s = 0; s < searches; s++) {
        condition = fmax(condition, j->details[s].condition);
        stuck += !j->details[s].converged;
        iterations = iterations > j->details[s].iterations ? iterations : j->details[s].iterations;
    }
    say(report->options, sizeof report->options, "%s%s=%.3g", "condition", condition, 0);
    if (layout->lobes > 1) {
        say(report->options, sizeof report->options, "%s%s=%.4g..%.4g", "starts", j->details[0].best,
            j->details[0].worst);
    }
    describe_shapes(j, report);
    const size_t used =
        (size_t)snprintf(report->note, sizeof report->note, "%s",
                         c == 1        ? ""
                         : j->together ? "shapes shared by the channels, strengths each channel's own"
                                       : "every channel has shapes of its own, printed are the first's");
    if (stuck > 0) {
        snprintf(report->note + used, sizeof report->note - used,
                 "%s%d of %d searches did not converge (%d iterations): take the parameters with care",
                 used > 0 ? "; " : "", stuck, searches, iterations);
    }
}

// ---- one search ----

// The parameters at the end of a search of the channels from `first` on.
static void store(const job *j, const gonio_analytic_problem *problem, const gonio_analytic_point *point, int first,
                  const double *variances, double noise) {
    const gonio_analytic_layout *layout = &j->layout;
    const gonio_formula *formula = layout->plan->formula;
    for (int lobe = 0; lobe < layout->lobes; lobe++) {
        for (int c = 0; c < problem->data->channels; c++) {
            const ptrdiff_t at = ((ptrdiff_t)lobe * j->data->channels + first + c) * formula->n;
            gonio_analytic_parameters_of(layout, point->shapes, lobe, j->parameters + at);
            for (int v = 0; v < layout->own; v++) {
                const gonio_analytic_variable *variable = &layout->variables[v];
                const int me = lobe * layout->own + v;
                double slope;
                gonio_analytic_value_of(variable, point->shapes[me], &slope);
                for (int k = variable->first; k <= variable->last; k++) {
                    j->sigmas[at + k] = isfinite(variances[me]) ? slope * sqrt(noise * variances[me]) : INFINITY;
                }
            }
        }
    }
    for (int c = 0; c < problem->data->channels; c++) {
        for (int k = 0; k < layout->strengths; k++) {
            const int me = layout->shapes + c * layout->strengths + k;
            const ptrdiff_t at = ((ptrdiff_t)layout->strength[k].lobe * j->data->channels + first + c) * formula->n +
                                 layout->strength[k].parameter;
            j->parameters[at] = point->strengths[c * layout->strengths + k] * j->unit;
            j->sigmas[at] = isfinite(variances[me]) ? sqrt(noise * variances[me]) * j->unit : INFINITY;
        }
    }
}

static gonio_status finish(const job *j, const gonio_analytic_problem *problem, const gonio_analytic_point *point,
                           int first, gonio_analytic_detail *detail, gonio_error *error) {
    gonio_arrow arrow;
    const size_t unknowns = (size_t)(j->layout.shapes + problem->data->channels * j->layout.strengths);
    double *variances = malloc(unknowns * sizeof *variances);
    gonio_status status = variances != NULL ? gonio_arrow_init(&arrow, problem, error)
                                            : gonio_fail(error, GONIO_E_MEMORY, "no memory for sigmas");
    if (status == GONIO_OK) {
        const double free_residuals = (double)problem->data->n * problem->data->channels - (double)unknowns;
        gonio_arrow_fill(&arrow, problem, point);
        for (int m = 0; m < j->layout.shapes; m++) {
            arrow.held[m] = j->layout.variables[m % j->layout.own].vary == GONIO_VARY_SIGN;
        }
        detail->condition = gonio_arrow_variances(&arrow, variances);
        const double noise = free_residuals > 0 ? 2 * point->cost / free_residuals : INFINITY;
        for (size_t k = 0; k < unknowns && !isfinite(noise); k++) {
            variances[k] = INFINITY;
        }
        store(j, problem, point, first, variances, noise);
        gonio_arrow_release(&arrow);
    }
    free(variances);
    return status;
}

static gonio_status search(const job *j, int first, int channels, int threads, gonio_analytic_detail *detail,
                           gonio_error *error) {
    const gonio_dataset *data = j->data;
    const size_t n = data->n;
    double *y = malloc((size_t)channels * n * sizeof *y), *weight = malloc(n * sizeof *weight);
    double *eps = malloc((size_t)channels * 2 * sizeof *eps), *highest = eps + channels;
    gonio_analytic_data d = {n, channels, j->loss, j->geometry, y, weight, eps, highest};
    const gonio_analytic_problem problem = {&j->layout, &d};
    gonio_analytic_point point;
    gonio_status status = y != NULL && weight != NULL && eps != NULL
                              ? gonio_analytic_point_init(&point, &problem, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory to fit lobes to %zu samples", n);
    if (status == GONIO_OK) {
        for (int c = 0; c < channels; c++) {
            const gonio_transform *t = &data->transforms[first + c];
            highest[c] = eps[c] = t->eps * (t->scale / j->unit);
            for (size_t i = 0; i < n; i++) {
                y[(size_t)c * n + i] = data->values[i * (size_t)data->channels + (size_t)(first + c)] / j->unit;
                highest[c] = fmax(highest[c], y[(size_t)c * n + i]);
            }
        }
        for (size_t i = 0; i < n; i++) {
            weight[i] = j->weighted ? data->weights[i] : 1;
        }
        gonio_analytic_end end = {0};
        status = gonio_analytic_search(&problem, &point, &end, threads, error);
        *detail = (gonio_analytic_detail){end.converged, end.iterations, end.starts, end.best, end.worst, INFINITY};
        if (status == GONIO_OK) {
            status = finish(j, &problem, &point, first, detail, error);
        }
        gonio_analytic_point_release(&point);
    }
    free(y);
    free(weight);
    free(eps);
    return status;
}

static gonio_status search_channel(void *context, size_t item, gonio_error *error) {
    const job *j = context;
    return search(j, (int)item, 1, 1, &j->details[item], error);
}

// ---- the whole ----

static gonio_status make_model(const job *j, const gonio_samples *samples, gonio_model **out, gonio_error *error) {
    const gonio_formula *formula = j->layout.plan->formula;
    gonio_analytic_term terms[GONIO_ANALYTIC_LOBES_MAX];
    for (int lobe = 0; lobe < j->layout.lobes; lobe++) {
        terms[lobe] = (gonio_analytic_term){formula, j->parameters + (ptrdiff_t)lobe * samples->channels * formula->n};
    }
    gonio_status status = gonio_analytic_new(terms, j->layout.lobes, samples->channels,
                                             (const char(*)[32])samples->channel_names, out, error);
    if (status == GONIO_OK && (status = gonio_analytic_set_sigmas(*out, j->sigmas, error)) != GONIO_OK) {
        gonio_model_free(*out);
        *out = NULL;
    }
    return status;
}

static gonio_status run(job *j, const gonio_samples *samples, gonio_model **out, gonio_fit_report *report,
                        gonio_error *error) {
    const gonio_dataset *data = j->data;
    const size_t c = (size_t)data->channels;
    const size_t count = (size_t)j->layout.lobes * c * (size_t)j->layout.plan->formula->n;
    j->geometry = malloc(data->n * sizeof *j->geometry);
    j->parameters = calloc(count, sizeof *j->parameters);
    j->sigmas = calloc(count, sizeof *j->sigmas);
    j->details = calloc(c, sizeof *j->details);
    gonio_status status = GONIO_OK;
    if (j->geometry == NULL || j->parameters == NULL || j->sigmas == NULL || j->details == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to fit lobes to %zu samples", data->n);
    }
    for (size_t i = 0; i < data->n && status == GONIO_OK; i++) {
        const gonio_pair *p = &data->pairs[i];
        j->geometry[i] =
            gonio_lobe_geometry_of(gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o));
    }
    if (status == GONIO_OK) {
        status = j->together ? search(j, 0, data->channels, j->threads, j->details, error)
                             : gonio_pool_try(j->threads, c, search_channel, j, error);
    }
    if (status == GONIO_OK) {
        status = make_model(j, samples, out, error);
        describe(j, report);
    }
    free(j->geometry);
    free(j->parameters);
    free(j->sigmas);
    return status;
}

// As many lobes as asked for; left open, as many as the method has and the geometries decide.
static gonio_status layout_for(gonio_analytic_layout *layout, const gonio_analytic_plan *plan, bool isotropic,
                               const gonio_fit_options *options, size_t n, const char *name, gonio_error *error) {
    const bool open = options->lobes == GONIO_LOBES_AUTO;
    int lobes = open ? plan->lobes : options->lobes;
    if (lobes > plan->lobes_max) {
        return gonio_fail(error, GONIO_E_USAGE, "--lobes %d; method '%s' has at most %d", lobes, name, plan->lobes_max);
    }
    gonio_analytic_layout_init(layout, plan, isotropic, lobes);
    while (open && lobes > 1 && n < 2 * (size_t)(layout->shapes + layout->strengths)) {
        gonio_analytic_layout_init(layout, plan, isotropic, --lobes);
    }
    const size_t unknowns = (size_t)(layout->shapes + layout->strengths);
    return n >= unknowns
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_INPUT, "%zu geometries; the %zu parameters of '%s' need at least %zu", n,
                            unknowns, name, unknowns);
}

static double unit_of(const gonio_dataset *data) {
    double unit = 0;
    for (int c = 0; c < data->channels; c++) {
        unit = fmax(unit, data->transforms[c].scale);
    }
    return unit;
}

gonio_status gonio_analytic_fit_detail(const gonio_analytic_plan *plan, const gonio_samples *samples,
                                       const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                                       gonio_analytic_detail *detail, gonio_error *error) {
    *out = NULL;
    const char *name = options->method != NULL ? options->method : plan->formula->name;
    if (!samples->isotropic && plan->anisotropic == NULL) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "'%s' describes isotropic materials only, and these samples are not declared to be of one",
                          name);
    }
    gonio_dataset data;
    gonio_status status = gonio_dataset_init(
        &data, samples, &(gonio_dataset_options){.mirror = samples->isotropic, .domain = GONIO_LOG}, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_loss loss = options->loss != GONIO_LOSS_AUTO ? options->loss
                            : options->thesis                ? GONIO_LOSS_LINEAR
                                                             : GONIO_LOSS_LOG;
    job j = {.data = &data,
             .unit = plan->formula->absolute ? 1 : unit_of(&data),
             .loss = {loss, data.kind == GONIO_TRANSFORM_ASINH},
             .weighted = !options->thesis,
             .threads = options->threads,
             .together = options->shapes != GONIO_SHAPES_CHANNEL || samples->channels == 1};
    status = layout_for(&j.layout, plan, samples->isotropic, options, data.n, name, error);
    status = status == GONIO_OK ? run(&j, samples, out, report, error) : status;
    if (status == GONIO_OK && detail != NULL) {
        *detail = j.details[0];
    }
    free(j.details);
    report->coordinates = GONIO_HALF_VECTOR;
    report->domain = loss == GONIO_LOSS_LOG ? GONIO_LOG : GONIO_LINEAR;
    gonio_dataset_release(&data);
    return status;
}

gonio_status gonio_analytic_fit(const gonio_analytic_plan *plan, const gonio_samples *samples,
                                const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                                gonio_error *error) {
    return gonio_analytic_fit_detail(plan, samples, options, out, report, NULL, error);
}

// ---- what the methods share ----

// The data set and its sorting, the geometry, two points of the search with five lobes' units, a part of the data.
double gonio_analytic_memory(const gonio_fit_size *size, double n) {
    const double channels = size->channels, samples = 160 + 8 * 3 * channels;
    const double units = 2 * 8 * (1 + GONIO_ANALYTIC_OWN_MAX) * (GONIO_ANALYTIC_STRENGTHS_MAX + 1);
    return 1e6 + n * (samples + sizeof(gonio_lobe_geometry) * 2 + units + 8 * channels + 64);
}

#define COMMON                                                                                                         \
    GONIO_METHOD_OPTION(thesis, "plain residuals of f_r, no weights"), GONIO_METHOD_OPTION(loss, "log"),               \
        GONIO_METHOD_OPTION(shapes, "shared")

const gonio_method_option gonio_analytic_options[] = {COMMON, {0}};
const gonio_method_option gonio_analytic_lobe_options[] = {COMMON, GONIO_METHOD_OPTION(lobes, NULL), {0}};
const gonio_method_form gonio_analytic_form = GONIO_METHOD_FORM_AUTO;
