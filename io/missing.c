// SPDX-License-Identifier: BSD-3-Clause
// Missing values that a file writes as numbers and that only the other values give away.
//
// A number of a kind that programs write for none, 9999 or 65535, far above all others: no lobe has a value that round
// twice and nothing near it.
//
// A detector that shadows the lamp, a blocked beam or a row that was never filled leaves blocks of exact zeros. A
// surface that is dark there has dark neighbours, and a noise that the laboratory clamped has neighbours that scatter;
// but where the nearest values that are not zero are bright and agree with each other, a zero among them is none. The
// The same holds for any other value that many rows share, such as what a detector's floor leaves, where it is far
// below what its neighbours on all sides agree on. The nearest are sought over the distance of the incident and the
// outgoing direction vectors, isotropic sets turned to phi_i = 0.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/nearest.h"
#include "base/number.h"
#include "base/statistics.h"
#include "base/vector.h"
#include "io/format.h"

enum { SHARED = 4 }; // values that many rows share, looked at

static const struct {
    size_t neighbours; // not zero, that must agree
    size_t block;      // zeros that make one
    double bright;     // share of the median value that a neighbour must have
    double agreement;  // smallest over largest of the neighbours
    double pairs;      // of zeros and others at most; beyond, every second, third ... zero is looked at
    double light_deg;  // a block this near to the light is told so
    size_t grown;      // zeros at most whose blocks are grown: its work is their square
    size_t ceiling;    // equal largest values that are told
    size_t shared;     // rows of one value, other than 0, that may be a block
    size_t part;       // such rows are fewer than that part of all: more of them are the surface's own plateau
    double apart;      // no other value of the first channel is so near to theirs: a plateau ends in slopes
    double one_sided;  // length of the neighbours' mean offset over their mean distance
    double fill, lone; // a fill number's ratio to the largest other value, where it stands twice, and once
} tuning = {8, 3, 0.2, 0.5, 1e8, 30, 5000, 8, 8, 5, 0.5, 0.5, 10, 1000};

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

