// SPDX-License-Identifier: BSD-3-Clause
// Frames at a camera's full rate into a session: 1280 x 1024 Y16, 60 frames/s, 30 s (an argument: other seconds), none
// lost. The camera's driver and the session are the real ones; the kernel is stood in for by a source that, like a
// capture driver, fills a queued buffer every 1/60 s by the clock and loses the frame where none is queued.
//
// Every frame carries its number, so that a lost, doubled or exchanged one shows in what was stored. Beside it the
// disk's own rate for as many bytes, written in files of a frame's size and synced in the same groups.
// usage: capture_throughput [SECONDS [FOLDER]]; 5 s in build/ otherwise
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "gonio/session.h"
#include "host/drivers/camera_v4l2.h"

enum { WIDTH = 1280, HEIGHT = 1024, PIXELS = WIDTH * HEIGHT, RATE = 60, BUFFERS = 16, GROUP = 30, PICTURES = 4 };
#define FRAME_BYTES (PIXELS * sizeof(uint16_t))
#define MEMORY_BYTES ((size_t)512 << 20)

static gonio_error error;

static void must(gonio_status status) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s: %s\n", gonio_status_text(status), error.message);
        exit(1);
    }
}

static int64_t now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

// ---- the source ----

typedef struct source {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    pthread_t thread;
    bool streaming;
    uint16_t *memory[BUFFERS], *pictures[PICTURES];
    int queue[BUFFERS], queued, done[BUFFERS], ready;
    struct v4l2_buffer filled[BUFFERS];
    uint32_t sequence, missed, late;
} source;

// Shot noise of a bright field, as hard to compress as the real thing.
static void make_pictures(source *s) {
    uint64_t state = 1;
    for (int p = 0; p < PICTURES; p++) {
        s->pictures[p] = malloc(FRAME_BYTES);
        for (int i = 0; i < PIXELS; i++) {
            uint32_t sum = 0;
            for (int k = 0; k < 4; k++) {
                state = state * 6364136223846793005u + 1442695040888963407u;
                sum += (uint32_t)(state >> 54);
            }
            s->pictures[p][i] = (uint16_t)(30000 + sum);
        }
    }
}

static void fill(source *s, int64_t due_ns) {
    const int index = s->queue[0];
    memmove(s->queue, s->queue + 1, sizeof s->queue - sizeof *s->queue);
    s->queued--;
    const uint32_t sequence = s->sequence;
    pthread_mutex_unlock(&s->lock); // as a camera's DMA would
    memcpy(s->memory[index], s->pictures[sequence % PICTURES], FRAME_BYTES);
    s->memory[index][0] = (uint16_t)sequence;
    pthread_mutex_lock(&s->lock);
    s->filled[index] = (struct v4l2_buffer){.index = (uint32_t)index,
                                            .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
                                            .bytesused = FRAME_BYTES,
                                            .flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
                                            .sequence = sequence};
    s->filled[index].timestamp.tv_sec = due_ns / 1000000000;
    s->filled[index].timestamp.tv_usec = due_ns % 1000000000 / 1000;
    s->done[s->ready++] = index;
    pthread_cond_broadcast(&s->changed);
}

