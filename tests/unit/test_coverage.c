// SPDX-License-Identifier: BSD-3-Clause
// What a set of samples covers, on sets whose answer is known.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/coverage.h"
#include "gonio/plan.h"
#include "tests/unit/near.h"

static gonio_samples *begin(bool isotropic) {
    gonio_samples *s;
    assert_int_equal(gonio_samples_new(1, false, &s, NULL), GONIO_OK);
    s->isotropic = isotropic;
    return s;
}

static void add(gonio_samples *s, double ti, double pi, double to, double po) {
    const gonio_pair pair = {gonio_radians(ti), gonio_radians(pi), gonio_radians(to), gonio_radians(po)};
    assert_int_equal(gonio_samples_add(s, &pair, &(double){1}, NULL, NULL, NULL), GONIO_OK);
}

static gonio_coverage end(gonio_samples *s) {
    gonio_coverage c;
    assert_int_equal(gonio_coverage_of(s, &c, NULL), GONIO_OK);
    gonio_samples_free(s);
    return c;
}

// 171 values of one incidence in one plane, as a lab's first scan is.
static void one_plane(void **state) {
    (void)state;
    gonio_samples *s = begin(true);
    for (int to = -85; to <= 85; to++) {
        add(s, 30, 0, abs(to), to < 0 ? 180 : 0);
    }
    const gonio_coverage c = end(s);
    assert_int_equal(c.geometries, 171);
    assert_int_equal(c.incidences, 1);
    assert_true(c.in_plane && gonio_coverage_is_narrow(&c));
    assert_near(c.theta_i_deg[0], 30, 1e-9);
    assert_near(c.theta_o_deg[1], 85, 1e-9);
    assert_near(c.horizon_deg, 5, 1e-9);
    assert_true(c.hole_deg > 90);
    char text[400];
    gonio_coverage_text(&c, text, sizeof text);
    assert_non_null(strstr(text, "171 geometries of 1 incidence, theta_i 30 deg, theta_o 0 to 85 deg, in the plane"));
    assert_non_null(strstr(text, "largest hole"));
}

// A plan that fills the domain leaves nothing to say, nor does its first half, as a stopped measure has it.
static void whole(void **state) {
    (void)state;
    for (size_t step = 1; step <= 2; step++) {
        gonio_plan *plan;
        assert_int_equal(gonio_plan_make("nusselt:1400", 1, &plan, NULL), GONIO_OK);
        gonio_samples *s = begin(true);
        for (size_t i = 0; i < plan->n / step; i++) {
            assert_int_equal(gonio_samples_add(s, &plan->poses[i], &(double){1}, NULL, NULL, NULL), GONIO_OK);
        }
        gonio_plan_free(plan);
        const gonio_coverage c = end(s);
        assert_false(gonio_coverage_is_narrow(&c));
        assert_true(c.hole_deg < 25 && !c.in_plane);
    }
}

// A sector that was left out is found, and where it is.
static void hole(void **state) {
    (void)state;
    gonio_samples *s = begin(true);
    for (int ti = 0; ti <= 80; ti += 10) {
        for (int to = 0; to <= 80; to += 10) {
            for (int po = 0; po <= 180; po += 15) {
                if (!(ti >= 20 && to >= 20 && po >= 120)) {
                    add(s, ti, 0, to, po);
                }
            }
        }
    }
    const gonio_coverage c = end(s);
    assert_true(c.hole_deg > 30 && c.hole.phi_o > gonio_radians(119) && c.hole.theta_i >= gonio_radians(20));
}

// Mirror images and whole turns repeat a geometry of an isotropic set; turning the sample does in that alone.
static void repeats(void **state) {
    (void)state;
    for (int isotropic = 0; isotropic < 2; isotropic++) {
        gonio_samples *s = begin(isotropic == 1);
        add(s, 30, 0, 40, 100);
        add(s, 30, 0, 40, -100);
        add(s, 30, 0, 40, -260);
        add(s, 30, 20, 40, 120);
        const gonio_coverage c = end(s);
        assert_int_equal(c.geometries, isotropic ? 1 : 3);
        assert_int_equal(c.incidences, isotropic ? 1 : 2);
    }
    const gonio_coverage none = end(begin(true));
    assert_int_equal(none.geometries, 0);
    assert_false(gonio_coverage_is_narrow(&none));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_plane), cmocka_unit_test(whole), cmocka_unit_test(hole),
                                       cmocka_unit_test(repeats)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
