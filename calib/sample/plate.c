// SPDX-License-Identifier: BSD-3-Clause
// A flat plate's pose -> one sample: f_r averaged over a disc of the sample about the centre of rotation.
//
// Every pixel is divided by the irradiance of its own point (the light is at a finite distance, and at 85 deg its
// cosine changes by several per cent over the disc) and weighted with its footprint, so that the mean is over area. Its
// directions spread evenly about those at the centre, which the sample therefore carries.
#include "calib/internal.h"

#include <math.h>

// Defects aside, a disc that misses more pixels than this would be a biased mean: the bright ones are missing.
#define INVALID_SHARE_MAX 0.02
// Least share of the disc's area that must lie inside the window.
#define COVERAGE_MIN 0.75
// Largest relative change of cos(theta_i) by the pointing's uncertainty.
#define INCIDENCE_MAX 0.1
// Standard uncertainties of pointing from the sample's plane within which a camera is edge-on.
#define EDGE_ON_SIGMAS 3
// A rig that is called perfect still stands on arithmetic and the lamp's size.
#define POINTING_MIN_DEG 1e-4

typedef struct disc_sums {
    double area, value;
    double photon, read, dark, flat, stray;
    double removed, irradiance; // stray light taken off, area-weighted like value; mean irradiance
    double frame[MERGE_MAX];    // each exposure's share of value
    size_t valid, invalid, saturated;
} disc_sums;

static void add_pixel(const gonio_calib *calib, size_t p, int n, const gonio_exposure *exposures, const double *scale,
                      const geometry_hit *hit, double area, disc_sums *sums) {
    merge_result merged;
    gonio_pixel_merge(calib, p, n, exposures, scale, &merged);
    if (merged.used == 0) {
        sums->invalid++;
        sums->saturated += merged.saturated;
        return;
    }
    const double a = area / hit->irradiance, a2 = a * a, value = a * merged.value;
    sums->valid++;
    sums->area += area;
    sums->value += value;
    sums->photon += a2 * merged.photon_variance;
    sums->read += a2 * merged.read_variance;
    sums->flat += value * value * calib->flat_variance[p];
    for (int j = 0; j < n; j++) {
        sums->frame[j] += a * merged.weight[j] * calib->flat[p] * scale[j] * merged.value;
    }
    const sensitivity s = gonio_sensitivity_of(calib, n, exposures, scale, &merged);
    sums->dark += a2 * gonio_dark_variance(calib, &s);
    sums->stray += a2 * s.stray * s.stray * calib->stray_variance;
    sums->removed += a * s.stray * calib->stray[p];
    sums->irradiance += area * hit->irradiance;
}

static void disc_estimate(const gonio_calib *calib, int n, const gonio_exposure *exposures, const disc_sums *sums,
                          double surroundings, double *value, uncertainty *u) {
    const double a2 = sums->area * sums->area;
    *value = sums->value / sums->area;
    *u = (uncertainty){
        .photon = sums->photon / a2, .read = sums->read / a2, .dark = sums->dark / a2, .flat = sums->flat / a2};
    for (int j = 0; j < n && calib->monitored; j++) {
        const double share = sums->frame[j] / sums->area * exposures[j].monitor_sigma;
        u->monitor += exposures[j].monitor > 0 ? share * share : 0;
    }
    const double removed = calib->facts.stray_variation * sums->removed / sums->area;
    const double irradiance = sums->irradiance / sums->area;
    u->stray_random = removed * removed;
    u->stray = sums->stray / a2 + removed * removed +
               gonio_glare_variance(calib, *value * irradiance, surroundings) / (irradiance * irradiance);
    gonio_uncertainty_common(calib, n, exposures, *value, u);
}

static gonio_status check_disc(const gonio_calib *calib, const gonio_exposure *first, const disc_sums *sums,
                               gonio_error *error) {
    size_t valid = 0, invalid = 0, saturated = 0;
    double area = 0;
    for (int k = 0; k < calib->channels; k++) {
        valid += sums[k].valid;
        invalid += sums[k].invalid;
        saturated += sums[k].saturated;
        area += sums[k].area;
    }
    const long long step = first->frame.stamp.pose;
    const double r = calib->facts.region_radius_mm;
    if ((double)invalid > INVALID_SHARE_MAX * (double)(valid + invalid)) {
        return gonio_fail_frame(error, GONIO_E_RANGE, step, first->frame.stamp.frame,
                                "no valid exposure for %zu of %zu pixels (%s)", invalid, valid + invalid,
                                saturated > 0 ? "saturated even at the shortest" : "no light");
    }
    area /= calib->camera.fx * calib->camera.fy;
    if (valid == 0 || area < COVERAGE_MIN * GONIO_PI * r * r) {
        return gonio_fail_frame(error, GONIO_E_RANGE, step, first->frame.stamp.frame,
                                "the window holds %.0f %% of the averaged disc of %g mm radius",
                                100 * area / (GONIO_PI * r * r), r);
    }
    for (int k = 0; k < calib->channels; k++) {
        if (sums[k].valid == 0) {
            return gonio_fail_frame(error, GONIO_E_RANGE, step, first->frame.stamp.frame,
                                    "no pixel of channel %s in the averaged disc", calib->names[k]);
        }
    }
    return GONIO_OK;
}

