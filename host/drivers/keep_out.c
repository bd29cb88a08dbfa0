// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/keep_out.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

int gonio_keep_out_zone(gonio_keep_out *keep_out, const char *name) {
    for (int i = 0; i < keep_out->n; i++) {
        if (strcmp(keep_out->zones[i].name, name) == 0) {
            return i;
        }
    }
    if (keep_out->n == GONIO_ZONES_MAX || strlen(name) >= sizeof keep_out->zones[0].name) {
        return -1;
    }
    gonio_zone *zone = &keep_out->zones[keep_out->n];
    strcpy(zone->name, name);
    for (int k = 0; k < GONIO_AXES; k++) {
        zone->minimum_deg[k] = -INFINITY;
        zone->maximum_deg[k] = INFINITY;
    }
    return keep_out->n++;
}

// The box between two places meets the zone where their intervals do in every axis.
static bool sweeps(const gonio_zone *zone, const double from_deg[GONIO_AXES], const double to_deg[GONIO_AXES]) {
    for (int k = 0; k < GONIO_AXES; k++) {
        if (fmax(from_deg[k], to_deg[k]) < zone->minimum_deg[k] ||
            fmin(from_deg[k], to_deg[k]) > zone->maximum_deg[k]) {
            return false;
        }
    }
    return true;
}

// Slabs: the part of the line (0 to 1) inside each axis's interval; what all share is inside the box.
static bool meets(const gonio_zone *zone, const double from_deg[GONIO_AXES], const double to_deg[GONIO_AXES],
                  double *where) {
    double enter = 0, leave = 1;
    for (int k = 0; k < GONIO_AXES; k++) {
        const double way = to_deg[k] - from_deg[k];
        if (way == 0) {
            if (from_deg[k] < zone->minimum_deg[k] || from_deg[k] > zone->maximum_deg[k]) {
                return false;
            }
            continue;
        }
        const double one = (zone->minimum_deg[k] - from_deg[k]) / way,
                     other = (zone->maximum_deg[k] - from_deg[k]) / way;
        enter = fmax(enter, fmin(one, other));
        leave = fmin(leave, fmax(one, other));
    }
    *where = enter;
    return enter <= leave;
}

static double between_deg(const double rad[GONIO_AXES]) {
    const double ti = rad[GONIO_LIGHT_THETA], to = rad[GONIO_CAMERA_THETA];
    const double apart = rad[GONIO_LIGHT_PHI] - rad[GONIO_CAMERA_PHI];
    // Haversines keep small angles exact.
    const double a = sin((ti - to) / 2), b = sin(apart / 2);
    return gonio_degrees(2 * asin(fmin(1, sqrt(fmax(0, a * a + sin(ti) * sin(to) * b * b)))));
}

