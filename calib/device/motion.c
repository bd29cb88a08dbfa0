// SPDX-License-Identifier: BSD-3-Clause
// Has the camera, or the sample, moved between two frames? Sub-pixel registration by OpenCV, and what to make of it.
#include <math.h>

#include "calib/opencv.h"

// Frames of one scene that noise alone tells apart correlate better than this; of two scenes worse.
#define SAME_CORRELATION 0.5
// Contrast of the edges over the noise, below which there is nothing to hold on to: noise alone has 0.1 to 0.4.
#define STRUCTURE_MIN 0.5

gonio_status gonio_motion_between(const gonio_image *first, const gonio_image *second, gonio_motion *motion,
                                  gonio_error *error) {
    *motion = (gonio_motion){.known = false};
    if (first->channels != 1 || second->channels != 1 || first->width != second->width ||
        first->height != second->height || first->width < 16 || first->height < 16) {
        return gonio_fail(error, GONIO_E_USAGE, "two grey frames of equal size, at least 16 x 16 pixels, are needed");
    }
    double structure;
    const gonio_status status =
        gonio_opencv_translation(first, second, motion->shift_px, &motion->correlation, &structure, error);
    // A shift that does not make the frames alike is no measurement of one.
    motion->known = status == GONIO_OK && structure >= STRUCTURE_MIN && motion->correlation >= SAME_CORRELATION;
    motion->moved = motion->known && hypot(motion->shift_px[0], motion->shift_px[1]) > GONIO_MOTION_MAX_PX;
    return status;
}
