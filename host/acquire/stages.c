// SPDX-License-Identifier: BSD-3-Clause
// A replay beside the journal, stage by stage: frames -> radiance -> samples -> final samples -> model. The first stage
// that differs is where this version does something else; what comes after follows from it.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/acquire/acquire.h"

static bool same(const gonio_samples *a, const gonio_samples *b) {
    if (a == NULL || b == NULL) {
        return a == b;
    }
    const size_t bytes = a->n * (size_t)a->channels * sizeof(double);
    return a->n == b->n && a->channels == b->channels &&
           (a->n == 0 ||
            (memcmp(a->pairs, b->pairs, a->n * sizeof *a->pairs) == 0 && memcmp(a->values, b->values, bytes) == 0 &&
             memcmp(a->sigma_random, b->sigma_random, bytes) == 0 &&
             memcmp(a->sigma_systematic, b->sigma_systematic, bytes) == 0));
}

static void differs(gonio_stage_report *stage, int64_t step, double by) {
    stage->first_step = stage->steps_differing == 0 ? step : stage->first_step;
    stage->steps_differing++;
    stage->largest = by > stage->largest || isnan(by) ? by : stage->largest;
}

static double relative(const gonio_step_radiance *a, const gonio_step_radiance *b) {
    double largest = a->channels == b->channels ? 0 : NAN;
    for (int k = 0; k < a->channels && k < b->channels; k++) {
        const double by = fabs(a->mean[k] - b->mean[k]) / fabs(a->mean[k]);
        largest = by > largest ? by : largest;
    }
    return largest;
}

static gonio_status compare_radiance(gonio_session *session, int64_t step, const gonio_step_radiance *again,
                                     gonio_stage_report *stage, gonio_error *error) {
    gonio_step_radiance journalled;
    const gonio_status status = gonio_session_radiance(session, step, &journalled, error);
    // Without a journalled one (a session of the first releases, a pose without a sample) there is nothing to compare.
    if (status == GONIO_OK && journalled.channels > 0 && strcmp(journalled.sha256, again->sha256) != 0) {
        differs(stage, step, relative(&journalled, again));
    }
    return status;
}

static gonio_status compare_samples(gonio_session *session, int64_t step, const gonio_samples *again,
                                    gonio_replay_report *report, gonio_error *error) {
    gonio_samples *stored = NULL;
    const gonio_status status = gonio_session_step_samples(session, step, &stored, error);
    if (status == GONIO_OK && !same(again, stored)) {
        gonio_agreement by = {0};
        gonio_agreement_add(&by, stored, again);
        gonio_agreement_join(&report->agreement, &by);
        differs(&report->stages[GONIO_STAGE_SAMPLES], step, gonio_agreement_relative(&by));
    }
    gonio_samples_free(stored);
    return status;
}

// The lines that gonio_session_stage_hash hashes, of what was computed again.
static gonio_status hash_again(const gonio_process *process, gonio_samples *const *sets,
                               const gonio_step_radiance *radiance, gonio_stage stage, char hex[GONIO_SHA256_HEX],
                               gonio_error *error) {
    char *lines;
    size_t size;
    gonio_status status = GONIO_OK;
    FILE *stream = open_memstream(&lines, &size);
    if (stream == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for checksums");
    }
    for (size_t i = 0; status == GONIO_OK && i < process->n; i++) {
        char rows[GONIO_SHA256_HEX];
        if (stage == GONIO_STAGE_SAMPLES && sets[i] != NULL) {
            status = gonio_sha256_rows(sets[i], rows, error);
            fprintf(stream, "%zu %s\n", i, rows);
        } else if (stage == GONIO_STAGE_RADIANCE && radiance[i].channels > 0) {
            fprintf(stream, "%zu %s\n", i, radiance[i].sha256);
        }
    }
    fclose(stream);
    hex[0] = 0;
    status = status == GONIO_OK && size > 0 ? gonio_sha256(lines, size, hex, error) : status;
    free(lines);
    return status;
}

static void get_checksum(gonio_session *session, const char *key, char hex[GONIO_SHA256_HEX]) {
    char *text = NULL;
    if (gonio_session_get(session, key, &text, NULL) == GONIO_OK) {
        snprintf(hex, GONIO_SHA256_HEX, "%s", text);
    }
    free(text);
}