static void *expose(void *opaque) {
    source *s = opaque;
    const int64_t start = now_ns();
    pthread_mutex_lock(&s->lock);
    for (int64_t n = 1; s->streaming; n++) {
        const int64_t due = start + n * 1000000000 / RATE;
        const struct timespec at = {due / 1000000000, due % 1000000000};
        pthread_mutex_unlock(&s->lock);
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
        pthread_mutex_lock(&s->lock);
        s->late += now_ns() - due > 1000000000 / RATE; // a real camera would not have waited for the processor
        if (s->queued > 0) {
            fill(s, due);
        } else {
            s->missed++;
        }
        s->sequence++;
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

static int source_open(void *state, const char *path) {
    (void)state, (void)path;
    return 3;
}
static void source_close(void *state, int handle) { (void)state, (void)handle; }

static int take_filled(source *s, struct v4l2_buffer *buffer) {
    if (s->ready == 0) {
        return -EAGAIN;
    }
    *buffer = s->filled[s->done[0]];
    memmove(s->done, s->done + 1, sizeof s->done - sizeof *s->done);
    s->ready--;
    return 0;
}

static void source_stop(source *s) {
    const bool was = s->streaming;
    s->streaming = false;
    s->queued = s->ready = 0;
    if (was) {
        pthread_mutex_unlock(&s->lock);
        pthread_join(s->thread, NULL);
        pthread_mutex_lock(&s->lock);
    }
}

static int answer(source *s, uint32_t request, void *argument) {
    struct v4l2_buffer *buffer = argument;
    switch (request) {
    case (uint32_t)VIDIOC_QUERYCAP:
        ((struct v4l2_capability *)argument)->capabilities = V4L2_CAP_STREAMING | V4L2_CAP_VIDEO_CAPTURE;
        return 0;
    case (uint32_t)VIDIOC_ENUM_FMT:
        ((struct v4l2_fmtdesc *)argument)->pixelformat = V4L2_PIX_FMT_Y16;
        return ((struct v4l2_fmtdesc *)argument)->index == 0 ? 0 : -EINVAL;
    case (uint32_t)VIDIOC_G_FMT:
    case (uint32_t)VIDIOC_S_FMT:
        ((struct v4l2_format *)argument)->fmt.pix = (struct v4l2_pix_format){.width = WIDTH,
                                                                             .height = HEIGHT,
                                                                             .pixelformat = V4L2_PIX_FMT_Y16,
                                                                             .bytesperline = 2 * WIDTH,
                                                                             .sizeimage = FRAME_BYTES};
        return 0;
    case (uint32_t)VIDIOC_REQBUFS:
        return 0;
    case (uint32_t)VIDIOC_QUERYBUF:
        buffer->length = FRAME_BYTES;
        buffer->m.offset = buffer->index;
        return 0;
    case (uint32_t)VIDIOC_QBUF:
        s->queue[s->queued++] = (int)buffer->index;
        return 0;
    case (uint32_t)VIDIOC_DQBUF:
        return take_filled(s, buffer);
    case (uint32_t)VIDIOC_STREAMON:
        s->streaming = true;
        return -pthread_create(&s->thread, NULL, expose, s);
    case (uint32_t)VIDIOC_STREAMOFF:
        source_stop(s);
        return 0;
    default:
        return -EINVAL; // no controls
    }
}

static int source_ioctl(void *state, int handle, unsigned long request, void *argument, size_t size) {
    (void)handle, (void)size;
    source *s = state;
    pthread_mutex_lock(&s->lock);
    const int code = answer(s, (uint32_t)request, argument);
    pthread_mutex_unlock(&s->lock);
    return code;
}

static int source_map(void *state, int handle, size_t length, int64_t offset, void **memory) {
    (void)handle, (void)length;
    *memory = ((source *)state)->memory[offset];
    return 0;
}
static void source_unmap(void *state, void *memory, size_t length) { (void)state, (void)memory, (void)length; }

static int source_wait(void *state, int handle, int timeout_ms) {
    (void)handle;
    source *s = state;
    struct timespec end;
    clock_gettime(CLOCK_REALTIME, &end);
    end.tv_sec += timeout_ms / 1000 + 1;
    pthread_mutex_lock(&s->lock);
    while (s->ready == 0 && pthread_cond_timedwait(&s->changed, &s->lock, &end) == 0) {
    }
    const int ready = s->ready > 0;
    pthread_mutex_unlock(&s->lock);
    return ready;
}

static int64_t source_now(void *state) {
    (void)state;
    return now_ns();
}

static const gonio_v4l2_io source_io = {source_open,  source_close, source_ioctl, source_map,
                                        source_unmap, source_wait,  source_now};

static void source_new(source *s) {
    *s = (source){.lock = PTHREAD_MUTEX_INITIALIZER, .changed = PTHREAD_COND_INITIALIZER};
    for (int i = 0; i < BUFFERS; i++) {
        s->memory[i] = calloc(1, FRAME_BYTES);
    }
    make_pictures(s);
}

// ---- the disk alone ----

static double disk_rate(const char *folder, int frames, const uint16_t *picture) {
    char path[600];
    int fds[GROUP];
    const int64_t start = now_ns();
    for (int k = 0; k < frames; k += GROUP) {
        for (int i = 0; i < GROUP; i++) {
            snprintf(path, sizeof path, "%s/plain-%d", folder, k + i);
            fds[i] = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0666);
            if (fds[i] < 0 || write(fds[i], picture, FRAME_BYTES) != (ssize_t)FRAME_BYTES) {
                perror(path);
                exit(1);
            }
        }
        for (int i = 0; i < GROUP; i++) {
            fsync(fds[i]);
            close(fds[i]);
        }
    }
    const double seconds = (double)(now_ns() - start) * 1e-9;
    for (int i = 0; i < (frames + GROUP - 1) / GROUP * GROUP; i++) {
        snprintf(path, sizeof path, "%s/plain-%d", folder, i);
        unlink(path);
    }
    return (double)frames * FRAME_BYTES / seconds / 1e6;
}

// ---- the capture ----

static double cpu_s(void) {
    struct rusage u;
    getrusage(RUSAGE_SELF, &u);
    return (double)(u.ru_utime.tv_sec + u.ru_stime.tv_sec) + 1e-6 * (double)(u.ru_utime.tv_usec + u.ru_stime.tv_usec);
}

static gonio_session *new_session(const char *path, int frames, gonio_step **steps, size_t *n) {
    gonio_session *session;
    *n = (size_t)(frames + GROUP - 1) / GROUP;
    *steps = calloc(*n, sizeof **steps);
    for (size_t i = 0; i < *n; i++) {
        (*steps)[i] = (gonio_step){.index = (int64_t)i, .kind = GONIO_STEP_BURST};
    }
    must(gonio_session_create(path, &session, &error));
    must(gonio_session_put(session, "camera.bits", "16", &error));
    must(gonio_session_put_steps(session, *steps, *n, &error));
    return session;
}

// Every stored frame in order, its pixels those of the picture it was made of; returns how many are not, and in *gaps
// how many numbers are missing between them.
static int verify(const char *path, const source *s, int frames, int64_t *gaps) {
    gonio_session *session;
    must(gonio_session_open(path, false, &session, &error));
    int wrong = 0, number = 0;
    uint16_t last = 0;
    *gaps = 0;
    for (int64_t step = 0; number < frames; step++) {
        gonio_exposure *exposures;
        int n;
        must(gonio_session_exposures(session, step, &exposures, &n, &error)); // verifies the checksums
        if (n == 0) {
            break;
        }
        for (int i = 0; i < n; i++, number++) {
            const uint16_t *pixels = exposures[i].frame.pixels;
            *gaps += number > 0 ? (uint16_t)(pixels[0] - last - 1) : 0;
            last = pixels[0];
            wrong += memcmp(pixels + 1, s->pictures[last % PICTURES] + 1, FRAME_BYTES - sizeof *pixels) != 0;
        }
        gonio_exposures_free(exposures, n);
    }
    gonio_session_close(session);
    return wrong + frames - number;
}

static int64_t capture(void *camera, gonio_burst *burst, int frames) {
    int64_t lost = 0;
    must(gonio_camera_v4l2.stream(camera, 0.01, 0, 5, &error));
    for (int i = 0; i < frames; i++) {
        gonio_frame frame;
        int64_t missing;
        must(gonio_burst_room(burst, &frame, &error));
        const gonio_window window = frame.window;
        must(gonio_camera_v4l2.next(camera, &window, 5, &frame, &missing, &error));
        gonio_burst_put(burst, &frame);
        lost += missing;
    }
    return lost;
}

int main(int argc, char **argv) {
    const int seconds = argc > 1 ? atoi(argv[1]) : 5, frames = seconds * RATE;
    char folder[512], path[600], command[700];
    snprintf(folder, sizeof folder, "%s/capture_throughput.XXXXXX", argc > 2 ? argv[2] : "build");
    if (frames < GROUP || mkdtemp(folder) == NULL) {
        fprintf(stderr, "usage: capture_throughput [SECONDS [FOLDER]]\n");
        return 2;
    }
    snprintf(path, sizeof path, "%s/session", folder);
    static source s;
    source_new(&s);
    const double before = disk_rate(folder, frames < 600 ? frames : 600, s.pictures[0]);

    gonio_camera_v4l2_config config;
    gonio_camera_v4l2_defaults(&config);
    config.fixed_exposure_s = 0.01;
    config.buffers = BUFFERS;
    void *camera;
    must(gonio_camera_v4l2_open(&config, &source_io, &s, &camera, &error));
    gonio_step *steps;
    size_t n;
    gonio_session *session = new_session(path, frames, &steps, &n);
    gonio_burst *burst;
    const gonio_burst_options options = {{0, 0, WIDTH, HEIGHT}, GROUP, MEMORY_BYTES, steps, n};
    must(gonio_burst_open(session, &options, &burst, &error));
    const double cpu = cpu_s();
    const int64_t start = now_ns();
    const int64_t lost = capture(camera, burst, frames);
    const int64_t captured = now_ns();
    const uint32_t late = s.late;
    gonio_burst_counts counts;
    must(gonio_burst_close(burst, &counts, &error));
    const double took = (double)(captured - start) * 1e-9, stored = (double)(now_ns() - start) * 1e-9;
    const double used = cpu_s() - cpu;
    gonio_camera_v4l2.close(camera);
    gonio_session_close(session);
    const double after = disk_rate(folder, frames < 600 ? frames : 600, s.pictures[0]);

    const double bytes = (double)frames * FRAME_BYTES;
    printf("%d x %d Y16, %d frames in %.2f s (%.2f frames/s, %.0f MB/s), all synced and entered after %.2f s\n", WIDTH,
           HEIGHT, frames, took, frames / took, bytes / took / 1e6, stored);
    printf("lost %lld; most frames in memory at a time %d of %d, times that a frame waited for memory %lld\n",
           (long long)lost, counts.most_waiting, (int)(MEMORY_BYTES / FRAME_BYTES), (long long)counts.waits);
    printf("processor %.2f s, %.0f %% of one core while capturing (the source's own copying among it); the source was a"
           " frame late %u times\n",
           used, 100 * used / stored, late);
    printf("the disk alone, synced in the same groups: %.0f MB/s before, %.0f MB/s after\n", before, after);
    int64_t gaps;
    const int wrong = verify(path, &s, frames, &gaps);
    printf("read back, checksums and pixels: %d of %d frames wrong, %lld missing in between\n", wrong, frames,
           (long long)gaps);
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    free(steps);
    return system(command) != 0 || wrong != 0 || gaps != lost; // a lost frame is a figure, a wrong one a fault
}
