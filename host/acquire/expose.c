// SPDX-License-Identifier: BSD-3-Clause
// The frames of one step: fixed exposures for dark frames, bracketing for everything else.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "host/acquire/acquire.h"

// gonio_calib_bracket ends by itself; this bound holds should it not.
#define BRACKET_MAX 16
#define CAPTURE_MARGIN_S 10 // beyond the exposure itself
// A monitor that sees the lamp knows it to a per cent or so; below this many sigmas it sees nothing.
#define LAMP_SIGMAS 5
// An instrument whose stated uncertainty is relative reads a dark lamp "well above" zero, and a damaged answer may
// still be a number; but no lamp halves or doubles its light between two frames.
#define LAMP_JUMP 2
// The bracket may end with the reference at a seventh of the range; one frame this much longer saturates in any case,
// so that the saturation level is measured, not assumed.
#define SATURATING 8

static gonio_status grow(gonio_exposures *out, gonio_error *error) {
    if (out->n < out->capacity) {
        return GONIO_OK;
    }
    const int capacity = out->capacity + 32;
    gonio_exposure *larger = realloc(out->items, (size_t)capacity * sizeof *larger);
    if (larger == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d frames", capacity);
    }
    out->items = larger;
    out->capacity = capacity;
    return GONIO_OK;
}

