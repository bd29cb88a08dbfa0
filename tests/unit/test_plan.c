// SPDX-License-Identifier: BSD-3-Clause
// Plans: what a grid and a stratified set must hold, then their errors.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "gonio/plan.h"
#include "tests/unit/near.h"

static gonio_plan *make(const char *text, uint64_t seed) {
    gonio_plan *plan;
    gonio_error error = {0};
    if (gonio_plan_make(text, seed, &plan, &error) != GONIO_OK) {
        fail_msg("%s: %s", text, error.message);
    }
    return plan;
}

static void uniform_is_the_whole_grid_once(void **state) {
    (void)state;
    gonio_plan *plan = make("uniform:10,theta_max=80", 1);
    // theta_i = 0: 9 (one azimuth); each other theta_i: the pole and 8 thetas of 19 azimuths.
    assert_int_equal(plan->n, 9 + 8 * (1 + 8 * 19));
    for (size_t a = 0; a < plan->n; a++) {
        assert_true(plan->poses[a].theta_i <= gonio_radians(80) && plan->poses[a].phi_i == 0);
        assert_true(plan->poses[a].phi_o >= 0 && plan->poses[a].phi_o <= gonio_radians(180));
        for (size_t b = 0; b < a; b++) {
            assert_true(memcmp(&plan->poses[a], &plan->poses[b], sizeof plan->poses[a]) != 0);
        }
    }
    gonio_plan_free(plan);
    plan = make("uniform:45", 1); // the default keeps to 85 deg
    assert_int_equal(plan->n, 2 + (1 + 5));
    gonio_plan_free(plan);
    plan = make("uniform:45,anisotropic=1", 1); // 8 azimuths of light; the pole of each direction once
    assert_int_equal(plan->n, (1 + 8) * (1 + 8));
    gonio_plan_free(plan);
}

static void nusselt_gives_exactly_n_in_range(void **state) {
    (void)state;
    static const int counts[] = {1, 2, 7, 1400, 4096};
    for (int k = 0; k < 5; k++) {
        char text[64];
        snprintf(text, sizeof text, "nusselt:%d,theta_max=75", counts[k]);
        gonio_plan *plan = make(text, 3);
        assert_int_equal(plan->n, counts[k]);
        for (size_t i = 0; i < plan->n; i++) {
            const gonio_pair *p = &plan->poses[i];
            assert_true(p->theta_i >= 0 && p->theta_i <= gonio_radians(75) && p->phi_i == 0);
            assert_true(p->theta_o >= 0 && p->theta_o <= gonio_radians(75));
            assert_true(p->phi_o >= 0 && p->phi_o <= gonio_radians(180));
            // Degrees and back must give the same bits, or a session's poses would differ from its samples file.
            assert_true(gonio_angle_canonical(p->theta_o) == p->theta_o);
        }
        gonio_plan_free(plan);
    }
}

// 4,096 points in 16 x 16 x 16 equal boxes of the domain: a scrambled net leaves none far from one a box in any
// two-dimensional projection, where random points would leave 18 of 256 columns outside 16 +- 8.
static void nusselt_is_stratified(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed <= 5; seed++) {
        gonio_plan *plan = make("nusselt:4096,theta_max=90", seed);
        int one[3][256] = {{0}}, two[3][256] = {{0}};
        for (size_t i = 0; i < plan->n; i++) {
            const gonio_pair *p = &plan->poses[i];
            const double u[3] = {sin(p->theta_i), sin(p->theta_o) * sin(p->theta_o), p->phi_o / GONIO_PI};
            int c[3];
            for (int k = 0; k < 3; k++) {
                one[k][(int)fmin(u[k] * 256, 255)]++;
                c[k] = (int)fmin(u[k] * 16, 15);
            }
            two[0][c[0] * 16 + c[1]]++;
            two[1][c[0] * 16 + c[2]]++;
            two[2][c[1] * 16 + c[2]]++;
        }
        for (int k = 0; k < 3; k++) {
            for (int b = 0; b < 256; b++) {
                // Rounding to 1e-4 deg moves a point across a boundary now and then.
                assert_in_range(one[k][b], 14, 18);
                assert_in_range(two[k][b], 13, 19);
            }
        }
        gonio_plan_free(plan);
    }
}

