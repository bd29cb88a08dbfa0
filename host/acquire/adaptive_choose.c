// SPDX-License-Identifier: BSD-3-Clause
// The next batch of an adaptive plan.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "fit/design/design.h"
#include "gonio/library.h"
#include "gonio/needs.h"
#include "host/acquire/adaptive.h"

#define FIRST_SHARE 6 // of the poses: one part is the first batch, within
#define FIRST_MIN 24
#define FIRST_MAX 64
#define BATCH_SHARE 4 // of the poses so far: one part is the next batch. Fits grow with the samples, and so do batches
#define BATCH_MIN 16
#define MIRROR_FIRST 3      // of the first batch every third fill pose lies about the mirror direction,
#define MIRROR_LATER 6      // later every sixth
#define TRIES_MAX 2         // of a pose that gives no sample
#define SURPRISE_BEYOND 2   // sigmas
#define SURPRISE_SHARE 0.25 // of the excess variance: the fit has learnt the rest from the sample itself
#define TINY 1e-3           // of the figures
#define POSES_APART 65536   // seeds have mirror poses of their own

const char *const gonio_adaptive_whys[] = {"fill", "mirror", "sigma", "again", "prior"};

void gonio_adaptive_release(gonio_adaptive *a) {
    free(a->poses);
    gonio_samples_free(a->samples);
    a->poses = NULL;
    a->samples = NULL;
}

static size_t count_why(const gonio_adaptive *a, gonio_adaptive_why why) {
    size_t n = 0;
    for (size_t i = 0; i < a->n; i++) {
        n += a->poses[i].why == why;
    }
    return n;
}

static gonio_status append(gonio_adaptive *a, const gonio_adaptive_pose *pose, gonio_error *error) {
    gonio_adaptive_pose *larger = realloc(a->poses, (a->n + 1) * sizeof *larger);
    if (larger == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a plan of %zu poses", a->n + 1);
    }
    a->poses = larger;
    a->poses[a->n] = *pose;
    a->poses[a->n++].batch = a->batches;
    return GONIO_OK;
}

static gonio_adaptive_pose plain(gonio_adaptive_why why, gonio_pair pose) {
    gonio_adaptive_pose p = {.why = why, .pose = pose, .sigma = NAN, .gain = NAN, .seconds = NAN, .sample = -1};
    for (int c = 0; c < GONIO_ADAPTIVE_CHANNELS; c++) {
        p.predicted[c] = p.uncertainty[c] = NAN;
    }
    return p;
}

// The next poses that fill the space: of the nusselt plan, which is evenly spread however far one goes, and some about
// the mirror direction.
static gonio_status add_fill(gonio_adaptive *a, size_t n, gonio_error *error) {
    char text[128];
    gonio_plan *plan;
    snprintf(text, sizeof text, "nusselt:%zu,theta_max=%.17g,anisotropic=%d", a->plan.poses, a->plan.theta_max_deg,
             a->plan.anisotropic);
    gonio_status status = gonio_plan_make(text, a->seed, &plan, error);
    size_t spread = status == GONIO_OK ? count_why(a, GONIO_ADAPTIVE_FILL) : 0;
    size_t mirror = status == GONIO_OK ? count_why(a, GONIO_ADAPTIVE_MIRROR) : 0;
    for (size_t k = 0; k < n && status == GONIO_OK; k++) {
        const size_t every = a->batches == 0 ? MIRROR_FIRST : MIRROR_LATER;
        const bool about = (spread + mirror) % every == every - 1;
        const gonio_pair pose =
            about ? gonio_design_mirror_place(gonio_random(a->seed) % 65536 * POSES_APART + mirror,
                                              !a->plan.anisotropic, gonio_radians(a->plan.theta_max_deg))
                  : plan->poses[spread];
        const gonio_adaptive_pose p = plain(about ? GONIO_ADAPTIVE_MIRROR : GONIO_ADAPTIVE_FILL, pose);
        status = append(a, &p, error);
        mirror += about;
        spread += !about;
    }
    gonio_plan_free(plan);
    return status;
}

static bool same_pose(const gonio_pair *a, const gonio_pair *b) { return memcmp(a, b, sizeof *a) == 0; }

