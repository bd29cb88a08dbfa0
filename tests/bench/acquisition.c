// SPDX-License-Identifier: BSD-3-Clause
// The main job through the library, stored as users get it: the default simulated rig measures
// ward:rho_d=0.3,rho_s=0.2,alpha=0.15 with nusselt:1400 into a session.
//
// Accuracy: samples against the truth for theta <= 75 deg, the fitted model at 20,000 directions that it never saw,
// both again where the specular term exceeds 10 % of the diffuse one. Speed: poses a second, storing a step against
// writing and syncing the same bytes plainly, and computing the samples again from the stored frames.
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "gonio/sim.h"
#include "host/acquire/acquire.h"

#define SPEC "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"
#define DIFFUSE (0.3 / GONIO_PI)

static gonio_error error;

static void must(gonio_status status) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s: %s\n", gonio_status_text(status), error.message);
        exit(1);
    }
}

static int by_value(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print_errors(const char *label, double *errors, size_t n) {
    qsort(errors, n, sizeof *errors, by_value);
    printf("%-44s %6zu  median %.3f %%  95th percentile %.3f %%\n", label, n, n > 0 ? 100 * errors[n / 2] : NAN,
           n > 0 ? 100 * errors[(size_t)(0.95 * (double)n)] : NAN);
}

// found[i] against the truth at pairs[i], theta <= 75 deg.
static void compare(const char *label, const gonio_model *truth, const gonio_pair *pairs, const double *found,
                    size_t n) {
    double *all = malloc((n + 1) * sizeof *all), *lobe = malloc((n + 1) * sizeof *lobe);
    size_t in_all = 0, in_lobe = 0;
    const double limit = gonio_radians(75);
    for (size_t i = 0; i < n; i++) {
        double f;
        if (pairs[i].theta_i > limit || pairs[i].theta_o > limit) {
            continue;
        }
        gonio_model_eval_pair(truth, &pairs[i], &f);
        all[in_all++] = fabs(found[i] - f) / f;
        if (f - DIFFUSE > 0.1 * DIFFUSE) {
            lobe[in_lobe++] = fabs(found[i] - f) / f;
        }
    }
    print_errors(label, all, in_all);
    print_errors("  where specular > 10 % of diffuse", lobe, in_lobe);
    free(all);
    free(lobe);
}

static gonio_session *begin(const char *path, const gonio_rig *rig, const gonio_plan *plan) {
    gonio_session *session;
    gonio_setup setup = {0};
    gonio_scan_options options;
    gonio_step *steps;
    size_t n;
    gonio_scan_options_default(&options);
    gonio_fit_options_default(&setup.fit);
    setup.fit.hold_out = 0.2;
    must(gonio_session_create(path, &session, &error));
    must(gonio_setup_of_rig(rig, &options, &setup, &error));
    must(gonio_scan_steps(rig, &options, plan, &steps, &n, &error));
    must(gonio_session_begin(session, &error));
    must(gonio_setup_put(session, &setup, &error));
    must(gonio_session_put_steps(session, steps, n, &error));
    must(gonio_session_commit(session, &error));
    free(steps);
    return session;
}

static double measure(gonio_session *session, const gonio_rig *rig) {
    const gonio_scan_hooks hooks = {0};
    gonio_scan *scan;
    const gonio_samples *samples;
    const double start = gonio_clock_s();
    must(gonio_scan_new(session, rig, &hooks, &scan, &error));
    while (!gonio_scan_done(scan)) {
        must(gonio_scan_step(scan, &samples, &error));
    }
    gonio_scan_free(scan);
    return gonio_clock_s() - start;
}

// The same bytes as a stored step's files, without any format: written, synced, renamed, the folder synced.
static double write_plainly(const char *root, const gonio_exposure *exposures, int n) {
    char path[160], final[160];
    const double start = gonio_clock_s();
    for (int i = 0; i < n; i++) {
        const size_t size = 2 * (size_t)exposures[i].frame.window.width * (size_t)exposures[i].frame.window.height;
        snprintf(path, sizeof path, "%s/plain.new", root);
        snprintf(final, sizeof final, "%s/plain-%d", root, i);
        const int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0666);
        if (fd < 0 || write(fd, exposures[i].frame.pixels, size) != (ssize_t)size || fsync(fd) != 0 || close(fd) != 0 ||
            rename(path, final) != 0) {
            fprintf(stderr, "cannot write %s\n", path);
            exit(1);
        }
    }
    const int folder = open(root, O_RDONLY | O_DIRECTORY);
    fsync(folder);
    close(folder);
    return gonio_clock_s() - start;
}

