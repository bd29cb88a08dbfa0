// SPDX-License-Identifier: BSD-3-Clause
// The batches of an adaptive plan in the journal: setting "adaptive.batch.N", a JSON object a batch (docs/formats.md),
// whose poses stand in the order of their steps.
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "host/acquire/adaptive.h"

static void key_of(size_t batch, char key[48]) { snprintf(key, 48, "adaptive.batch.%zu", batch); }

// ---- writing ----

static json_t *number(double value) { return isfinite(value) ? json_real(value) : json_null(); }

static json_t *numbers(const double *values, size_t n) {
    json_t *list = json_array();
    for (size_t i = 0; i < n; i++) {
        json_array_append_new(list, number(values[i]));
    }
    return list;
}

static json_t *pose_json(const gonio_adaptive_pose *p, size_t channels) {
    const double deg[4] = {gonio_degrees(p->pose.theta_i), gonio_degrees(p->pose.phi_i), gonio_degrees(p->pose.theta_o),
                           gonio_degrees(p->pose.phi_o)};
    json_t *object = json_pack("{s:s,s:o}", "why", gonio_adaptive_whys[p->why], "pose_deg", numbers(deg, 4));
    if (isfinite(p->sigma)) {
        json_object_set_new(object, "sigma", number(p->sigma));
        json_object_set_new(object, "gain", number(p->gain));
        json_object_set_new(object, "seconds", number(p->seconds));
    }
    if (isfinite(p->predicted[0])) {
        json_object_set_new(object, "predicted", numbers(p->predicted, channels));
        json_object_set_new(object, "predicted_sigma", numbers(p->uncertainty, channels));
    }
    return object;
}

// The checksum of the samples that the choice stands on; empty: of none.
static gonio_status hash_of(const gonio_samples *samples, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    hex[0] = 0;
    return samples != NULL && samples->n > 0 ? gonio_sha256_rows(samples, hex, error) : GONIO_OK;
}

static gonio_status describe_batch(const gonio_adaptive *a, size_t first, size_t first_step, char **record,
                                   gonio_error *error) {
    char hex[GONIO_SHA256_HEX];
    const gonio_status status = hash_of(a->samples, hex, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t channels = a->samples != NULL ? (size_t)a->samples->channels : 0;
    json_t *poses = json_array();
    for (size_t i = first; i < a->n; i++) {
        json_array_append_new(poses, pose_json(&a->poses[i], channels));
    }
    json_t *object =
        json_pack("{s:I,s:f,s:I,s:s,s:o}", "first_step", (json_int_t)first_step, "share", a->shares[0], "samples",
                  (json_int_t)(a->samples != NULL ? a->samples->n : 0), "samples_sha256", hex, "poses", poses);
    *record = object != NULL ? json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(17) | JSON_PRESERVE_ORDER) : NULL;
    json_decref(object);
    return *record != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a batch's record");
}

gonio_status gonio_adaptive_put(gonio_session *session, size_t batch, const char *record, gonio_error *error) {
    char key[48];
    key_of(batch, key);
    return gonio_session_put(session, key, record, error);
}

// ---- reading ----

static gonio_status foreign(gonio_session *session, size_t batch, const char *expected, gonio_error *error) {
    return gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1,
                           "table settings, row key = 'adaptive.batch.%zu', column value: expected %s", batch,
                           expected);
}

static void take_numbers(const json_t *list, double *values, size_t n) {
    for (size_t i = 0; i < n; i++) {
        const json_t *value = json_array_get(list, i);
        values[i] = json_is_number(value) ? json_number_value(value) : NAN;
    }
}

static double take_number(const json_t *object, const char *name) {
    const json_t *value = json_object_get(object, name);
    return json_is_number(value) ? json_number_value(value) : NAN;
}

static bool take_pose(const json_t *object, gonio_adaptive_pose *p) {
    const char *why = json_string_value(json_object_get(object, "why"));
    double deg[4];
    int k = 0;
    while (why != NULL && k < GONIO_ADAPTIVE_WHYS && strcmp(gonio_adaptive_whys[k], why) != 0) {
        k++;
    }
    take_numbers(json_object_get(object, "pose_deg"), deg, 4);
    *p = (gonio_adaptive_pose){
        .why = (gonio_adaptive_why)k,
        .pose = {gonio_radians(deg[0]), gonio_radians(deg[1]), gonio_radians(deg[2]), gonio_radians(deg[3])},
        .sigma = take_number(object, "sigma"),
        .gain = take_number(object, "gain"),
        .seconds = take_number(object, "seconds"),
        .sample = -1};
    take_numbers(json_object_get(object, "predicted"), p->predicted, GONIO_ADAPTIVE_CHANNELS);
    take_numbers(json_object_get(object, "predicted_sigma"), p->uncertainty, GONIO_ADAPTIVE_CHANNELS);
    return why != NULL && k < GONIO_ADAPTIVE_WHYS && fabs(deg[0]) <= 720 && fabs(deg[1]) <= 720 &&
           fabs(deg[2]) <= 720 && fabs(deg[3]) <= 720;
}

