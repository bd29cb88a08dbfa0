// SPDX-License-Identifier: BSD-3-Clause
// Missing values that a file writes as numbers and that only their neighbours give away.
//
// A detector that shadows the lamp, a blocked beam or a row that was never filled leaves blocks of exact zeros. A
// surface that is dark there has dark neighbours, and a noise that the laboratory clamped has neighbours that scatter;
// but where the nearest values that are not zero are bright and agree with each other, a zero among them is none. The
// nearest are sought over the distance of the incident and the outgoing direction vectors, isotropic sets turned to
// phi_i = 0.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/nearest.h"
#include "base/statistics.h"
#include "base/vector.h"
#include "io/format.h"

static const struct {
    size_t neighbours; // not zero, that must agree
    size_t block;      // zeros that make one
    double bright;     // share of the median value that a neighbour must have
    double agreement;  // smallest over largest of the neighbours
    double pairs;      // of zeros and others at most; beyond, every second, third ... zero is looked at
    double light_deg;  // a block this near to the light is told so
    size_t grown;      // zeros at most whose blocks are grown: its work is their square
    size_t ceiling;    // equal largest values that are told
} tuning = {8, 3, 0.2, 0.5, 1e8, 30, 5000, 8};

typedef struct place {
    gonio_vec3 wi, wo;
    double level; // mean over the channels
} place;

static place place_of(const gonio_samples *s, size_t i) {
    const gonio_pair *p = &s->pairs[i];
    const double turn = s->isotropic ? p->phi_i : 0;
    place at = {gonio_direction(p->theta_i, p->phi_i - turn), gonio_direction(p->theta_o, p->phi_o - turn), 0};
    for (int c = 0; c < s->channels; c++) {
        at.level += s->values[i * (size_t)s->channels + (size_t)c] / s->channels;
    }
    return at;
}

static bool all_zero(const gonio_samples *s, size_t i) {
    for (int c = 0; c < s->channels; c++) {
        if (s->values[i * (size_t)s->channels + (size_t)c] != 0) {
            return false;
        }
    }
    return true;
}

static double gap(const place *a, const place *b) {
    const double x = a->wi.x - b->wi.x, y = a->wi.y - b->wi.y, z = a->wi.z - b->wi.z;
    const double u = a->wo.x - b->wo.x, v = a->wo.y - b->wo.y, w = a->wo.z - b->wo.z;
    return x * x + y * y + z * z + u * u + v * v + w * w;
}

// What the nearest of the others say of a zero.
typedef struct verdict {
    bool bright, agreed; // all are; and they agree with each other
    double gap;          // to the nearest
} verdict;

static verdict judge(const place *zero, const place *others, size_t n, double median) {
    gonio_nearest near = {.wanted = tuning.neighbours};
    for (size_t k = 0; k < n; k++) {
        gonio_nearest_show(&near, gap(zero, &others[k]), k);
    }
    double low = INFINITY, high = -INFINITY;
    for (size_t k = 0; k < near.found; k++) {
        low = fmin(low, others[near.index[k]].level);
        high = fmax(high, others[near.index[k]].level);
    }
    const bool bright = near.found == near.wanted && low >= tuning.bright * median;
    return (verdict){bright, bright && low >= tuning.agreement * high, near.found > 0 ? near.distance[0] : INFINITY};
}

typedef struct search {
    place *zeros, *others;
    verdict *verdicts;
    size_t *rows; // of the zeros
    size_t n_zeros, n_others;
    bool *keep; // of every row
} search;

// A zero beside one of a block belongs to it where its own neighbours are bright, though a lobe be among them.
static size_t grow_blocks(search *f) {
    size_t grown = 0, last;
    do {
        last = grown;
        for (size_t k = 0; k < f->n_zeros; k++) {
            for (size_t j = 0; f->keep[f->rows[k]] && f->verdicts[k].bright && j < f->n_zeros; j++) {
                if (!f->keep[f->rows[j]] && gap(&f->zeros[k], &f->zeros[j]) <= 4 * f->verdicts[k].gap) {
                    f->keep[f->rows[k]] = false;
                    grown++;
                }
            }
        }
    } while (grown > last);
    return grown;
}

static size_t find_blocks(search *f, double median) {
    const double pairs = (double)f->n_zeros * (double)f->n_others;
    const size_t step = pairs > tuning.pairs ? (size_t)ceil(pairs / tuning.pairs) : 1;
    size_t found = 0;
    for (size_t k = 0; k < f->n_zeros; k += step) {
        const verdict v = judge(&f->zeros[k], f->others, f->n_others, median);
        for (size_t j = k; j < k + step && j < f->n_zeros; j++) {
            f->verdicts[j] = v;
            f->keep[f->rows[j]] = !v.agreed;
            found += v.agreed;
        }
    }
    return found >= tuning.block && f->n_zeros <= tuning.grown ? found + grow_blocks(f) : found;
}

