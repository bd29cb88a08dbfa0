// SPDX-License-Identifier: BSD-3-Clause
// What the tests of frames -> samples share.
#ifndef GONIO_TESTS_CALIB_SCAN_H
#define GONIO_TESTS_CALIB_SCAN_H

#include "tests/sim_scan.h"

#define SIDE 64
static const char *const small[] = {"sample.region_radius_mm=2", NULL};

static inline gonio_pair pose_deg(double ti, double pi, double to, double po) {
    return (gonio_pair){gonio_radians(ti), gonio_radians(pi), gonio_radians(to), gonio_radians(po)};
}

static inline gonio_samples *new_samples(const gonio_calib *calib) {
    gonio_samples *samples;
    assert_int_equal(gonio_samples_new(gonio_calib_channels(calib), true, &samples, NULL), GONIO_OK);
    return samples;
}

#endif