// Does the row hold these values? NULL: zeros.
static bool holds(const gonio_samples *s, size_t i, const double *values) {
    for (int c = 0; c < s->channels; c++) {
        if (s->values[i * (size_t)s->channels + (size_t)c] != (values != NULL ? values[c] : 0)) {
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

// What the nearest of the others say of a zero, or of the value that is looked at.
typedef struct verdict {
    bool bright, agreed; // it is far from all; and they agree with each other
    double gap;          // to the nearest
} verdict;

// Do the neighbours lie on all sides? A plateau beside a lobe has all others on one.
static bool surrounded(const place *of, const place *others, const gonio_nearest *near) {
    double mean[6] = {0}, length = 0, reach = 0;
    for (size_t k = 0; k < near->found; k++) {
        const place *p = &others[near->index[k]];
        const double d[6] = {p->wi.x - of->wi.x, p->wi.y - of->wi.y, p->wi.z - of->wi.z,
                             p->wo.x - of->wo.x, p->wo.y - of->wo.y, p->wo.z - of->wo.z};
        for (int j = 0; j < 6; j++) {
            mean[j] += d[j];
        }
        reach += sqrt(near->distance[k]);
    }
    for (int j = 0; j < 6; j++) {
        length += mean[j] * mean[j];
    }
    return sqrt(length) < tuning.one_sided * reach;
}

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
    const bool bright =
        near.found == near.wanted && low >= tuning.bright * median && zero->level <= tuning.bright * low;
    const bool agreed = low >= tuning.agreement * high && (zero->level == 0 || surrounded(zero, others, &near));
    return (verdict){bright, bright && agreed, near.found > 0 ? near.distance[0] : INFINITY};
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

// Does another row of the value stand as near as the nearest of other values? Those of a symmetric surface's equal
// places do not.
static bool has_company(const search *f, size_t k, double nearest) {
    for (size_t j = 0; j < f->n_zeros; j++) {
        if (j != k && gap(&f->zeros[k], &f->zeros[j]) <= nearest) {
            return true;
        }
    }
    return false;
}

static size_t find_blocks(search *f, double median) {
    const double pairs = (double)f->n_zeros * (double)f->n_others;
    const size_t step = pairs > tuning.pairs ? (size_t)ceil(pairs / tuning.pairs) : 1;
    size_t found = 0;
    bool any = f->n_zeros < 64;
    for (size_t k = 0; k < f->n_zeros && !any; k += f->n_zeros / 64) {
        any = judge(&f->zeros[k], f->others, f->n_others, median).agreed;
    }
    for (size_t k = 0; k < f->n_zeros && any; k += step) {
        verdict v = judge(&f->zeros[k], f->others, f->n_others, median);
        v.agreed = v.agreed && (f->zeros[k].level == 0 || (f->n_zeros <= tuning.grown && has_company(f, k, v.gap)));
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

static void tell_blocks(const gonio_samples *s, const search *f, const double *values, const long long *lines,
                        size_t found, bool leave_out, char *notes, size_t size) {
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
    char what[64] = "exact zeros";
    if (values != NULL) {
        snprintf(what, sizeof what, "one value, %.6g,", values[0]);
    }
    gonio_text_append(notes, size, "%zu rows of %s %s (the first at line %lld) stand among bright neighbours: %s\n",
                      found, what, where, first,
                      leave_out ? "taken for missing and left out; --missing none keeps them"
                                : "are they missing? --missing auto leaves them out");
}

// Leave out rows; keep and lines are of the set as it is. lines follow.
static gonio_status leave_rows_out(gonio_samples **samples, const bool *keep, long long *lines, gonio_error *error) {
    gonio_samples *rest;
    const gonio_status status = gonio_samples_select(*samples, keep, &rest, error);
    if (status == GONIO_OK) {
        for (size_t i = 0, to = 0; i < (*samples)->n; i++) {
            lines[to] = lines[i];
            to += keep[i];
        }
        gonio_samples_free(*samples);
        *samples = rest;
    }
    return status;
}

// values: of the rows that may be a block; NULL: zeros.
static gonio_status look_for_blocks(gonio_samples **samples, const double *values, long long *lines, bool leave_out,
                                    search *f, double *levels, char *notes, size_t size, gonio_error *error) {
    gonio_samples *s = *samples;
    f->n_zeros = f->n_others = 0;
    for (size_t i = 0; i < s->n; i++) {
        f->keep[i] = true;
        const place at = place_of(s, i);
        if (holds(s, i, values)) {
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
    tell_blocks(s, f, values, lines, found, leave_out, notes, size);
    return leave_out ? leave_rows_out(samples, f->keep, lines, error) : GONIO_OK;
}

// ---- values that many rows share ----

typedef struct shared {
    double value; // of the first channel
    size_t row;
} shared;

static int by_value(const void *left, const void *right) {
    const shared *a = left, *b = right;
    return a->value != b->value ? (a->value < b->value ? -1 : 1) : (a->row > b->row) - (a->row < b->row);
}

// A row of the values, none all zero, apart from all others, that most rows share, fewer than `fewer`; SIZE_MAX: none
// that so many do.
static size_t most_shared(const gonio_samples *s, size_t *fewer, shared *sorted) {
    size_t most = tuning.shared - 1, at = SIZE_MAX;
    for (size_t i = 0; i < s->n; i++) {
        sorted[i] = (shared){s->values[i * (size_t)s->channels], i};
    }
    qsort(sorted, s->n, sizeof *sorted, by_value);
    for (size_t i = 0, next; i < s->n; i = next) {
        size_t alike = 0;
        const double *first = s->values + sorted[i].row * (size_t)s->channels;
        for (next = i; next < s->n && sorted[next].value == sorted[i].value; next++) {
            alike += holds(s, sorted[next].row, first);
        }
        const bool stands_apart = (i == 0 || sorted[i - 1].value <= tuning.apart * sorted[i].value) &&
                                  (next == s->n || sorted[i].value <= tuning.apart * sorted[next].value);
        if (alike > most && alike < *fewer && stands_apart && !holds(s, sorted[i].row, NULL)) {
            most = alike;
            at = sorted[i].row;
        }
    }
    *fewer = most;
    return at;
}

static gonio_status look_for_shared(gonio_samples **samples, long long *lines, bool leave_out, search *f,
                                    double *levels, char *notes, size_t size, gonio_error *error) {
    const size_t c = (size_t)(*samples)->channels;
    shared *sorted = malloc((*samples)->n * sizeof *sorted);
    double *values = malloc(c * sizeof *values);
    gonio_status status = sorted != NULL && values != NULL
                              ? GONIO_OK
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory to look for missing values");
    size_t fewer = (*samples)->n / tuning.part;
    for (int k = 0; k < SHARED && status == GONIO_OK; k++) {
        const size_t row = most_shared(*samples, &fewer, sorted);
        if (row == SIZE_MAX) {
            break;
        }
        memcpy(values, (*samples)->values + row * c, c * sizeof *values);
        status = look_for_blocks(samples, values, lines, leave_out, f, levels, notes, size, error);
    }
    free(values);
    free(sorted);
    return status;
}

// ---- numbers that programs fill with ----

// 1e30, 9.96921e36 or the largest of a type, to the digits that programs write.
static bool is_huge(double v) {
    static const double largest[] = {FLT_MAX, DBL_MAX, 9.969209968386869e36}; // the last of netCDF
    for (size_t k = 0; k < sizeof largest / sizeof *largest; k++) {
        if (fabs(v / largest[k] - 1) < 1e-5) {
            return true;
        }
    }
    char text[32];
    gonio_number_format(text, sizeof text, "%.5e", v);
    return v >= 1e10 && gonio_number_parse(text, NULL) == v;
}

// 99, 999.9, 4095, 65535, 1e10: a number that is written, not measured.
static bool is_fill(double v) {
    char text[32];
    gonio_text_shortest(v, text);
    if (v >= 99 && text[strspn(text, "9.")] == 0) {
        return true;
    }
    int exponent;
    const double one = frexp(v + 1, &exponent);
    return is_huge(v) || (v >= 255 && one == 0.5) || (v >= 1e4 && fmod(log10(v), 1) == 0);
}

// The largest value of a channel, how often it stands there, and the largest below it.
static double top_of(const gonio_samples *s, int c, size_t *count, double *below, size_t *first) {
    double top = -INFINITY;
    *below = -INFINITY;
    *count = *first = 0;
    for (size_t i = 0; i < s->n; i++) {
        const double v = s->values[i * (size_t)s->channels + (size_t)c];
        if (v > top) {
            *below = top;
            top = v;
            *count = 0;
            *first = i;
        } else if (v < top) {
            *below = fmax(*below, v);
        }
        *count += v == top;
    }
    return top;
}

static gonio_status look_for_fill(gonio_samples **samples, long long *lines, bool *keep, char *notes, size_t size,
                                  gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int c = 0; c < (*samples)->channels && status == GONIO_OK; c++) {
        size_t count, first;
        double below;
        const double top = top_of(*samples, c, &count, &below, &first);
        const size_t channels = (size_t)(*samples)->channels;
        if (!(below > 0) || !is_fill(top) || top < (count > 1 ? tuning.fill : tuning.lone) * below ||
            2 * count > (*samples)->n) {
            continue;
        }
        for (size_t i = 0; i < (*samples)->n; i++) {
            keep[i] = (*samples)->values[i * channels + (size_t)c] != top;
        }
        gonio_text_append(notes, size,
                          "%zu rows with %.10g, far above all others (the first at line %lld): taken for missing and "
                          "left out; --missing none keeps them\n",
                          count, top, lines[first]);
        status = leave_rows_out(samples, keep, lines, error);
        c--; // there may be another
    }
    return status;
}

// A detector at its end reads the same number again and again: told, as the truth lies above it.
static void look_for_ceiling(const gonio_samples *s, const long long *lines, char *notes, size_t size) {
    for (int c = 0; c < s->channels; c++) {
        size_t count, first;
        double below;
        const double top = top_of(s, c, &count, &below, &first);
        if ((count >= tuning.ceiling || (count > 1 && top > 100 * below && below > 0)) && 2 * count < s->n &&
            below < 0.999 * top) {
            gonio_text_append(notes, size,
                              "channel %s: the largest value, %g, stands in %zu rows (the first at line %lld): was the "
                              "detector at its end?\n",
                              s->channel_names[c], top, count, lines[first]);
        }
    }
}

gonio_status gonio_missing_look(gonio_samples **samples, long long *lines, bool leave_out, char *notes, size_t size,
                                gonio_error *error) {
    const size_t n = (*samples)->n;
    search f = {.zeros = malloc(n * sizeof *f.zeros),
                .others = malloc(n * sizeof *f.others),
                .verdicts = malloc(n * sizeof *f.verdicts),
                .rows = malloc(n * sizeof *f.rows),
                .keep = malloc(n * sizeof *f.keep)};
    double *levels = malloc(n * sizeof *levels);
    const bool room =
        f.zeros != NULL && f.others != NULL && f.verdicts != NULL && f.rows != NULL && f.keep != NULL && levels != NULL;
    gonio_status status = room ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to look for missing values");
    if (status == GONIO_OK && leave_out) {
        status = look_for_fill(samples, lines, f.keep, notes, size, error);
    }
    if (status == GONIO_OK) {
        look_for_ceiling(*samples, lines, notes, size);
        status = look_for_blocks(samples, NULL, lines, leave_out, &f, levels, notes, size, error);
    }
    if (status == GONIO_OK) {
        status = look_for_shared(samples, lines, leave_out, &f, levels, notes, size, error);
    }
    free(f.zeros);
    free(f.others);
    free(f.verdicts);
    free(f.rows);
    free(f.keep);
    free(levels);
    return status;
}