// How often the pose was asked for, and whether it ever gave a sample.
static size_t tries(const gonio_adaptive *a, const gonio_pair *pose, bool *sampled) {
    size_t n = 0;
    *sampled = false;
    for (size_t i = 0; i < a->n; i++) {
        if (same_pose(&a->poses[i].pose, pose)) {
            n++;
            *sampled = *sampled || a->poses[i].sample >= 0;
        }
    }
    return n;
}

// Poses of the batch before that gave no sample are asked for again; those that never do are barred.
static gonio_status add_again(gonio_adaptive *a, size_t room, gonio_pair *barred, size_t *barred_n,
                              gonio_error *error) {
    const size_t n = a->n;
    gonio_status status = GONIO_OK;
    *barred_n = 0;
    for (size_t i = 0; i < n && status == GONIO_OK; i++) {
        bool sampled;
        const gonio_pair pose = a->poses[i].pose;
        if (a->poses[i].sample >= 0) {
            continue;
        }
        const size_t tried = tries(a, &pose, &sampled);
        if (!sampled && tried < TRIES_MAX && a->n - n < room) {
            const gonio_adaptive_pose p = plain(GONIO_ADAPTIVE_AGAIN, pose);
            status = append(a, &p, error);
        } else if (!sampled && tried >= TRIES_MAX) {
            barred[(*barred_n)++] = pose;
        }
    }
    return status;
}

// Where the last batch was further from its predictions than sigma says.
static size_t find_surprises(const gonio_adaptive *a, gonio_design_surprise *out) {
    const size_t channels = (size_t)a->samples->channels;
    size_t n = 0;
    for (size_t i = 0; i < a->n; i++) {
        const gonio_adaptive_pose *p = &a->poses[i];
        if (p->batch + 1 != a->batches || p->sample < 0 || !isfinite(p->predicted[0])) {
            continue;
        }
        double excess = 0;
        for (size_t c = 0; c < channels; c++) {
            const double f = a->samples->values[(size_t)p->sample * channels + c];
            const double unit = fmax(f, 0) + TINY;
            const double by = (p->predicted[c] - f) / unit, sigma = SURPRISE_BEYOND * p->uncertainty[c] / unit;
            excess += (by * by - sigma * sigma) / (double)channels;
        }
        if (excess > 0) {
            out[n++] = (gonio_design_surprise){a->samples->pairs[p->sample], SURPRISE_SHARE * fmin(excess, 4)};
        }
    }
    return n;
}

// ---- the live fit ----

static gonio_status fit_live(const gonio_adaptive *a, const gonio_adaptive_how *how, gonio_model **model,
                             gonio_error *error) {
    gonio_fit_options options;
    gonio_fit_options_default(&options);
    options.hold_out = 0;
    options.seed = a->seed;
    options.threads = how->threads;
    options.progress = how->progress;
    options.progress_context = how->context;
    if (a->prior != NULL) {
        snprintf(options.prior, sizeof options.prior, "%s", a->prior);
        gonio_error unlike = {0};
        const gonio_status status = gonio_fit(a->samples, &options, model, NULL, &unlike);
        if (status != GONIO_E_MISMATCH) {
            return status == GONIO_OK ? status : gonio_fail(error, status, "%s", unlike.message);
        }
        options.prior[0] = 0; // the sample is not like the library
    }
    return gonio_fit(a->samples, &options, model, NULL, error);
}

static void predict(const gonio_model *model, gonio_adaptive_pose *p) {
    double f[GONIO_CHANNELS_MAX], sigma[GONIO_CHANNELS_MAX];
    const gonio_vec3 wi = gonio_direction(p->pose.theta_i, p->pose.phi_i),
                     wo = gonio_direction(p->pose.theta_o, p->pose.phi_o);
    gonio_model_eval(model, wi, wo, f);
    const bool told = gonio_model_sigma(model, wi, wo, sigma);
    for (int c = 0; c < GONIO_ADAPTIVE_CHANNELS && c < model->channels; c++) {
        p->predicted[c] = f[c];
        p->uncertainty[c] = told ? sigma[c] : NAN;
    }
}

// ---- the choice ----

static double travel_s(void *context, const gonio_pair *from, const gonio_pair *to) {
    return gonio_pose_time_travel_s(((const gonio_adaptive_how *)context)->time, from, to);
}