static void a_prefix_is_a_plan(void **state) {
    (void)state;
    gonio_plan *a = make("nusselt:100", 1), *b = make("nusselt:1000", 1), *c = make("nusselt:100", 2);
    assert_memory_equal(a->poses, b->poses, 100 * sizeof *a->poses);
    assert_memory_not_equal(a->poses, c->poses, 100 * sizeof *a->poses);
    gonio_plan_free(a);
    gonio_plan_free(b);
    gonio_plan_free(c);
    a = make("nusselt:500,anisotropic=1", 1);
    int quadrants[4] = {0};
    for (size_t i = 0; i < a->n; i++) {
        quadrants[(int)(a->poses[i].phi_i / (GONIO_PI / 2)) % 4]++;
    }
    for (int q = 0; q < 4; q++) {
        assert_in_range(quadrants[q], 120, 130);
    }
    gonio_plan_free(a);
}

static void refused(const char *text, gonio_status status, long long line, const char *expected) {
    gonio_plan *plan;
    gonio_error error = {0};
    assert_int_equal(gonio_plan_make(text, 1, &plan, &error), status);
    assert_null(plan);
    if (strstr(error.message, expected) == NULL || (status == GONIO_E_INPUT && line != error.line)) {
        fail_msg("%s: line %lld '%s' does not say '%s'", text, error.line, error.message, expected);
    }
}

// Behind the sample as in front of it, each pose once.
static void presets_go_behind(void **state) {
    (void)state;
    static const struct {
        const char *flags;
        int halves;
    } cases[] = {{"", 1}, {",transmission=1", 2}, {",back=1", 2}, {",transmission=1,back=1", 4}};
    gonio_plan *front = make("nusselt:25", 1), *grid = make("uniform:30,theta_max=90", 1);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char text[80];
        snprintf(text, sizeof text, "nusselt:%d%s", 25 * cases[k].halves, cases[k].flags);
        gonio_plan *plan = make(text, 1);
        size_t counts[GONIO_HALVES] = {0};
        for (size_t i = 0; i < plan->n; i++) {
            const gonio_pair raised = gonio_pair_raised(plan->poses[i]);
            counts[gonio_pair_half(plan->poses[i])]++;
            assert_memory_equal(&raised, &front->poses[i / (size_t)cases[k].halves], sizeof raised);
        }
        for (int h = 0; h < GONIO_HALVES; h++) {
            assert_true(counts[h] == 0 || counts[h] == 25);
        }
        assert_int_equal(gonio_pairs_transmit(plan->poses, plan->n), k > 0);
        gonio_plan_free(plan);
        // A grid that touches the horizon has it once.
        snprintf(text, sizeof text, "uniform:30,theta_max=90%s", cases[k].flags);
        plan = make(text, 1);
        for (size_t i = 0; i < plan->n; i++) {
            for (size_t j = 0; j < i; j++) {
                assert_memory_not_equal(&plan->poses[i], &plan->poses[j], sizeof *plan->poses);
            }
        }
        assert_true(plan->n <= (size_t)cases[k].halves * grid->n && (k == 0 || plan->n > grid->n));
        gonio_plan_free(plan);
    }
    gonio_plan_free(front);
    gonio_plan_free(grid);
}

