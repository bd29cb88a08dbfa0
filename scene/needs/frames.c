// SPDX-License-Identifier: BSD-3-Clause
// The pictures that a model is judged by.
#include <math.h>
#include <stdlib.h>

#include "fit/needs/needs.h"
#include "gonio/scene_needs.h"

struct gonio_frames {
    int n;
    double *exposures;
    gonio_picture **pictures;
};

gonio_status gonio_needs_open_scene(const gonio_needs *needs, gonio_scene **scene, gonio_error *error) {
    uint64_t sum;
    *scene = NULL;
    const gonio_status status = gonio_needs_checksum(needs->scene, &sum, error);
    if (status != GONIO_OK) {
        return status;
    }
    return sum == needs->scene_checksum
               ? gonio_scene_open(needs->scene, scene, error)
               : gonio_fail_line(error, GONIO_E_INPUT, needs->scene, -1,
                                 "it has changed since its needs were written: run gonio scene needs again");
}

void gonio_frames_free(gonio_frames *frames) {
    if (frames != NULL) {
        for (int f = 0; frames->pictures != NULL && f < frames->n; f++) {
            gonio_picture_free(frames->pictures[f]);
        }
        free(frames->pictures);
        free(frames->exposures);
        free(frames);
    }
}

static gonio_status frames_new(int n, gonio_frames **out, gonio_error *error) {
    gonio_frames *all = calloc(1, sizeof *all);
    if (all != NULL) {
        all->n = n;
        all->pictures = calloc((size_t)n, sizeof *all->pictures);
        all->exposures = calloc((size_t)n, sizeof *all->exposures);
    }
    if (all == NULL || all->pictures == NULL || all->exposures == NULL) {
        gonio_frames_free(all);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d pictures", n);
    }
    *out = all;
    return GONIO_OK;
}

void gonio_needs_render_options(const gonio_needs *needs, const gonio_scene *scene, gonio_scene_options *options) {
    gonio_scene_options_default(scene, options);
    options->width = needs->width;
    options->height = needs->height;
    options->samples = needs->samples;
    options->interreflection = needs->interreflection;
}

gonio_status gonio_frames_render(const gonio_scene *scene, const gonio_scene_options *render,
                                 const gonio_needs_frame *frames, int n, double turn_deg, gonio_frames **out,
                                 gonio_error *error) {
    gonio_frames *all = NULL;
    gonio_status status = frames_new(n, &all, error);
    *out = NULL;
    for (int f = 0; f < n && status == GONIO_OK; f++) {
        gonio_scene_options o = *render;
        o.camera = frames[f].camera[0] != 0 ? frames[f].camera : NULL;
        o.light = frames[f].light[0] != 0 ? frames[f].light : NULL;
        o.turn_deg = frames[f].turn_deg + turn_deg;
        all->exposures[f] = frames[f].exposure;
        status = gonio_scene_render(scene, &o, &all->pictures[f], NULL, error);
        if (status == GONIO_OK && !(all->exposures[f] > 0)) {
            status = gonio_picture_exposure(all->pictures[f], &all->exposures[f], error);
        }
    }
    if (status != GONIO_OK) {
        gonio_frames_free(all);
        return status;
    }
    *out = all;
    return GONIO_OK;
}

gonio_status gonio_frames_compare(const gonio_frames *frames, const gonio_frames *reference,
                                  gonio_picture_error *result, gonio_error *error) {
    double squares = 0, noise = 0;
    *result = (gonio_picture_error){0};
    for (int f = 0; f < frames->n; f++) {
        gonio_picture_error one;
        const gonio_status status =
            gonio_picture_compare(frames->pictures[f], reference->pictures[f], reference->exposures[f], &one, error);
        if (status != GONIO_OK) {
            return status;
        }
        result->mae += one.mae / frames->n;
        result->largest = fmax(result->largest, one.largest);
        squares += pow(10, -one.psnr_db / 10) / frames->n;
        noise += pow(10, -one.snr_db / 10) / frames->n;
    }
    result->psnr_db = squares > 0 ? -10 * log10(squares) : INFINITY;
    result->snr_db = noise > 0 ? -10 * log10(noise) : INFINITY;
    return GONIO_OK;
}
