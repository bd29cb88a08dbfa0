// SPDX-License-Identifier: BSD-3-Clause
// Klems matrices: J. H. Klems, "A new method for predicting the solar heat gain of complex fenestration systems"
// (1994), as WINDOW and Radiance write them. A value is f_r in 1/sr, the average over two patches; there is no cosine
// in it.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/number.h"
#include "io/radiance/radiance.h"

// The three bases that WINDOW knows by name; their rings may be left out of the file.
static const struct known {
    const char *name;
    int rings;
    double bound[10]; // deg
    int n[9];
} bases[] = {
    {"LBNL/Klems Full", 9, {0, 5, 15, 25, 35, 45, 55, 65, 75, 90}, {1, 8, 16, 20, 24, 24, 24, 16, 12}},
    {"LBNL/Klems Half", 7, {0, 6.5, 19.5, 32.5, 45.5, 58.5, 71.5, 90}, {1, 8, 12, 16, 20, 12, 8}},
    {"LBNL/Klems Quarter", 5, {0, 9, 27, 45, 63, 90}, {1, 8, 12, 12, 8}},
};

static bool add_ring(gonio_klems_basis *basis, double upper_deg, int n) {
    const int r = basis->rings;
    if (r == GONIO_KLEMS_RINGS_MAX || n < 1 || n > GONIO_KLEMS_PATCHES_MAX - basis->patches) {
        return false;
    }
    basis->bound[r + 1] = gonio_radians(upper_deg);
    basis->n[r] = n;
    basis->first[r] = basis->patches;
    basis->patches += n;
    basis->rings++;
    return basis->bound[r + 1] > basis->bound[r] && upper_deg <= 90;
}

static double number_in(const xmlNode *node, const char *name) {
    const char *text = gonio_radiance_text(node, name);
    char *end;
    const double value = gonio_number_parse(text, &end);
    return end != text && *end == 0 ? value : NAN;
}

// The rings that the file states for a basis of its own.
static gonio_status stated_rings(const gonio_radiance_file *file, const xmlNode *stated, gonio_klems_basis *basis,
                                 gonio_error *error) {
    for (const xmlNode *ring = gonio_radiance_child(stated, "AngleBasisBlock"); ring != NULL;
         ring = gonio_radiance_next(ring)) {
        const xmlNode *bounds = gonio_radiance_child(ring, "ThetaBounds");
        const double low = number_in(bounds, "LowerTheta"), high = number_in(bounds, "UpperTheta");
        const double n = number_in(ring, "nPhis");
        if (!(fabs(low - gonio_degrees(basis->bound[basis->rings])) < 1e-6 && n >= 1 && n <= 4096) ||
            !add_ring(basis, high, (int)n)) {
            return gonio_radiance_fail(file, xmlGetLineNo(ring), error,
                                       "a ring of %g to %g deg with %g patches; expected rings that follow one another "
                                       "from 0 to 90 deg, of 1 patch or more",
                                       low, high, n);
        }
    }
    return basis->rings > 0 && fabs(basis->bound[basis->rings] - GONIO_PI / 2) < 1e-6
               ? GONIO_OK
               : gonio_radiance_fail(file, xmlGetLineNo(stated), error, "the rings of a basis end before 90 deg");
}

void gonio_klems_known(const char *name, gonio_klems_basis *basis) {
    *basis = (gonio_klems_basis){0};
    for (size_t k = 0; k < sizeof bases / sizeof *bases; k++) {
        for (int r = 0; strcasecmp(bases[k].name, name) == 0 && r < bases[k].rings; r++) {
            add_ring(basis, bases[k].bound[r + 1], bases[k].n[r]);
        }
    }
}

static gonio_status find_basis(const gonio_radiance_file *file, const gonio_radiance_block *block, const char *name,
                               gonio_klems_basis *basis, gonio_error *error) {
    *basis = (gonio_klems_basis){0};
    for (const xmlNode *stated = gonio_radiance_child(file->definition, "AngleBasis"); stated != NULL;
         stated = gonio_radiance_next(stated)) {
        if (strcasecmp(gonio_radiance_text(stated, "AngleBasisName"), name) == 0 &&
            gonio_radiance_child(stated, "AngleBasisBlock") != NULL) {
            return stated_rings(file, stated, basis, error);
        }
    }
    gonio_klems_known(name, basis);
    return basis->rings > 0 ? GONIO_OK
                            : gonio_radiance_fail(file, block->line, error,
                                                  "angle basis '%.60s' is neither defined in the file nor one of "
                                                  "LBNL/Klems Full, Half and Quarter",
                                                  name);
}

