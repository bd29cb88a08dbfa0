// SPDX-License-Identifier: BSD-3-Clause
// Did the camera or the sample move between the scan's start and its end?
#include <stdio.h>

#include "host/acquire/acquire.h"

static gonio_status read_check(gonio_session *session, const gonio_step *step, gonio_exposure **exposures, int *n,
                               gonio_error *error) {
    const gonio_status status = gonio_session_exposures(session, step->index, exposures, n, error);
    return status != GONIO_OK || *n > 0
               ? status
               : gonio_fail(error, GONIO_E_INPUT, "step %lld has no frame", (long long)step->index);
}

static gonio_status compare(const gonio_exposure *first, const gonio_exposure *last, gonio_motion *motion,
                            gonio_error *error) {
    const gonio_window *a = &first->frame.window, *b = &last->frame.window;
    const gonio_image from = {a->width, a->height, 1, 16, first->frame.pixels};
    const gonio_image to = {b->width, b->height, 1, 16, last->frame.pixels};
    return gonio_motion_between(&from, &to, motion, error);
}

gonio_status gonio_process_motion(gonio_session *session, const gonio_process *process, gonio_motion *motion,
                                  char text[256], gonio_error *error) {
    const gonio_step *first = NULL, *last = NULL;
    gonio_exposure *begun = NULL, *ended = NULL;
    int n_begun = 0, n_ended = 0;
    *motion = (gonio_motion){.known = false};
    text[0] = '\0';
    for (size_t i = 0; i < process->n; i++) {
        if (process->steps[i].kind == GONIO_STEP_CHECK && process->steps[i].done) {
            first = first == NULL ? &process->steps[i] : first;
            last = &process->steps[i];
        }
    }
    if (first == last) {
        return GONIO_OK;
    }
    gonio_status status = read_check(session, first, &begun, &n_begun, error);
    status = status == GONIO_OK ? read_check(session, last, &ended, &n_ended, error) : status;
    status = status == GONIO_OK ? compare(&begun[n_begun - 1], &ended[n_ended - 1], motion, error) : status;
    if (status == GONIO_OK && motion->moved) {
        snprintf(text, 256,
                 "camera or sample moved: step %lld frame %d lies (%.2f, %.2f) px from step %lld frame %d "
                 "(correlation %.2f)",
                 (long long)last->index, ended[n_ended - 1].frame.stamp.frame, motion->shift_px[0], motion->shift_px[1],
                 (long long)first->index, begun[n_begun - 1].frame.stamp.frame, motion->correlation);
    }
    gonio_exposures_free(begun, n_begun);
    gonio_exposures_free(ended, n_ended);
    return status;
}
