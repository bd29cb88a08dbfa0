// SPDX-License-Identifier: BSD-3-Clause
// The transforms of scattered samples: what the property asks for is interpolated by the kernel (fit/check/kernel.h),
// the one by which the property is measured, so that at delta 1 the measure is 0.
//
// Where a sample's exchanged directions, or those of the turned sample, were not measured, it gets partners there, of
// the interpolated values, and all move towards their mean: the measure then finds the partners in place of
// interpolated values. Separability makes the table on which it is measured: products have no scattered form. The
// interpolation's own error is part of the partner's variance, so a partner that is not well known counts little.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/check/change.h"
#include "fit/check/kernel.h"
#include "fit/check/measures.h"

enum {
    TURNS = GONIO_CHECK_TURNS,
    ROUNDS = 8, // of energy: each leaves a part of what interpolation makes of the last one
};

// What the kernel says at a pair, with its uncertainty: what its samples have and what it errs. Systematic is that of a
// sample beside it, relatively.
typedef struct interpolated {
    double values[GONIO_CHANNELS_MAX], random[GONIO_CHANNELS_MAX], systematic[GONIO_CHANNELS_MAX];
} interpolated;

static bool interpolate(const gonio_kernel *k, gonio_pair p, size_t without, size_t beside, interpolated *out) {
    const gonio_samples *s = k->samples;
    const size_t c = (size_t)s->channels;
    const bool there = gonio_kernel_value(k, gonio_direction(p.theta_i, p.phi_i), gonio_direction(p.theta_o, p.phi_o),
                                          without, out->values, out->random);
    for (size_t j = 0; j < c && s->sigma_random != NULL; j++) {
        const double own = s->values[beside * c + j], part = own != 0 ? fabs(out->values[j] / own) : 1;
        // Relative errors of the interpolation are about the same everywhere.
        out->random[j] = hypot(out->random[j], 1.4826 * k->left_out * out->values[j]);
        out->systematic[j] = s->sigma_systematic[beside * c + j] * part;
    }
    return there;
}

static gonio_status add(gonio_samples *out, const gonio_pair *pair, const interpolated *z, gonio_error *error) {
    const bool with = out->sigma_random != NULL;
    return gonio_samples_add(out, pair, z->values, with ? z->random : NULL, with ? z->systematic : NULL, error);
}

// ---- reciprocity and isotropy: values that ought to be equal ----

// Where else a sample's value ought to be found: its directions exchanged, or the sample turned.
typedef struct orbit {
    const gonio_samples *in;
    const gonio_kernel *kernel;
    bool turns;
    size_t places; // with its own
} orbit;

static gonio_pair place_of(const orbit *o, size_t i, size_t place) {
    gonio_pair p = o->in->pairs[i];
    if (o->turns) {
        const double angle = 2 * GONIO_PI * (double)place / (double)o->places;
        p.phi_i = gonio_angle_canonical(remainder(p.phi_i + angle, 2 * GONIO_PI));
        p.phi_o = gonio_angle_canonical(remainder(p.phi_o + angle, 2 * GONIO_PI));
    } else if (place > 0) {
        p = gonio_pair_swapped(p);
        if (o->in->isotropic) {
            p.phi_o = gonio_angle_canonical(remainder(p.phi_o - p.phi_i, 2 * GONIO_PI));
            p.phi_i = 0;
        }
    }
    return p;
}

static size_t rows_at(const orbit *o, size_t i, size_t place, size_t *rows) {
    const gonio_pair p = place > 0 ? place_of(o, i, place) : o->in->pairs[i];
    return gonio_kernel_at(o->kernel, gonio_direction(p.theta_i, p.phi_i), gonio_direction(p.theta_o, p.phi_o),
                           SIZE_MAX, rows);
}

#define ALONE SIZE_MAX // reciprocal by itself, or far from all that was measured

typedef struct member {
    size_t class, row; // class: the least row of all places
} member;

static int by_class(const void *left, const void *right) {
    const member *a = left, *b = right;
    return a->class != b->class ? (a->class < b->class ? -1 : 1) : (a->row > b->row) - (a->row < b->row);
}

// The class of sample i, and at which places nothing was measured.
static size_t class_of(const orbit *o, size_t i, bool *lonely) {
    size_t rows[GONIO_NEAREST_MAX], class = i;
    for (size_t q = 0; q < o->places; q++) {
        const size_t n = rows_at(o, i, q, rows);
        lonely[q] = n == 0;
        for (size_t j = 0; j < n; j++) {
            if (q > 0 && !o->turns && rows[j] == i) {
                return ALONE;
            }
            class = rows[j] < class ? rows[j] : class;
        }
    }
    return class;
}

