// SPDX-License-Identifier: BSD-3-Clause
// Frames at a camera's full rate: one thread takes them, another stores them in groups, with memory for some seconds of
// them in between, so that a disk that pauses loses none.
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "host/session/internal.h"

struct gonio_burst {
    gonio_session *session;
    gonio_step *steps;
    size_t n_steps, next;
    gonio_window window;
    int group, slots, head, filled; // frames wait in slots head .. head + filled - 1, around the ring's end
    bool ending, taken;             // taken: the slot after them is with the caller
    uint16_t *pixels;
    gonio_exposure *ring;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    gonio_status status; // of the storing thread
    gonio_error error;
    gonio_burst_counts counts;
};

static size_t frame_pixels(const gonio_burst *b) { return (size_t)b->window.width * (size_t)b->window.height; }

static gonio_status store_group(gonio_burst *b, int from, int n, gonio_error *error) {
    if (b->next == b->n_steps) {
        return gonio_fail(error, GONIO_E_RANGE, "more frames than the burst's %zu steps of %d hold", b->n_steps,
                          b->group);
    }
    gonio_step *step = &b->steps[b->next];
    gonio_exposure *group = malloc((size_t)n * sizeof *group);
    if (group == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a group of %d frames", n);
    }
    for (int i = 0; i < n; i++) {
        group[i] = b->ring[(from + i) % b->slots];
        group[i].frame.stamp.pose = step->index;
        group[i].frame.stamp.frame = i;
    }
    step->clock_end_s = group[n - 1].frame.stamp.clock_s;
    step->exposure_end_s = group[n - 1].frame.exposure_s;
    const gonio_status status = gonio_session_finish_step(b->session, step, group, n, NULL, error);
    free(group);
    b->next++;
    return status;
}

static void *store(void *opaque) {
    gonio_burst *b = opaque;
    pthread_mutex_lock(&b->lock);
    for (;;) {
        while (b->filled < b->group && !b->ending) {
            pthread_cond_wait(&b->changed, &b->lock);
        }
        const int n = b->filled < b->group ? b->filled : b->group, from = b->head;
        if (n == 0 || b->status != GONIO_OK) {
            break;
        }
        pthread_mutex_unlock(&b->lock);
        gonio_error error = {0};
        const gonio_status status = store_group(b, from, n, &error);
        pthread_mutex_lock(&b->lock);
        if (status != GONIO_OK) {
            b->status = status;
            b->error = error;
        } else {
            b->counts.stored += n;
            b->counts.groups++;
        }
        b->head = (b->head + n) % b->slots;
        b->filled -= n;
        pthread_cond_broadcast(&b->changed);
    }
    pthread_mutex_unlock(&b->lock);
    return NULL;
}

static void release(gonio_burst *b) {
    free(b->steps);
    free(b->ring);
    free(b->pixels);
    free(b);
}

static gonio_status reserve(gonio_burst *b, size_t memory_bytes, gonio_error *error) {
    const size_t frame = frame_pixels(b) * sizeof *b->pixels;
    const size_t slots = memory_bytes / frame;
    if (slots < 2 * (size_t)b->group || slots > 1 << 20) {
        return gonio_fail(error, GONIO_E_RANGE,
                          "a burst in groups of %d frames of %zu bytes needs %zu bytes or more, found %zu", b->group,
                          frame, 2 * (size_t)b->group * frame, memory_bytes);
    }
    b->slots = (int)slots;
    b->ring = calloc(slots, sizeof *b->ring);
    b->pixels = malloc(slots * frame);
    if (b->ring == NULL || b->pixels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu frames of %zu bytes", slots, frame);
    }
    memset(b->pixels, 0, slots * frame); // the pages are there before the first frame is
    return GONIO_OK;
}

gonio_status gonio_burst_open(gonio_session *session, const gonio_burst_options *options, gonio_burst **out,
                              gonio_error *error) {
    *out = NULL;
    gonio_burst *b = calloc(1, sizeof *b);
    if (b == NULL || options->group < 1 || options->window.width < 1 || options->window.height < 1) {
        free(b);
        return gonio_fail(error, b == NULL ? GONIO_E_MEMORY : GONIO_E_RANGE, "a burst of %d frames of %d x %d a group",
                          options->group, options->window.width, options->window.height);
    }
    b->session = session;
    b->window = options->window;
    b->group = options->group;
    b->n_steps = options->n_steps;
    gonio_status status = reserve(b, options->memory_bytes, error);
    b->steps = malloc((b->n_steps + 1) * sizeof *b->steps);
    if (status == GONIO_OK && b->steps == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu steps", b->n_steps);
    }
    if (status != GONIO_OK) {
        release(b);
        return status;
    }
    memcpy(b->steps, options->steps, b->n_steps * sizeof *b->steps);
    pthread_mutex_init(&b->lock, NULL);
    pthread_cond_init(&b->changed, NULL);
    gonio_session_set_plain(session, true);
    if (pthread_create(&b->thread, NULL, store, b) != 0) {
        release(b);
        return gonio_fail(error, GONIO_E_FAILED, "no thread to store a burst");
    }
    *out = b;
    return GONIO_OK;
}

gonio_status gonio_burst_room(gonio_burst *b, gonio_frame *frame, gonio_error *error) {
    pthread_mutex_lock(&b->lock);
    b->counts.waits += b->filled == b->slots && b->status == GONIO_OK;
    while (b->filled == b->slots && b->status == GONIO_OK) {
        pthread_cond_wait(&b->changed, &b->lock);
    }
    const gonio_status status = b->status;
    if (status != GONIO_OK && error != NULL) {
        *error = b->error;
    }
    const int slot = (b->head + b->filled) % b->slots;
    b->taken = status == GONIO_OK;
    pthread_mutex_unlock(&b->lock);
    *frame = (gonio_frame){.window = b->window, .pixels = b->pixels + (size_t)slot * frame_pixels(b)};
    return status;
}

void gonio_burst_put(gonio_burst *b, const gonio_frame *frame) {
    pthread_mutex_lock(&b->lock);
    if (b->taken) {
        const int slot = (b->head + b->filled) % b->slots;
        b->ring[slot] = (gonio_exposure){.frame = *frame,
                                         .monitor = NAN,
                                         .monitor_sigma = NAN,
                                         .utc_s = gonio_clock_utc_s(),
                                         .monotonic_s = gonio_clock_s()};
        b->ring[slot].frame.pixels = b->pixels + (size_t)slot * frame_pixels(b);
        b->filled++;
        b->taken = false;
        b->counts.most_waiting = b->filled > b->counts.most_waiting ? b->filled : b->counts.most_waiting;
        pthread_cond_broadcast(&b->changed);
    }
    pthread_mutex_unlock(&b->lock);
}

gonio_status gonio_burst_close(gonio_burst *b, gonio_burst_counts *counts, gonio_error *error) {
    pthread_mutex_lock(&b->lock);
    b->ending = true;
    pthread_cond_broadcast(&b->changed);
    pthread_mutex_unlock(&b->lock);
    pthread_join(b->thread, NULL);
    gonio_session_set_plain(b->session, false);
    const gonio_status status = b->status;
    if (status != GONIO_OK && error != NULL) {
        *error = b->error;
    }
    if (counts != NULL) {
        *counts = b->counts;
    }
    pthread_cond_destroy(&b->changed);
    pthread_mutex_destroy(&b->lock);
    release(b);
    return status;
}
