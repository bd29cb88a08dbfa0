// SPDX-License-Identifier: BSD-3-Clause
// Which poses to measure: a uniform grid, a low-discrepancy set in Nusselt coordinates, or a CSV.
//
// nusselt:N   The isotropic Nusselt domain is kappa_i in [0.5, 1] (phi_i = 0) times the disc of (kappa_o, lambda_o);
//   mirror symmetry halves the disc. The first N points of a scrambled Sobol sequence fill it: every power-of-two block
//   is stratified in each coordinate, and any prefix is spread evenly, so a measurement that is stopped early still
//   covers the domain. The unit square goes to the half disc by r = sqrt(u), angle = pi v, which keeps areas. Random
//   points would leave gaps of several cells at 1,400 poses, a grid would alias with the lattice.
#include "gonio/plan.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/sobol.h"
#include "base/text.h"

#define POSES_MAX 20000000 // 640 MB of poses; no rig visits more
#define THETA_MAX_DEG 85   // beyond it a flat sample's foreshortening leaves little of the signal

typedef struct plan_options {
    double theta_max_deg;
    bool anisotropic, centred, transmission, back;
} plan_options;

// The halves that a preset's poses lie in, one after the other.
static int halves_of(const plan_options *options, gonio_half halves[GONIO_HALVES]) {
    int n = 0;
    for (int light = 0; light <= (options->back ? GONIO_REFLECTION_BACK : 0); light += GONIO_REFLECTION_BACK) {
        for (int through = 0; through <= (options->transmission ? GONIO_TRANSMISSION : 0); through++) {
            halves[n++] = (gonio_half)(light | through);
        }
    }
    return n;
}

static gonio_status allocate(size_t n, gonio_plan **out, gonio_error *error) {
    gonio_plan *plan = calloc(1, sizeof *plan);
    if (plan != NULL) {
        plan->poses = malloc((n + 1) * sizeof *plan->poses);
    }
    if (plan == NULL || plan->poses == NULL) {
        free(plan);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a plan of %zu poses", n);
    }
    *out = plan;
    return GONIO_OK;
}

void gonio_plan_free(gonio_plan *plan) {
    if (plan != NULL) {
        free(plan->poses);
        free(plan);
    }
}

bool gonio_pairs_transmit(const gonio_pair *pairs, size_t n) {
    bool any = false;
    for (size_t i = 0; i < n && !any; i++) {
        any = gonio_pair_half(pairs[i]) != GONIO_REFLECTION;
    }
    return any;
}

// ---- uniform ----

typedef struct grid {
    double step_deg;
    int n_theta,
        n_phi;        // theta = first, first + step ...; phi = 0, step ... over half a turn (both ends) or a whole one
    double first_deg; // 0, or half a step: the middles of cells that fill the hemisphere
    bool anisotropic;
    gonio_half halves[GONIO_HALVES];
    int n_halves;
} grid;

// At the pole every azimuth is the same direction, so one is enough (isotropic samples do not tell phi_i apart either).
static bool is_pole(const grid *g, int theta) { return theta == 0 && g->first_deg == 0; }
static int azimuths(const grid *g, int theta) { return is_pole(g, theta) ? 1 : g->n_phi; }

static gonio_pair grid_pose(const grid *g, int ti, int pi, int to, int po) {
    const double s = g->step_deg, first = g->first_deg;
    return (gonio_pair){gonio_radians(first + ti * s), gonio_radians(pi * s), gonio_radians(first + to * s),
                        gonio_radians(po * s)};
}

// The pose in every half; at the horizon, which two of them share, once. Returns how many.
static size_t place(const grid *g, gonio_pair pose, gonio_pair *poses) {
    size_t n = 0;
    for (int h = 0; h < g->n_halves; h++) {
        const gonio_pair lowered = gonio_pair_lowered(pose, g->halves[h]);
        if (gonio_pair_half(lowered) == g->halves[h]) {
            if (poses != NULL) {
                poses[n] = lowered;
            }
            n++;
        }
    }
    return n;
}

static size_t fill_grid(const grid *g, gonio_pair *poses) {
    size_t n = 0;
    for (int ti = 0; ti < g->n_theta; ti++) {
        const int turns = g->anisotropic ? azimuths(g, ti) : 1;
        for (int pi = 0; pi < turns; pi++) {
            for (int to = 0; to < g->n_theta; to++) {
                const bool around = !is_pole(g, to) && (!is_pole(g, ti) || g->anisotropic);
                for (int po = 0; po < (around ? g->n_phi : 1); po++) {
                    n += place(g, grid_pose(g, ti, pi, to, po), poses != NULL ? poses + n : NULL);
                }
            }
        }
    }
    return n;
}

