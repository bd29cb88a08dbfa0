// SPDX-License-Identifier: BSD-3-Clause
// Plan -> steps, in an order of short moves.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/acquire/acquire.h"

// The next pose is the nearest in travel time among this many candidates. Plans up to this size get the full
// nearest-neighbour tour; larger ones a tour within a window that slides along a serpentine order and narrows as they
// grow, so that all of them take about as long.
#define CANDIDATES 2000
#define CANDIDATES_MIN 8
#define CELL_DEG 10.0 // of the serpentine
#define SPELLINGS 10  // of one direction: five turns of phi on either side of theta = 0

void gonio_scan_target(const gonio_pair *pose, double target_rad[GONIO_AXES]) {
    target_rad[GONIO_LIGHT_THETA] = pose->theta_i;
    target_rad[GONIO_LIGHT_PHI] = pose->phi_i;
    target_rad[GONIO_CAMERA_THETA] = pose->theta_o;
    target_rad[GONIO_CAMERA_PHI] = pose->phi_o;
}

// Some spelling of one arm's direction: whole turns of phi, or theta on the other side; at the pole, which has no
// azimuth, a few others. 0 is the plan's own.
static void spell(double theta, double phi, int spelling, double *to_theta, double *to_phi) {
    const bool flipped = spelling >= SPELLINGS / 2;
    const int k = spelling % (SPELLINGS / 2), turns = k % 2 == 0 ? k / 2 : -(k + 1) / 2; // 0, -1, 1, -2, 2
    if (theta == 0 && flipped) {
        static const double azimuths[SPELLINGS / 2] = {0, 90, -90, 180, 45};
        *to_theta = 0;
        *to_phi = gonio_angle_canonical(gonio_radians(azimuths[k]));
        return;
    }
    // The half turn leads toward 0, and in whole degrees, so that an arm without azimuth finds its only one.
    const double half = flipped ? (phi > 0 ? -180 : 180) : 0;
    *to_theta = flipped ? -theta : theta;
    *to_phi =
        flipped || turns != 0 ? gonio_angle_canonical(gonio_radians(gonio_degrees(phi) + half + 360.0 * turns)) : phi;
}

// The pose by the first of its spellings that the stage can reach; false, and as the plan has it, where none is; as the
// plan has it where nobody knows. Which one does not depend on where the arms stand, so that a resume asks for the
// same.
static bool find_reachable(const gonio_rig *rig, const gonio_pair *pose, gonio_pair *best) {
    double target[GONIO_AXES];
    *best = *pose;
    for (int s = 0; rig->stage->check != NULL && s < SPELLINGS * SPELLINGS; s++) {
        gonio_pair p;
        spell(pose->theta_i, pose->phi_i, s % SPELLINGS, &p.theta_i, &p.phi_i);
        spell(pose->theta_o, pose->phi_o, s / SPELLINGS, &p.theta_o, &p.phi_o);
        gonio_scan_target(&p, target);
        gonio_error why;
        if (rig->stage->check(rig->stage_device, target, target, &why) == GONIO_OK) {
            *best = p;
            return true;
        }
    }
    return rig->stage->check == NULL;
}

static gonio_pair reachable(const gonio_rig *rig, const gonio_pair *pose) {
    gonio_pair best;
    find_reachable(rig, pose, &best);
    return best;
}

bool gonio_scan_reaches(const gonio_rig *rig, const gonio_pair *pose) {
    gonio_pair best;
    return find_reachable(rig, pose, &best);
}

static double travel_s(const gonio_rig *rig, const gonio_pair *from, const gonio_pair *to) {
    double a[GONIO_AXES], b[GONIO_AXES];
    gonio_scan_target(from, a);
    gonio_scan_target(to, b);
    return rig->stage->duration_s(rig->stage_device, a, b);
}

typedef struct keyed {
    long cell[4];
    gonio_pair pose;
    size_t index;
} keyed;

// Serpentine: within odd cells the next coordinate runs backward, so that neighbours in the order are neighbours.
static int compare(const void *a, const void *b) {
    const keyed *x = a, *y = b;
    bool backward = false;
    for (int k = 0; k < 4; k++) {
        if (x->cell[k] != y->cell[k]) {
            return (x->cell[k] < y->cell[k]) != backward ? -1 : 1;
        }
        backward ^= (x->cell[k] & 1) != 0;
    }
    return x->index < y->index ? -1 : 1;
}

