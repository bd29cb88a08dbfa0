// SPDX-License-Identifier: BSD-3-Clause
// What was chosen, in words, and its neighbours: the next better and the next cheaper one.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/statistics.h"
#include "fit/auto/choose.h"

static int neighbour(const gonio_auto_choice *choice, bool cheaper) {
    const gonio_auto_trial *chosen = &choice->trials[choice->chosen];
    int best = -1;
    for (int t = 0; t < choice->trials_n; t++) {
        const gonio_auto_trial *trial = &choice->trials[t];
        const bool candidate =
            cheaper ? trial->bytes < chosen->bytes : trial->score.score < chosen->score.score && t != choice->chosen;
        if (candidate && (best < 0 || trial->score.score < choice->trials[best].score.score)) {
            best = t;
        }
    }
    return best;
}

static void describe_trial(const gonio_auto_choice *choice, int index, const char *label, char *text, size_t size) {
    const size_t used = strlen(text);
    if (index < 0) {
        snprintf(text + used, size - used, "; %s: none was found", label);
        return;
    }
    const gonio_auto_trial *t = &choice->trials[index];
    const double change = 100 * (exp(t->score.score / 1.5 - choice->trials[choice->chosen].score.score / 1.5) - 1);
    snprintf(text + used, size - used, "; %s: %s level %d base %s (error %+.0f %%, %zu kB)", label,
             gonio_coordinates_name(t->form.coordinates), t->form.level,
             gonio_lobe_base_name(&choice->bases[t->base].lobes), change, (t->bytes + 512) / 1024);
}

// What the limits allowed, where they were not met.
static void describe_limits(const gonio_auto_choice *choice, const gonio_fit_options *o, char *text, size_t size) {
    const gonio_auto_trial *t = &choice->trials[choice->chosen];
    size_t used = strlen(text);
    if (t->ns > 0) {
        snprintf(text + used, size - used, "; an evaluation takes %.0f ns%s", t->ns,
                 t->ns > o->max_ns ? ", above the limit: nothing faster was found" : "");
        used = strlen(text);
    }
    if (o->max_bytes > 0 && t->bytes > o->max_bytes) {
        snprintf(text + used, size - used, "; %zu bytes, above the limit: nothing smaller was found", t->bytes);
        used = strlen(text);
    }
    if (o->max_error > 0) {
        snprintf(text + used, size - used, "; leave-one-out rmse %.3g%s", t->score.rmse,
                 t->score.rmse > o->max_error ? ", above the limit: nothing better was found" : "");
    }
}

void gonio_auto_describe(const gonio_auto_choice *choice, const gonio_fit_options *options, gonio_fit_report *report) {
    const gonio_auto_trial *t = &choice->trials[choice->chosen];
    double lambdas[GONIO_CHANNELS_MAX];
    memcpy(lambdas, choice->lambdas, (size_t)report->channels * sizeof *lambdas);
    snprintf(report->options, sizeof report->options,
             "base=%s lambda=%.2g stiffness=%g:%g:%g profile=%g reciprocity=%g",
             gonio_lobe_base_name(&choice->bases[t->base].lobes), gonio_upper_median(lambdas, (size_t)report->channels),
             t->form.stretch[0], t->form.stretch[1], t->form.stretch[2], t->form.profile, t->form.reciprocity);
    snprintf(report->note, sizeof report->note, "chosen by leave-one-out among %d", choice->trials_n);
    describe_limits(choice, options, report->note, sizeof report->note);
    describe_trial(choice, neighbour(choice, false), "next better", report->note, sizeof report->note);
    describe_trial(choice, neighbour(choice, true), "next cheaper", report->note, sizeof report->note);
}
