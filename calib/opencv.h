// SPDX-License-Identifier: BSD-3-Clause
// The C face of OpenCV: every call is wrapped in try/catch and returns a status; nothing of OpenCV is seen outside.
#ifndef CALIB_OPENCV_H
#define CALIB_OPENCV_H

#include "gonio/characterise.h"

#ifdef __cplusplus
extern "C" {
#endif

// Undistort n pixel positions (u, v) (2 n doubles) to points (x, y) of the plane Z = 1 in front of the camera (rig.h).
gonio_status gonio_opencv_undistort(const gonio_camera_info *camera, int n, const double *pixels, double *points,
                                    gonio_error *error);

// Read an image file as 8 or 16 bits, channels r g b; *pixels is malloc'ed.
gonio_status gonio_opencv_read_image(const char *path, bool grey, int *width, int *height, int *channels, int *bits,
                                     uint16_t **pixels, gonio_error *error);
gonio_status gonio_opencv_write_image(const gonio_image *image, const char *path, gonio_error *error);
// Write a float map as 32-bit TIFF to a path that ends in .tiff.
gonio_status gonio_opencv_write_map(const char *path, int width, int height, const float *values, gonio_error *error);

// See gonio_board_draw and gonio_board_find.
gonio_status gonio_opencv_draw_board(const gonio_board *board, int square_px, gonio_image *image, gonio_error *error);
gonio_status gonio_opencv_find_board(const gonio_image *image, const gonio_board *board, int half_window,
                                     gonio_corners *corners, gonio_error *error);
// Fit intrinsics to the views that have used set; views get rms and pose. sigma is the spread of one coordinate's
// residuals propagated to the parameters. radial: how many of k1 k2 k3 are fitted, 1 to 3; the others are 0.
gonio_status gonio_opencv_calibrate(int n, const gonio_corners *corners, int radial, gonio_view *views,
                                    gonio_camera_calibration *out, gonio_error *error);
gonio_status gonio_opencv_undistortion_map(const gonio_camera_info *camera, float *map, gonio_error *error);

// Debevec and Malik's or Robertson's response of 8-bit images: exposure[256] up to a factor.
gonio_status gonio_opencv_response(bool robertson, int n, const gonio_image *images, int channel,
                                   const double *exposure_s, double exposure[256], gonio_error *error);

// By how much `image` must move to lie on `onto` (equal sizes).
gonio_status gonio_opencv_shift(const gonio_image *onto, const gonio_image *image, int shift[2], gonio_error *error);

// The translation (u, v) that takes `from` onto `to` (equal sizes), to a few hundredths of a pixel, and the correlation
// of the two once it is undone; and how much structure `from` has: the contrast of its edges over its noise.
gonio_status gonio_opencv_translation(const gonio_image *from, const gonio_image *to, double shift[2],
                                      double *correlation, double *structure, gonio_error *error);

#ifdef __cplusplus
}
#endif
#endif