static keyed *serpentine(const gonio_rig *rig, const gonio_plan *plan) {
    keyed *order = malloc((plan->n + 1) * sizeof *order);
    for (size_t i = 0; order != NULL && i < plan->n; i++) {
        const gonio_pair *p = &plan->poses[i];
        const double angles[4] = {p->theta_i, p->phi_i, p->theta_o, p->phi_o};
        const gonio_pair own = {gonio_angle_canonical(p->theta_i), gonio_angle_canonical(p->phi_i),
                                gonio_angle_canonical(p->theta_o), gonio_angle_canonical(p->phi_o)};
        order[i].pose = reachable(rig, &own);
        order[i].index = i;
        for (int k = 0; k < 4; k++) {
            order[i].cell[k] = lround(floor(gonio_degrees(angles[k]) / CELL_DEG));
        }
    }
    if (order != NULL) {
        qsort(order, plan->n, sizeof *order, compare);
    }
    return order;
}

// Greedy: the candidate that is reached soonest; ties go to the earlier one. Removing keeps the candidates' order.
static void tour(const gonio_rig *rig, const gonio_pair *start, keyed *order, size_t n, gonio_step *steps) {
    gonio_pair here = *start;
    const size_t share = n > CANDIDATES ? (size_t)CANDIDATES * CANDIDATES / n : CANDIDATES;
    const size_t wide = share > CANDIDATES_MIN ? share : CANDIDATES_MIN;
    for (size_t i = 0; i < n; i++) {
        const size_t end = n - i < wide ? n : i + wide;
        size_t best = i;
        double best_s = INFINITY;
        for (size_t j = i; j < end; j++) {
            const double s = travel_s(rig, &here, &order[j].pose);
            if (s < best_s) {
                best_s = s;
                best = j;
            }
        }
        const keyed chosen = order[best];
        memmove(order + i + 1, order + i, (best - i) * sizeof *order);
        order[i] = chosen;
        here = chosen.pose;
        steps[i].kind = GONIO_STEP_SAMPLE;
        steps[i].pose = here;
    }
}

size_t gonio_scan_ending(const gonio_scan_options *options, const gonio_pair *reference, gonio_step ending[2]) {
    size_t n = 0;
    if (options->motion_check > 0) {
        ending[n++] = (gonio_step){.kind = GONIO_STEP_CHECK, .pose = *reference};
    }
    ending[n++] = (gonio_step){.kind = GONIO_STEP_REFERENCE, .pose = *reference};
    return n;
}

gonio_status gonio_scan_tour(const gonio_rig *rig, const gonio_pair *start, const gonio_plan *plan, gonio_step *steps,
                             size_t *which, gonio_error *error) {
    keyed *order = serpentine(rig, plan);
    if (order == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu steps", plan->n);
    }
    tour(rig, start, order, plan->n, steps);
    for (size_t i = 0; i < plan->n; i++) {
        which[i] = order[i].index;
    }
    free(order);
    return GONIO_OK;
}

gonio_status gonio_scan_steps(const gonio_rig *rig, const gonio_scan_options *options, const gonio_plan *plan,
                              gonio_step **steps, size_t *n, gonio_error *error) {
    const size_t calibration = options->trap_frames > 0 ? 3 : 2, checks = options->motion_check > 0 ? 1 : 0;
    const size_t before = calibration + checks;
    *n = before + plan->n + checks + 1;
    *steps = calloc(*n, sizeof **steps);
    keyed *order = serpentine(rig, plan);
    if (*steps == NULL || order == NULL) {
        free(*steps);
        free(order);
        *steps = NULL;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu steps", *n);
    }
    const gonio_pair nominal = {gonio_radians(GONIO_REFERENCE_THETA_I_DEG), 0, 0, 0},
                     reference = reachable(rig, &nominal);
    gonio_step *s = *steps;
    s[0] = (gonio_step){.kind = GONIO_STEP_DARK, .pose = reference};
    s[1] = (gonio_step){.kind = GONIO_STEP_TRAP, .pose = reference};
    s[calibration - 1] = (gonio_step){.kind = GONIO_STEP_REFERENCE, .pose = reference};
    if (checks > 0) {
        s[before - 1] = (gonio_step){.kind = GONIO_STEP_CHECK, .pose = reference};
    }
    tour(rig, &reference, order, plan->n, s + before);
    gonio_scan_ending(options, &reference, s + before + plan->n);
    for (size_t i = 0; i < *n; i++) {
        s[i].index = (int64_t)i;
    }
    free(order);
    return GONIO_OK;
}

double gonio_scan_travel_s(const gonio_rig *rig, const gonio_step *steps, size_t n, double settle_s) {
    gonio_pair here = {0, 0, 0, 0};
    double total = 0;
    for (size_t i = 0; i < n; i++) {
        total += travel_s(rig, &here, &steps[i].pose) + settle_s;
        here = steps[i].pose;
    }
    return total;
}
