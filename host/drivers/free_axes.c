// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/free_axes.h"

#include <math.h>
#include <stdlib.h>

#include "host/transport/clock.h"

enum { POLL_MS = 20, START_MS = 250, IDLE_TWICE = 2, STOP_TIMEOUT_S = 10 };
#define ARRIVAL_DEG 0.02 // beyond this the controller stands elsewhere than it was sent to

const char *const gonio_free_axis_names[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};
#define axis_names gonio_free_axis_names

gonio_free_axis gonio_free_axis_default(void) {
    return (gonio_free_axis){.units_per_deg = 1, .speed_deg_per_s = 10, .min_deg = -360, .max_deg = 360};
}

gonio_status gonio_free_check_config(const gonio_free_axis axes[GONIO_AXES], const char *named, gonio_error *error) {
    bool any = false;
    for (int k = 0; k < GONIO_AXES; k++) {
        const gonio_free_axis *a = &axes[k];
        if (a->min_deg >= a->max_deg) {
            return gonio_fail(error, GONIO_E_INPUT, "[axis %s] min_deg %g is not below max_deg %g", axis_names[k],
                              a->min_deg, a->max_deg);
        }
        if (a->units_per_deg == 0) {
            return gonio_fail(error, GONIO_E_INPUT, "[axis %s] units_per_deg: expected a number that is not 0",
                              axis_names[k]);
        }
        any = any || a->there;
    }
    return any ? GONIO_OK : gonio_fail(error, GONIO_E_INPUT, "[axis ...] %s", named);
}

void gonio_free_watch(gonio_free_stage *s, const gonio_driver_context *context) {
    s->interlock = context->interlock;
    s->interlock_device = context->interlock_device;
    s->cancelled = context->cancelled;
    s->cancelled_context = context->event_context;
}

// ---- waiting ----

static gonio_status watch(const gonio_free_stage *s, gonio_error *error) {
    if (s->cancelled != NULL && s->cancelled(s->cancelled_context)) {
        return gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; the axes stand");
    }
    return s->interlock != NULL ? s->interlock->check(s->interlock_device, error) : GONIO_OK;
}

// Half a unit of the controller is as near as it can come.
static double tolerance_deg(const gonio_free_axis *a) { return fmax(ARRIVAL_DEG, 0.51 / fabs(a->units_per_deg)); }

static gonio_status stand_at(gonio_free_stage *s, const double dial[GONIO_AXES], bool *all, gonio_error *error) {
    gonio_status status = GONIO_OK;
    *all = true;
    for (int k = 0; k < GONIO_AXES && *all && status == GONIO_OK; k++) {
        const gonio_free_axis *a = &s->axes[k];
        double units = 0;
        status = a->there ? s->drive->position(s, k, &units, error) : GONIO_OK;
        *all = status == GONIO_OK && (!a->there || fabs(units / a->units_per_deg - dial[k]) <= tolerance_deg(a));
    }
    return status;
}

// A command, and what has been seen since.
typedef struct waiting {
    const double *dial; // where the axes were sent; NULL: home
    gonio_deadline start, end;
    bool begun;
    int idle;
} waiting;

// Some say that they are idle before they have begun. They have where they were busy since, stand where they were sent,
// or had their time.
static gonio_status has_begun(gonio_free_stage *s, waiting *w, gonio_error *error) {
    w->begun = w->begun || gonio_deadline_left_ms(w->start) == 0;
    return w->begun || w->dial == NULL ? GONIO_OK : stand_at(s, w->dial, &w->begun, error);
}

static gonio_status look(gonio_free_stage *s, waiting *w, double timeout_s, gonio_error *error) {
    gonio_free_state now = GONIO_FREE_IDLE;
    gonio_status status = watch(s, error);
    if (status != GONIO_OK) {
        s->drive->stop(s, NULL);
        return status;
    }
    status = s->drive->state(s, &now, error);
    if (status == GONIO_OK && now == GONIO_FREE_UNHOMED) {
        s->homed = false;
        return gonio_fail(error, GONIO_E_DEVICE, "stage: the motion controller has lost its position: home it");
    }
    if (status == GONIO_OK && now == GONIO_FREE_STOPPED) {
        return gonio_fail(error, GONIO_E_DEVICE, "stage: it was stopped on its way");
    }
    w->begun = w->begun || now == GONIO_FREE_BUSY;
    status = status == GONIO_OK && now == GONIO_FREE_IDLE ? has_begun(s, w, error) : status;
    w->idle = now == GONIO_FREE_IDLE && w->begun ? w->idle + 1 : 0;
    if (status == GONIO_OK && w->idle < IDLE_TWICE && gonio_deadline_left_ms(w->end) == 0) {
        s->drive->stop(s, NULL);
        return gonio_fail(error, GONIO_E_TIMEOUT, "stage: it still moves after %g s; stopped", timeout_s);
    }
    return status;
}