// f_r = L/(E cos theta_i): where the pointing alone moves cos(theta_i) by a tenth, nothing is known of E cos(theta_i).
static gonio_status check_incidence(const gonio_calib *calib, const gonio_pair *pair, const gonio_exposure *first,
                                    gonio_error *error) {
    const gonio_rig_facts *facts = &calib->facts;
    const double systematic =
        facts->alignment.known ? gonio_degrees(facts->alignment.sigma_rad) : facts->pointing_systematic_deg;
    const double pointing = fmax(hypot(facts->pointing_random_deg, systematic), POINTING_MIN_DEG);
    // Which face the camera sees decides whether light was reflected or transmitted: not known edge-on.
    if (fabs(gonio_degrees(pair->theta_o) - 90) < EDGE_ON_SIGMAS * pointing) {
        return gonio_fail_frame(
            error, GONIO_E_RANGE, first->frame.stamp.pose, first->frame.stamp.frame,
            "theta_o %.6g deg sees the sample edge-on: pointing to %.2g deg leaves the face unknown",
            gonio_degrees(pair->theta_o), pointing);
    }
    if (gonio_radians(pointing) * sin(pair->theta_i) < INCIDENCE_MAX * fabs(cos(pair->theta_i))) {
        return GONIO_OK;
    }
    return gonio_fail_frame(error, GONIO_E_RANGE, first->frame.stamp.pose, first->frame.stamp.frame,
                            "theta_i %.6g deg grazes so far that pointing to %.2g deg leaves its "
                            "irradiance unknown",
                            gonio_degrees(pair->theta_i), pointing);
}

static gonio_status check_edges(const gonio_calib *calib, const gonio_pair *pose, const gonio_exposure *first,
                                gonio_error *error) {
    char text[256];
    const int flags = gonio_calib_edges(&calib->camera, &calib->facts, pose, text);
    if ((flags & (GONIO_EDGE_REGION | GONIO_EDGE_UNLIT)) == 0) {
        return GONIO_OK;
    }
    return gonio_fail_frame(error, GONIO_E_RANGE, first->frame.stamp.pose, first->frame.stamp.frame, "%s", text);
}

gonio_status gonio_plate_estimate(const gonio_calib *calib, const gonio_pair *pose, int n,
                                  const gonio_exposure *exposures, estimate_sink sink, void *context,
                                  gonio_error *error) {
    const gonio_pair pair = gonio_geometry_pair(&calib->facts, pose);
    gonio_status status = check_incidence(calib, &pair, &exposures[0], error);
    if (status != GONIO_OK) {
        return status;
    }
    status = check_edges(calib, pose, &exposures[0], error);
    if (status != GONIO_OK) {
        return status;
    }
    const geometry g = gonio_geometry_of_pose(&calib->facts, pose);
    disc_sums sums[3] = {0};
    double scale[MERGE_MAX];
    for (int j = 0; j < n; j++) {
        scale[j] = exposure_scale(calib, exposures[j].frame.exposure_s, exposures[j].monitor);
    }
    for (size_t p = 0; p < calib->pixels; p++) {
        geometry_hit hit;
        double footprint;
        if (gonio_pixel_used(calib, &g, p, &hit, &footprint)) {
            add_pixel(calib, p, n, exposures, scale, &hit, footprint, &sums[calib->channel[p]]);
        }
    }
    status = check_disc(calib, &exposures[0], sums, error);
    if (status != GONIO_OK) {
        return status;
    }
    estimate e = {.pair = pair};
    double surroundings[3];
    gonio_stray_surroundings(calib, n, exposures, scale, surroundings);
    for (int k = 0; k < calib->channels; k++) {
        disc_estimate(calib, n, exposures, &sums[k], surroundings[k], &e.value[k], &e.variance[k]);
    }
    return sink(context, &e, error);
}
