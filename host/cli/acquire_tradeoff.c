// SPDX-License-Identifier: BSD-3-Clause
// Each row is a whole measure into a session that is thrown away: what a lab would do, but with a sample whose BRDF is
// known.
#include "host/cli/acquire_tradeoff.h"

#include <ftw.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/number.h"
#include "base/text.h"
#include "gonio/acquire.h"
#include "gonio/io.h"
#include "gonio/sim.h"

#define DIRECTIONS 5000
#define LIST_MAX 32

// ---- lists ----

static gonio_status read_numbers(const char *name, const char *text, double low, double high, double *values, size_t *n,
                                 gonio_error *error) {
    *n = 0;
    for (const char *at = text;; at++) {
        char *end;
        const double value = gonio_number_parse(at, &end);
        if (end == at || (*end != ',' && *end != 0) || !(value >= low && value <= high) || *n == LIST_MAX) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "tradeoff: --%s '%.80s', character %zu: expected up to %d numbers from %g to %g with "
                              "commas between them",
                              name, text, (size_t)(at - text) + 1, LIST_MAX, low, high);
        }
        values[(*n)++] = value;
        at = end;
        if (*at == 0) {
            return GONIO_OK;
        }
    }
}

static const char *const kinds[] = {"uniform", "nusselt", "adaptive", "scene", "prior"};
#define KINDS (sizeof kinds / sizeof *kinds)

static gonio_status read_plans(const cli_acquire_request *r, bool wanted[KINDS], gonio_error *error) {
    const char *text = r->plans;
    wanted[0] = wanted[1] = wanted[2] = text == NULL;
    wanted[3] = text == NULL && r->needs != NULL;
    wanted[4] = text == NULL && r->prior != NULL;
    for (const char *at = text; at != NULL; at = strchr(at, ',') != NULL ? strchr(at, ',') + 1 : NULL) {
        const size_t length = strcspn(at, ",");
        size_t k = 0;
        while (k < KINDS && (strlen(kinds[k]) != length || strncmp(at, kinds[k], length) != 0)) {
            k++;
        }
        if (k == KINDS) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "tradeoff: --plans '%.80s', character %zu: expected uniform, nusselt, adaptive, scene or "
                              "prior",
                              text, (size_t)(at - text) + 1);
        }
        wanted[k] = true;
    }
    if ((wanted[3] && r->needs == NULL) || (wanted[4] && r->prior == NULL)) {
        return gonio_fail(error, GONIO_E_USAGE, "tradeoff: a %s",
                          wanted[3] && r->needs == NULL ? "scene's plan needs --scene NEEDS"
                                                        : "prior's plan needs --prior PRIOR");
    }
    return GONIO_OK;
}

// The grid that has most poses of those that have no more than asked for.
static gonio_status uniform_plan(size_t poses, bool anisotropic, char *text, size_t size, gonio_error *error) {
    double low = 0.5, high = 90; // steps: the former has too many
    for (int k = 0; k < 24; k++) {
        const double step = 0.5 * (low + high);
        gonio_plan *plan;
        snprintf(text, size, "uniform:%.4f,anisotropic=%d", step, anisotropic);
        const gonio_status status = gonio_plan_make(text, 1, &plan, error);
        if (status != GONIO_OK) {
            return status;
        }
        *(plan->n > poses ? &low : &high) = step;
        gonio_plan_free(plan);
    }
    snprintf(text, size, "uniform:%.4f,anisotropic=%d", high, anisotropic);
    return GONIO_OK;
}

static gonio_status plan_of(const cli_acquire_request *r, size_t kind, size_t poses, bool anisotropic,
                            cli_acquire_row *row, gonio_error *error) {
    snprintf(row->kind, sizeof row->kind, "%s", kinds[kind]);
    const char *file = kind == 3 ? r->needs : r->prior;
    if (kind == 0) {
        return uniform_plan(poses, anisotropic, row->plan, sizeof row->plan, error);
    }
    if (kind < 3) {
        snprintf(row->plan, sizeof row->plan, "%s:%zu%s", kinds[kind], poses, anisotropic ? ",anisotropic=1" : "");
        return GONIO_OK;
    }
    return snprintf(row->plan, sizeof row->plan, "%s:%s,N=%zu", kinds[kind], file, poses) < (int)sizeof row->plan
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE, "the path '%.80s...' is too long", file);
}