// Until all are idle, twice in a row.
static gonio_status wait_idle(gonio_free_stage *s, const double *dial, double timeout_s, gonio_error *error) {
    waiting w = {.dial = dial, .start = gonio_deadline_in_s(1e-3 * START_MS), .end = gonio_deadline_in_s(timeout_s)};
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && w.idle < IDLE_TWICE) {
        status = look(s, &w, timeout_s, error);
        gonio_clock_sleep_ms(status == GONIO_OK && w.idle < IDLE_TWICE ? POLL_MS : 0);
    }
    return status;
}

// ---- coordinates ----

static double dial_deg(const gonio_free_axis *a, double user_deg) {
    return (a->invert ? -user_deg : user_deg) + a->zero_deg;
}

static double user_deg(const gonio_free_axis *a, double dial) { return (a->invert ? -1 : 1) * (dial - a->zero_deg); }

gonio_status gonio_free_position(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    gonio_free_stage *s = device;
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < GONIO_AXES; k++) {
        const gonio_free_axis *a = &s->axes[k];
        double units = 0;
        status = a->there ? s->drive->position(s, k, &units, error) : GONIO_OK;
        position_rad[k] = gonio_radians(a->there ? user_deg(a, units / a->units_per_deg) : a->fixed_deg);
    }
    return status;
}

// ---- moves ----

gonio_status gonio_free_home(void *device, double timeout_s, gonio_error *error) {
    gonio_free_stage *s = device;
    gonio_status status = watch(s, error);
    s->homed = false;
    status = status == GONIO_OK ? s->drive->home(s, timeout_s, error) : status;
    status = status == GONIO_OK ? wait_idle(s, NULL, timeout_s, error) : status;
    s->homed = status == GONIO_OK;
    return status;
}

// Where the way to a target overshoots to, per axis, in dial degrees: the side of the final approach decides.
static double overshoot_deg(const gonio_free_axis *a, double from, double to) {
    const bool takes_up = a->backlash_deg != 0 && to != from && (to > from) != (a->backlash_deg > 0);
    return takes_up ? to - a->backlash_deg : to;
}

static gonio_status check_axis(const gonio_free_stage *s, int k, double from_rad, double to_rad, gonio_error *error) {
    const gonio_free_axis *a = &s->axes[k];
    const double user = gonio_degrees(to_rad), to = dial_deg(a, user), from = dial_deg(a, gonio_degrees(from_rad));
    const double slack = 1e-9;
    if (!a->there) {
        return fabs(user - a->fixed_deg) < ARRIVAL_DEG
                   ? GONIO_OK
                   : gonio_fail(error, GONIO_E_RANGE, "%s does not exist and stands at %g deg; %g deg was asked for",
                                axis_names[k], a->fixed_deg, user);
    }
    if (!(to >= a->min_deg - slack && to <= a->max_deg + slack)) {
        const double one = user_deg(a, a->min_deg), other = user_deg(a, a->max_deg);
        return gonio_fail(error, GONIO_E_RANGE, "%s cannot go to %.6g deg; its limits are %g and %g deg", axis_names[k],
                          user, fmin(one, other), fmax(one, other));
    }
    const double over = overshoot_deg(a, from, to);
    return over >= a->min_deg - slack && over <= a->max_deg + slack
               ? GONIO_OK
               : gonio_fail(
                     error, GONIO_E_RANGE,
                     "%s cannot go to %.6g deg: from where it stands it has to pass it by %g deg (backlash_deg), "
                     "beyond its limits",
                     axis_names[k], user, fabs(a->backlash_deg));
}

gonio_status gonio_free_check(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                              gonio_error *error) {
    const gonio_free_stage *s = device;
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < GONIO_AXES; k++) {
        status = check_axis(s, k, from_rad[k], to_rad[k], error);
    }
    return status;
}

// All axes to dial positions, and wait.
static gonio_status go(gonio_free_stage *s, const double dial[GONIO_AXES], double timeout_s, gonio_error *error) {
    double units[GONIO_AXES];
    for (int k = 0; k < GONIO_AXES; k++) {
        units[k] = dial[k] * s->axes[k].units_per_deg;
    }
    const gonio_status status = s->drive->go(s, units, error);
    return status == GONIO_OK ? wait_idle(s, dial, timeout_s, error) : status;
}