// The lamp's monitor during the frame; NaN without a meter.
static gonio_status read_monitor(const gonio_rig *rig, double *before, gonio_exposure *exposure, gonio_error *error) {
    exposure->monitor = exposure->monitor_sigma = NAN;
    if (rig->meter == NULL) {
        return GONIO_OK;
    }
    double value, sigma;
    const gonio_status status =
        rig->meter->read(rig->meter_device, &exposure->frame.stamp, exposure->frame.exposure_s, &value, &sigma, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (!(value > LAMP_SIGMAS * sigma)) {
        return gonio_fail(error, GONIO_E_DEVICE, "lamp: it is off: its monitor reads %.3g +- %.2g", value, sigma);
    }
    if (*before > 0 && (value < *before / LAMP_JUMP || value > *before * LAMP_JUMP)) {
        return gonio_fail(error, GONIO_E_DEVICE,
                          "lamp: it fails, or its monitor does: that reads %.3g, at the frame before it read %.3g",
                          value, *before);
    }
    *before = value;
    exposure->monitor = value;
    exposure->monitor_sigma = sigma / value;
    return GONIO_OK;
}

static gonio_status take(const gonio_rig *rig, const gonio_setup *setup, const gonio_step *step, double exposure_s,
                         gonio_exposures *out, gonio_error *error) {
    gonio_status status = grow(out, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_stamp stamp = {step->index, out->n, out->clock_s};
    gonio_exposure *exposure = &out->items[out->n];
    const gonio_window all = {0, 0, setup->camera.width, setup->camera.height};
    const gonio_window window = step->kind == GONIO_STEP_CHECK ? all : setup->window;
    *exposure = (gonio_exposure){.frame = {window, exposure_s, 0, stamp, NULL}, .monitor = NAN, .monitor_sigma = NAN};
    const size_t pixels = (size_t)window.width * (size_t)window.height;
    exposure->frame.pixels = malloc(pixels * sizeof *exposure->frame.pixels);
    if (exposure->frame.pixels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a frame");
    }
    out->n++;
    status = rig->camera->capture(rig->camera_device, &window, exposure_s, 0, &stamp, exposure_s + CAPTURE_MARGIN_S,
                                  &exposure->frame, error);
    exposure->utc_s = gonio_clock_utc_s();
    exposure->monotonic_s = gonio_clock_s();
    // Behind a closed shutter the monitor tells nothing that a frame needs.
    if (status == GONIO_OK && step->kind != GONIO_STEP_DARK) {
        status = read_monitor(rig, &out->monitor, exposure, error);
    }
    out->clock_s += exposure_s + setup->camera.read_out_s;
    return status;
}

static gonio_status expose_dark(const gonio_rig *rig, const gonio_setup *setup, const gonio_step *step,
                                gonio_exposures *out, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < 2 * setup->scan.dark_frames; i++) {
        out->end_s = i < setup->scan.dark_frames ? setup->camera.exposure_min_s : setup->camera.exposure_max_s;
        status = take(rig, setup, step, out->end_s, out, error);
    }
    return status;
}

// The light trap: so long that even faint stray light stands above the read noise, shorter where it is not so dark.
#define TRAP_EXPOSURE_S 1.0
#define TRAP_SHORTEN 8

static bool too_bright(const gonio_setup *setup, const gonio_frame *frame) {
    const int limit = (1 << setup->camera.bits) * 3 / 4;
    const size_t n = (size_t)frame->window.width * (size_t)frame->window.height;
    size_t bright = 0;
    for (size_t p = 0; p < n; p++) {
        bright += frame->pixels[p] > limit;
    }
    return bright * 100 > n; // hot pixels are fewer
}

static gonio_status expose_trap(const gonio_rig *rig, const gonio_setup *setup, const gonio_step *step,
                                gonio_exposures *out, gonio_error *error) {
    const double shortest_s = setup->camera.exposure_min_s;
    out->end_s = fmax(fmin(TRAP_EXPOSURE_S, setup->camera.exposure_max_s), shortest_s);
    gonio_status status = take(rig, setup, step, out->end_s, out, error);
    while (status == GONIO_OK && out->end_s > shortest_s && too_bright(setup, &out->items[out->n - 1].frame)) {
        out->end_s = fmax(out->end_s / TRAP_SHORTEN, shortest_s);
        status = take(rig, setup, step, out->end_s, out, error);
    }
    for (int i = 1; status == GONIO_OK && i < setup->scan.trap_frames; i++) {
        status = take(rig, setup, step, out->end_s, out, error);
    }
    return status;
}

static gonio_status bracket(const gonio_rig *rig, const gonio_setup *setup, const gonio_calib *calib,
                            const gonio_step *step, double first_s, gonio_exposures *out, gonio_error *error) {
    double next_s = first_s;
    if (!(first_s > 0)) {
        gonio_calib_bracket(calib, &step->pose, 0, NULL, &next_s);
    }
    gonio_status status = GONIO_OK;
    gonio_exposure_verdict verdict = GONIO_EXPOSURE_MORE;
    while (status == GONIO_OK && verdict == GONIO_EXPOSURE_MORE && out->n < BRACKET_MAX) {
        out->end_s = next_s;
        status = take(rig, setup, step, next_s, out, error);
        if (status == GONIO_OK) {
            verdict = gonio_calib_bracket(calib, &step->pose, out->n, out->items, &next_s);
        }
    }
    return status;
}

static gonio_status expose_reference(const gonio_rig *rig, const gonio_setup *setup, const gonio_calib *calib,
                                     const gonio_step *step, double first_s, gonio_exposures *out, gonio_error *error) {
    gonio_status status = bracket(rig, setup, calib, step, first_s, out, error);
    for (int i = 1; status == GONIO_OK && i < setup->scan.reference_frames; i++) {
        status = take(rig, setup, step, out->end_s, out, error);
    }
    const double long_s = fmin(SATURATING * out->end_s, setup->camera.exposure_max_s);
    return status == GONIO_OK ? take(rig, setup, step, long_s, out, error) : status;
}

static void drop_last(gonio_exposures *out) {
    free(out->items[--out->n].frame.pixels);
    out->items[out->n].frame.pixels = NULL;
}

static int by_word(const void *a, const void *b) { return *(const uint16_t *)a - *(const uint16_t *)b; }

// Where the brightest hundredth of a frame begins, of full scale. 0 without memory.
static double bright_share(const gonio_setup *setup, const gonio_frame *frame) {
    const size_t n = (size_t)frame->window.width * (size_t)frame->window.height;
    uint16_t *sorted = malloc(n * sizeof *sorted);
    if (sorted == NULL) {
        return 0;
    }
    memcpy(sorted, frame->pixels, n * sizeof *sorted);
    qsort(sorted, n, sizeof *sorted, by_word);
    const double share = sorted[n - 1 - n / 100] / (double)((1 << setup->camera.bits) - 1);
    free(sorted);
    return share;
}

// The check's frame: as long that its brightest hundredth uses the range; the later one like the first.
#define CHECK_SHARE 0.6

static gonio_status expose_check(const gonio_rig *rig, const gonio_setup *setup, const gonio_step *step, double first_s,
                                 gonio_exposures *out, gonio_error *error) {
    const double shortest_s = setup->camera.exposure_min_s, longest_s = fmin(1, setup->camera.exposure_max_s);
    out->end_s = first_s > 0 ? first_s : fmin(fmax(0.01, shortest_s), longest_s);
    gonio_status status = take(rig, setup, step, out->end_s, out, error);
    for (int i = 0; status == GONIO_OK && first_s <= 0 && i < 8; i++) {
        const double share = bright_share(setup, &out->items[out->n - 1].frame);
        const double factor = share > 0.95 ? 1.0 / 8 : fmin(CHECK_SHARE / fmax(share, 0.01), 16);
        const double next_s = fmin(fmax(out->end_s * factor, shortest_s), longest_s);
        if ((share >= 0.2 && share <= 0.95) || next_s == out->end_s) {
            break;
        }
        drop_last(out);
        out->end_s = next_s;
        status = take(rig, setup, step, next_s, out, error);
    }
    return status;
}

gonio_status gonio_expose_step(const gonio_rig *rig, const gonio_setup *setup, const gonio_calib *calib,
                               const gonio_step *step, double first_s, gonio_exposures *out, gonio_error *error) {
    switch (step->kind) {
    case GONIO_STEP_DARK:
        return expose_dark(rig, setup, step, out, error);
    case GONIO_STEP_REFERENCE:
        return expose_reference(rig, setup, calib, step, first_s, out, error);
    case GONIO_STEP_TRAP:
        return expose_trap(rig, setup, step, out, error);
    case GONIO_STEP_CHECK:
        return expose_check(rig, setup, step, first_s, out, error);
    case GONIO_STEP_SAMPLE:
    case GONIO_STEP_BURST:
        break;
    }
    return bracket(rig, setup, calib, step, first_s, out, error);
}