// ---- one measure ----

static int remove_entry(const char *path, const struct stat *info, int kind, struct FTW *where) {
    (void)info, (void)kind, (void)where;
    return remove(path);
}

static gonio_status temporary_folder(char path[64], gonio_error *error) {
    const char *folder = getenv("TMPDIR");
    snprintf(path, 64, "%s/gonio-tradeoff-XXXXXX", folder != NULL && strlen(folder) < 32 ? folder : "/tmp");
    return mkdtemp(path) != NULL ? GONIO_OK
                                 : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot make a temporary folder");
}

static bool go_on(void *context, const gonio_measure_progress *now) {
    (void)context, (void)now;
    return !cli_interrupted();
}

static void count_time(gonio_session *session, cli_acquire_row *row) {
    gonio_step *steps = NULL;
    size_t n = 0, first = 0, last = 0;
    if (gonio_session_steps(session, &steps, &n, NULL) != GONIO_OK || n == 0) {
        return;
    }
    for (size_t i = 0; i < n; i++) {
        if (steps[i].kind == GONIO_STEP_SAMPLE) {
            first = first == 0 ? i : first;
            last = i;
        }
    }
    row->rig_min = steps[n - 1].clock_end_s / 60;
    row->poses_min = first > 0 ? (steps[last].clock_end_s - steps[first - 1].clock_end_s) / 60 : row->rig_min;
    free(steps);
}

static gonio_status measure(const cli_acquire_request *r, const gonio_samples *truth, const char *path, cli_rig *rig,
                            cli_acquire_row *row, gonio_error *error) {
    gonio_measure_options options;
    gonio_session *session = NULL;
    gonio_outcome outcome = {0};
    gonio_measure_options_default(&options);
    options.plan = row->plan;
    options.seed = r->rig.seed;
    options.fit.seed = r->rig.seed;
    options.fit.hold_out = 0;
    if (strcmp(row->kind, "prior") == 0) {
        snprintf(options.fit.prior, sizeof options.fit.prior, "%s", r->prior);
    }
    options.threads = r->threads;
    options.hooks.progress = go_on;
    rig->scan.unsynced = true;
    gonio_status status = gonio_measure_begin(path, rig, &options, &session, error);
    status = status == GONIO_OK ? gonio_measure_run(session, rig, &options, &outcome, error) : status;
    if (status == GONIO_OK) {
        row->poses = outcome.poses;
        row->frames = outcome.frames;
        row->choosing_s = outcome.adaptive.choosing_s;
        count_time(session, row);
        status = gonio_errors_model(outcome.model, truth, NULL, r->threads, &row->errors, error);
    }
    gonio_outcome_free(&outcome);
    gonio_session_close(session);
    return status;
}

static gonio_status measure_row(const cli_acquire_request *r, const gonio_samples *truth, cli_acquire_row *row,
                                gonio_error *error) {
    char folder[64], session[80], exposure[64], aperture[64];
    cli_rig_options options = r->rig;
    cli_rig rig = {0};
    gonio_status status = temporary_folder(folder, error);
    if (status != GONIO_OK) {
        return status;
    }
    snprintf(session, sizeof session, "%s/session", folder);
    snprintf(exposure, sizeof exposure, "scan.exposure_max_s=%.9g", row->exposure_s);
    snprintf(aperture, sizeof aperture, "rig.aperture_radius_mm=%.9g", row->aperture_mm);
    if (row->exposure_s > 0) {
        options.set.items[options.set.n++] = exposure;
    }
    if (row->aperture_mm >= 0) {
        options.set.items[options.set.n++] = aperture;
    }
    status = cli_rig_open(&options, &rig, error);
    status = status == GONIO_OK ? measure(r, truth, session, &rig, row, error) : status;
    cli_rig_close(&rig);
    nftw(folder, remove_entry, 16, FTW_DEPTH | FTW_PHYS);
    return status;
}

// ---- all ----

