// SPDX-License-Identifier: BSD-3-Clause
// The simulated rig's settings, by the sections and keys of the rig file, and their defaults.
#ifndef GONIO_SIM_SETTINGS_H
#define GONIO_SIM_SETTINGS_H

#include <stddef.h>
#include <stdint.h>

#include "base/keys.h"
#include "gonio/rig.h"

typedef struct sim_axis_settings {
    double speed_deg_per_s, acceleration_deg_per_s2, backlash_deg, min_deg, max_deg;
    double jerk_deg_per_s3;     // 0: trapezoid
    double pointing_deg;        // k = 1, half of its variance a zero error, half repeatability
    double tilt_deg, offset_mm; // k = 1, of the axis in space, each of two components; drawn once
} sim_axis_settings;

// When an injected fault strikes: at a pose (and frame), at most `times` times in a process.
typedef struct sim_fault {
    int64_t pose;  // -1: never
    int32_t frame; // -1: any
    int times;     // 0: every time
} sim_fault;

typedef enum sim_fault_kind {
    SIM_FAULT_CAMERA_TIMEOUT,
    SIM_FAULT_CAMERA_ERROR,
    SIM_FAULT_STAGE_STALL,
    SIM_FAULT_STAGE_TIMEOUT,
    SIM_FAULT_STAGE_ESTOP,
    SIM_FAULT_LAMP_OFF,
    SIM_FAULT_METER_ERROR,
    SIM_FAULT_INTERLOCK_OPEN,
    SIM_FAULT_LOST_STEPS,
    SIM_FAULT_ENCODER_SILENT,
    SIM_FAULT_ENCODER_FROZEN,
    SIM_FAULTS
} sim_fault_kind;

enum { SIM_PATTERN_AUTO = -1 }; // else a gonio_pattern

// Lengths and names follow the keys. NaN in a value that may be "auto" means auto.
typedef struct sim_settings {
    struct {
        double light_distance_mm, camera_distance_mm, light_spot_mm, light_radius_mm, aperture_radius_mm;
        int backlash_takeup; // 0: poses are approached from wherever the axis comes, so backlash shows
    } rig;
    sim_axis_settings axis[GONIO_AXES];
    struct {
        int width, height, bits, pattern;
        double full_well_e, read_noise_e, dark_e_per_s, dark_nonuniformity_percent, offset_nonuniformity_e;
        double prnu_percent, hot_pixel_percent, vignetting_percent, white_e_per_s;
        double fx_px, fy_px, cx_px, cy_px, k1, k2, p1, p2, k3;
        double exposure_min_s, exposure_max_s, read_out_s;
        double moved_px; // its image slips sideways by this at the step moved_at
        int moved_at;    // -1: never
        char response[256];
        int response_known; // 0: the rig's facts do not name the curve
    } camera;
    struct {
        double drift_percent_per_hour, wander_percent, warm_up_percent, warm_up_s;
    } lamp;
    // Light that does not come from the sample. ambient: scattered by the room, relative to a white diffuser's
    // radiance, drawn about this once and again at every pose (variation). glare: share of the scene's mean radiance
    // that the lens spreads over the frame, drawn with this as its root mean square.
    struct {
        double ambient_percent, variation_percent, glare_percent;
    } stray;
    struct {
        int present;
        double noise_percent;
    } meter;
    struct {
        double reflectance[3], sigma_percent, panel_mm;
    } reference;
    struct {
        int sphere;
        double radius_mm, plate_mm, region_radius_mm;
    } sample;
    struct {
        double radius_mm, offset_mm; // offset: k = 1, of where it comes to lie, each of three components
    } ball;
    sim_fault fault[SIM_FAULTS];
} sim_settings;

extern const gonio_key gonio_sim_setting_keys[];
void gonio_sim_settings_default(sim_settings *settings);
// GONIO_E_INPUT for an unknown section or key (the message lists what exists) and for a value that is not possible.
gonio_status gonio_sim_settings_set(sim_settings *settings, const char *section, const char *key, const char *value,
                                    gonio_error *error);
// All of them as "section.key=value" lines; the caller frees. NULL: no memory.
char *gonio_sim_settings_text(const sim_settings *settings);

#endif
