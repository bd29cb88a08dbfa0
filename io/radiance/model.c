// SPDX-License-Identifier: BSD-3-Clause
// Klems matrices and tensor trees that were read, as a model of one half.
#include <math.h>
#include <stdlib.h>

#include "io/radiance/radiance.h"

#define CHROMATICITY_MIN 1e-3 // below the v' of every colour

// The file's names of the halves.
static const char *const directions[GONIO_HALVES] = {"Reflection Back", "Transmission Back", "Reflection Front",
                                                     "Transmission Front"};

const char *gonio_radiance_direction(gonio_half half) { return directions[half]; }

static void release(gonio_model *model) {
    gonio_radiance_model *m = (gonio_radiance_model *)model;
    for (int k = 0; k < 3; k++) {
        free(m->klems[k].values);
        gonio_tensor_tree_free(&m->tree[k]);
    }
    free(m);
}

static double part_value(const gonio_radiance_model *m, int part, gonio_vec3 wi, gonio_vec3 wo) {
    return m->is_tree ? gonio_tensor_tree_value(&m->tree[part], wi, wo) : gonio_klems_value(&m->klems[part], wi, wo);
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const gonio_radiance_model *m = (const gonio_radiance_model *)model;
    const double y = fmax(0, part_value(m, 0, wi, wo));
    if (m->parts == 1) {
        values[0] = y;
        return;
    }
    const double a = part_value(m, 1, wi, wo), b = part_value(m, 2, wi, wo);
    if (!m->is_tree) {
        gonio_radiance_xyz_to_rgb((double[3]){a, y, b}, values);
    } else { // u', v'
        const double v = fmax(b, CHROMATICITY_MIN);
        gonio_radiance_xyz_to_rgb((double[3]){y * 9 * a / (4 * v), y, y * (12 - 3 * a - 20 * v) / (4 * v)}, values);
    }
    for (int c = 0; c < 3; c++) {
        values[c] += m->floor[c];
    }
}

const gonio_model_ops gonio_radiance_ops = {.kind = "measured", .eval = eval, .free = release};

const gonio_radiance_model *gonio_radiance_own(const gonio_model *model) {
    return model->ops == &gonio_radiance_ops ? (const gonio_radiance_model *)model : NULL;
}
