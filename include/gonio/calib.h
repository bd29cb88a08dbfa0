// Frames -> radiance -> BRDF samples with an uncertainty.
//
// The order of calls: gonio_calib_new; the dark frames and the reference frames; gonio_calib_prepare; then for every
// pose gonio_calib_pose. Plain functions of the frames: replay calls the same ones and gets the same bits.
#ifndef GONIO_CALIB_H
#define GONIO_CALIB_H

#include "gonio/model.h"
#include "gonio/rig.h"
#include "gonio/sample.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gonio_calib gonio_calib;

// A frame with what was journalled beside it.
typedef struct gonio_exposure {
    gonio_frame frame;
    double monitor;       // lamp monitor reading during it; NaN: none
    double monitor_sigma; // relative
} gonio_exposure;

typedef enum gonio_exposure_verdict {
    GONIO_EXPOSURE_DONE,  // every used pixel is well exposed somewhere
    GONIO_EXPOSURE_MORE,  // take *next_s too
    GONIO_EXPOSURE_LIMIT, // the camera's limits are reached; what lacks is in the pose's flags
} gonio_exposure_verdict;

gonio_status gonio_calib_new(const gonio_camera_info *camera, const gonio_rig_facts *facts, const gonio_window *window,
                             gonio_calib **out, gonio_error *error);
void gonio_calib_free(gonio_calib *calib);
// Channels that the samples will have (1 mono, 3 Bayer) and their names.
int gonio_calib_channels(const gonio_calib *calib);
const char (*gonio_calib_channel_names(const gonio_calib *calib))[32];

// The shutter was closed. Frames are borrowed for the call only.
gonio_status gonio_calib_add_dark(gonio_calib *calib, const gonio_exposure *exposure, gonio_error *error);
// The white reference lay on the table at this pose.
gonio_status gonio_calib_add_reference(gonio_calib *calib, const gonio_pair *pose, const gonio_exposure *exposure,
                                       gonio_error *error);
// Derive dark maps, read noise, gain, flat field and scale. Polite failures are named: dark frame not dark, lamp off,
// reference overexposed.
gonio_status gonio_calib_prepare(gonio_calib *calib, gonio_error *error);

// After n exposures of the pose: enough, or which exposure next? Depends on the frames alone.
gonio_exposure_verdict gonio_calib_bracket(const gonio_calib *calib, const gonio_pair *pose, int n,
                                           const gonio_exposure *exposures, double *next_s);
// One pose's exposures -> samples added to `samples` (one for a flat plate, thousands for a sphere), sigma without the
// pointing term, which needs the slope of the BRDF: gonio_calib_pointing.
gonio_status gonio_calib_pose(const gonio_calib *calib, const gonio_pair *pose, int n, const gonio_exposure *exposures,
                              gonio_samples *samples, gonio_error *error);
// Add the pointing term to the sigmas, from the slope of a model that was fitted to these samples.
gonio_status gonio_calib_pointing(const gonio_rig_facts *facts, const gonio_model *model, gonio_samples *samples,
                                  gonio_error *error);

#ifdef __cplusplus
}
#endif
#endif
