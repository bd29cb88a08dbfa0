// SPDX-License-Identifier: BSD-3-Clause
// Published fits by name: every line of every table is a model, and different forms of one material are near.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/simulate.h"

static const struct {
    const char *form, *file;
    int materials;
} tables[] = {{"sgd", "bagher_sgd", 100},
              {"ngan-ward", "ngan_ward", 86},
              {"ngan-blinn-phong", "ngan_blinnphong", 86},
              {"ngan-cook-torrance", "ngan_cooktorrance", 86},
              {"ngan-lafortune", "ngan_lafortune", 86}};

static void every_line_is_a_model(void **state) {
    (void)state;
    for (size_t t = 0; t < sizeof tables / sizeof *tables; t++) {
        char path[4096], line[4096], spec[200];
        int materials = 0;
        snprintf(path, sizeof path, "%s/fits/%s.fit", getenv("GONIO_DATA"), tables[t].file);
        FILE *file = fopen(path, "r");
        if (file == NULL) {
            skip();
        }
        while (fgets(line, sizeof line, file) != NULL) {
            if (line[0] == '#') {
                continue;
            }
            uint64_t seed = 3;
            snprintf(spec, sizeof spec, "%s:%.*s", tables[t].form, (int)strcspn(line, " "), line);
            gonio_model *model = simulate_truth(spec);
            assert_true(model->channels == 3 && model->isotropic);
            for (int i = 0; i < 20; i++) {
                const gonio_pair pair = simulate_pair(&seed, 1);
                double values[3];
                gonio_model_eval_pair(model, &pair, values);
                assert_true(isfinite(values[0]) && values[0] >= 0 && isfinite(values[2]) && values[2] >= 0);
            }
            gonio_model_free(model);
            materials++;
        }
        fclose(file);
        assert_int_equal(materials, tables[t].materials);
    }
}

// All were fitted to the same measurements: at the mirror direction they agree within a factor.
static void forms_agree(void **state) {
    (void)state;
    static const char *const materials[] = {"nickel", "pure-rubber", "delrin"};
    const gonio_pair mirror = {0.5, 0, 0.5, GONIO_PI};
    for (size_t m = 0; m < 3; m++) {
        double first = 0;
        for (size_t t = 0; t < sizeof tables / sizeof *tables; t++) {
            char spec[200];
            gonio_model *model;
            snprintf(spec, sizeof spec, "%s:%s", tables[t].form, materials[m]);
            if (gonio_model_from_spec(spec, &model, NULL) != GONIO_OK) {
                skip();
            }
            double values[3];
            gonio_model_eval_pair(model, &mirror, values);
            first = t == 0 ? values[0] : first;
            if (!(values[0] > first / 2.5 && values[0] < 2.5 * first)) {
                fail_msg("%s: %g, sgd %g", spec, values[0], first);
            }
            gonio_model_free(model);
        }
    }
}

static void refusals_say_why(void **state) {
    (void)state;
    gonio_model *model;
    gonio_error error = {0};
    const char *folder = getenv("GONIO_DATA");
    char kept[4096];
    snprintf(kept, sizeof kept, "%s", folder != NULL ? folder : "");
    setenv("GONIO_DATA", "/nowhere", 1);
    assert_int_equal(gonio_model_from_spec("sgd:chrome", &model, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.file, "/nowhere/fits/bagher_sgd.fit"));
    unsetenv("GONIO_DATA");
    assert_int_equal(gonio_model_from_spec("sgd:chrome", &model, &error), GONIO_E_USAGE);
    assert_non_null(strstr(error.message, "GONIO_DATA is not set"));
    if (folder == NULL) {
        skip();
    }
    setenv("GONIO_DATA", kept, 1);
    const gonio_status status = gonio_model_from_spec("sgd:unobtainium", &model, &error);
    assert_true(status == GONIO_E_INPUT || (status == GONIO_E_USAGE && strstr(error.message, "alum-bronze") != NULL));
}

int main(void) {
    if (getenv("GONIO_DATA") == NULL) {
        printf("SKIP: no GONIO_DATA\n");
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_line_is_a_model), cmocka_unit_test(forms_agree),
                                       cmocka_unit_test(refusals_say_why)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
