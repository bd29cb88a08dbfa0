// SPDX-License-Identifier: BSD-3-Clause
// One pose's exposures -> samples: checks, then the plate's sample or the sphere's.
#include "calib/internal.h"

gonio_status gonio_pose_estimates(const gonio_calib *calib, const gonio_pair *pose, int n,
                                  const gonio_exposure *exposures, estimate_sink sink, void *context,
                                  gonio_error *error) {
    if (!calib->prepared) {
        return gonio_fail(error, GONIO_E_USAGE, "the calibration is not prepared");
    }
    if (n < 1 || n > MERGE_MAX) {
        return gonio_fail(error, GONIO_E_INPUT, "%d exposures of a pose; 1 to %d are possible", n, MERGE_MAX);
    }
    for (int j = 0; j < n; j++) {
        const gonio_status status = gonio_exposure_check(calib, &exposures[j], error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    return calib->facts.sphere ? gonio_sphere_estimate(calib, pose, n, exposures, sink, context, error)
                               : gonio_plate_estimate(calib, pose, n, exposures, sink, context, error);
}

typedef struct collector {
    const gonio_calib *calib;
    gonio_samples *samples;
} collector;

static gonio_status collect(void *context, const estimate *e, gonio_error *error) {
    const collector *c = context;
    double random[3], systematic[3];
    for (int k = 0; k < c->calib->channels; k++) {
        random[k] = gonio_uncertainty_random(&e->variance[k]);
        systematic[k] = gonio_uncertainty_systematic(&e->variance[k]);
    }
    return gonio_samples_add(c->samples, &e->pair, e->value, random, systematic, error);
}

gonio_status gonio_calib_pose(const gonio_calib *calib, const gonio_pair *pose, int n, const gonio_exposure *exposures,
                              gonio_samples *samples, gonio_error *error) {
    if (samples->channels != calib->channels) {
        return gonio_fail(error, GONIO_E_USAGE, "a set of %d channels for a camera of %d", samples->channels,
                          calib->channels);
    }
    collector c = {calib, samples};
    return gonio_pose_estimates(calib, pose, n, exposures, collect, &c, error);
}