// Partners of sample i, the least of its class, where nothing was measured; none where one of them is too far away.
static gonio_status add_partners(const orbit *o, size_t i, const bool *lonely, gonio_samples *out, bool *there,
                                 gonio_error *error) {
    interpolated *z = malloc(o->places * sizeof *z);
    gonio_status status = z != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for partners");
    for (size_t q = 0; q < o->places && *there && status == GONIO_OK; q++) {
        *there = !lonely[q] || interpolate(o->kernel, place_of(o, i, q), i, i, &z[q]);
    }
    for (size_t q = 0; q < o->places && *there && status == GONIO_OK; q++) {
        const gonio_pair p = place_of(o, i, q);
        status = lonely[q] ? add(out, &p, &z[q], error) : GONIO_OK;
        if (status == GONIO_OK && lonely[q] && o->in->group != NULL) {
            status = gonio_samples_set_group(out, out->n - 1, o->in->group[i], error);
        }
    }
    free(z);
    return status;
}

// Partners behind the samples in `out`, and who belongs to whom: members of *n.
static gonio_status find_partners(const orbit *o, gonio_samples *out, member *members, size_t *n, gonio_error *error) {
    gonio_status status = GONIO_OK;
    bool *left = calloc(o->in->n, sizeof *left); // classes that stay as they are
    if (left == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for partners");
    }
    for (size_t i = 0; i < o->in->n && status == GONIO_OK; i++) {
        bool lonely[TURNS], there = true;
        const size_t class = class_of(o, i, lonely), from = out->n;
        if (class == i) { // the least row comes first
            status = add_partners(o, i, lonely, out, &there, error);
            left[i] = !there;
        }
        if (class == ALONE || left[class]) {
            continue;
        }
        members[(*n)++] = (member){class, i};
        for (size_t row = from; row < out->n; row++) {
            members[(*n)++] = (member){class, row};
        }
    }
    free(left);
    return status;
}

static gonio_status join_classes(const gonio_change *change, member *members, size_t n, gonio_samples *out,
                                 gonio_error *error) {
    gonio_samples *in = NULL;
    bool *all = malloc(out->n * sizeof *all);
    size_t *of = malloc((n + 1) * sizeof *of);
    double *weight = malloc((n + 1) * sizeof *weight);
    gonio_status status = all != NULL && of != NULL && weight != NULL
                              ? GONIO_OK
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory to join %zu samples", n);
    if (status == GONIO_OK) {
        memset(all, true, out->n * sizeof *all);
        status = gonio_samples_select(out, all, &in, error);
        qsort(members, n, sizeof *members, by_class);
    }
    for (size_t from = 0, to; status == GONIO_OK && from < n; from = to) {
        for (to = from; to < n && members[to].class == members[from].class; to++) {
            of[to - from] = members[to].row;
        }
        for (size_t c = 0; c < (size_t)out->channels; c++) {
            gonio_change_weigh(in, c, to - from, of, weight);
            for (size_t j = 0; j < to - from; j++) {
                gonio_change_towards(change, in, of[j], c, to - from, of, weight, out);
            }
        }
    }
    gonio_samples_free(in);
    free(weight);
    free(of);
    free(all);
    return status;
}

static gonio_status make_equal(const gonio_samples *in, const gonio_kernel *k, const gonio_change *change,
                               gonio_samples *out, gonio_error *error) {
    const bool turns = change->kind == GONIO_CHANGE_ISOTROPY;
    const orbit o = {in, k, turns, turns ? TURNS : 2};
    member *members = malloc(o.places * in->n * sizeof *members);
    size_t n = 0;
    gonio_status status = members != NULL ? find_partners(&o, out, members, &n, error)
                                          : gonio_fail(error, GONIO_E_MEMORY, "no memory to join %zu samples", in->n);
    status = status == GONIO_OK ? join_classes(change, members, n, out, error) : status;
    free(members);
    return status;
}

static gonio_status make_isotropic(const gonio_samples *in, const gonio_kernel *k, const gonio_change *change,
                                   gonio_samples *out, gonio_error *error) {
    const gonio_status status = make_equal(in, k, change, out, error);
    if (status == GONIO_OK && change->delta == 1) { // turned to azimuth 0 and declared isotropic: no partners needed
        out->n = in->n;
        out->isotropic = true;
        for (size_t i = 0; i < out->n; i++) {
            out->pairs[i].phi_o =
                gonio_angle_canonical(remainder(out->pairs[i].phi_o - out->pairs[i].phi_i, 2 * GONIO_PI));
            out->pairs[i].phi_i = 0;
        }
    }
    return status;
}

