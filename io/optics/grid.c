// SPDX-License-Identifier: BSD-3-Clause
#include "io/optics/grid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Samples of one file: 2^26 values are 512 MB.
#define VALUES_MAX ((size_t)1 << 26)
enum { AXIS_MAX = 100000 };

gonio_status gonio_grid_axis_read(gonio_grid *grid, int axis, gonio_words *words, const char *what, int n, double low,
                                  double high, gonio_error *error) {
    gonio_grid_axis *a = &grid->axis[axis];
    if (n < 1 || n > AXIS_MAX || a->deg != NULL) {
        return gonio_text_fail(&words->text, error,
                               a->deg != NULL ? "%s: stands a second time" : "%s: expected 1 to %d angles, found %d",
                               what, AXIS_MAX, n);
    }
    a->deg = malloc((size_t)n * sizeof *a->deg);
    if (a->deg == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d angles", n);
    }
    a->n = n;
    for (int k = 0; k < n; k++) {
        const gonio_status status = gonio_word_number(words, what, &a->deg[k], error);
        if (status != GONIO_OK) {
            return status;
        }
        if (!(a->deg[k] >= low && a->deg[k] <= high) || (k > 0 && a->deg[k] <= a->deg[k - 1])) {
            return gonio_text_fail(&words->text, error, "%s: expected ascending angles of %g to %g deg, found %g", what,
                                   low, high, a->deg[k]);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_grid_axis_counted(gonio_grid *grid, int axis, gonio_words *words, const char *what, double low,
                                     double high, gonio_error *error) {
    double n;
    const gonio_status status = gonio_word_number(words, what, &n, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (!(n >= 1 && n <= AXIS_MAX && n == floor(n))) {
        return gonio_text_fail(&words->text, error, "%s: expected a number of angles, 1 to %d, found %g", what,
                               AXIS_MAX, n);
    }
    return gonio_grid_axis_read(grid, axis, words, what, (int)n, low, high, error);
}

gonio_status gonio_grid_channels(gonio_grid *grid, int channels, gonio_error *error) {
    grid->channels = channels;
    free(grid->names);
    grid->names = calloc((size_t)channels, sizeof *grid->names);
    if (grid->names == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d channels", channels);
    }
    for (int c = 0; c < channels; c++) {
        if (channels == 3) {
            snprintf(grid->names[c], sizeof *grid->names, "%c", "rgb"[c]);
        } else {
            snprintf(grid->names[c], sizeof *grid->names, channels == 1 ? "visible" : "c%d", c + 1);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_grid_allocate(gonio_grid *grid, const gonio_words *words, gonio_error *error) {
    static const char *const names[GONIO_GRID_AXES] = {"incident azimuths", "incident angles", "outgoing azimuths",
                                                       "outgoing angles"};
    size_t count = (size_t)grid->channels;
    grid->report.open_end = words->open_end;
    for (int k = 0; k < GONIO_GRID_AXES; k++) {
        gonio_grid_axis *a = &grid->axis[k];
        if (k == GONIO_GRID_IN_PHI && a->deg == NULL) {
            a->deg = calloc(1, sizeof *a->deg);
            a->n = a->deg != NULL;
        }
        if (a->n == 0 || count > VALUES_MAX / (size_t)a->n) {
            return gonio_text_fail(&words->text, error,
                                   a->n == 0 ? "the values begin and there are no %s" : "too many values with the %s",
                                   names[k]);
        }
        count *= (size_t)a->n;
    }
    grid->values = malloc(count * sizeof *grid->values);
    for (size_t k = 0; grid->values != NULL && k < count; k++) {
        grid->values[k] = NAN;
    }
    return grid->values != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu values", count);
}

double *gonio_grid_at(gonio_grid *grid, int channel, int in_phi, int in_theta, int out_phi, int out_theta) {
    const gonio_grid_axis *a = grid->axis;
    size_t at = (size_t)channel;
    at = at * (size_t)a[GONIO_GRID_IN_PHI].n + (size_t)in_phi;
    at = at * (size_t)a[GONIO_GRID_IN_THETA].n + (size_t)in_theta;
    at = at * (size_t)a[GONIO_GRID_OUT_PHI].n + (size_t)out_phi;
    return grid->values + at * (size_t)a[GONIO_GRID_OUT_THETA].n + (size_t)out_theta;
}

gonio_status gonio_grid_value(gonio_grid *grid, gonio_words *words, double *value, gonio_error *error) {
    const gonio_status status = gonio_word_number(words, "value", value, error);
    if (status != GONIO_OK || *value >= 0) {
        return status;
    }
    if (grid->report.negatives++ == 0) {
        grid->report.first_negative_line = words->text.line;
    }
    if (grid->policy == GONIO_NEGATIVES_CLAMP) {
        grid->report.clamped++;
        *value = 0;
    }
    return grid->policy == GONIO_NEGATIVES_CLAMP || grid->policy == GONIO_NEGATIVES_KEEP
               ? GONIO_OK
               : gonio_text_fail(&words->text, error, "negative value %g; --negatives clamp or keep lets it pass",
                                 *value);
}

// ---- nodes ----

static gonio_vec3 turned_about_z(gonio_vec3 v, double angle) {
    const double c = cos(angle), s = sin(angle);
    return (gonio_vec3){c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

// The light in the xz plane at +x; the mirror direction is (-s, 0, c).
static gonio_vec3 about_mirror(double theta_i, double polar, double azimuth) {
    const gonio_vec3 d = gonio_direction(polar, azimuth);
    const double c = cos(theta_i), s = sin(theta_i);
    return (gonio_vec3){c * d.x - s * d.z, d.y, s * d.x + c * d.z};
}

static gonio_vec3 turned_about_y(gonio_vec3 v, double angle) {
    const double c = cos(angle), s = sin(angle);
    return (gonio_vec3){c * v.x + s * v.z, v.y, c * v.z - s * v.x};
}

static bool canonical(gonio_vec3 wi, gonio_vec3 wo, bool isotropic, gonio_pair *pair) {
    if (wi.z < -1e-9 || wo.z <= 1e-9) {
        return false;
    }
    wi.z = fmax(wi.z, 0);
    const gonio_pair found = gonio_pair_from_vectors(wi, wo);
    *pair = (gonio_pair){
        gonio_angle_canonical(found.theta_i), isotropic ? 0 : gonio_angle_canonical(found.phi_i),
        gonio_angle_canonical(found.theta_o),
        gonio_angle_canonical(isotropic ? remainder(found.phi_o - found.phi_i, 2 * GONIO_PI) : found.phi_o)};
    return true;
}

bool gonio_grid_pair(const gonio_grid *grid, const int at[GONIO_GRID_AXES], gonio_pair *pair) {
    double rad[GONIO_GRID_AXES];
    for (int k = 0; k < GONIO_GRID_AXES; k++) {
        rad[k] = gonio_radians(grid->axis[k].deg[at[k]]);
    }
    const double phi_i = rad[GONIO_GRID_IN_PHI] + gonio_radians(grid->light_deg), theta_i = rad[GONIO_GRID_IN_THETA];
    const double phi = rad[GONIO_GRID_OUT_PHI], theta = rad[GONIO_GRID_OUT_THETA];
    const bool isotropic = grid->axis[GONIO_GRID_IN_PHI].n == 1;
    if (grid->frame == GONIO_GRID_ABSOLUTE) {
        *pair = (gonio_pair){gonio_angle_canonical(theta_i), gonio_angle_canonical(isotropic ? 0 : phi_i),
                             gonio_angle_canonical(theta),
                             gonio_angle_canonical(isotropic ? remainder(phi - phi_i, 2 * GONIO_PI) : phi)};
        return pair->theta_i <= GONIO_PI / 2 && pair->theta_o <= GONIO_PI / 2;
    }
    gonio_vec3 wi = gonio_direction(theta_i, 0), wo;
    if (grid->frame == GONIO_GRID_SPECULAR) {
        wo = about_mirror(theta_i, theta, phi);
    } else { // theta_i is theta_h: the difference angles give wi about the half vector
        const gonio_vec3 half = gonio_direction(theta_i, 0);
        wi = turned_about_y(gonio_direction(theta, phi), theta_i);
        const double dot = 2 * (wi.x * half.x + wi.z * half.z);
        wo = (gonio_vec3){dot * half.x - wi.x, dot * half.y - wi.y, dot * half.z - wi.z};
    }
    return canonical(turned_about_z(wi, phi_i), turned_about_z(wo, phi_i), isotropic, pair);
}

static gonio_status add_node(gonio_grid *grid, const int at[GONIO_GRID_AXES], double *values, gonio_samples *samples,
                             gonio_error *error) {
    gonio_pair pair;
    bool whole = true;
    for (int c = 0; c < grid->channels; c++) {
        values[c] = *gonio_grid_at(grid, c, at[0], at[1], at[2], at[3]);
        whole = whole && !isnan(values[c]);
    }
    grid->report.rows++;
    if (!whole || !gonio_grid_pair(grid, at, &pair)) {
        grid->report.invalid++;
        return GONIO_OK;
    }
    double rgb[3];
    if (grid->xyz) {
        gonio_xyz_to_rgb(values, rgb);
    }
    pair = gonio_pair_lowered(pair, grid->half);
    return gonio_samples_add(samples, &pair, grid->xyz ? rgb : values, NULL, NULL, error);
}

static gonio_status add_nodes(gonio_grid *grid, gonio_samples *samples, gonio_error *error) {
    double *values = calloc((size_t)grid->channels, sizeof *values);
    gonio_status status = values != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a sample");
    int at[GONIO_GRID_AXES] = {0};
    while (status == GONIO_OK && at[0] < grid->axis[0].n) {
        status = add_node(grid, at, values, samples, error);
        int k = GONIO_GRID_AXES - 1;
        while (++at[k] == grid->axis[k].n && k > 0) {
            at[k--] = 0;
        }
    }
    free(values);
    return status;
}

gonio_status gonio_grid_end(gonio_grid *grid, gonio_status status, const gonio_source *source, const char *format,
                            gonio_samples **out, gonio_read_report *report, gonio_error *error) {
    const bool isotropic = grid->axis[GONIO_GRID_IN_PHI].n == 1, first = *out == NULL;
    status = status == GONIO_OK && first ? gonio_samples_new(grid->channels, false, out, error) : status;
    if (status == GONIO_OK && !first && (*out)->channels != grid->channels) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, source->path, -1, "its %s has %d channels, the table before it %d",
                            gonio_half_name(grid->half), grid->channels, (*out)->channels);
    }
    if (status == GONIO_OK) {
        (*out)->isotropic = isotropic && (first || (*out)->isotropic);
        (*out)->transmission = (*out)->transmission || grid->half != GONIO_REFLECTION;
        memcpy((*out)->channel_names, grid->names, (size_t)grid->channels * sizeof *grid->names);
        status = add_nodes(grid, *out, error);
    }
    if (status == GONIO_OK && (*out)->n == 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, source->path, 1, "no value above the horizon in the table");
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    } else if (report != NULL) {
        *report = grid->report;
        snprintf(report->format, sizeof report->format, "%s", format);
        report->first_negative_line = grid->report.negatives > 0 ? grid->report.first_negative_line : -1;
    }
    for (int k = 0; k < GONIO_GRID_AXES; k++) {
        free(grid->axis[k].deg);
    }
    free(grid->values);
    free(grid->names);
    return status;
}

void gonio_xyz_to_rgb(const double xyz[3], double rgb[3]) {
    const double x = xyz[0], y = xyz[1], z = xyz[2];
    rgb[0] = fmax(0, 3.2404542 * x - 1.5371385 * y - 0.4985314 * z);
    rgb[1] = fmax(0, -0.9692660 * x + 1.8760108 * y + 0.0415560 * z);
    rgb[2] = fmax(0, 0.0556434 * x - 0.2040259 * y + 1.0572252 * z);
}

// Of the matrix above the inverse to all digits: what is read is written again as it was.
void gonio_rgb_to_xyz(const double rgb[3], double xyz[3]) {
    const double r = rgb[0], g = rgb[1], b = rgb[2];
    xyz[0] = 0.41245643226823603 * r + 0.35757607628002747 * g + 0.1804374802944501 * b;
    xyz[1] = 0.212672846318362 * r + 0.7151521671548808 * g + 0.07217499957321262 * b;
    xyz[2] = 0.01933390410329902 * r + 0.11919202824322096 * g + 0.950304073677404 * b;
}