static gonio_status check_line(const gonio_keep_out *keep_out, const double from_rad[GONIO_AXES],
                               const double to_rad[GONIO_AXES], const char *what, gonio_error *error) {
    double from_deg[GONIO_AXES], to_deg[GONIO_AXES], where = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        from_deg[k] = gonio_degrees(from_rad[k]);
        to_deg[k] = gonio_degrees(to_rad[k]);
    }
    for (int i = 0; i < keep_out->n; i++) {
        const gonio_zone *zone = &keep_out->zones[i];
        if (keep_out->independent && sweeps(zone, from_deg, to_deg)) {
            return gonio_fail(
                error, GONIO_E_RANGE,
                "keep-out zone '%s': the axes move each at its own pace and may meet it on the way%s; go by "
                "places from which single axes lead past it",
                zone->name, what);
        }
        if (meets(zone, from_deg, to_deg, &where)) {
            double at[GONIO_AXES];
            for (int k = 0; k < GONIO_AXES; k++) {
                at[k] = from_deg[k] + where * (to_deg[k] - from_deg[k]);
            }
            return gonio_fail(error, GONIO_E_RANGE,
                              "keep-out zone '%s': the way%s meets it at light %.4g, %.4g and camera %.4g, %.4g deg",
                              zone->name, what, at[0], at[1], at[2], at[3]);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_keep_out_check(const gonio_keep_out *keep_out, const double from_rad[GONIO_AXES],
                                  const double turn_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                                  gonio_error *error) {
    static const char take_up[] = ", with the take-up of backlash,";
    gonio_status status = GONIO_OK;
    if (turn_rad != NULL) {
        status = check_line(keep_out, from_rad, turn_rad, take_up, error);
        status = status == GONIO_OK ? check_line(keep_out, turn_rad, to_rad, take_up, error) : status;
    } else {
        status = check_line(keep_out, from_rad, to_rad, "", error);
    }
    const double apart = between_deg(to_rad);
    if (status == GONIO_OK && apart < keep_out->retro_deg) {
        return gonio_fail(error, GONIO_E_RANGE,
                          "unmeasurable: the camera shadows the light, %.4g deg from it; at least %g are needed", apart,
                          keep_out->retro_deg);
    }
    return status;
}

// ---- the guard ----

typedef struct guard {
    gonio_keep_out keep_out;
    const gonio_stage_ops *stage;
    void *device;
    gonio_stage_ops ops; // with those optional ones that the stage has
} guard;

static gonio_status guard_home(void *device, double timeout_s, gonio_error *error) {
    const guard *g = device;
    return g->stage->home(g->device, timeout_s, error);
}

static bool guard_turns(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                        double turn_rad[GONIO_AXES]) {
    const guard *g = device;
    return g->stage->turns != NULL && g->stage->turns(g->device, from_rad, to_rad, turn_rad);
}

static gonio_status check_zones(guard *g, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                                gonio_error *error) {
    double turn_rad[GONIO_AXES];
    const bool turns = guard_turns(g, from_rad, to_rad, turn_rad);
    return gonio_keep_out_check(&g->keep_out, from_rad, turns ? turn_rad : NULL, to_rad, error);
}

static gonio_status guard_check(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                                gonio_error *error) {
    guard *g = device;
    const gonio_status status = check_zones(g, from_rad, to_rad, error);
    return status == GONIO_OK && g->stage->check != NULL ? g->stage->check(g->device, from_rad, to_rad, error) : status;
}

static gonio_status guard_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                               double timeout_s, gonio_error *error) {
    guard *g = device;
    double now[GONIO_AXES];
    gonio_status status = g->stage->position(g->device, now, error);
    status = status == GONIO_OK ? check_zones(g, now, target_rad, error) : status;
    return status == GONIO_OK ? g->stage->move(g->device, target_rad, id, stamp, timeout_s, error) : status;
}

static gonio_status guard_position(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    const guard *g = device;
    return g->stage->position(g->device, position_rad, error);
}

static gonio_status guard_stop(void *device, gonio_error *error) {
    const guard *g = device;
    return g->stage->stop(g->device, error);
}

static double guard_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES]) {
    const guard *g = device;
    return g->stage->duration_s(g->device, from_rad, to_rad);
}

static gonio_status guard_audit(void *device, double timeout_s, double difference_rad[GONIO_AXES], gonio_error *error) {
    const guard *g = device;
    return g->stage->audit(g->device, timeout_s, difference_rad, error);
}

static gonio_status guard_verify(void *device, double difference_rad[GONIO_AXES], gonio_error *error) {
    const guard *g = device;
    return g->stage->verify(g->device, difference_rad, error);
}

static void guard_close(void *device) {
    guard *g = device;
    g->stage->close(g->device);
    free(g);
}

static const gonio_stage_ops guard_ops = {.name = "guarded by keep-out zones",
                                          .home = guard_home,
                                          .move = guard_move,
                                          .position = guard_position,
                                          .stop = guard_stop,
                                          .duration_s = guard_duration_s,
                                          .close = guard_close,
                                          .check = guard_check,
                                          .turns = guard_turns};

gonio_status gonio_keep_out_guard(const gonio_keep_out *keep_out, gonio_rig *rig, gonio_error *error) {
    guard *g = malloc(sizeof *g);
    if (g == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for keep-out zones");
    }
    *g = (guard){*keep_out, rig->stage, rig->stage_device, guard_ops};
    g->keep_out.independent = g->ops.independent = rig->stage->independent;
    g->ops.real = rig->stage->real;
    g->ops.audit = rig->stage->audit != NULL ? guard_audit : NULL;
    g->ops.verify = rig->stage->verify != NULL ? guard_verify : NULL;
    rig->stage = &g->ops;
    rig->stage_device = g;
    return GONIO_OK;
}
