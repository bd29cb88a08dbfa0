// SPDX-License-Identifier: BSD-3-Clause
// From the session's frames to samples; a replay and a resume run this on what is stored.
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "host/acquire/acquire.h"

static gonio_status new_calib(gonio_process *process, gonio_error *error) {
    gonio_calib_free(process->calib);
    process->calib = NULL;
    const gonio_setup *s = &process->setup;
    return gonio_calib_new(&s->camera, &s->facts, &s->window, &process->calib, error);
}

gonio_status gonio_process_begin(gonio_session *session, gonio_process *process, gonio_error *error) {
    *process = (gonio_process){.isotropic = true};
    gonio_status status = gonio_setup_get(session, &process->setup, error);
    status = status == GONIO_OK ? gonio_session_check_steps(session, error) : status;
    status = status == GONIO_OK ? gonio_session_steps(session, &process->steps, &process->n, error) : status;
    if (status == GONIO_OK) {
        status = gonio_calib_new(&process->setup.camera, &process->setup.facts, &process->setup.window, &process->calib,
                                 error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_step *steps = process->steps;
    while (process->first_sample < process->n && steps[process->first_sample].kind != GONIO_STEP_SAMPLE) {
        process->first_sample++;
    }
    for (size_t i = process->first_sample; i < process->n; i++) {
        const gonio_pair tilts = {fabs(steps[i].pose.theta_i), 0, fabs(steps[i].pose.theta_o), 0};
        process->transmission |= steps[i].kind == GONIO_STEP_SAMPLE && gonio_pair_half(tilts) != GONIO_REFLECTION;
    }
    for (size_t i = process->first_sample; i < process->n && !process->setup.facts.sphere; i++) {
        process->isotropic &=
            steps[i].kind != GONIO_STEP_SAMPLE || steps[i].pose.phi_i == steps[process->first_sample].pose.phi_i;
    }
    return GONIO_OK;
}

void gonio_process_end(gonio_process *process) {
    gonio_calib_free(process->calib);
    free(process->steps);
    *process = (gonio_process){0};
}

static gonio_status calibrate(gonio_process *process, const gonio_step *step, const gonio_exposure *exposures, int n,
                              gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < n && step->kind != GONIO_STEP_CHECK; i++) {
        status = step->kind == GONIO_STEP_DARK ? gonio_calib_add_dark(process->calib, &exposures[i], error)
                 : step->kind == GONIO_STEP_TRAP
                     ? gonio_calib_add_trap(process->calib, &exposures[i], error)
                     : gonio_calib_add_reference(process->calib, &step->pose, &exposures[i], error);
    }
    return status;
}

static gonio_status calibrate_stored(gonio_session *session, gonio_process *process, const gonio_step *step,
                                     gonio_error *error) {
    gonio_exposure *exposures;
    int n;
    gonio_status status = gonio_session_exposures(session, step->index, &exposures, &n, error);
    status = status == GONIO_OK ? calibrate(process, step, exposures, n, error) : status;
    gonio_exposures_free(exposures, n);
    return status;
}

gonio_status gonio_process_prepare(gonio_session *session, gonio_process *process, const gonio_step *fresh,
                                   const gonio_exposure *exposures, int n, bool *ready, gonio_error *error) {
    *ready = false;
    gonio_status status = new_calib(process, error);
    for (size_t i = 0; status == GONIO_OK && i < process->first_sample; i++) {
        const gonio_step *step = &process->steps[i];
        if (step->kind == GONIO_STEP_CHECK) {
            continue; // the calibration does not wait for it
        }
        if (step == fresh) {
            status = calibrate(process, step, exposures, n, error);
        } else if (step->done) {
            status = calibrate_stored(session, process, step, error);
        } else {
            return GONIO_OK;
        }
    }
    status = status == GONIO_OK ? gonio_calib_prepare(process->calib, error) : status;
    *ready = status == GONIO_OK;
    return status;
}

gonio_status gonio_process_late_references(gonio_session *session, gonio_process *process, bool *any,
                                           gonio_error *error) {
    *any = false;
    gonio_status status = GONIO_OK;
    for (size_t i = process->first_sample; status == GONIO_OK && i < process->n; i++) {
        if (process->steps[i].kind == GONIO_STEP_REFERENCE && process->steps[i].done) {
            status = calibrate_stored(session, process, &process->steps[i], error);
            *any = true;
        }
    }
    return status;
}

gonio_status gonio_process_new_samples(const gonio_process *process, gonio_samples **out, gonio_error *error) {
    const int channels = gonio_calib_channels(process->calib);
    const gonio_status status = gonio_samples_new(channels, true, out, error);
    if (status == GONIO_OK) {
        (*out)->isotropic = process->isotropic;
        (*out)->transmission = process->transmission;
        memcpy((*out)->channel_names, gonio_calib_channel_names(process->calib),
               (size_t)channels * sizeof *(*out)->channel_names);
    }
    return status;
}

static gonio_status probe(const gonio_process *process, const gonio_exposure *exposures, int n,
                          gonio_step_radiance *radiance, gonio_error *error) {
    double values[GONIO_PROBES_MAX];
    size_t count;
    gonio_status status = gonio_calib_probe(process->calib, n, exposures, values, &count, radiance->mean, error);
    status = status == GONIO_OK ? gonio_sha256(values, count * sizeof *values, radiance->sha256, error) : status;
    radiance->channels = status == GONIO_OK ? gonio_calib_channels(process->calib) : 0;
    return status;
}

gonio_status gonio_process_pose(const gonio_process *process, const gonio_step *step, const gonio_exposure *exposures,
                                int n, gonio_samples **out, gonio_step_radiance *radiance, char why[512],
                                gonio_error *error) {
    why[0] = 0;
    *radiance = (gonio_step_radiance){0};
    gonio_status status = gonio_process_new_samples(process, out, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_error own = {.line = -1, .byte = -1};
    status = gonio_calib_pose(process->calib, &step->pose, n, exposures, *out, &own);
    if (status == GONIO_E_RANGE) {
        snprintf(why, 512, "%s", own.message);
        return GONIO_OK;
    }
    status = status == GONIO_OK ? probe(process, exposures, n, radiance, &own) : status;
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
        if (error != NULL) {
            *error = own;
        }
    }
    return status;
}

static gonio_status process_step(gonio_session *session, const gonio_process *process, const gonio_step *step,
                                 bool only_missing, gonio_samples **out, gonio_step_radiance *radiance,
                                 gonio_error *error) {
    if (only_missing) {
        gonio_samples *known = NULL;
        gonio_error ignored;
        const gonio_status status = gonio_session_step_samples(session, step->index, &known, &ignored);
        gonio_samples_free(known);
        if (status == GONIO_OK && known != NULL) {
            return GONIO_OK;
        }
    }
    gonio_exposure *exposures;
    int n;
    char why[512];
    gonio_status status = gonio_session_exposures(session, step->index, &exposures, &n, error);
    status = status == GONIO_OK ? gonio_process_pose(process, step, exposures, n, out, radiance, why, error) : status;
    gonio_exposures_free(exposures, n);
    return status;
}

void gonio_sets_free(gonio_samples **sets, size_t n) {
    for (size_t i = 0; sets != NULL && i < n; i++) {
        gonio_samples_free(sets[i]);
    }
    free(sets);
}

typedef struct many {
    gonio_session *session;
    const gonio_process *process;
    bool only_missing;
    gonio_samples **sets;
    gonio_step_radiance *radiance;
    gonio_progress_fn progress;
    void *context;
    pthread_t caller; // the thread that progress is told by
    atomic_size_t done;
} many;

static gonio_status do_one(void *context, size_t i, gonio_error *error) {
    many *m = context;
    const gonio_step *step = &m->process->steps[i];
    gonio_status status = GONIO_OK;
    if (step->kind == GONIO_STEP_SAMPLE && step->done) {
        status = process_step(m->session, m->process, step, m->only_missing, &m->sets[i], &m->radiance[i], error);
    }
    const size_t done = ++m->done;
    if (status == GONIO_OK && m->progress != NULL && pthread_equal(pthread_self(), m->caller) &&
        !m->progress(m->context, (double)done / (double)m->process->n, "frames", 0)) {
        status = gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted");
    }
    return status;
}

gonio_status gonio_process_samples(gonio_session *session, const gonio_process *process, bool only_missing, int threads,
                                   gonio_progress_fn progress, void *context, gonio_samples ***out,
                                   gonio_step_radiance **radiance, gonio_error *error) {
    *out = NULL;
    *radiance = NULL;
    many m = {session, process, only_missing, NULL, NULL, progress, context, pthread_self(), 0};
    m.sets = calloc(process->n + 1, sizeof(gonio_samples *));
    m.radiance = calloc(process->n + 1, sizeof *m.radiance);
    if (m.sets == NULL || m.radiance == NULL) {
        free(m.sets);
        free(m.radiance);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu sample sets", process->n);
    }
    const gonio_status status = gonio_pool_try(threads, process->n, do_one, &m, error);
    if (status != GONIO_OK) {
        gonio_sets_free(m.sets, process->n);
        free(m.radiance);
        return status;
    }
    *out = m.sets;
    *radiance = m.radiance;
    return GONIO_OK;
}
