// The C face of OpenCV: every call is wrapped in try/catch and returns a status; nothing of OpenCV is seen outside.
#ifndef CALIB_OPENCV_H
#define CALIB_OPENCV_H

#include "gonio/rig.h"

#ifdef __cplusplus
extern "C" {
#endif

// Undistort n pixel positions (u, v) (2 n doubles) to points (x, y) of the plane Z = 1 in front of the camera (rig.h).
gonio_status opencv_undistort(const gonio_camera_info *camera, int n, const double *pixels, double *points,
                              gonio_error *error);

#ifdef __cplusplus
}
#endif
#endif
