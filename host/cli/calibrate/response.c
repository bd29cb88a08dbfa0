// SPDX-License-Identifier: BSD-3-Clause
// gonio calibrate response: the curve of a camera that is not linear, from images of one scene.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/keys.h"
#include "host/cli/calibrate/calibrate.h"

typedef struct settings {
    const cli_common *common;
    const char *list, *method, *out;
    int channel, bits;
    bool align;
    gonio_response_options fit;
} settings;

typedef struct work {
    frame_row *rows;
    size_t n;
    gonio_image images[GONIO_RESPONSE_FRAMES];
    double exposure_s[GONIO_RESPONSE_FRAMES];
    int shifts[GONIO_RESPONSE_FRAMES][2];
    gonio_response_curve curve;
    frame_top top;
} work;

static const char *const methods[] = {[GONIO_RESPONSE_SPLINE] = "spline",
                                      [GONIO_RESPONSE_EMOR] = "emor",
                                      [GONIO_RESPONSE_DEBEVEC] = "debevec",
                                      [GONIO_RESPONSE_ROBERTSON] = "robertson",
                                      NULL};

static bool parse_method(const char *name, gonio_response_method *method) {
    const int found = gonio_names_find(methods, name);
    *method = found >= 0 ? (gonio_response_method)found : *method;
    return found >= 0;
}

static gonio_status read_images(const settings *s, work *w, gonio_error *error) {
    gonio_status status = frame_list_read(s->common, s->list, &w->rows, &w->n, error);
    if (status == GONIO_OK && w->n > GONIO_RESPONSE_FRAMES) {
        status = gonio_fail_line(error, GONIO_E_INPUT, s->list, -1, "%zu images; at most %d are used", w->n,
                                 GONIO_RESPONSE_FRAMES);
    }
    for (size_t i = 0; status == GONIO_OK && i < w->n; i++) {
        status = frame_image_read(&w->rows[i], false, s->bits, &w->top, &w->images[i], error);
        w->exposure_s[i] = w->rows[i].exposure_s;
    }
    return status == GONIO_OK ? frame_top_check(s->list, &w->top, error) : status;
}

static gonio_status calibrate(const settings *s, work *w, gonio_error *error) {
    gonio_status status = read_images(s, w, error);
    if (status == GONIO_OK && s->align) {
        status = gonio_images_align((int)w->n, w->images, w->exposure_s, w->shifts, error);
    }
    if (status == GONIO_OK) {
        status = gonio_response_fit((int)w->n, w->images, s->channel, w->exposure_s, &s->fit, &w->curve, error);
    }
    return status == GONIO_OK && s->out != NULL ? gonio_response_write(&w->curve, s->out, error) : status;
}

static json_t *as_json(const settings *s, const work *w) {
    json_t *images = json_array(), *curve = json_array();
    for (size_t i = 0; i < w->n; i++) {
        json_array_append_new(images, json_pack("{s:s,s:f,s:f,s:f,s:b,s:[i,i]}", "file", w->rows[i].path, "nominal_s",
                                                w->exposure_s[i], "fitted_s", w->curve.exposure_s[i], "disagreement",
                                                w->curve.disagreement[i], "rejected", (int)w->curve.rejected[i],
                                                "shift_px", w->shifts[i][0], w->shifts[i][1]));
    }
    for (int j = 0; j < GONIO_RESPONSE_POINTS; j++) {
        json_array_append_new(curve, json_real(w->curve.exposure[j]));
    }
    return json_pack("{s:s,s:i,s:f,s:f,s:f,s:i,s:f,s:o,s:o}", "method", methods[s->fit.method], "channel", s->channel,
                     "low", w->curve.covered_low, "high", w->curve.covered_high, "gap", w->curve.covered_gap, "pixels",
                     w->curve.pixels, "rms_stops", w->curve.rms_stops, "images", images, "relative_exposure", curve);
}

