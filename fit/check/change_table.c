// SPDX-License-Identifier: BSD-3-Clause
// The transforms of a table, in place on a copy of its samples. Poles take part, though the measures leave them out.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/check/change.h"
#include "fit/check/measures.h"

// The stored direction that this one is; GONIO_TABLE_NONE: none.
static size_t find(const gonio_table_direction *d, size_t n, double theta, double phi, bool folded) {
    const double turn = 2 * GONIO_PI, tolerance = 2 * GONIO_TABLE_TOLERANCE;
    size_t low = 0, high = n;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        *(d[middle].theta < theta - tolerance ? &low : &high) =
            d[middle].theta < theta - tolerance ? middle + 1 : middle;
    }
    for (size_t k = low; k < n && d[k].theta < theta + tolerance; k++) {
        const double apart = fabs(remainder(d[k].phi - phi, turn)), mirrored = fabs(remainder(d[k].phi + phi, turn));
        if (theta < tolerance || apart < tolerance || (folded && mirrored < tolerance)) {
            return k;
        }
    }
    return GONIO_TABLE_NONE;
}

// ---- reciprocity ----

static size_t partner(const gonio_table *t, size_t p, size_t q) {
    const gonio_table_direction i = t->in[p], o = t->out[q];
    // An isotropic table has its light at azimuth 0: exchanged directions are turned back there.
    const double phi_i = t->isotropic ? 0 : o.phi, phi_o = t->isotropic ? -o.phi : i.phi;
    const size_t row = find(t->in, t->n_in, o.theta, phi_i, false);
    const size_t column = find(t->out, t->n_out, i.theta, phi_o, t->folded);
    return row == GONIO_TABLE_NONE || column == GONIO_TABLE_NONE ? GONIO_TABLE_NONE : t->cell[row * t->n_out + column];
}

static void make_reciprocal(const gonio_table *t, const gonio_change *change, gonio_samples *out) {
    for (size_t p = 0; p < t->n_in; p++) {
        for (size_t q = 0; q < t->n_out; q++) {
            const size_t a = t->cell[p * t->n_out + q], b = partner(t, p, q);
            // The smaller number first, so that both sums have one order and the values come out the same.
            const size_t of[2] = {a < b ? a : b, a < b ? b : a};
            double weight[2];
            for (size_t c = 0; b != GONIO_TABLE_NONE && a != b && c < (size_t)out->channels; c++) {
                gonio_change_weigh(t->samples, c, 2, of, weight);
                gonio_change_towards(change, t->samples, a, c, 2, of, weight, out);
            }
        }
    }
}

// ---- isotropy ----

static void join(const gonio_table *t, const gonio_change *change, const size_t *of, size_t n, double *weight,
                 gonio_samples *out) {
    for (size_t c = 0; c < (size_t)out->channels; c++) {
        gonio_change_weigh(t->samples, c, n, of, weight);
        for (size_t j = 0; j < n; j++) {
            gonio_change_towards(change, t->samples, of[j], c, n, of, weight, out);
        }
    }
}

static gonio_status make_isotropic(const gonio_table *t, const gonio_change *change, gonio_samples *out,
                                   gonio_error *error) {
    if (t->phis == 0) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "isotropy: the table has no rings of equal azimuths on both sides to average over");
    }
    const size_t n = t->phis;
    size_t *of = malloc(n * sizeof *of);
    double *weight = malloc(n * sizeof *weight);
    if (of == NULL || weight == NULL) {
        free(weight);
        free(of);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to average over %zu azimuths", n);
    }
    for (size_t row = 0; row < t->rows; row += n) {
        for (size_t column = 0; column < t->columns; column++) {
            for (size_t j = 0; j < n; j++) {
                of[j] = gonio_table_at(t, row + j, column - column % n + (column % n + j) % n);
            }
            join(t, change, of, n, weight, out);
        }
    }
    const bool pole_in = t->in[0].theta < GONIO_TABLE_TOLERANCE, pole_out = t->out[0].theta < GONIO_TABLE_TOLERANCE;
    for (size_t column = 0; pole_in && column < t->columns; column += n) {
        for (size_t j = 0; j < n; j++) {
            of[j] = t->cell[t->ring_out[column + j]];
        }
        join(t, change, of, n, weight, out);
    }
    for (size_t row = 0; pole_out && row < t->rows; row += n) {
        for (size_t j = 0; j < n; j++) {
            of[j] = t->cell[t->ring_in[row + j] * t->n_out];
        }
        join(t, change, of, n, weight, out);
    }
    free(weight);
    free(of);
    return GONIO_OK;
}

// ---- energy ----

static void scale(gonio_samples *s, size_t i, double by) {
    const size_t c = (size_t)s->channels;
    for (size_t k = i * c; k < (i + 1) * c; k++) {
        s->values[k] *= by;
        if (s->sigma_random != NULL) {
            s->sigma_random[k] *= by;
            s->sigma_systematic[k] *= by;
        }
    }
}

// One factor for all channels of an incidence, of the largest albedo, so that no colour changes.
static gonio_status make_conserving(const gonio_table *t, const gonio_change *change, int threads, gonio_samples *out,
                                    gonio_error *error) {
    gonio_check_report r;
    const gonio_status status = gonio_check_samples(t->samples, threads, &r, error);
    if (status != GONIO_OK) {
        return status;
    }
    bool *done = calloc(out->n, sizeof *done); // light at an isotropic pole shares samples
    for (size_t p = 0; done != NULL && p < t->n_in; p++) {
        const double albedo = change->one_scalar ? r.energy : r.albedos[p].largest;
        const double by = isfinite(albedo) ? gonio_change_factor(change, albedo) : 1;
        for (size_t q = 0; q < t->n_out; q++) {
            const size_t i = t->cell[p * t->n_out + q];
            if (!done[i]) {
                scale(out, i, by);
                done[i] = true;
            }
        }
    }
    gonio_check_report_free(&r);
    const bool memory = done != NULL;
    free(done);
    return memory ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to change %zu samples", out->n);
}

gonio_status gonio_change_table(const gonio_table *t, const gonio_change *change, int threads, gonio_samples **out,
                                gonio_error *error) {
    switch (change->kind) {
    case GONIO_CHANGE_RECIPROCITY:
        if (t->row_of_column[0] == GONIO_TABLE_NONE && t->columns > 0) {
            return gonio_change_scattered(t->samples, change, threads, out, error); // exchanged directions are missing
        }
        make_reciprocal(t, change, *out);
        return GONIO_OK;
    case GONIO_CHANGE_ISOTROPY:
        return t->isotropic ? GONIO_OK : make_isotropic(t, change, *out, error);
    case GONIO_CHANGE_ENERGY:
        return make_conserving(t, change, threads, *out, error);
    default:
        return gonio_change_separable(t, change, *out, error);
    }
}