// A step's sample, if it gave one: appended to the samples, and its own uncertainty to the prediction's.
static gonio_status take_sample(gonio_adaptive *a, gonio_adaptive_pose *p, const gonio_samples *set,
                                gonio_error *error) {
    gonio_status status = GONIO_OK;
    if (set == NULL || set->n == 0) {
        return GONIO_OK;
    }
    if (a->samples == NULL) {
        status = gonio_samples_new(set->channels, true, &a->samples, error);
        if (status != GONIO_OK) {
            return status;
        }
        a->samples->isotropic = !a->plan.anisotropic;
        memcpy(a->samples->channel_names, set->channel_names, (size_t)set->channels * sizeof *set->channel_names);
    }
    status =
        gonio_samples_add(a->samples, &set->pairs[0], set->values, set->sigma_random, set->sigma_systematic, error);
    p->sample = status == GONIO_OK ? (ptrdiff_t)a->samples->n - 1 : -1;
    for (int c = 0; status == GONIO_OK && c < set->channels && c < GONIO_ADAPTIVE_CHANNELS; c++) {
        p->uncertainty[c] = hypot(p->uncertainty[c], gonio_samples_sigma(set, 0, c));
    }
    return status;
}

// Where samples come from: the journal, or (replay) the sets that were computed again.
typedef struct source {
    gonio_session *session;
    const gonio_step *steps;
    size_t n;
    gonio_samples *const *sets; // NULL: the journal
} source;

static gonio_status add_step(const source *from, gonio_adaptive *a, size_t step, const gonio_adaptive_pose *pose,
                             gonio_error *error) {
    gonio_adaptive_pose *larger = realloc(a->poses, (a->n + 1) * sizeof *larger);
    gonio_samples *own = NULL;
    if (larger == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a plan of %zu poses", a->n + 1);
    }
    a->poses = larger;
    a->poses[a->n] = *pose;
    a->poses[a->n].batch = a->batches;
    gonio_status status = GONIO_OK;
    if (from->sets == NULL && from->steps[step].done) {
        status = gonio_session_step_samples(from->session, (int64_t)step, &own, error);
    }
    if (status == GONIO_OK) {
        status = take_sample(a, &a->poses[a->n], from->sets != NULL ? from->sets[step] : own, error);
        a->n++;
    }
    gonio_samples_free(own);
    return status;
}

static gonio_status read_batch(const source *from, gonio_adaptive *a, const json_t *object, gonio_error *error) {
    const json_t *poses = json_object_get(object, "poses");
    const json_int_t first = json_integer_value(json_object_get(object, "first_step"));
    const size_t n = json_array_size(poses);
    if (!json_is_integer(json_object_get(object, "first_step")) || first < 0 || n == 0 || (size_t)first > from->n ||
        n > from->n - (size_t)first) {
        return foreign(from->session, a->batches, "an object with the poses of steps that there are", error);
    }
    gonio_status status = GONIO_OK;
    for (size_t i = 0; i < n && status == GONIO_OK; i++) {
        gonio_adaptive_pose pose;
        const size_t step = (size_t)first + i;
        if (!take_pose(json_array_get(poses, i), &pose) || from->steps[step].kind != GONIO_STEP_SAMPLE) {
            return foreign(from->session, a->batches, "poses of sample steps, with why they were chosen", error);
        }
        status = add_step(from, a, step, &pose, error);
    }
    a->shares[0] = take_number(object, "share");
    return status;
}

static gonio_status read_settings(gonio_session *session, gonio_adaptive *a, gonio_error *error) {
    char *plan = NULL, *seed = NULL;
    gonio_status status = gonio_session_get(session, "plan", &plan, error);
    status = status == GONIO_OK ? gonio_session_get(session, "plan.seed", &seed, error) : status;
    if (status == GONIO_OK && !gonio_adaptive_is(plan)) {
        status = gonio_fail(error, GONIO_E_INPUT, "the session's plan is none that is made while it is measured");
    }
    status = status == GONIO_OK ? gonio_adaptive_parse(plan, &a->plan, error) : status;
    a->seed = status == GONIO_OK ? strtoull(seed, NULL, 10) : 0;
    free(plan);
    free(seed);
    return status;
}

// The record of the next batch; NULL: there is none.
static gonio_status find_batch(gonio_session *session, size_t batch, json_t **object, gonio_error *error) {
    char key[48], *text;
    key_of(batch, key);
    const gonio_status status = gonio_session_find(session, key, &text, error);
    *object = text != NULL ? json_loads(text, JSON_REJECT_DUPLICATES, NULL) : NULL;
    const bool bad = text != NULL && *object == NULL;
    free(text);
    return bad ? foreign(session, batch, "a JSON object", error) : status;
}

