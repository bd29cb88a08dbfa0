// SPDX-License-Identifier: BSD-3-Clause
// The simulated rig: implements rig.h's operations; every effect comes from one seed and the stamps. It knows the
// truth.
#ifndef GONIO_SIM_H
#define GONIO_SIM_H

#include "gonio/export.h"
#include "gonio/model.h"
#include "gonio/rig.h"

GONIO_BEGIN

typedef struct gonio_sim gonio_sim;

// A simulated rig with the defaults below, holding the sample of `spec` (a BRDF spec, optionally followed by
// shape=flat|sphere,radius_mm=20). The caller frees it after the rig that it opened is closed.
gonio_status gonio_sim_new(const char *spec, uint64_t seed, gonio_sim **out, gonio_error *error);
void gonio_sim_free(gonio_sim *sim);
// Change one setting before opening, by the section and key of the rig file ("camera", "read_noise_e", "5").
// Unknown ones are GONIO_E_INPUT with the list of what exists: sections [rig], [axis light_theta] (light_phi,
// camera_theta, camera_phi), [camera], [lamp], [meter], [reference], [sample], [faults].
// The default camera has 640 x 512 pixels of 12 bit, a full well of 10,000 e-, 5 e- of read noise, 5 e-/s of dark
// current, 1 % PRNU and 0.01 % hot pixels; the default rig points to 0.01 deg, knows its white reference to 0.2 % and
// has a lamp that drifts by 0.5 %/h (all k = 1). Beyond these the defaults have 10 % nonuniformity of the dark current,
// 1 e- of the offset, 3 % vignetting, k1 = -2 (1.4 px at the corner), 5 % warm-up over 120 s, 0.05 % lamp wander, a
// monitor with 0.05 % noise a reading. An axis stands off by tilt_deg and offset_mm (k = 1 a component, 0 by default),
// drawn once: `gonio calibrate rig`. A perfect white diffuser, lit and seen at normal incidence, gives
// camera.white_e_per_s = 500,000 e-/s. camera.response: linear, gamma:G, or a CSV's path. A fault (camera_timeout,
// camera_error, stage_stall, stage_timeout, stage_estop, lamp_off, meter_error, interlock_open, lost_steps) strikes at
// POSE, or POSE:FRAME, either with xTIMES as a bound per process. lost_steps: from this move on an axis stands half a
// degree off, until it is homed.
gonio_status gonio_sim_set(gonio_sim *sim, const char *section, const char *key, const char *value, gonio_error *error);
// Whether gonio_sim_set knows the key; and " key" of every key of a section, for messages (empty: no such section).
bool gonio_sim_has_key(const char *section, const char *key);
void gonio_sim_keys(const char *section, char *text, size_t size);
// What the fiducial's plate shows (copied): width x height greys 0..255, centred on the table, its right side toward
// the sample's +x, its top toward +y. May be called before or after opening.
gonio_status gonio_sim_fiducial(gonio_sim *sim, int width, int height, const uint16_t *pixels, double mm_per_px,
                                gonio_error *error);
// Every setting as "section.key=value" lines, for the journal: setting them all on a new sim gives the same sim. Caller
// frees.
char *gonio_sim_settings(const gonio_sim *sim);
// Fill every device of the rig and its facts; rig->*_device borrow from sim.
gonio_status gonio_sim_open(gonio_sim *sim, int threads, gonio_rig *rig, gonio_error *error);
// The truth: the sample's exact BRDF, borrowed from sim.
const gonio_model *gonio_sim_truth(const gonio_sim *sim);
// ... and what the rig draws from its stated uncertainties, for tests: where the arms really stand after the last move,
// the white reference's reflectance, the lamp's output relative to its nominal one. Valid once opened.
typedef struct gonio_sim_facts {
    double angles_rad[GONIO_AXES];
    double reference_reflectance[3];
    double lamp_output;
    // The lines that the arms turn about, in the order of the axes, and where the ball lies.
    struct {
        gonio_vec3 direction, point;
    } axis[GONIO_AXES];
    gonio_vec3 ball_centre_mm;
} gonio_sim_facts;
void gonio_sim_true_facts(const gonio_sim *sim, double clock_s, gonio_sim_facts *facts);

GONIO_END
#endif