static void storing(const char *root, gonio_session *session, const gonio_rig *rig, const gonio_plan *plan) {
    char path[128];
    snprintf(path, sizeof path, "%s/again", root);
    gonio_session *again = begin(path, rig, plan);
    gonio_step *steps;
    size_t n;
    double stored_s = 0, plain_s = 0;
    int count = 0, frames = 0;
    must(gonio_session_steps(session, &steps, &n, &error));
    for (size_t i = 2; i < n && count < 200; i++, count++) {
        gonio_exposure *exposures;
        gonio_samples *samples;
        int got;
        must(gonio_session_exposures(session, (int64_t)i, &exposures, &got, &error));
        must(gonio_session_step_samples(session, (int64_t)i, &samples, &error));
        const double start = gonio_clock_s();
        must(gonio_session_finish_step(again, &steps[i], exposures, got, samples, &error));
        stored_s += gonio_clock_s() - start;
        plain_s += write_plainly(root, exposures, got);
        frames += got;
        gonio_samples_free(samples);
        gonio_exposures_free(exposures, got);
    }
    printf("storing a step of %.1f frames: %.2f ms; writing and syncing its pixels plainly %.2f ms; ratio %.2f\n",
           (double)frames / count, 1e3 * stored_s / count, 1e3 * plain_s / count, stored_s / plain_s);
    free(steps);
    gonio_session_close(again);
}

static double finish(gonio_session *session, const char *model_path, gonio_outcome *outcome) {
    gonio_process process;
    gonio_samples **sets;
    gonio_step_radiance *radiance;
    bool ready;
    const double start = gonio_clock_s();
    must(gonio_process_begin(session, &process, &error));
    must(gonio_process_prepare(session, &process, NULL, NULL, 0, &ready, &error));
    must(gonio_process_samples(session, &process, false, 0, NULL, NULL, &sets, &radiance, &error));
    free(radiance);
    const double frames_s = gonio_clock_s() - start;
    const gonio_finish_options options = {.sets = sets, .model_path = model_path};
    must(gonio_finish(session, &process, &options, outcome, &error));
    gonio_sets_free(sets, process.n);
    gonio_process_end(&process);
    return frames_s;
}

int main(void) {
    char root[] = "/tmp/gonio-bench-XXXXXX", path[64], model_path[64], command[64];
    gonio_sim *sim;
    gonio_rig rig;
    gonio_plan *plan, *unseen;
    if (mkdtemp(root) == NULL) {
        return 1;
    }
    snprintf(path, sizeof path, "%s/session", root);
    snprintf(model_path, sizeof model_path, "%s/model", root);
    must(gonio_sim_new(SPEC, 1, &sim, &error));
    must(gonio_sim_open(sim, 0, &rig, &error));
    must(gonio_plan_make("nusselt:1400", 1, &plan, &error));
    must(gonio_plan_make("nusselt:20000,theta_max=75", 2, &unseen, &error));
    gonio_session *session = begin(path, &rig, plan);
    const double scan_s = measure(session, &rig);
    gonio_outcome outcome;
    const double again_s = finish(session, model_path, &outcome);
    printf("%zu poses, %zu frames: measured in %.1f s (%.0f poses/s), samples again from the frames in %.1f s\n",
           outcome.poses, outcome.frames, scan_s, (double)outcome.poses / scan_s, again_s);
    storing(root, session, &rig, plan);
    const gonio_model *truth = gonio_sim_truth(sim);
    compare("samples, theta <= 75 deg", truth, outcome.samples->pairs, outcome.samples->values, outcome.samples->n);
    double *values = malloc(unseen->n * sizeof *values);
    for (size_t i = 0; i < unseen->n; i++) {
        gonio_model_eval_pair(outcome.model, &unseen->poses[i], &values[i]);
    }
    printf("fitted: %s, level %d, %s\n", outcome.fit.method, outcome.fit.level, outcome.fit.note);
    compare("the model at unseen directions", truth, unseen->poses, values, unseen->n);
    free(values);
    gonio_outcome_free(&outcome);
    gonio_session_close(session);
    gonio_plan_free(plan);
    gonio_plan_free(unseen);
    gonio_rig_close(&rig);
    gonio_sim_free(sim);
    snprintf(command, sizeof command, "rm -rf %s", root);
    return system(command);
}