static gonio_status make_uniform(double step, const plan_options *options, gonio_plan **out, gonio_error *error) {
    if (!(step >= 0.05 && step <= 90)) {
        return gonio_fail(error, GONIO_E_USAGE, "uniform:%g; expected a step of 0.05 to 90 degrees", step);
    }
    // 1e-9: 85/0.1 must count as 850 steps although it rounds below.
    const double turn = options->anisotropic ? 360 : 180;
    grid g = {.step_deg = step, .anisotropic = options->anisotropic, .first_deg = options->centred ? step / 2 : 0};
    g.n_theta = options->centred ? (int)floor(90 / step + 1e-9) : (int)floor(options->theta_max_deg / step + 1e-9) + 1;
    g.n_phi = options->anisotropic ? (int)ceil(turn / step - 1e-9) : (int)floor(turn / step + 1e-9) + 1;
    g.n_halves = halves_of(options, g.halves);
    const double thetas = g.n_theta, phis = g.n_phi;
    const double estimate = thetas * thetas * phis * (options->anisotropic ? phis : 1) * g.n_halves;
    if (estimate > POSES_MAX) {
        return gonio_fail(error, GONIO_E_USAGE, "uniform:%g makes about %.3g poses; at most %d are possible", step,
                          estimate, POSES_MAX);
    }
    const size_t n = fill_grid(&g, NULL);
    const gonio_status status = allocate(n, out, error);
    if (status == GONIO_OK) {
        (*out)->n = fill_grid(&g, (*out)->poses);
    }
    return status;
}

// ---- nusselt ----

// Degrees with four decimals: finer than any stage points, and short in a CSV.
static double tidy_rad(double rad, double limit_deg) {
    return gonio_radians(fmin(round(rad * (180 / GONIO_PI) * 1e4) / 1e4, limit_deg));
}

static gonio_pair nusselt_pose(uint32_t index, uint64_t seed, const plan_options *options) {
    const double radius = sin(gonio_radians(options->theta_max_deg)), limit = options->theta_max_deg;
    const double u = gonio_sobol(index, 1, seed), v = gonio_sobol(index, 2, seed), w = gonio_sobol(index, 0, seed);
    if (!options->anisotropic) {
        return (gonio_pair){tidy_rad(asin(radius * w), limit), 0, tidy_rad(asin(radius * sqrt(u)), limit),
                            tidy_rad(GONIO_PI * v, 180)};
    }
    const double t = gonio_sobol(index, 3, seed);
    return (gonio_pair){tidy_rad(asin(radius * sqrt(w)), limit), tidy_rad(2 * GONIO_PI * t, 360),
                        tidy_rad(asin(radius * sqrt(u)), limit), tidy_rad(2 * GONIO_PI * v, 360)};
}

static gonio_status make_nusselt(double count, uint64_t seed, const plan_options *options, gonio_plan **out,
                                 gonio_error *error) {
    if (!(count >= 1 && count <= POSES_MAX && count == floor(count))) {
        return gonio_fail(error, GONIO_E_USAGE, "nusselt:%.10g; expected 1 to %d poses", count, POSES_MAX);
    }
    const gonio_status status = allocate((size_t)count, out, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_plan *plan = *out;
    gonio_half halves[GONIO_HALVES];
    const size_t n_halves = (size_t)halves_of(options, halves);
    for (; plan->n < (size_t)count; plan->n++) {
        const gonio_pair pose = nusselt_pose((uint32_t)(plan->n / n_halves), seed, options);
        plan->poses[plan->n] = gonio_pair_lowered(pose, halves[plan->n % n_halves]);
    }
    return GONIO_OK;
}

// ---- text ----

// The flag that an item "name=..." sets; NULL: none.
static bool *flag_of(plan_options *options, const char *item) {
    static const char *const names[] = {"anisotropic", "centred", "transmission", "back"};
    bool *const flags[] = {&options->anisotropic, &options->centred, &options->transmission, &options->back};
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        const size_t length = strlen(names[k]);
        if (strncmp(item, names[k], length) == 0 && item[length] == '=') {
            return flags[k];
        }
    }
    return NULL;
}