gonio_status gonio_adaptive_get(gonio_session *session, const gonio_step *steps, size_t n, gonio_adaptive *a,
                                gonio_error *error) {
    const source from = {session, steps, n, NULL};
    *a = (gonio_adaptive){0};
    gonio_status status = read_settings(session, a, error);
    json_t *object = NULL;
    for (; status == GONIO_OK; a->batches++) {
        status = find_batch(session, a->batches, &object, error);
        if (status != GONIO_OK || object == NULL) {
            break;
        }
        status = read_batch(&from, a, object, error);
        json_decref(object);
    }
    return status;
}

gonio_status gonio_adaptive_verify(gonio_session *session, const gonio_step *steps, size_t n,
                                   gonio_samples *const *sets, size_t *batches, size_t *differing, gonio_error *error) {
    const source from = {session, steps, n, sets};
    gonio_adaptive a = {0};
    json_t *object = NULL;
    *batches = *differing = 0;
    gonio_status status = read_settings(session, &a, error);
    for (; status == GONIO_OK; a.batches++) {
        char hex[GONIO_SHA256_HEX];
        status = find_batch(session, a.batches, &object, error);
        if (status != GONIO_OK || object == NULL) {
            break;
        }
        const char *chosen_on = json_string_value(json_object_get(object, "samples_sha256"));
        status = hash_of(a.samples, hex, error);
        *differing += status == GONIO_OK && (chosen_on == NULL || strcmp(chosen_on, hex) != 0);
        status = status == GONIO_OK ? read_batch(&from, &a, object, error) : status;
        json_decref(object);
    }
    *batches = a.batches;
    gonio_adaptive_release(&a);
    return status;
}

// ---- going on ----

// The poses from `first` on as steps in an order of short moves, into which they are put too.
static gonio_status order_batch(gonio_adaptive *a, const gonio_rig *rig, const gonio_pair *here, size_t first,
                                gonio_step *steps, gonio_error *error) {
    const size_t n = a->n - first;
    gonio_plan plan = {n, malloc((n + 1) * sizeof(gonio_pair))};
    size_t *which = malloc((n + 1) * sizeof *which);
    gonio_adaptive_pose *ordered = malloc((n + 1) * sizeof *ordered);
    gonio_status status = GONIO_OK;
    if (plan.poses == NULL || which == NULL || ordered == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu poses", n);
    } else {
        for (size_t i = 0; i < n; i++) {
            plan.poses[i] = a->poses[first + i].pose;
        }
        status = gonio_scan_tour(rig, here, &plan, steps, which, error);
    }
    for (size_t i = 0; i < n && status == GONIO_OK; i++) {
        ordered[i] = a->poses[first + which[i]];
    }
    if (status == GONIO_OK) {
        memcpy(a->poses + first, ordered, n * sizeof *ordered);
    }
    free(plan.poses);
    free(which);
    free(ordered);
    return status;
}

static gonio_status refuse(const gonio_setup *setup, gonio_error *error) {
    return setup->facts.sphere
               ? gonio_fail(error, GONIO_E_USAGE,
                            "an adaptive plan chooses the poses of a flat sample; a sphere shows thousands of "
                            "directions in each frame, and a few poses of any plan cover them")
               : GONIO_OK;
}

gonio_status gonio_adaptive_begin(const gonio_rig *rig, const gonio_setup *setup, const char *plan, uint64_t seed,
                                  gonio_step **steps, size_t *n, char **record, gonio_error *error) {
    gonio_adaptive a = {.seed = seed, .prior = setup->fit.prior[0] != 0 ? setup->fit.prior : NULL};
    const gonio_plan none = {0};
    const gonio_pose_time time = gonio_pose_time_of(rig, setup);
    gonio_adaptive_how how = {.time = &time};
    gonio_step ending[2];
    size_t count = 0;
    *steps = NULL;
    *record = NULL;
    gonio_status status = refuse(setup, error);
    status = status == GONIO_OK ? gonio_adaptive_parse(plan, &a.plan, error) : status;
    status = status == GONIO_OK ? gonio_scan_steps(rig, &setup->scan, &none, steps, n, error) : status;
    status = status == GONIO_OK ? gonio_adaptive_choose(&a, &how, &count, error) : status;
    if (status == GONIO_OK) {
        const gonio_pair reference = (*steps)[0].pose;
        *n -= gonio_scan_ending(&setup->scan, &reference, ending); // it comes behind the last batch
        gonio_step *larger = realloc(*steps, (*n + count) * sizeof *larger);
        *steps = larger != NULL ? larger : *steps;
        if (larger != NULL) {
            memset(larger + *n, 0, count * sizeof *larger);
        }
        status = larger != NULL ? order_batch(&a, rig, &reference, 0, larger + *n, error)
                                : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu steps", *n + count);
    }
    status = status == GONIO_OK ? describe_batch(&a, 0, *n, record, error) : status;
    for (size_t i = 0; i < count && status == GONIO_OK; i++) {
        (*steps)[*n].index = (int64_t)*n;
        ++*n;
    }
    gonio_adaptive_release(&a);
    if (status != GONIO_OK) {
        free(*steps);
        *steps = NULL;
    }
    return status;
}