static double dwell_s(void *context, const gonio_pair *pose, double value) {
    return gonio_pose_time_dwell_s(((const gonio_adaptive_how *)context)->time, pose, value);
}

static bool allowed(void *context, const gonio_pair *pose) {
    return gonio_scan_reaches(((const gonio_adaptive_how *)context)->time->rig, pose);
}

// What scenes ask for, and how far their pictures are expected to be off.
typedef struct asked {
    gonio_pair *pairs;
    double *worth;
    size_t n;
} asked;

static void release_asked(asked *of) {
    free(of->pairs);
    free(of->worth);
}

static gonio_status read_asked(gonio_adaptive *a, const gonio_model *model, asked *of, gonio_error *error) {
    gonio_needs *needs;
    int material;
    gonio_needs_facts facts;
    *of = (asked){0};
    a->codes = NAN;
    if (a->needs == NULL) {
        return GONIO_OK;
    }
    gonio_status status = gonio_needs_open(a->needs, &needs, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_needs_material(needs, NULL, &material, error);
    if (status == GONIO_OK) {
        gonio_needs_describe(needs, material, &facts);
        of->pairs = malloc((facts.cells + 1) * sizeof *of->pairs);
        of->worth = malloc((facts.cells + 1) * sizeof *of->worth);
        status = of->pairs != NULL && of->worth != NULL
                     ? GONIO_OK
                     : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu cells", facts.cells);
    }
    const gonio_need *cells = status == GONIO_OK ? gonio_needs_cells(needs, material) : NULL;
    for (size_t i = 0; cells != NULL && i < facts.cells; i++) {
        double value;
        of->pairs[i] = gonio_pair_from_vectors(cells[i].wi, cells[i].wo);
        of->worth[i] = cells[i].squares;
        a->codes = (i > 0 ? a->codes : 0) + cells[i].codes * fmin(gonio_design_spread(model, &of->pairs[i], &value), 1);
    }
    of->n = cells != NULL ? facts.cells : 0;
    gonio_needs_free(needs);
    return status;
}

static gonio_status append_chosen(gonio_adaptive *a, const gonio_design_pose *chosen, size_t n, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (size_t i = 0; i < n && status == GONIO_OK; i++) {
        gonio_adaptive_pose p = plain(GONIO_ADAPTIVE_SIGMA, chosen[i].pose);
        p.sigma = chosen[i].sigma;
        p.gain = chosen[i].gain;
        p.seconds = chosen[i].seconds;
        status = append(a, &p, error);
    }
    return status;
}

// The poses that the model asks for, behind those of the batch that are there.
static gonio_status add_wanted(gonio_adaptive *a, const gonio_adaptive_how *how, const gonio_model *model,
                               const asked *of, size_t first, size_t n, const gonio_pair *barred, size_t barred_n,
                               gonio_error *error) {
    const size_t taken_n = a->n - first;
    gonio_design_surprise *surprises = calloc(a->n + 1, sizeof *surprises);
    gonio_design_pose *chosen = calloc(n + 1, sizeof *chosen);
    gonio_pair *taken = calloc(taken_n + 1, sizeof *taken);
    size_t count = 0;
    gonio_status status = GONIO_OK;
    if (surprises == NULL || chosen == NULL || taken == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to choose poses");
    } else {
        for (size_t i = 0; i < taken_n; i++) {
            taken[i] = a->poses[first + i].pose;
        }
        const gonio_design design = {.isotropic = !a->plan.anisotropic,
                                     .theta_max = gonio_radians(a->plan.theta_max_deg),
                                     .seed = gonio_random(a->seed + a->batches),
                                     .threads = how->threads,
                                     .context = (void *)how,
                                     .travel_s = travel_s,
                                     .dwell_s = dwell_s,
                                     .allowed = allowed,
                                     .asked = of->pairs,
                                     .asked_worth = of->worth,
                                     .asked_n = of->n,
                                     .surprises = surprises,
                                     .surprises_n = find_surprises(a, surprises),
                                     .barred = barred,
                                     .barred_n = barred_n};
        status = gonio_design_choose(&design, model, a->samples, taken, taken_n, &how->here, n, chosen, &count, error);
    }
    status = status == GONIO_OK ? append_chosen(a, chosen, count, error) : status;
    free(surprises);
    free(chosen);
    free(taken);
    return status;
}

static size_t clamp(size_t n, size_t low, size_t high) { return n < low ? low : n > high ? high : n; }

static size_t first_batch(const gonio_adaptive_plan *plan) {
    const size_t n = plan->first > 0 ? plan->first : clamp(plan->poses / FIRST_SHARE, FIRST_MIN, FIRST_MAX);
    return n < plan->poses ? n : plan->poses;
}

static gonio_status next_batch(gonio_adaptive *a, const gonio_adaptive_how *how, const gonio_model *model,
                               const asked *of, gonio_pair *barred, gonio_error *error) {
    const size_t first = a->n, left = a->plan.poses - a->n;
    const size_t usual = a->plan.batch > 0 ? a->plan.batch : clamp(a->n / BATCH_SHARE, BATCH_MIN, SIZE_MAX);
    const size_t batch = usual < left ? usual : left;
    const size_t fill = (size_t)fmin(ceil(a->shares[1] * (double)batch), (double)batch);
    size_t barred_n;
    gonio_status status = add_again(a, batch - fill, barred, &barred_n, error);
    status = status == GONIO_OK ? add_fill(a, fill, error) : status;
    const size_t there = a->n - first;
    if (status == GONIO_OK && there < batch) {
        status = add_wanted(a, how, model, of, first, batch - there, barred, barred_n, error);
    }
    for (size_t i = first; i < a->n; i++) {
        predict(model, &a->poses[i]);
    }
    return status;
}

// The stated share fills the space, the rest is what the prior asks for.
static gonio_status begin_with_prior(gonio_adaptive *a, size_t n, int threads, gonio_error *error) {
    const size_t fill = (size_t)ceil(a->plan.share * (double)n);
    gonio_library *library;
    gonio_plan *plan = NULL;
    gonio_status status = a->plan.anisotropic
                              ? gonio_fail(error, GONIO_E_USAGE, "a prior is of isotropic reflection; the plan is not")
                              : gonio_library_open(a->prior, &library, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (fill < n) {
        status =
            gonio_library_plan(library, n - fill, gonio_radians(a->plan.theta_max_deg), a->seed, threads, &plan, error);
    }
    gonio_library_free(library);
    for (size_t i = 0; plan != NULL && i < plan->n && status == GONIO_OK; i++) {
        const gonio_adaptive_pose p = plain(GONIO_ADAPTIVE_PRIOR, plan->poses[i]);
        status = append(a, &p, error);
    }
    gonio_plan_free(plan);
    return status == GONIO_OK ? add_fill(a, fill, error) : status;
}

gonio_status gonio_adaptive_choose(gonio_adaptive *a, const gonio_adaptive_how *how, size_t *count,
                                   gonio_error *error) {
    const size_t before = a->n;
    gonio_status status = GONIO_OK;
    a->shares[1] = a->batches == 0 ? 1 : gonio_adaptive_share(a);
    if (a->batches == 0 || a->samples == NULL || a->samples->n == 0) {
        // Without a sample there is no model; the space is filled on.
        const size_t left = a->plan.poses - a->n, wanted = first_batch(&a->plan), n = wanted < left ? wanted : left;
        status =
            a->batches == 0 && a->prior != NULL ? begin_with_prior(a, n, how->threads, error) : add_fill(a, n, error);
    } else {
        gonio_model *model = NULL;
        gonio_pair *barred = calloc(a->n + 1, sizeof *barred);
        status = barred != NULL ? fit_live(a, how, &model, error)
                                : gonio_fail(error, GONIO_E_MEMORY, "no memory to choose poses");
        asked of = {0};
        status = status == GONIO_OK ? read_asked(a, model, &of, error) : status;
        if (status == GONIO_OK && !(a->plan.codes > 0 && a->codes <= a->plan.codes)) {
            status = next_batch(a, how, model, &of, barred, error);
        }
        release_asked(&of);
        gonio_model_free(model);
        free(barred);
    }
    *count = a->n - before;
    if (*count > 0) {
        a->shares[0] = a->shares[1];
        a->batches++;
    }
    return status;
}