// ---- energy ----

static double albedo_at(const gonio_check_report *r, const gonio_pair *p, bool isotropic) {
    const gonio_check_albedo_point *best = NULL;
    double nearest = INFINITY;
    const gonio_vec3 wi = gonio_direction(p->theta_i, isotropic ? 0 : p->phi_i);
    for (size_t k = 0; k < r->incidences; k++) {
        const gonio_vec3 at = gonio_direction(r->albedos[k].theta_i, isotropic ? 0 : r->albedos[k].phi_i);
        const double apart = hypot(hypot(at.x - wi.x, at.y - wi.y), at.z - wi.z);
        if (isfinite(r->albedos[k].largest) && apart < nearest) {
            nearest = apart;
            best = &r->albedos[k];
        }
    }
    return best != NULL ? best->largest : 0;
}

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

// Where the albedo is the interpolant's, scaling one incidence changes its neighbours' too: again, until none exceeds
// the ceiling, at last by what is left for all of them.
gonio_status gonio_change_conserve(const gonio_change *change, int threads, gonio_samples *out, gonio_error *error) {
    const bool sheet = gonio_samples_halves(out) != 1u << GONIO_REFLECTION;
    gonio_status status = GONIO_OK;
    for (int round = 0; status == GONIO_OK && round <= ROUNDS; round++) {
        gonio_check_report r = {0};
        status = sheet ? gonio_check_samples(out, threads, &r, error)
                       : gonio_check_interpolated(out, GONIO_CHECK_OF_ENERGY, threads, &r, error);
        const bool over = status == GONIO_OK && r.energy > change->ceiling * (1 + 1e-12), last = round == ROUNDS;
        for (size_t i = 0; over && i < out->n; i++) {
            scale(out, i,
                  gonio_change_factor(
                      change, change->one_scalar || last ? r.energy : albedo_at(&r, &out->pairs[i], out->isotropic)));
        }
        gonio_check_report_free(&r);
        if (!over || change->delta < 1) {
            break;
        }
    }
    return status;
}

// ---- separability ----

static gonio_status make_table(const gonio_samples *in, const gonio_kernel *k, gonio_samples **out,
                               gonio_error *error) {
    gonio_plan *plan = NULL;
    interpolated *z = malloc(sizeof *z);
    gonio_status status = z != NULL ? gonio_check_grid_plan(in->isotropic, &plan, error)
                                    : gonio_fail(error, GONIO_E_MEMORY, "no memory for an interpolated value");
    gonio_samples *rows = *out;
    rows->n = 0;
    for (size_t i = 0; status == GONIO_OK && i < plan->n; i++) {
        interpolate(k, plan->poses[i], SIZE_MAX, gonio_kernel_nearest(k, &plan->poses[i]), z);
        status = add(rows, &plan->poses[i], z, error);
    }
    gonio_plan_free(plan);
    free(z);
    return status;
}

static gonio_status separate(const gonio_samples *in, const gonio_kernel *k, const gonio_change *change,
                             gonio_samples **out, gonio_error *error) {
    gonio_samples *changed = NULL;
    gonio_table *table = NULL;
    gonio_status status = make_table(in, k, out, error);
    status = status == GONIO_OK ? gonio_change_copy(*out, false, &changed, error) : status;
    status = status == GONIO_OK ? gonio_table_of(*out, &table, error) : status;
    status = status == GONIO_OK ? gonio_change_separable(table, change, changed, error) : status;
    gonio_table_free(table);
    if (status == GONIO_OK) {
        gonio_samples_free(*out);
        *out = changed;
    } else {
        gonio_samples_free(changed);
    }
    return status;
}

gonio_status gonio_change_scattered(const gonio_samples *in, const gonio_change *change, int threads,
                                    gonio_samples **out, gonio_error *error) {
    if (change->kind == GONIO_CHANGE_ENERGY) {
        return gonio_change_conserve(change, threads, *out, error);
    }
    if (change->kind == GONIO_CHANGE_ISOTROPY && in->isotropic) {
        return GONIO_OK;
    }
    gonio_kernel k;
    gonio_status status = gonio_kernel_new(in, false, &k, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = change->kind == GONIO_CHANGE_RECIPROCITY ? make_equal(in, &k, change, *out, error)
             : change->kind == GONIO_CHANGE_ISOTROPY  ? make_isotropic(in, &k, change, *out, error)
                                                      : separate(in, &k, change, out, error);
    gonio_kernel_free(&k);
    return status;
}