// The sample's BRDF where nobody measured: what the errors are of.
static gonio_status read_truth(const cli_acquire_request *r, gonio_samples **out, bool *anisotropic,
                               gonio_error *error) {
    gonio_sim *sim;
    gonio_plan *plan = NULL;
    char text[64];
    gonio_status status = gonio_sim_new(r->sample, 1, &sim, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_model *truth = gonio_sim_truth(sim);
    *anisotropic = !truth->isotropic;
    snprintf(text, sizeof text, "nusselt:%d,anisotropic=%d", DIRECTIONS, *anisotropic);
    status = gonio_plan_make(text, 20011, &plan, error);
    status = status == GONIO_OK ? gonio_samples_of_model(truth, plan->poses, plan->n, r->threads, out, error) : status;
    gonio_plan_free(plan);
    gonio_sim_free(sim);
    return status;
}

static void tell(const cli_acquire_row *row) {
    if (row->status == GONIO_OK) {
        fprintf(stderr, "%-28.28s %5zu poses %7.2f min  median_rel %.4g  rms_log %.4g\n", cli_text(row->plan),
                row->poses, row->rig_min, row->errors.median_rel, row->errors.rms_log);
    } else {
        fprintf(stderr, "%-28.28s failed: %s\n", cli_text(row->plan), cli_text(row->error.message));
    }
}

static gonio_status lay_out(const cli_acquire_request *r, bool anisotropic, cli_acquire_row **rows, size_t *n,
                            gonio_error *error) {
    double poses[LIST_MAX], exposures[LIST_MAX] = {0}, apertures[LIST_MAX] = {-1};
    size_t poses_n, exposures_n = 1, apertures_n = 1;
    bool wanted[KINDS] = {false};
    gonio_status status = read_numbers("poses", r->poses, 8, 20000, poses, &poses_n, error);
    if (status == GONIO_OK && r->exposures != NULL) {
        status = read_numbers("exposures", r->exposures, 1e-6, 1e4, exposures, &exposures_n, error);
    }
    if (status == GONIO_OK && r->apertures != NULL) {
        status = read_numbers("apertures", r->apertures, 0, 1e3, apertures, &apertures_n, error);
    }
    status = status == GONIO_OK ? read_plans(r, wanted, error) : status;
    *rows = status == GONIO_OK ? calloc(KINDS * poses_n * exposures_n * apertures_n, sizeof **rows) : NULL;
    if (status == GONIO_OK && *rows == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the rows");
    }
    for (size_t k = 0; k < KINDS * poses_n * exposures_n * apertures_n && status == GONIO_OK; k++) {
        const size_t kind = k % KINDS, p = k / KINDS % poses_n, e = k / KINDS / poses_n % exposures_n;
        if (wanted[kind]) {
            cli_acquire_row *row = &(*rows)[(*n)++];
            row->exposure_s = exposures[e];
            row->aperture_mm = apertures[k / KINDS / poses_n / exposures_n];
            status = plan_of(r, kind, (size_t)poses[p], anisotropic, row, error);
        }
    }
    return status;
}

gonio_status cli_acquire_run(const cli_acquire_request *r, cli_acquire_row **rows, size_t *n, gonio_error *error) {
    gonio_samples *truth = NULL;
    bool anisotropic = false;
    *rows = NULL;
    *n = 0;
    if (r->rig.set.n + 2 > (int)(sizeof r->rig.set.items / sizeof *r->rig.set.items)) {
        return gonio_fail(error, GONIO_E_USAGE, "tradeoff: too many --set");
    }
    gonio_status status = read_truth(r, &truth, &anisotropic, error);
    status = status == GONIO_OK ? lay_out(r, anisotropic, rows, n, error) : status;
    for (size_t i = 0; i < *n && status == GONIO_OK; i++) {
        cli_acquire_row *row = &(*rows)[i];
        row->error = (gonio_error){.line = -1, .byte = -1};
        row->status = measure_row(r, truth, row, &row->error);
        if (cli_interrupted()) {
            status = gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; nothing was written");
        }
        tell(row);
    }
    gonio_samples_free(truth);
    return status;
}