static void print(const work *w) {
    for (size_t i = 0; i < w->n; i++) {
        printf("%-44s %10.6g s  fitted %10.6g s (%+.4f stop)  disagreement %.1f %%%s\n", cli_text(w->rows[i].path),
               w->exposure_s[i], w->curve.exposure_s[i], log2(w->curve.exposure_s[i] / w->exposure_s[i]),
               100 * w->curve.disagreement[i],
               w->curve.rejected[i] ? "  <- stands apart: shifted, or something moved" : "");
    }
    printf(
        "residuals %.4f stop rms over %d pixels; the curve rests on readings of relative values %.3f to %.3f, no more "
        "than %.3f apart\n",
        w->curve.rms_stops, w->curve.pixels, w->curve.covered_low, w->curve.covered_high, w->curve.covered_gap);
    for (int j = 0; j < GONIO_RESPONSE_POINTS; j += 32) {
        printf("value %.3f  relative exposure %.6g\n", (double)j / (GONIO_RESPONSE_POINTS - 1), w->curve.exposure[j]);
    }
}

int calibrate_response(int argc, char **argv) {
    cli_common common;
    settings s = {.common = &common, .method = "spline", .channel = 0};
    gonio_response_options_default(&s.fit);
    const cli_option options[] = {
        {"method", 0, CLI_TEXT, &s.method, NULL, "NAME", "spline (default), emor, debevec or robertson (8 bits)"},
        {"emor", 0, CLI_TEXT, &s.fit.emor_path, NULL, "FILE", "emor.txt of Grossberg and Nayar, for --method emor"},
        {"terms", 0, CLI_INT, &s.fit.terms, NULL, "N", "EMoR functions to use (7)"},
        {"times-sigma", 0, CLI_DOUBLE, &s.fit.times_sigma, NULL, "R",
         "relative uncertainty of the exposure times (0.02; 0: exact)"},
        {"channel", 0, CLI_INT, &s.channel, NULL, "N", "channel of colour images: 0 r, 1 g, 2 b (0)"},
        {"bits", 0, CLI_INT, &s.bits, NULL, "N", "bits that carry information (the files' 8 or 16)"},
        {"align", 0, CLI_FLAG, &s.align, NULL, NULL, "shift the images onto each other first"},
        {"out", 'o', CLI_OUTPUT, &s.out, NULL, "CSV", "write the curve, for the rig's response_path"},
        {0}};
    static const cli_verb verb = {"calibrate response", "LIST.csv [-o CSV]",
                                  "response curve from an exposure series; LIST.csv: file,exposure_s", NULL};
    int count;
    if (!cli_parse(&verb, options, argc, argv, &s.list, 1, 1, &count, &common)) {
        return 2;
    }
    if (!parse_method(s.method, &s.fit.method)) {
        return cli_usage(&common, "--method '%s'; spline, emor, debevec and robertson exist", s.method);
    }
    if (s.fit.method == GONIO_RESPONSE_EMOR && s.fit.emor_path == NULL) {
        return cli_usage(&common, "--method emor needs --emor FILE");
    }
    if ((s.bits != 0 && (s.bits < 8 || s.bits > 16)) || !(s.fit.times_sigma >= 0)) {
        return cli_usage(&common, "--bits must be 8 to 16, --times-sigma not negative");
    }
    gonio_error error = {.line = -1, .byte = -1};
    work *w = calloc(1, sizeof *w);
    int exit_status = 0;
    if (w == NULL || calibrate(&s, w, &error) != GONIO_OK) {
        exit_status = cli_fail(&common, &error);
    } else if (common.json) {
        exit_status = cli_json(as_json(&s, w));
    } else {
        print(w);
    }
    for (size_t i = 0; w != NULL && i < GONIO_RESPONSE_FRAMES; i++) {
        gonio_image_free(&w->images[i]);
    }
    free(w != NULL ? w->rows : NULL);
    free(w);
    return exit_status;
}