static gonio_status enter(gonio_session *session, gonio_step *more, size_t count, size_t first_step, size_t batch,
                          const char *record, gonio_error *error) {
    for (size_t i = 0; i < count; i++) {
        more[i].index = (int64_t)(first_step + i);
    }
    gonio_status status = gonio_session_begin(session, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_session_put_steps(session, more, count, error);
    if (status == GONIO_OK && record != NULL) {
        status = gonio_adaptive_put(session, batch, record, error);
    }
    return gonio_session_end(session, status, error);
}

// f_r of each step's sample, mean over the channels; NaN where there is none.
static double *values_of(const gonio_adaptive *a, size_t n, size_t first_step) {
    double *values = malloc((n + 1) * sizeof *values);
    for (size_t i = 0; values != NULL && i < n; i++) {
        values[i] = NAN;
    }
    for (size_t i = 0; values != NULL && i < a->n && first_step + i < n; i++) {
        const ptrdiff_t s = a->poses[i].sample;
        double sum = 0;
        for (int c = 0; s >= 0 && c < a->samples->channels; c++) {
            sum += a->samples->values[(size_t)s * (size_t)a->samples->channels + (size_t)c] / a->samples->channels;
        }
        values[first_step + i] = s >= 0 ? sum : NAN;
    }
    return values;
}

static gonio_status choose_next(gonio_adaptive *a, const gonio_rig *rig, const gonio_setup *setup,
                                const gonio_step *steps, size_t n, gonio_adaptive_how *how, gonio_step **more,
                                size_t *count, char **record, gonio_error *error) {
    const size_t first = a->n;
    gonio_pose_time time = gonio_pose_time_of(rig, setup);
    double *values = values_of(a, n, n - a->n);
    gonio_pose_time_learn(&time, steps, values, n);
    free(values);
    how->time = &time;
    how->here = steps[n - 1].pose;
    gonio_status status = gonio_adaptive_choose(a, how, count, error);
    *more = status == GONIO_OK ? calloc(*count + 1, sizeof **more) : NULL;
    if (status == GONIO_OK && *more == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu steps", *count);
    }
    status = status == GONIO_OK ? order_batch(a, rig, &how->here, first, *more, error) : status;
    return status == GONIO_OK ? describe_batch(a, first, n, record, error) : status;
}

gonio_status gonio_adaptive_next(gonio_session *session, const gonio_rig *rig, const gonio_setup *setup,
                                 const gonio_step *steps, size_t n, int threads, gonio_progress_fn progress,
                                 void *context, gonio_step **more, size_t *count, gonio_error *error) {
    *more = NULL;
    *count = 0;
    if (n > 0 && steps[n - 1].kind != GONIO_STEP_SAMPLE) {
        return GONIO_OK;
    }
    gonio_adaptive a;
    gonio_adaptive_report report;
    gonio_adaptive_how how = {.threads = threads, .progress = progress, .context = context};
    char *record = NULL;
    gonio_status status = gonio_adaptive_get(session, steps, n, &a, error);
    a.prior = setup->fit.prior[0] != 0 ? setup->fit.prior : NULL;
    a.needs = setup->scan.needs[0] != 0 ? setup->scan.needs : NULL;
    status = status == GONIO_OK ? gonio_adaptive_figures(&a, &report, error) : status;
    if (status == GONIO_OK && !gonio_adaptive_over(&a, &report)) {
        status = choose_next(&a, rig, setup, steps, n, &how, more, count, &record, error);
    }
    if (status == GONIO_OK && *count == 0) { // over, or no pose is left to ask for
        free(*more);
        *more = calloc(2, sizeof **more);
        *count = *more != NULL ? gonio_scan_ending(&setup->scan, &steps[0].pose, *more) : 0;
        free(record);
        record = NULL;
        status = *more != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for steps");
    }
    if (status == GONIO_OK) {
        status = enter(session, *more, *count, n, a.batches - (record != NULL ? 1 : 0), record, error);
    }
    free(record);
    gonio_adaptive_release(&a);
    if (status != GONIO_OK) {
        free(*more);
        *more = NULL;
        *count = 0;
    }
    return status;
}
