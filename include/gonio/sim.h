// The simulated rig: implements rig.h's operations; every effect comes from one seed and the stamps. It knows the
// truth.
#ifndef GONIO_SIM_H
#define GONIO_SIM_H

#include "gonio/model.h"
#include "gonio/rig.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gonio_sim gonio_sim;

// A simulated rig with DESIGN section 3's defaults holding the sample of `spec` (a BRDF spec, optionally followed by
// shape=flat|sphere,radius_mm=20). The caller frees it after the rig that it opened is closed.
gonio_status gonio_sim_new(const char *spec, uint64_t seed, gonio_sim **out, gonio_error *error);
void gonio_sim_free(gonio_sim *sim);
// Change one setting before opening, by the section and key of the rig file ("camera", "read_noise_e", "5").
// Unknown ones are GONIO_E_INPUT with the list of what exists.
gonio_status gonio_sim_set(gonio_sim *sim, const char *section, const char *key, const char *value, gonio_error *error);
// Every setting as "section.key=value" lines, for the journal: setting them all on a new sim gives the same sim. Caller
// frees.
char *gonio_sim_settings(const gonio_sim *sim);
// Fill every device of the rig and its facts; rig->*_device borrow from sim.
gonio_status gonio_sim_open(gonio_sim *sim, int threads, gonio_rig *rig, gonio_error *error);
// The truth: the sample's exact BRDF, borrowed from sim.
const gonio_model *gonio_sim_truth(const gonio_sim *sim);

// ---- preview rendering, on the same ray caster ----
typedef struct gonio_render_options {
    int width, height;
    const char *mesh; // PLY or OBJ; NULL: a sphere
    double light_theta_deg, light_phi_deg;
    double exposure_ev; // 0: automatic, shared by the strip
    bool exposure_auto;
    int threads;
} gonio_render_options;
void gonio_render_options_default(gonio_render_options *options);
// A strip of n models side by side, one exposure, sRGB, 8-bit PNG written beside and renamed.
gonio_status gonio_render(const gonio_model *const *models, int n, const gonio_render_options *options,
                          const char *path, gonio_error *error);

#ifdef __cplusplus
}
#endif
#endif
