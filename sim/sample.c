// SPDX-License-Identifier: BSD-3-Clause
#include "sim/sample.h"

#include <stdlib.h>
#include <string.h>

#include "io/spec.h"
#include "scene/patch/patch_model.h"

gonio_status gonio_sim_sample_parse(const char *spec, sim_settings *settings, gonio_model **out, gonio_error *error) {
    *out = NULL;
    char *text = strdup(spec);
    if (text == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the sample");
    }
    gonio_status status = GONIO_OK;
    const char *key;
    for (const char *value; status == GONIO_OK && (value = gonio_spec_take_body(text, &key)) != NULL;) {
        gonio_error detail = {0};
        if (gonio_sim_settings_set(settings, "sample", key, value, &detail) != GONIO_OK) {
            status = gonio_fail(error, GONIO_E_USAGE, "sample '%s': %s", spec, detail.message);
        }
    }
    if (status == GONIO_OK) {
        status = strncmp(text, "patch:", 6) == 0 ? gonio_patch_model_new(text + 6, out, error)
                                                 : gonio_model_from_spec(text, out, error);
    }
    free(text);
    return status;
}

// A model seen through other channels.
typedef struct seen_model {
    gonio_model head;
    const gonio_model *of;
    char names[3][32];
} seen_model;

static double mean(const seen_model *seen, gonio_vec3 wi, gonio_vec3 wo) {
    const int n = seen->of->channels;
    double values[n], sum = 0;
    gonio_model_eval(seen->of, wi, wo, values);
    for (int c = 0; c < n; c++) {
        sum += values[c];
    }
    return sum / n;
}

static double seen_eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    (void)channel;
    return mean((const seen_model *)model, wi, wo);
}

static void seen_eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const double value = mean((const seen_model *)model, wi, wo);
    for (int c = 0; c < model->channels; c++) {
        values[c] = value;
    }
}

static void seen_free(gonio_model *model) { free(model); }

static const gonio_model_ops seen_ops = {
    .kind = "seen", .eval = seen_eval, .eval_channel = seen_eval_channel, .free = seen_free, .both_sides = true};

gonio_status gonio_sim_sample_seen(gonio_model *model, int channels, gonio_model **out, gonio_error *error) {
    *out = model;
    if (model->channels == channels) {
        return GONIO_OK;
    }
    if (channels == 3 && model->channels != 1) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "a Bayer camera shows samples of 1 or 3 channels; this one has %d (camera pattern: mono?)",
                          model->channels);
    }
    seen_model *seen = calloc(1, sizeof *seen);
    if (seen == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the sample");
    }
    seen->head = (gonio_model){.ops = &seen_ops,
                               .channels = channels,
                               .isotropic = model->isotropic,
                               .channel_names = (const char(*)[32])seen->names,
                               .bytes = model->bytes,
                               .control_points = model->control_points};
    static const char *const names[2][3] = {{"value", "", ""}, {"r", "g", "b"}};
    for (int c = 0; c < channels; c++) {
        strcpy(seen->names[c], names[channels == 3][c]);
    }
    seen->of = model;
    *out = &seen->head;
    return GONIO_OK;
}
