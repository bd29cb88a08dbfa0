// SPDX-License-Identifier: BSD-3-Clause
// Is a BRDF physical, and what would a simplification cost: reciprocity, energy, isotropy and separability after
// DeYoung, "Properties of tabulated bidirectional reflectance distribution functions" (1996), with what the samples'
// sigma says of each; and transforms that give a BRDF the property (docs/physical.md).
#ifndef GONIO_CHECK_H
#define GONIO_CHECK_H

#include "gonio/export.h"
#include "gonio/model.h"
#include "gonio/sample.h"

GONIO_BEGIN

#define GONIO_CHECK_RANKS 16

// A statistic that is chi-square distributed while sigma explains it, and the chance p that sigma alone goes as far.
// Several channels, or several incidences: the one of the least p, whose p is multiplied by their number (Bonferroni).
// NaN where nothing is known of sigma.
typedef struct gonio_check_test {
    double chi2, dof, p;
    int channel;  // of the least p; -1: none
    double least; // that p, not multiplied
} gonio_check_test;

// Of one property: relative differences in per cent, and where the largest is.
typedef struct gonio_check_range {
    double low, mean, high; // NaN: nothing was compared
    gonio_pair where;
    int channel;
    size_t compared;
} gonio_check_range;

// Directional-hemispherical reflectance for light from one direction, and what goes through with it; mean over the channels where not said otherwise.
typedef struct gonio_check_albedo_point {
    double theta_i, phi_i;     // rad
    double value, largest;     // mean and largest over the channels
    double random, systematic; // standard uncertainties of the mean from the samples' own; 0: none known
    double integration;        // what the sum itself may be off, from two rules
    double covered;            // fraction of the projected hemisphere that samples reach
    int channel;               // of the largest
    // Of a sheet that transmits: the parts of value. NaN: not measured, and not in value.
    double reflected, transmitted;
} gonio_check_albedo_point;

typedef enum gonio_check_form {
    GONIO_CHECK_UNIFORM,      // every incidence with every outgoing direction, both on grids of equal steps
    GONIO_CHECK_SEMI_UNIFORM, // every incidence with every outgoing direction of one set
    GONIO_CHECK_SCATTERED,
    GONIO_CHECK_MODEL
} gonio_check_form;
const char *gonio_check_form_name(gonio_check_form form); // "uniform" "semi-uniform" "scattered" "model"

typedef struct gonio_check_report {
    gonio_check_form form;
    // Are there other halves than the front reflection? Then the albedos and the energy are of what is reflected and what
    // goes through, and all else is of one half, the first there is: reflection, from the front before the back, then
    // transmission.
    bool transmission;
    gonio_half half;
    // P_r (4.1), 1/sr^2; P_i (4.10), 1/sr; the means over the channels. NaN: the samples do not allow it.
    double reciprocity, isotropy;
    gonio_check_range reciprocity_range, isotropy_range;
    gonio_check_test reciprocity_test, isotropy_test;
    // What sigma and, of scattered samples, the interpolation make of P_r by themselves; NaN: not known.
    double reciprocity_expected;
    // Scattered samples: the rms of the smooth part of what is not reciprocal, or not isotropic, as a part of f; mean over
    // the channels.
    double reciprocity_part, isotropy_part;
    // P_ec (4.5), the mean and the largest albedo, and where.
    double excess, albedo, energy, energy_theta_rad, energy_phi_rad;
    int energy_channel;
    gonio_check_range energy_range;    // the albedo itself, in per cent
    gonio_check_test energy_test;      // does an albedo exceed 1
    gonio_check_albedo_point *albedos; // [incidences]; gonio_check_report_free
    size_t incidences;
    // Of samples, those of each channel and their standard uncertainties, 0: not known; [incidences][channels].
    double *channel_albedos, *channel_sigmas;
    // P_s^(k) (4.20), k = 1 ... ranks, 1/sr: the rms over entries and channels of what the k best products leave.
    double separability[GONIO_CHECK_RANKS];
    double separability_error;                    // of each at most, downwards: a randomised decomposition; else 0
    double separability_range[GONIO_CHECK_RANKS]; // as a part of the rms of f
    gonio_check_test separability_test[GONIO_CHECK_RANKS];
    int ranks;
    // Mean square of f over the matrix' entries; of a model, as a part of its quadrature: far from 1, lobes are narrower
    // than the matrix' steps. 1 for samples.
    double mean_square, mean_square_seen;
    size_t directions[2]; // of the matrix: incident, outgoing; 0: there is none
    // Medians over direction pairs and channels of 2|a - b| / (|a| + |b| + 2e-3 /sr): exchanged, and turned.
    double reciprocity_median, isotropy_median;
    size_t negative, not_finite; // values
} gonio_check_report;

// Measure a model. Deterministic: any thread count (0: all) gives the same figures. The report is the caller's, who
// releases it. GONIO_E_FAILED where a value is not finite.
gonio_status gonio_check_model(const gonio_model *model, int threads, gonio_check_report *report, gonio_error *error);
// Measure samples: as a table where every incidence comes with every outgoing direction, else as they lie.
gonio_status gonio_check_samples(const gonio_samples *samples, int threads, gonio_check_report *report,
                                 gonio_error *error);
void gonio_check_report_free(gonio_check_report *report);

// Directional-hemispherical reflectance of every channel (albedo: channels values) for light at theta_i, phi_i = 0, to
// about 1e-3 of it.
void gonio_check_albedo(const gonio_model *model, double theta_i_rad, double *albedo);

