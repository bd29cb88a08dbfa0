// SPDX-License-Identifier: BSD-3-Clause
// How fast the simulated camera delivers frames: a window and a full frame of a flat Ward sample, one thread, beside
// the bare evaluations of the same BRDF in the same run.
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "gonio/sim.h"

#define REPEATS 9

static int fail(const gonio_error *error) {
    fprintf(stderr, "sim_frame: %s\n", error->message);
    return 1;
}

static double evaluate(const gonio_model *model, int n) {
    double sum = 0;
    const gonio_vec3 wi = gonio_direction(0.4, 0);
    const double start = gonio_clock_s();
    for (int k = 0; k < n; k++) {
        sum += gonio_model_eval_channel(model, wi, gonio_direction(0.5, 3 + 1e-6 * k), 0);
    }
    const double taken = gonio_clock_s() - start;
    return sum > 0 ? taken : 0; // the sum keeps the loop
}

static int measure(const gonio_rig *rig, const gonio_model *model, gonio_window window, uint16_t *pixels) {
    gonio_error error = {0};
    const int n = window.width * window.height;
    double frame_s = 1e9, evaluation_s = 1e9;
    double mean = 0;
    for (int r = 0; r < REPEATS; r++) {
        const gonio_stamp stamp = {.pose = 1, .frame = r, .clock_s = 1000};
        gonio_frame frame = {.pixels = pixels};
        const double start = gonio_clock_s();
        if (rig->camera->capture(rig->camera_device, &window, 0.005, 0, &stamp, 1, &frame, &error) != GONIO_OK) {
            return fail(&error);
        }
        const double taken = gonio_clock_s() - start;
        frame_s = taken < frame_s ? taken : frame_s;
        const double bare = evaluate(model, n);
        evaluation_s = bare < evaluation_s ? bare : evaluation_s;
    }
    for (int k = 0; k < n; k++) {
        mean += pixels[k];
    }
    printf("%4d x %-4d frame %7.2f ms, %5.0f ns a pixel, %.2f times the bare evaluation (mean word %.0f)\n",
           window.width, window.height, 1e3 * frame_s, 1e9 * frame_s / n, frame_s / evaluation_s, mean / n);
    return 0;
}

int main(void) {
    gonio_error error = {0};
    gonio_sim *sim;
    gonio_rig rig;
    uint16_t *pixels = malloc(640 * 512 * sizeof *pixels);
    if (pixels == NULL || gonio_sim_new("ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 1, &sim, &error) != GONIO_OK ||
        gonio_sim_open(sim, 1, &rig, &error) != GONIO_OK) {
        return fail(&error);
    }
    const gonio_stamp stamp = {.pose = 1};
    const double target[GONIO_AXES] = {gonio_radians(30), 0, gonio_radians(40), gonio_radians(170)};
    if (rig.stage->home(rig.stage_device, 100, &error) != GONIO_OK ||
        rig.stage->move(rig.stage_device, target, 1, &stamp, 100, &error) != GONIO_OK ||
        rig.lamp->set_shutter(rig.lamp_device, true, &error) != GONIO_OK) {
        return fail(&error);
    }
    const int status = measure(&rig, gonio_sim_truth(sim), (gonio_window){240, 192, 160, 128}, pixels) +
                       measure(&rig, gonio_sim_truth(sim), (gonio_window){0, 0, 640, 512}, pixels);
    gonio_sim_free(sim);
    free(pixels);
    return status;
}
