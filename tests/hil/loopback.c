// SPDX-License-Identifier: BSD-3-Clause
// A camera made of a session: feeds v4l2loopback the frames of a simulated measure, one for each trigger pulse, in the
// order in which they were captured. Around a frame's window the picture is 1, so that a wrong window shows.
// usage: loopback SESSION WIDTH HEIGHT VIDEO_DEVICE TRIGGER_VALUE_FILE
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "gonio/session.h"
#include "host/transport/clock.h"

static int width, height, video, line;
static uint16_t *picture;

static void die(const char *what) {
    perror(what);
    exit(1);
}

static bool pulled(void) {
    char text[4] = "";
    return pread(line, text, sizeof text - 1, 0) > 0 && text[0] == '1';
}

static void wait_for_trigger(void) {
    while (!pulled()) {
        gonio_clock_sleep_ms(1);
    }
}

static void put_picture(void) {
    const size_t size = (size_t)width * (size_t)height * sizeof *picture;
    if (write(video, picture, size) != (ssize_t)size) {
        die("write");
    }
}

static void show(const gonio_exposure *exposure) {
    const gonio_window *w = &exposure->frame.window;
    for (int i = 0; i < width * height; i++) {
        picture[i] = 1;
    }
    for (int y = 0; y < w->height; y++) {
        memcpy(picture + (size_t)(w->y + y) * (size_t)width + w->x,
               exposure->frame.pixels + (size_t)y * (size_t)w->width, (size_t)w->width * sizeof *picture);
    }
    wait_for_trigger();
    gonio_clock_sleep_ms((int)(exposure->frame.exposure_s * 1000) + 2); // it exposes
    put_picture();
    while (pulled()) {
        gonio_clock_sleep_ms(1);
    }
}

static void open_video(const char *path) {
    struct v4l2_format format = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
    format.fmt.pix = (struct v4l2_pix_format){.width = (uint32_t)width,
                                              .height = (uint32_t)height,
                                              .pixelformat = V4L2_PIX_FMT_Y16,
                                              .field = V4L2_FIELD_NONE,
                                              .bytesperline = 2 * (uint32_t)width,
                                              .sizeimage = 2 * (uint32_t)(width * height)};
    video = open(path, O_RDWR);
    if (video < 0 || ioctl(video, VIDIOC_S_FMT, &format) != 0) {
        die(path);
    }
}

int main(int argc, char **argv) {
    if (argc != 6) {
        return 2;
    }
    width = atoi(argv[2]);
    height = atoi(argv[3]);
    picture = calloc((size_t)width * (size_t)height, sizeof *picture);
    open_video(argv[4]);
    line = open(argv[5], O_RDONLY);
    if (picture == NULL || line < 0) {
        die(argv[5]);
    }
    gonio_session *session;
    gonio_step *steps;
    size_t n;
    gonio_error error = {0};
    if (gonio_session_open(argv[1], false, &session, &error) != GONIO_OK ||
        gonio_session_steps(session, &steps, &n, &error) != GONIO_OK) {
        fprintf(stderr, "%s\n", error.message);
        return 1;
    }
    put_picture(); // the device captures only once something has been written; the camera must throw this away
    puts("ready");
    fflush(stdout);
    for (size_t i = 0; i < n; i++) {
        gonio_exposure *exposures;
        int frames;
        if (gonio_session_exposures(session, steps[i].index, &exposures, &frames, &error) != GONIO_OK) {
            fprintf(stderr, "%s\n", error.message);
            return 1;
        }
        for (int k = 0; k < frames; k++) {
            show(&exposures[k]);
        }
        gonio_exposures_free(exposures, frames);
    }
    free(steps);
    gonio_session_close(session);
    return 0;
}
