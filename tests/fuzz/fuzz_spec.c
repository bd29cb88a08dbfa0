// SPDX-License-Identifier: BSD-3-Clause
// Any text as a spec: refused with a message, or a model of finite values.
#include <math.h>
#include <string.h>

#include "gonio/model.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char text[512];
    const size_t n = size < sizeof text - 1 ? size : sizeof text - 1;
    memcpy(text, data, n);
    text[n] = 0;
    if (strncmp(text, "file:", 5) == 0) {
        return 0; // would open any path
    }
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_model_from_spec(text, &model, &error) != GONIO_OK) {
        if (model != NULL || error.message[0] == 0) {
            abort();
        }
        return 0;
    }
    double values[64];
    for (int k = 0; k < 20; k++) {
        gonio_model_eval(model, gonio_direction(0.0826 * k, k), gonio_direction(1.57 - 0.07 * k, 2 * k), values);
        for (int c = 0; c < model->channels; c++) {
            if (!isfinite(values[c]) || values[c] < 0) {
                abort();
            }
        }
    }
    gonio_model_free(model);
    return 0;
}
