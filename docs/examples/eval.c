// SPDX-License-Identifier: BSD-3-Clause
#include <gonio/model.h>
#include <stdio.h>

int main(int argc, char **argv) {
    gonio_model *model;
    gonio_error error = {0};
    if (argc != 2 || gonio_model_open(argv[1], &model, &error) != GONIO_OK) {
        fprintf(stderr, "%s\n", argc != 2 ? "usage: eval MODEL" : error.message);
        return 1;
    }
    const gonio_vec3 light = gonio_direction(gonio_radians(30), 0);
    const gonio_vec3 camera = gonio_direction(gonio_radians(30), gonio_radians(180)); // the mirror direction
    float values[model->channels];
    gonio_model_eval_f32(model, light, camera, values); // no lock, no allocation: any number of threads
    for (int c = 0; c < model->channels; c++) {
        printf("%s %g /sr\n", model->channel_names[c], values[c]);
    }
    gonio_model_free(model);
    return 0;
}