static void bad_presets(void **state) {
    (void)state;
    refused("uniform:", GONIO_E_USAGE, -1, "expected a number");
    refused("uniform:0", GONIO_E_USAGE, -1, "expected a step");
    refused("uniform:-5", GONIO_E_USAGE, -1, "expected a step");
    refused("uniform:nan", GONIO_E_USAGE, -1, "expected a step");
    refused("uniform:0.06", GONIO_E_USAGE, -1, "poses; at most");
    refused("uniform:5x", GONIO_E_USAGE, -1, "expected a number");
    refused("uniform:5,theta=3", GONIO_E_USAGE, -1, "unknown option");
    refused("uniform:5,theta_max=91", GONIO_E_USAGE, -1, "expected theta_max");
    refused("nusselt:0", GONIO_E_USAGE, -1, "expected 1 to");
    refused("nusselt:1.5", GONIO_E_USAGE, -1, "expected 1 to");
    refused("nusselt:1e30", GONIO_E_USAGE, -1, "expected 1 to");
    refused("nusselt:10,anisotropic=2", GONIO_E_USAGE, -1, "expected anisotropic");
    refused("/nonexistent/plan.csv", GONIO_E_INPUT, -1, "cannot open");
    refused("/", GONIO_E_INPUT, -1, "folder");
}

static void with_file(const char *content, gonio_status status, long long line, const char *expected) {
    char path[] = "/tmp/gonio-plan-XXXXXX";
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, content, strlen(content)), strlen(content));
    close(fd);
    refused(path, status, line, expected);
    unlink(path);
}

static void bad_files(void **state) {
    (void)state;
    with_file("", GONIO_E_INPUT, -1, "expected the header");
    with_file("1,2,3,4\n", GONIO_E_INPUT, 1, "expected the header");
    with_file("# a plan\ntheta_i,phi_i,theta_o,phi_o\n", GONIO_E_INPUT, 2, "no poses");
    with_file("theta_i,phi_i,theta_o,phi_o\n1,2,3\n", GONIO_E_INPUT, 2, "expected 4 columns, found 3");
    with_file("theta_i,phi_i,theta_o,phi_o\n\n1,2,3,4\n1,2,91,4\n", GONIO_E_INPUT, 4, "theta_o: expected 0 to 90");
    with_file("theta_i,phi_i,theta_o,phi_o\n-91,2,3,4\n", GONIO_E_INPUT, 2, "theta_i: expected 0 to 90");
    with_file("theta_i,phi_i,theta_o,phi_o\n1,nan,3,4\n", GONIO_E_INPUT, 2, "phi_i: expected a finite number");
    with_file("theta_i,phi_i,theta_o,phi_o\n1,2,3,0x10\n", GONIO_E_INPUT, 2, "phi_o: expected a finite number");
    with_file("theta_i,phi_i,theta_o,phi_o\n1,2,3,4,\n", GONIO_E_INPUT, 2, "found 5");
}

static void a_file_is_read(void **state) {
    (void)state;
    char path[] = "/tmp/gonio-plan-XXXXXX";
    const int fd = mkstemp(path);
    const char *content =
        "\xef\xbb\xbf# made by hand\r\ntheta_i, phi_i, theta_o, phi_o\r\n10, 0, 20.5,-180\r\n\r\n0,0,90,360";
    assert_int_equal(write(fd, content, strlen(content)), strlen(content));
    close(fd);
    gonio_plan *plan = make(path, 1);
    unlink(path);
    assert_int_equal(plan->n, 2);
    assert_true(plan->poses[0].theta_o == gonio_radians(20.5) && plan->poses[0].phi_o == gonio_radians(-180));
    assert_true(plan->poses[1].theta_o == gonio_radians(90));
    gonio_plan_free(plan);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(uniform_is_the_whole_grid_once),
        cmocka_unit_test(nusselt_gives_exactly_n_in_range),
        cmocka_unit_test(nusselt_is_stratified),
        cmocka_unit_test(a_prefix_is_a_plan),
        cmocka_unit_test(presets_go_behind),
        cmocka_unit_test(bad_presets),
        cmocka_unit_test(bad_files),
        cmocka_unit_test(a_file_is_read),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