// The nine reflectances of Nicodemus et al. 1977 (DeYoung A.2.3): each of the two solid angles a direction, a cone
// about it or the hemisphere, filled evenly. [incident][reflected], 0 a direction, 1 a cone, 2 the hemisphere; mean
// over the channels. Where light leaves into a single direction, it is the reflectance factor (1 for a white diffuser),
// which is finite. cone_rad: half the cone's opening.
void gonio_check_reflectances(const gonio_model *model, const gonio_pair *pair, double cone_rad, double out[3][3]);

// ---- transforms: DeYoung 5.1 to 5.15 ----

typedef enum gonio_change_kind {
    GONIO_CHANGE_RECIPROCITY, // (5.2): towards the mean with the exchanged value
    GONIO_CHANGE_ENERGY,      // (5.5), (5.8): an incidence whose albedo exceeds the ceiling is scaled down
    GONIO_CHANGE_ISOTROPY,    // (5.10): towards the mean over azimuths
    GONIO_CHANGE_SEPARABLE,   // (5.15): towards the best sum of `products` products
    GONIO_CHANGE_MIRROR,      // of isotropic samples alone: add the mirror images
    GONIO_CHANGE_CLAMP,       // of samples alone: raise negative values to 0
    GONIO_CHANGES
} gonio_change_kind;
const char *gonio_change_name(gonio_change_kind kind); // "reciprocity" ...

typedef struct gonio_change {
    gonio_change_kind kind;
    int products;    // of SEPARABLE: 1 to 64
    double delta;    // 0: nothing changes; 1: the property holds
    double ceiling;  // of ENERGY: tau, above 0 and at most 1
    bool one_scalar; // of ENERGY: the whole BRDF by the factor of the worst incidence (5.6)
    bool geometric;  // by powers f^(1 - delta) target^delta instead of the line, where both are positive
} gonio_change;

// A new set, which the caller frees; `samples` stay as they are. Means are weighted by inverse variances where the
// samples carry sigma, and sigma goes on through them. The measure is 0 to rounding at delta 1. Scattered samples get
// partners for it, of interpolated values, where RECIPROCITY and ISOTROPY ask for what was not measured; SEPARABLE makes
// of them the table on which P_s is measured. Of a sheet energy is reflected and transmitted, all else of each half,
// and reciprocity leaves transmission as it is.
gonio_status gonio_check_change(const gonio_samples *samples, const gonio_change *change, int threads,
                                gonio_samples **out, gonio_error *error);
// A new model, or the same one where it has the property already; takes over `model`, which is freed on failure. A
// model stays a model: of kind "transformed", with the given one inside; one of halves keeps them, each changed so.
gonio_status gonio_check_change_model(gonio_model *model, const gonio_change *change, int threads, gonio_model **out,
                                      gonio_error *error);

// The same of a samples file that memory need not hold: an anisotropic table incidence by incidence, as
// `gonio convert --plan uniform:STEP,anisotropic=1` writes it, with any channels and their sigmas. It is read in passes,
// holding at most about `memory` bytes of it (0: 256 MB) and never less than one ring of incidences. GONIO_E_INPUT with
// the line where it is no such file. P_s is that of a randomised search.
gonio_status gonio_check_stream(const char *path, size_t memory, gonio_check_report *report, gonio_error *error);
// RECIPROCITY, ENERGY, ISOTROPY or SEPARABLE of such a file to another.
gonio_status gonio_check_stream_change(const char *path, const gonio_change *change, size_t memory, const char *out,
                                       gonio_error *error);

// What gonio_check_make_physical did.
typedef struct gonio_physical_report {
    double reciprocity_before, energy_before; // P_r and the largest albedo
    double energy;                            // the largest albedo afterwards
    double least_factor, theta_rad;           // the smallest factor, where; 1: none was needed
    double least_factor_bound;                // of all factors that do, the least is at most so large: 1 / sqrt(A), A the
                                              // largest albedo before, for there c(i) int f c(o) is 1 at most
} gonio_physical_report;

// A model that is reciprocal to rounding and whose albedo is at most 1 for every incidence (by two quadratures,
// every 1.25 and 5 deg). Takes over `model`, which is freed on failure. The mean with the exchanged value makes it
// reciprocal; where an albedo still exceeds 1, f is multiplied by c(theta_i) c(theta_o), c <= 1. Wherever c < 1 the
// albedo is 1, so no factor could be raised by itself. Of a sheet the albedo is reflected and transmitted light from
// either side, c the same for all halves, and reciprocity of its reflecting halves alone.
gonio_status gonio_check_make_physical(gonio_model *model, bool reciprocal, bool passive, int threads,
                                       gonio_model **out, gonio_physical_report *report, gonio_error *error);

typedef struct gonio_mueller_report {
    size_t matrices;   // sets of sixteen elements that were looked at, one a sample and matrix of channels
    size_t unphysical; // of no sample whatever
    double tolerance;  // an eigenvalue below minus this, of their sum, is none; or 5 standard uncertainties, if that is
                       // more
    double worst;      // the smallest eigenvalue over their sum, and where
    gonio_pair worst_pair;
    char worst_channel[GONIO_CHANNEL_NAME_MAX]; // of the matrix' element 11
} gonio_mueller_report;
// Channels f_r11 to f_r44 (or any sixteen names that end so) are a Mueller matrix: is each physically realisable
// (Cloude 1989)? No matrices: there are no such channels.
void gonio_check_mueller(const gonio_samples *samples, gonio_mueller_report *report);

GONIO_END
#endif
