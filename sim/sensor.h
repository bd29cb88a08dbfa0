// SPDX-License-Identifier: BSD-3-Clause
// What is fixed about every pixel of the simulated sensor.
#ifndef GONIO_SIM_SENSOR_H
#define GONIO_SIM_SENSOR_H

#include "gonio/rig.h"
#include "sim/settings.h"

// One pixel's own: 20 bytes, together so that a window touches few cache lines.
typedef struct sim_pixel {
    float x, y;     // undistorted image coordinates of its centre
    float gain;     // vignetting x (1 + PRNU)
    float dark_e_s; // dark current
    float offset_e; // fixed offset
} sim_pixel;

typedef struct sim_sensor {
    int width, height;
    sim_pixel *pixels; // row by row
} sim_sensor;

// Draws the maps from the seed. GONIO_E_INPUT where the distortion cannot be inverted over the frame. The caller frees
// it.
gonio_status gonio_sim_sensor_new(const sim_settings *settings, const gonio_camera_info *info, uint64_t seed,
                                  int threads, sim_sensor **out, gonio_error *error);
void gonio_sim_sensor_free(sim_sensor *sensor); // NULL is allowed

#endif