static gonio_status read_matrix(const gonio_radiance_file *file, const gonio_radiance_block *block, bool rows,
                                gonio_klems *klems, gonio_error *error) {
    const size_t in = (size_t)klems->in.patches, out = (size_t)klems->out.patches;
    klems->values = malloc(in * out * sizeof *klems->values);
    if (klems->values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a matrix of %zu x %zu", out, in);
    }
    const char *at = block->data;
    long long line = block->line;
    double value;
    for (size_t k = 0; k < in * out; k++) {
        if (!gonio_radiance_number(&at, &line, &value)) {
            return gonio_radiance_fail(file, line, error, "number %zu of %zu: expected a finite number, found '%.12s'",
                                       k + 1, in * out, at);
        }
        // Columns: the outgoing patch changes slowest. Rows: the other way about.
        const size_t o = rows ? k % out : k / in, i = rows ? k / out : k % in;
        klems->values[o * in + i] = value;
    }
    return gonio_radiance_number(&at, &line, &value) || *at != 0
               ? gonio_radiance_fail(file, line, error,
                                     "more than the %zu numbers of %zu outgoing and %zu incident "
                                     "patches",
                                     in * out, out, in)
               : GONIO_OK;
}

gonio_status gonio_klems_read(const gonio_radiance_file *file, const gonio_radiance_block *block, gonio_klems *klems,
                              gonio_error *error) {
    *klems = (gonio_klems){0};
    const bool rows = strcasecmp(file->structure, "Rows") == 0;
    gonio_status status = find_basis(file, block, block->column, &klems->in, error);
    status = status == GONIO_OK ? find_basis(file, block, block->row, &klems->out, error) : status;
    return status == GONIO_OK ? read_matrix(file, block, rows, klems, error) : status;
}

static int patch_of(const gonio_klems_basis *basis, double theta, double phi) {
    int r = 0;
    while (r + 1 < basis->rings && theta >= basis->bound[r + 1]) {
        r++;
    }
    const int n = basis->n[r], k = (int)floor(phi / (2 * GONIO_PI) * n + 0.5) % n;
    return basis->first[r] + (k < 0 ? k + n : k);
}

// The incident patches of these files are turned by half a turn, so that a patch and its mirror direction have one
// number.
double gonio_klems_value(const gonio_klems *klems, gonio_vec3 wi, gonio_vec3 wo) {
    const gonio_vec3 turned = {-wi.x, -wi.y, wi.z};
    const int i = patch_of(&klems->in, gonio_direction_theta(turned), gonio_direction_phi(turned));
    const int o = patch_of(&klems->out, gonio_direction_theta(wo), gonio_direction_phi(wo));
    return klems->values[(size_t)o * (size_t)klems->in.patches + (size_t)i];
}

// A ring of one patch is a cap: its centre is its pole.
static void centre_of(const gonio_klems_basis *basis, int patch, double *theta, double *phi) {
    int r = 0;
    while (r + 1 < basis->rings && patch >= basis->first[r + 1]) {
        r++;
    }
    const double middle = gonio_degrees(basis->bound[r] + basis->bound[r + 1]) / 2;
    *theta = gonio_angle_canonical(gonio_radians(r == 0 && basis->n[r] == 1 ? 0 : middle));
    *phi = gonio_angle_canonical(2 * GONIO_PI * (patch - basis->first[r]) / basis->n[r]);
}

gonio_pair gonio_klems_centre(const gonio_klems *klems, int in, int out) {
    gonio_pair pair;
    centre_of(&klems->in, in, &pair.theta_i, &pair.phi_i);
    centre_of(&klems->out, out, &pair.theta_o, &pair.phi_o);
    pair.phi_i = gonio_angle_canonical(remainder(pair.phi_i + GONIO_PI, 2 * GONIO_PI));
    return pair;
}
