// SPDX-License-Identifier: BSD-3-Clause
// The distance of two models' pictures: none of a model from itself, more where the model is farther off, the same
// whatever the unit.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "scene/model_pictures.h"
#include "tests/simulate.h"

static gonio_image_scene *scene;

static float *pictures(const char *spec, int threads) {
    gonio_model *model = simulate_truth(spec);
    float *rgb;
    assert_int_equal(gonio_image_render(scene, model, threads, &rgb, NULL), GONIO_OK);
    gonio_model_free(model);
    return rgb;
}

static double distance(const char *reference, const char *other) {
    float *a = pictures(reference, 1), *b = pictures(other, 2);
    double mean;
    assert_int_equal(gonio_image_error(scene, a, b, &mean, NULL), GONIO_OK);
    free(a);
    free(b);
    return mean;
}

static void pictures_are_as_far_apart_as_models(void **state) {
    (void)state;
    const char *ward = "ward:rho_d=0.3,rho_s=0.2,alpha=0.15";
    assert_true(distance(ward, ward) == 0);
    const double near = distance(ward, "ward:rho_d=0.3,rho_s=0.2,alpha=0.16");
    const double far = distance(ward, "ward:rho_d=0.3,rho_s=0.2,alpha=0.3"), none = distance(ward, "lambert:rho=0.3");
    assert_true(near > 0.01 && near < far && far < none && none < 100);
    // Anisotropy is seen too.
    assert_true(distance(ward, "ward:rho_d=0.3,rho_s=0.2,alpha_x=0.1,alpha_y=0.2") > near);
    // A diffuser of a tenth less is darker by the ratio of the curve's codes, nowhere more than 255 (1 - 0.9^(1/2.4)).
    const double darker = distance("lambert:rho=0.5", "lambert:rho=0.45");
    assert_true(darker > 1 && darker < sqrt(3) * 255 * (1 - pow(0.9, 1 / 2.4)));
    // Exposure follows the reference, so twice the light of both is the same picture.
    assert_true(fabs(distance("lambert:rho=0.25", "lambert:rho=0.225") - darker) < 0.3);
}

static void impossible_values_are_black(void **state) {
    (void)state;
    float *a = pictures("lambert:rho=0", 1);
    double mean = -1;
    assert_int_equal(gonio_image_error(scene, a, a, &mean, NULL), GONIO_OK);
    assert_true(mean == 0);
    free(a);
}

int main(void) {
    if (gonio_image_scene_new(&scene, NULL) != GONIO_OK) {
        return 1;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(pictures_are_as_far_apart_as_models),
                                       cmocka_unit_test(impossible_values_are_black)};
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    gonio_image_scene_free(scene);
    return failed;
}