static double angle_deg(gonio_vec3 a, gonio_vec3 b) {
    return gonio_degrees(acos(fmin(fmax(a.x * b.x + a.y * b.y + a.z * b.z, -1), 1)));
}

static void tell_blocks(const gonio_samples *s, const search *f, const long long *lines, size_t found, bool leave_out,
                        char *notes, size_t size) {
    double from_light = 0, theta[2] = {90, 0};
    long long first = -1;
    for (size_t k = 0; k < f->n_zeros; k++) {
        if (!f->keep[f->rows[k]]) {
            from_light = fmax(from_light, angle_deg(f->zeros[k].wi, f->zeros[k].wo));
            const double deg = gonio_degrees(s->pairs[f->rows[k]].theta_o);
            theta[0] = fmin(theta[0], deg);
            theta[1] = fmax(theta[1], deg);
            first = first < 0 ? lines[f->rows[k]] : first;
        }
    }
    char where[80];
    if (from_light <= tuning.light_deg) {
        snprintf(where, sizeof where, "within %.3g deg of the light", from_light);
    } else {
        snprintf(where, sizeof where, "at theta_o of %.3g to %.3g deg", theta[0], theta[1]);
    }
    gonio_text_append(notes, size,
                      "%zu rows of exact zeros %s (the first at line %lld) stand among bright neighbours: %s\n", found,
                      where, first,
                      leave_out ? "taken for missing and left out; --missing none keeps them"
                                : "are they missing? --missing auto or 0 leaves them out");
}

static gonio_status look_for_blocks(gonio_samples **samples, const long long *lines, bool leave_out, search *f,
                                    double *levels, char *notes, size_t size, gonio_error *error) {
    gonio_samples *s = *samples;
    for (size_t i = 0; i < s->n; i++) {
        f->keep[i] = true;
        const place at = place_of(s, i);
        if (all_zero(s, i)) {
            f->rows[f->n_zeros] = i;
            f->zeros[f->n_zeros++] = at;
        } else {
            levels[f->n_others] = at.level;
            f->others[f->n_others++] = at;
        }
    }
    if (f->n_zeros < tuning.block || f->n_others < tuning.neighbours) {
        return GONIO_OK;
    }
    const size_t found = find_blocks(f, gonio_median(levels, f->n_others));
    if (found < tuning.block) {
        return GONIO_OK;
    }
    tell_blocks(s, f, lines, found, leave_out, notes, size);
    gonio_samples *rest;
    const gonio_status status = leave_out ? gonio_samples_select(s, f->keep, &rest, error) : GONIO_OK;
    if (leave_out && status == GONIO_OK) {
        gonio_samples_free(s);
        *samples = rest;
    }
    return status;
}

// A detector at its end reads the same number again and again: told, as the truth lies above it.
static void look_for_ceiling(const gonio_samples *s, const long long *lines, char *notes, size_t size) {
    for (int c = 0; c < s->channels; c++) {
        double top = -INFINITY, below = -INFINITY;
        size_t count = 0;
        long long first = -1;
        for (size_t i = 0; i < s->n; i++) {
            const double v = s->values[i * (size_t)s->channels + (size_t)c];
            if (v > top) {
                below = top;
                top = v;
                count = 0;
                first = lines[i];
            } else if (v < top) {
                below = fmax(below, v);
            }
            count += v == top;
        }
        if (count >= tuning.ceiling && 2 * count < s->n && below < 0.999 * top) {
            gonio_text_append(notes, size,
                              "channel %s: the largest value, %g, stands in %zu rows (the first at line %lld): was the "
                              "detector at its end?\n",
                              s->channel_names[c], top, count, first);
        }
    }
}

gonio_status gonio_missing_look(gonio_samples **samples, const long long *lines, bool leave_out, char *notes,
                                size_t size, gonio_error *error) {
    gonio_samples *s = *samples;
    size_t zeros = 0;
    for (size_t i = 0; i < s->n; i++) {
        zeros += all_zero(s, i);
    }
    look_for_ceiling(s, lines, notes, size);
    if (zeros < tuning.block) {
        return GONIO_OK;
    }
    const size_t n = s->n;
    search f = {.zeros = malloc(n * sizeof *f.zeros),
                .others = malloc(n * sizeof *f.others),
                .verdicts = malloc(n * sizeof *f.verdicts),
                .rows = malloc(n * sizeof *f.rows),
                .keep = malloc(n * sizeof *f.keep)};
    double *levels = malloc(n * sizeof *levels);
    const bool room =
        f.zeros != NULL && f.others != NULL && f.verdicts != NULL && f.rows != NULL && f.keep != NULL && levels != NULL;
    const gonio_status status = room ? look_for_blocks(samples, lines, leave_out, &f, levels, notes, size, error)
                                     : gonio_fail(error, GONIO_E_MEMORY, "no memory to look for missing values");
    free(f.zeros);
    free(f.others);
    free(f.verdicts);
    free(f.rows);
    free(f.keep);
    free(levels);
    return status;
}
