// Any bytes as a model file: refused, or evaluated without harm. The checksum would turn every mutation away, so this
// build does not compare it.
#include <math.h>

#include "gonio/model.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_model_open(memory_file(data, size), &model, &error) != GONIO_OK) {
        if (model != NULL || error.message[0] == 0) {
            abort();
        }
        return 0;
    }
    double values[1024];
    for (int k = 0; k < 20; k++) {
        gonio_model_eval(model, gonio_direction(0.08 * k, k), gonio_direction(1.57 - 0.07 * k, 2 * k), values);
    }
    gonio_model_free(model);
    return 0;
}
