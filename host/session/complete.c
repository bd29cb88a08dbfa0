// SPDX-License-Identifier: BSD-3-Clause
// Whether the journal still has every step of the plan (a row that damage took is nowhere missed by SQL), and whether
// all that is to be done is done.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/session/internal.h"

typedef struct gaps {
    int64_t missing;
    char *which;
    size_t size;
} gaps;

static void add(gaps *g, int64_t first, int64_t n) {
    if (n < 1) {
        return;
    }
    const size_t used = strlen(g->which);
    const char *comma = used > 0 ? ", " : "";
    g->missing += n;
    if (n == 1) {
        snprintf(g->which + used, g->size - used, "%sstep %lld", comma, (long long)first);
    } else {
        snprintf(g->which + used, g->size - used, "%ssteps %lld to %lld", comma, (long long)first,
                 (long long)(first + n - 1));
    }
}

static int64_t stored_count(gonio_session *session) {
    char *text = NULL;
    int64_t count = -1;
    if (gonio_session_get(session, "steps", &text, NULL) == GONIO_OK) {
        count = strtoll(text, NULL, 10);
    }
    free(text);
    return count;
}

// Earlier releases did not store how many steps there are. Of a scan the last one is the reference again, after all
// poses of the plan; 0: nothing lacks, or there is no telling.
static int64_t lacking_at_end(gonio_session *session, const gonio_step *steps, size_t n) {
    char *text = NULL;
    gonio_plan *plan = NULL;
    int64_t samples = 0, lacking = 0;
    if (gonio_session_get(session, "plan", &text, NULL) != GONIO_OK || strcmp(text, "burst") == 0) {
        free(text);
        return 0;
    }
    for (size_t i = 0; i < n; i++) {
        samples += steps[i].kind == GONIO_STEP_SAMPLE;
    }
    lacking = n == 0 || samples == 0 || steps[n - 1].kind != GONIO_STEP_REFERENCE;
    // A plan that is a formula has as many poses as ever; a file may have changed.
    if ((strncmp(text, "nusselt:", 8) == 0 || strncmp(text, "uniform:", 8) == 0) &&
        gonio_plan_make(text, 1, &plan, NULL) == GONIO_OK && lacking > 0 && (int64_t)plan->n > samples) {
        lacking = (int64_t)plan->n - samples + 1;
    }
    gonio_plan_free(plan);
    free(text);
    return lacking;
}

gonio_status gonio_session_missing_steps(gonio_session *session, int64_t *missing, char *which, size_t size,
                                         gonio_error *error) {
    gonio_step *steps;
    size_t n;
    gaps g = {0, which, size};
    which[0] = 0;
    *missing = 0;
    const gonio_status status = gonio_session_steps(session, &steps, &n, error);
    if (status != GONIO_OK) {
        return status;
    }
    int64_t next = 0;
    for (size_t i = 0; i < n; i++) {
        add(&g, next, steps[i].index - next);
        next = steps[i].index + 1;
    }
    const int64_t count = stored_count(session);
    add(&g, next, count >= 0 ? count - next : lacking_at_end(session, steps, n));
    free(steps);
    *missing = g.missing;
    return GONIO_OK;
}

gonio_status gonio_session_check_steps(gonio_session *session, gonio_error *error) {
    int64_t missing;
    char which[200];
    const gonio_status status = gonio_session_missing_steps(session, &missing, which, sizeof which, error);
    return status == GONIO_OK && missing != 0
               ? gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1,
                                 "the journal has lost %s of the plan, so the session cannot be finished; `gonio "
                                 "samples` and `gonio fit` read what is there",
                                 which)
               : status;
}

// ---- finished? ----

// *expected is freed.
static bool is_hash(const char *hash, char *expected) {
    const bool equal = expected != NULL && strcmp(hash, expected) == 0;
    free(expected);
    return equal;
}

static gonio_status check_samples(gonio_session *session, bool *good, gonio_error *error) {
    gonio_samples *samples = NULL;
    char *expected = NULL;
    bool final = false;
    const gonio_status status = gonio_session_final_samples(session, &samples, &final, error);
    gonio_session_get(session, "result.samples_sha256", &expected, NULL);
    *good = status == GONIO_OK && final && expected != NULL && gonio_sha256_samples_is(samples, expected);
    gonio_samples_free(samples);
    free(expected);
    return status;
}

static bool model_stands(gonio_session *session) {
    char *path = NULL, *expected = NULL, hash[GONIO_SHA256_HEX] = "";
    if (gonio_session_model_path(session, &path, NULL) == GONIO_OK) {
        gonio_sha256_file(path, hash, NULL);
    }
    free(path);
    gonio_session_get(session, "result.model_sha256", &expected, NULL);
    return is_hash(hash, expected);
}

gonio_status gonio_session_finished(gonio_session *session, bool *finished, gonio_error *error) {
    gonio_step *steps;
    size_t n;
    *finished = false;
    gonio_status status = gonio_session_steps(session, &steps, &n, error);
    if (status != GONIO_OK) {
        return status;
    }
    bool all = n > 0;
    for (size_t i = 0; i < n; i++) {
        all = all && steps[i].done && !steps[i].flagged;
    }
    free(steps);
    if (!all || !model_stands(session)) {
        return GONIO_OK;
    }
    return check_samples(session, finished, error);
}