// ",theta_max=DEG,anisotropic=1" after a preset's number.
static gonio_status parse_options(const char *preset, char *text, plan_options *options, gonio_error *error) {
    char *rest;
    for (char *item = strtok_r(text, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
        char *equals = strchr(item, '='), *end = NULL;
        const double value = equals != NULL ? gonio_number_parse(equals + 1, &end) : NAN;
        const bool number = equals != NULL && end != equals + 1 && *end == 0;
        if (strncmp(item, "theta_max=", 10) == 0) {
            if (!number || !(value > 0 && value <= 90)) {
                return gonio_fail(error, GONIO_E_USAGE, "%s: %s; expected theta_max above 0, up to 90 degrees", preset,
                                  item);
            }
            options->theta_max_deg = value;
            continue;
        }
        bool *flag = flag_of(options, item);
        if (flag == NULL) {
            return gonio_fail(
                error, GONIO_E_USAGE,
                "%s: unknown option '%s'; expected theta_max=DEG, anisotropic=1, centred=1, transmission=1 or back=1",
                preset, item);
        }
        if (!number || (value != 0 && value != 1)) {
            return gonio_fail(error, GONIO_E_USAGE, "%s: %s; expected %.*s=0 or 1", preset, item,
                              (int)strcspn(item, "="), item);
        }
        if (flag == &options->centred && preset[0] != 'u') {
            return gonio_fail(error, GONIO_E_USAGE, "%s: %s; only a uniform plan can be centred", preset, item);
        }
        *flag = value == 1;
    }
    return GONIO_OK;
}

static gonio_status make_preset(const char *text, uint64_t seed, gonio_plan **out, gonio_error *error) {
    char copy[256];
    if (strlen(text) >= sizeof copy) {
        return gonio_fail(error, GONIO_E_USAGE, "the plan '%.40s...' is too long", text);
    }
    strcpy(copy, text);
    char *number = strchr(copy, ':') + 1, *end;
    const double value = gonio_number_parse(number, &end);
    if (end == number || (*end != 0 && *end != ',')) {
        return gonio_fail(error, GONIO_E_USAGE, "plan '%s': expected a number after the colon", text);
    }
    plan_options options = {.theta_max_deg = THETA_MAX_DEG};
    const gonio_status status = parse_options(text, end, &options, error);
    if (status != GONIO_OK) {
        return status;
    }
    return copy[0] == 'u' ? make_uniform(value, &options, out, error) : make_nusselt(value, seed, &options, out, error);
}

static size_t count_lines(const char *data, size_t size) {
    size_t lines = 1;
    for (const char *at = data; (at = memchr(at, '\n', (size_t)(data + size - at))) != NULL; at++) {
        lines++;
    }
    return lines;
}

static gonio_status read_poses(gonio_text *text, gonio_plan *plan, gonio_error *error) {
    char *fields[4];
    char *line = gonio_text_row(text);
    if (line == NULL) {
        return gonio_text_fail(text, error, "nothing in it; expected the header %s", GONIO_PAIR_HEADER);
    }
    const int columns = gonio_text_split(line, ',', fields, 4);
    if (columns != 4 || !gonio_text_is_pair_header(fields, columns)) {
        return gonio_text_fail(text, error, "expected the header %s, found %d columns that begin with '%.40s'",
                               GONIO_PAIR_HEADER, columns, fields[0]);
    }
    while ((line = gonio_text_row(text)) != NULL) {
        const int n = gonio_text_split(line, ',', fields, 4);
        if (n != 4) {
            return gonio_text_fail(text, error, "expected 4 columns, found %d", n);
        }
        const gonio_status status = gonio_text_pair(text, fields, &plan->poses[plan->n], error);
        if (status != GONIO_OK) {
            return status;
        }
        plan->n++;
    }
    return plan->n > 0 ? GONIO_OK : gonio_text_fail(text, error, "no poses after the header");
}

static gonio_status read_plan(const char *path, gonio_plan **out, gonio_error *error) {
    gonio_text text;
    gonio_status status = gonio_text_open(path, 0, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    text.transmission = gonio_text_declares_transmission(&text);
    status = allocate(count_lines(text.next, (size_t)(text.end - text.next)), out, error);
    status = status == GONIO_OK ? read_poses(&text, *out, error) : status;
    gonio_text_free(&text);
    return status;
}

gonio_status gonio_plan_make(const char *text, uint64_t seed, gonio_plan **out, gonio_error *error) {
    *out = NULL;
    if (strncmp(text, "adaptive:", 9) == 0) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "the poses of plan '%.80s' are chosen while it is measured; only a measure takes it", text);
    }
    const bool preset = strncmp(text, "uniform:", 8) == 0 || strncmp(text, "nusselt:", 8) == 0;
    const gonio_status status = preset ? make_preset(text, seed, out, error) : read_plan(text, out, error);
    if (status != GONIO_OK) {
        gonio_plan_free(*out);
        *out = NULL;
    }
    return status;
}