// As journalled when the session was finished; an unfinished one is held against its own rows.
static gonio_status journalled(gonio_session *session, gonio_stage stage, char hex[GONIO_SHA256_HEX],
                               gonio_error *error) {
    char key[64];
    snprintf(key, sizeof key, "result.stage.%s", gonio_stage_name((int)stage));
    get_checksum(session, key, hex);
    return hex[0] == 0 && stage != GONIO_STAGE_FRAMES ? gonio_session_stage_hash(session, stage, hex, error) : GONIO_OK;
}

static void settle(gonio_stage_report *stage) {
    stage->known = stage->journalled[0] != 0 && stage->again[0] != 0;
    stage->equal = stage->known && stage->steps_differing == 0 && strcmp(stage->journalled, stage->again) == 0;
}

gonio_status gonio_stages_steps(gonio_session *session, const gonio_process *process, gonio_samples *const *sets,
                                const gonio_step_radiance *radiance, gonio_replay_report *report, gonio_error *error) {
    *report = (gonio_replay_report){.first_differing = -1, .first_stage = -1};
    for (int k = 0; k < GONIO_STAGES; k++) {
        report->stages[k].first_step = -1;
    }
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < process->n; i++) {
        if (sets[i] != NULL) {
            status = compare_samples(session, (int64_t)i, sets[i], report, error);
            status = status == GONIO_OK ? compare_radiance(session, (int64_t)i, &radiance[i],
                                                           &report->stages[GONIO_STAGE_RADIANCE], error)
                                        : status;
        }
    }
    report->steps_differing = report->stages[GONIO_STAGE_SAMPLES].steps_differing;
    report->first_differing = report->stages[GONIO_STAGE_SAMPLES].first_step;
    for (int k = GONIO_STAGE_FRAMES; status == GONIO_OK && k <= GONIO_STAGE_SAMPLES; k++) {
        gonio_stage_report *stage = &report->stages[k];
        status = journalled(session, (gonio_stage)k, stage->journalled, error);
        if (status == GONIO_OK) {
            // Every frame's pixels were held against its own checksum when they were read.
            status = k == GONIO_STAGE_FRAMES
                         ? gonio_session_stage_hash(session, GONIO_STAGE_FRAMES, stage->again, error)
                         : hash_again(process, sets, radiance, (gonio_stage)k, stage->again, error);
        }
        settle(stage);
    }
    return status;
}

static void copy_checksum(char to[GONIO_SHA256_HEX], const char *from) { memcpy(to, from, GONIO_SHA256_HEX); }

gonio_status gonio_stages_results(gonio_session *session, const gonio_outcome *outcome, gonio_replay_report *report,
                                  gonio_error *error) {
    gonio_stage_report *final = &report->stages[GONIO_STAGE_FINAL], *model = &report->stages[GONIO_STAGE_MODEL];
    get_checksum(session, "result.samples_sha256", report->samples_sha256);
    get_checksum(session, "result.model_sha256", report->model_sha256);
    copy_checksum(final->journalled, report->samples_sha256);
    // Sessions of earlier releases have the checksum of the samples without their head.
    copy_checksum(final->again, outcome->samples != NULL && final->journalled[0] != 0 &&
                                        gonio_sha256_samples_is(outcome->samples, final->journalled)
                                    ? final->journalled
                                    : outcome->samples_sha256);
    copy_checksum(model->journalled, report->model_sha256);
    copy_checksum(model->again, outcome->model_sha256);
    settle(final);
    settle(model);
    for (int k = GONIO_STAGES; k-- > 0;) {
        report->first_stage = report->stages[k].known && !report->stages[k].equal ? k : report->first_stage;
    }
    report->finished = final->known && model->known;
    report->samples_equal = report->finished && final->equal;
    report->model_equal = report->finished && model->equal;
    report->equal =
        report->steps_differing == 0 && (!report->finished || (report->samples_equal && report->model_equal));
    if (report->equal) {
        return GONIO_OK;
    }
    gonio_agreement last = {0};
    const gonio_status status = report->finished ? gonio_agreement_finish(&last, session, outcome, error) : GONIO_OK;
    final->largest = gonio_agreement_relative(&last);
    model->largest = model->equal ? 0 : NAN; // its share of what rounding may make of it is in the agreement
    gonio_agreement_join(&report->agreement, &last);
    report->rounding = gonio_agreement_largest(&report->agreement) <= 1;
    return status;
}
