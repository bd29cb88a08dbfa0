// SPDX-License-Identifier: BSD-3-Clause
// The variances that a whole pose has in common, and their sums.
#include "calib/internal.h"

#include <math.h>

void gonio_uncertainty_common(const gonio_calib *calib, int n, const gonio_exposure *exposures, double value,
                              uncertainty *u) {
    const gonio_rig_facts *facts = &calib->facts;
    const double v2 = value * value;
    const double random = gonio_radians(facts->pointing_random_deg) * reference_slope(facts, calib->reference_theta_i);
    u->reference = v2 * facts->reference_relative_sigma * facts->reference_relative_sigma;
    // The reference's own pose was off by the axes' repeatability: its irradiance goes with cos(theta_i).
    u->alignment = v2 * random * random / calib->reference_poses;
    double clock = 0;
    bool measured = calib->monitored;
    for (int j = 0; j < n; j++) {
        clock += exposures[j].frame.stamp.clock_s / n;
        measured = measured && exposures[j].monitor > 0;
    }
    const double bound = facts->lamp_drift_per_h * (clock - calib->reference_clock_s) / 3600;
    u->drift = v2 * (measured ? calib->monitor_reference_variance : bound * bound);
}

double gonio_uncertainty_random(const uncertainty *u) {
    return sqrt(u->photon + u->read + u->monitor + u->stray_random);
}

double gonio_uncertainty_systematic(const uncertainty *u) {
    return sqrt(u->dark + u->flat + u->reference + u->drift + u->stray + u->alignment);
}
