// SPDX-License-Identifier: BSD-3-Clause
// gonio rig burst: frames at the camera's own rate, into a session.
#include <math.h>
#include <stdlib.h>

#include "gonio/session.h"
#include "gonio/version.h"
#include "host/cli/rig/actions.h"

// Half a second of a fast camera is synced and entered at once; three seconds of it may wait for the disk.
#define GROUP 30
#define MEMORY_BYTES ((size_t)512 << 20)
#define FRAMES_MAX 1000000

typedef struct burst {
    const gonio_rig *rig;
    gonio_camera_info info;
    double exposure_s;
    int64_t frames, lost;
    double seconds;
} burst;

static gonio_status create(const char *path, const burst *b, gonio_session **session, gonio_step **steps, size_t *n,
                           gonio_error *error) {
    *n = (size_t)((b->frames + GROUP - 1) / GROUP);
    *steps = calloc(*n, sizeof **steps);
    if (*steps == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu steps", *n);
    }
    for (size_t i = 0; i < *n; i++) {
        (*steps)[i] = (gonio_step){.index = (int64_t)i, .kind = GONIO_STEP_BURST};
    }
    char bits[8];
    snprintf(bits, sizeof bits, "%d", b->info.bits);
    gonio_status status = gonio_session_create(path, session, error);
    const char *const texts[][2] = {{"gonio.version", GONIO_VERSION}, {"plan", "burst"}, {"camera.bits", bits}};
    for (size_t i = 0; status == GONIO_OK && i < sizeof texts / sizeof *texts; i++) {
        status = gonio_session_put(*session, texts[i][0], texts[i][1], error);
    }
    return status == GONIO_OK ? gonio_session_put_steps(*session, *steps, *n, error) : status;
}

static gonio_status take(burst *b, gonio_burst *storing, gonio_error *error) {
    const double patience_s = 10 + 8 * b->exposure_s;
    gonio_status status = b->rig->camera->stream(b->rig->camera_device, b->exposure_s, 0, patience_s, error);
    double first_s = NAN;
    for (int64_t i = 0; status == GONIO_OK && i < b->frames; i++) {
        gonio_frame frame;
        int64_t lost = 0;
        status = gonio_burst_room(storing, &frame, error);
        if (status == GONIO_OK) {
            const gonio_window window = frame.window;
            status = b->rig->camera->next(b->rig->camera_device, &window, patience_s, &frame, &lost, error);
        }
        if (status == GONIO_OK) {
            gonio_burst_put(storing, &frame);
            first_s = i == 0 ? frame.stamp.clock_s : first_s;
            b->seconds = frame.stamp.clock_s - first_s;
            status = cli_interrupted()
                         ? gonio_fail(error, GONIO_E_INTERRUPTED, "stopped after %lld frames", (long long)i + 1)
                         : status;
        }
        b->lost += lost;
    }
    return status;
}

static gonio_status capture_into(burst *b, gonio_session *session, const gonio_step *steps, size_t n,
                                 gonio_burst_counts *counts, gonio_error *error) {
    const gonio_burst_options options = {{0, 0, b->info.width, b->info.height}, GROUP, MEMORY_BYTES, steps, n};
    gonio_burst *storing;
    gonio_error why = {.line = -1, .byte = -1};
    gonio_status status = gonio_burst_open(session, &options, &storing, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = take(b, storing, error);
    const gonio_status closed = gonio_burst_close(storing, counts, &why);
    if (status == GONIO_OK && closed != GONIO_OK) {
        *error = why;
    }
    return status != GONIO_OK ? status : closed;
}

gonio_status rig_burst(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    burst b = {.rig = &rig->rig};
    char *end;
    b.frames = strtoll(request->arguments[0], &end, 10);
    if (*end != 0 || b.frames < 1 || b.frames > FRAMES_MAX) {
        return gonio_fail(error, GONIO_E_USAGE, "burst: found '%s', expected 1 to %d frames", request->arguments[0],
                          FRAMES_MAX);
    }
    if (rig->rig.camera->stream == NULL || rig->rig.camera->next == NULL) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "burst: a %s has no frames at a rate of its own",
                          rig->rig.camera->name);
    }
    gonio_status status = rig->rig.camera->info(rig->rig.camera_device, &b.info, error);
    if (status != GONIO_OK) {
        return status;
    }
    b.exposure_s = request->exposure_s > 0 ? request->exposure_s : b.info.exposure_min_s;
    gonio_session *session = NULL;
    gonio_step *steps = NULL;
    size_t n;
    gonio_burst_counts counts = {0};
    status = create(request->arguments[1], &b, &session, &steps, &n, error);
    if (status == GONIO_OK) {
        status = capture_into(&b, session, steps, n, &counts, error);
        *out =
            json_pack("{s:I,s:I,s:f,s:f,s:i}", "frames", (json_int_t)counts.stored, "lost", (json_int_t)b.lost,
                      "seconds", b.seconds, "frames_per_s", b.seconds > 0 ? (double)(counts.stored - 1) / b.seconds : 0,
                      "most_waiting", counts.most_waiting);
    }
    gonio_session_close(session);
    free(steps);
    return status;
}