static gonio_status check_arrival(gonio_free_stage *s, const double target_rad[GONIO_AXES], gonio_error *error) {
    double now[GONIO_AXES];
    gonio_status status = gonio_free_position(s, now, error);
    for (int k = 0; status == GONIO_OK && k < GONIO_AXES; k++) {
        const double off = gonio_degrees(now[k] - target_rad[k]);
        if (fabs(off) > tolerance_deg(&s->axes[k])) {
            status = gonio_fail(error, GONIO_E_DEVICE, "%s stands at %.6g deg, asked for %.6g deg", axis_names[k],
                                gonio_degrees(now[k]), gonio_degrees(target_rad[k]));
        }
    }
    return status;
}

static gonio_status check_homed(gonio_free_stage *s, gonio_error *error) {
    gonio_free_state now;
    const gonio_status status = s->drive->state(s, &now, error);
    if (status != GONIO_OK) {
        return status;
    }
    const bool known = s->homed || s->absolute || (s->drive->tells_homed(s) && now != GONIO_FREE_UNHOMED);
    return known && now != GONIO_FREE_UNHOMED ? GONIO_OK
                                              : gonio_fail(error, GONIO_E_DEVICE,
                                                           "the stage is not homed: `gonio rig home` "
                                                           "first");
}

gonio_status gonio_free_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                             double timeout_s, gonio_error *error) {
    (void)id, (void)stamp;
    gonio_free_stage *s = device;
    double from_rad[GONIO_AXES], over[GONIO_AXES], to[GONIO_AXES];
    bool takes_up = false;
    gonio_status status = watch(s, error);
    status = status == GONIO_OK ? check_homed(s, error) : status;
    status = status == GONIO_OK ? gonio_free_position(s, from_rad, error) : status;
    status = status == GONIO_OK ? gonio_free_check(s, from_rad, target_rad, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    for (int k = 0; k < GONIO_AXES; k++) {
        const gonio_free_axis *a = &s->axes[k];
        to[k] = dial_deg(a, gonio_degrees(target_rad[k]));
        over[k] = overshoot_deg(a, dial_deg(a, gonio_degrees(from_rad[k])), to[k]);
        takes_up = takes_up || over[k] != to[k];
    }
    status = takes_up ? go(s, over, timeout_s, error) : GONIO_OK;
    status = status == GONIO_OK ? go(s, to, timeout_s, error) : status;
    return status == GONIO_OK ? check_arrival(s, target_rad, error) : status;
}

double gonio_free_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES]) {
    const gonio_free_stage *s = device;
    double longest = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        const gonio_free_axis *a = &s->axes[k];
        const double from = dial_deg(a, gonio_degrees(from_rad[k])), to = dial_deg(a, gonio_degrees(to_rad[k]));
        const double over = overshoot_deg(a, from, to);
        longest = fmax(longest, (fabs(over - from) + fabs(to - over)) / a->speed_deg_per_s);
    }
    return longest;
}

bool gonio_free_turns(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                      double turn_rad[GONIO_AXES]) {
    const gonio_free_stage *s = device;
    bool turns = false;
    for (int k = 0; k < GONIO_AXES; k++) {
        const gonio_free_axis *a = &s->axes[k];
        const double to = dial_deg(a, gonio_degrees(to_rad[k]));
        const double over = a->there ? overshoot_deg(a, dial_deg(a, gonio_degrees(from_rad[k])), to) : to;
        turn_rad[k] = over == to ? to_rad[k] : gonio_radians(user_deg(a, over));
        turns = turns || over != to;
    }
    return turns;
}

gonio_status gonio_free_stop(void *device, gonio_error *error) {
    gonio_free_stage *s = device;
    return s->drive->stop(s, error);
}

gonio_status gonio_free_come_to_rest(gonio_free_stage *s, gonio_free_state *now, gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_s(STOP_TIMEOUT_S);
    gonio_status status = GONIO_OK;
    *now = GONIO_FREE_BUSY;
    while (status == GONIO_OK && *now == GONIO_FREE_BUSY) {
        status = s->drive->state(s, now, error);
        if (status == GONIO_OK && *now == GONIO_FREE_BUSY && gonio_deadline_left_ms(deadline) == 0) {
            return gonio_fail(error, GONIO_E_TIMEOUT, "stage: it still moves %d s after its stop", STOP_TIMEOUT_S);
        }
        gonio_clock_sleep_ms(*now == GONIO_FREE_BUSY ? POLL_MS : 0);
    }
    return status;
}

void gonio_free_close(void *device) {
    gonio_free_stage *s = device;
    s->drive->close(s);
}
