// SPDX-License-Identifier: BSD-3-Clause
// Questions are repeated when an answer is missing or makes no sense; moves have absolute targets, so that a repeated
// one harms nothing, but they are not repeated by themselves: what happened to the first one is asked instead. The axes
// of such controllers move each at its own pace, so a move may pass any place of the box between its ends.
#include "host/drivers/stage_lines.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "host/drivers/driver.h"
#include "host/transport/clock.h"

enum { POLL_MS = 20, IDLE_TWICE = 2 };
#define ARRIVAL_DEG 0.02 // beyond this the controller stands elsewhere than it was sent to
#define STOP_TIMEOUT_S 10

static const char *const axis_names[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};

typedef struct stage {
    gonio_stage_lines_config config;
    gonio_lines_table table;
    gonio_line *line;
    gonio_lines_axes there;  // those that exist
    int axis_of[GONIO_AXES]; // of there: which of ours
    bool homed;
} stage;

void gonio_stage_lines_defaults(gonio_stage_lines_config *config) {
    *config = (gonio_stage_lines_config){.line = {.baud = 115200, .timeout_ms = 1000}, .table = "grbl", .retries = 3};
    for (int k = 0; k < GONIO_AXES; k++) {
        config->axes[k] =
            (gonio_lines_axis){.units_per_deg = 1, .speed_deg_per_s = 10, .min_deg = -360, .max_deg = 360};
    }
}

// ---- talking ----

static bool matches_any(const stage *s, const char *patterns, const char *answer) {
    for (int k = 0; k < s->there.n; k++) {
        if (gonio_lines_match(patterns, s->there.names[k], answer)) {
            return true;
        }
    }
    return false;
}

// The next answer; one that is an error ends it.
static gonio_status answer_of(stage *s, int timeout_ms, char answer[GONIO_LINE_MAX], gonio_error *error) {
    const gonio_status status = gonio_line_receive(s->line, timeout_ms, answer, error);
    return status == GONIO_OK && matches_any(s, s->table.error, answer)
               ? gonio_fail(error, GONIO_E_FAILED, "the motion controller says '%.80s'", answer)
               : status;
}

static gonio_status send(stage *s, const char *template, const gonio_lines_axes *axes, int axis, gonio_error *error) {
    char command[GONIO_LINES_COMMAND];
    size_t n;
    const gonio_status status = gonio_lines_command(&s->table, template, axes, axis, command, &n, error);
    return status == GONIO_OK ? gonio_line_send(s->line, command, n, error) : status;
}

// A question until its answer fits, each time with a clean line. accept: does the answer fit?
typedef bool (*accept_fn)(const stage *s, int axis, const char *answer, void *out);

static gonio_status ask(stage *s, const char *template, int axis, accept_fn accept, void *out, gonio_error *error) {
    gonio_error last = {.line = -1, .byte = -1};
    for (int attempt = 0; attempt <= s->config.retries; attempt++) {
        char answer[GONIO_LINE_MAX] = "";
        gonio_line_drain(s->line);
        gonio_status status = send(s, template, &s->there, axis, &last);
        // A late answer to an earlier question may come first, and what nobody asked for in between.
        for (int k = 0; status == GONIO_OK && k < 4; k++) {
            status = answer_of(s, s->config.line.timeout_ms, answer, &last);
            if (status == GONIO_OK && accept(s, axis, answer, out)) {
                return GONIO_OK;
            }
            k -= status == GONIO_OK && matches_any(s, s->table.ignore, answer);
        }
        if (status == GONIO_OK) {
            gonio_fail(&last, GONIO_E_DEVICE, "'%.80s' answers '%.40s'", answer, template);
        } else if (status == GONIO_E_FAILED) {
            last.status = GONIO_E_DEVICE; // its own error, which a repeated question does not mend
            break;
        }
    }
    return gonio_fail(error, last.status, "stage: %.400s", last.message);
}

typedef enum state { STATE_IDLE, STATE_BUSY, STATE_UNHOMED, STATE_STOPPED } state;

static bool accept_state(const stage *s, int axis, const char *answer, void *out) {
    const char *name = axis < s->there.n ? s->there.names[axis] : NULL;
    // A hold that has come to rest is both stopped and, to a move that waits, busy: which counts is the caller's
    // matter.
    const struct {
        const char *patterns;
        state state;
    } states[] = {{s->table.unhomed, STATE_UNHOMED},
                  {s->table.stopped, STATE_STOPPED},
                  {s->table.idle, STATE_IDLE},
                  {s->table.busy, STATE_BUSY}};
    for (size_t k = 0; k < sizeof states / sizeof *states; k++) {
        if (gonio_lines_match(states[k].patterns, name, answer)) {
            *(state *)out = states[k].state == STATE_STOPPED && gonio_lines_match(s->table.idle, name, answer)
                                ? STATE_IDLE
                                : states[k].state;
            return true;
        }
    }
    return false;
}

// The state of all: busy where one is, else the worst of them.
static gonio_status read_state(stage *s, state *all, gonio_error *error) {
    const bool each = gonio_lines_each(s->table.state);
    *all = STATE_IDLE;
    for (int k = 0; k < (each ? s->there.n : 1); k++) {
        state one;
        const gonio_status status = ask(s, s->table.state, k, accept_state, &one, error);
        if (status != GONIO_OK) {
            return status;
        }
        *all = *all == STATE_BUSY || one == STATE_BUSY ? STATE_BUSY : one > *all ? one : *all;
    }
    return GONIO_OK;
}

static bool accept_good(const stage *s, int axis, const char *answer, void *out) {
    const char *name = axis < s->there.n ? s->there.names[axis] : NULL;
    *(bool *)out = gonio_lines_match(s->table.check_good, name, answer);
    return *(bool *)out || answer[0] != 0;
}

// What went wrong with the last commands, where the controller has to be asked.
static gonio_status check_errors(stage *s, gonio_error *error) {
    const bool each = gonio_lines_each(s->table.check);
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && s->table.check[0] != 0 && k < (each ? s->there.n : 1); k++) {
        bool good = false;
        status = ask(s, s->table.check, k, accept_good, &good, error);
        if (status == GONIO_OK && !good) {
            status = gonio_fail(error, GONIO_E_DEVICE, "stage: the motion controller reports an error%s%s ('%.40s')",
                                each ? " of axis " : "", each ? s->there.names[k] : "", s->table.check);
        }
    }
    return status;
}

// Every command of a template, acknowledged where the controller does that.
static gonio_status command(stage *s, const char *template, const gonio_lines_axes *axes, int timeout_ms,
                            gonio_error *error) {
    char part[GONIO_LINES_TEXT], answer[GONIO_LINE_MAX];
    gonio_status status = GONIO_OK;
    gonio_line_drain(s->line);
    for (int p = 0; status == GONIO_OK && gonio_lines_part(template, p, part); p++) {
        const bool each = gonio_lines_each(part), silent = strstr(part, "\\c") != NULL;
        for (int k = 0; status == GONIO_OK && k < (each ? axes->n : 1); k++) {
            status = send(s, part, axes, k, error);
            bool acknowledged = s->table.ack[0] == 0 || silent;
            while (status == GONIO_OK && !acknowledged) {
                status = answer_of(s, timeout_ms, answer, error);
                status = status == GONIO_E_FAILED ? GONIO_E_DEVICE : status;
                acknowledged = status == GONIO_OK && gonio_lines_match(s->table.ack, NULL, answer);
            }
        }
    }
    return status == GONIO_OK ? check_errors(s, error) : status;
}

// ---- waiting ----

static gonio_status stage_stop(void *device, gonio_error *error);

static gonio_status watch(const stage *s, gonio_error *error) {
    if (s->config.cancelled != NULL && s->config.cancelled(s->config.cancelled_context)) {
        return gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; the axes stand");
    }
    return s->config.interlock != NULL ? s->config.interlock->check(s->config.interlock_device, error) : GONIO_OK;
}

// Until all are idle, twice in a row: some controllers say so before they have begun.
static gonio_status wait_idle(stage *s, double timeout_s, gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_s(timeout_s);
    int idle = 0;
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && idle < IDLE_TWICE) {
        state now = STATE_BUSY;
        status = watch(s, error);
        if (status != GONIO_OK) {
            stage_stop(s, NULL);
            return status;
        }
        status = read_state(s, &now, error);
        idle = now == STATE_IDLE ? idle + 1 : 0;
        if (status == GONIO_OK && now == STATE_UNHOMED) {
            s->homed = false;
            return gonio_fail(error, GONIO_E_DEVICE, "stage: the motion controller has lost its position: home it");
        }
        if (status == GONIO_OK && now == STATE_STOPPED) {
            return gonio_fail(error, GONIO_E_DEVICE, "stage: it was stopped on its way");
        }
        if (status == GONIO_OK && idle < IDLE_TWICE && gonio_deadline_left_ms(deadline) == 0) {
            stage_stop(s, NULL);
            return gonio_fail(error, GONIO_E_TIMEOUT, "stage: it still moves after %g s; stopped", timeout_s);
        }
        gonio_clock_sleep_ms(idle < IDLE_TWICE ? POLL_MS : 0);
    }
    return status;
}

// ---- coordinates ----

static double dial_deg(const gonio_lines_axis *a, double user_deg) {
    return (a->invert ? -user_deg : user_deg) + a->zero_deg;
}

static double user_deg(const gonio_lines_axis *a, double dial) { return (a->invert ? -1 : 1) * (dial - a->zero_deg); }

static bool accept_position(const stage *s, int axis, const char *answer, void *out) {
    return gonio_lines_number_in(&s->table, s->table.position_answer, s->there.names[axis], axis, answer, out);
}

static gonio_status stage_position(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    stage *s = device;
    for (int k = 0; k < GONIO_AXES; k++) {
        position_rad[k] = gonio_radians(s->config.axes[k].fixed_deg);
    }
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < s->there.n; k++) {
        const gonio_lines_axis *a = &s->config.axes[s->axis_of[k]];
        double units = 0;
        status = ask(s, s->table.position, k, accept_position, &units, error);
        position_rad[s->axis_of[k]] = gonio_radians(user_deg(a, units / a->units_per_deg));
    }
    return status;
}

// ---- moves ----

static gonio_status stage_home(void *device, double timeout_s, gonio_error *error) {
    stage *s = device;
    const double bound = s->table.home_timeout_s > 0 ? s->table.home_timeout_s : timeout_s;
    gonio_status status = watch(s, error);
    s->homed = false;
    status = status == GONIO_OK ? command(s, s->table.home, &s->there, (int)(1000 * fmin(bound, 3600)), error) : status;
    status = status == GONIO_OK ? wait_idle(s, timeout_s, error) : status;
    s->homed = status == GONIO_OK;
    return status;
}

// Where the way to a target overshoots to, per axis, in dial degrees: the side of the final approach decides.
static double overshoot_deg(const gonio_lines_axis *a, double from, double to) {
    const bool takes_up = a->backlash_deg != 0 && to != from && (to > from) != (a->backlash_deg > 0);
    return takes_up ? to - a->backlash_deg : to;
}

static gonio_status check_axis(const stage *s, int k, double from_rad, double to_rad, gonio_error *error) {
    const gonio_lines_axis *a = &s->config.axes[k];
    const double user = gonio_degrees(to_rad), to = dial_deg(a, user), from = dial_deg(a, gonio_degrees(from_rad));
    const double slack = 1e-9;
    if (a->name[0] == 0) {
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

static gonio_status stage_check(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                                gonio_error *error) {
    const stage *s = device;
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < GONIO_AXES; k++) {
        status = check_axis(s, k, from_rad[k], to_rad[k], error);
    }
    return status;
}

// All axes to dial positions, and wait.
static gonio_status go(stage *s, const double dial[GONIO_AXES], double timeout_s, gonio_error *error) {
    gonio_lines_axes axes = s->there;
    for (int k = 0; k < axes.n; k++) {
        axes.values[k] = dial[s->axis_of[k]] * s->config.axes[s->axis_of[k]].units_per_deg;
    }
    const gonio_status status = command(s, s->table.move, &axes, s->config.line.timeout_ms, error);
    return status == GONIO_OK ? wait_idle(s, timeout_s, error) : status;
}

static gonio_status check_arrival(stage *s, const double target_rad[GONIO_AXES], gonio_error *error) {
    double now[GONIO_AXES];
    gonio_status status = stage_position(s, now, error);
    for (int k = 0; status == GONIO_OK && k < GONIO_AXES; k++) {
        const double off = gonio_degrees(now[k] - target_rad[k]);
        // Half a unit of the controller is as near as it can come.
        if (fabs(off) > fmax(ARRIVAL_DEG, 0.51 / fabs(s->config.axes[k].units_per_deg))) {
            status = gonio_fail(error, GONIO_E_DEVICE, "%s stands at %.6g deg, asked for %.6g deg", axis_names[k],
                                gonio_degrees(now[k]), gonio_degrees(target_rad[k]));
        }
    }
    return status;
}

static gonio_status check_homed(stage *s, gonio_error *error) {
    state now;
    const gonio_status status = read_state(s, &now, error);
    if (status != GONIO_OK) {
        return status;
    }
    const bool known = s->homed || s->config.absolute || (s->table.unhomed[0] != 0 && now != STATE_UNHOMED);
    return known && now != STATE_UNHOMED ? GONIO_OK
                                         : gonio_fail(error, GONIO_E_DEVICE,
                                                      "the stage is not homed: `gonio rig home` "
                                                      "first");
}

static gonio_status stage_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                               double timeout_s, gonio_error *error) {
    (void)id, (void)stamp;
    stage *s = device;
    double from_rad[GONIO_AXES], over[GONIO_AXES], to[GONIO_AXES];
    bool takes_up = false;
    gonio_status status = watch(s, error);
    status = status == GONIO_OK ? check_homed(s, error) : status;
    status = status == GONIO_OK ? stage_position(s, from_rad, error) : status;
    status = status == GONIO_OK ? stage_check(s, from_rad, target_rad, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    for (int k = 0; k < GONIO_AXES; k++) {
        const gonio_lines_axis *a = &s->config.axes[k];
        to[k] = dial_deg(a, gonio_degrees(target_rad[k]));
        over[k] = overshoot_deg(a, dial_deg(a, gonio_degrees(from_rad[k])), to[k]);
        takes_up = takes_up || over[k] != to[k];
    }
    status = takes_up ? go(s, over, timeout_s, error) : GONIO_OK;
    status = status == GONIO_OK ? go(s, to, timeout_s, error) : status;
    return status == GONIO_OK ? check_arrival(s, target_rad, error) : status;
}

// To rest, and where that takes a second step ready for the next command.
static gonio_status stage_stop(void *device, gonio_error *error) {
    stage *s = device;
    if (s->table.stop[0] == 0) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "stage: this motion controller knows no stop; it ends its move");
    }
    gonio_status status = command(s, s->table.stop, &s->there, s->config.line.timeout_ms, error);
    if (status != GONIO_OK || s->table.stopped[0] == 0) {
        return status;
    }
    const gonio_deadline deadline = gonio_deadline_in_s(STOP_TIMEOUT_S);
    state now = STATE_BUSY;
    while (status == GONIO_OK && now == STATE_BUSY) {
        status = read_state(s, &now, error);
        if (status == GONIO_OK && now == STATE_BUSY && gonio_deadline_left_ms(deadline) == 0) {
            return gonio_fail(error, GONIO_E_TIMEOUT, "stage: it still moves %d s after its stop", STOP_TIMEOUT_S);
        }
        gonio_clock_sleep_ms(now == STATE_BUSY ? POLL_MS : 0);
    }
    return status == GONIO_OK && now == STATE_STOPPED
               ? command(s, s->table.release, &s->there, s->config.line.timeout_ms, error)
               : status;
}

static double stage_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES]) {
    const stage *s = device;
    double longest = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        const gonio_lines_axis *a = &s->config.axes[k];
        const double from = dial_deg(a, gonio_degrees(from_rad[k])), to = dial_deg(a, gonio_degrees(to_rad[k]));
        const double over = overshoot_deg(a, from, to);
        longest = fmax(longest, (fabs(over - from) + fabs(to - over)) / a->speed_deg_per_s);
    }
    return longest;
}

static void stage_close(void *device) {
    stage *s = device;
    gonio_line_close(s->line);
    free(s);
}

const gonio_stage_ops gonio_stage_lines = {.name = "lines",
                                           .home = stage_home,
                                           .move = stage_move,
                                           .position = stage_position,
                                           .stop = stage_stop,
                                           .duration_s = stage_duration_s,
                                           .close = stage_close,
                                           .check = stage_check,
                                           .independent = true,
                                           .real = true};

// ---- opening ----

static gonio_status find_axes(stage *s, gonio_error *error) {
    for (int k = 0; k < GONIO_AXES; k++) {
        const gonio_lines_axis *a = &s->config.axes[k];
        if (a->min_deg >= a->max_deg) {
            return gonio_fail(error, GONIO_E_INPUT, "[axis %s] min_deg %g is not below max_deg %g", axis_names[k],
                              a->min_deg, a->max_deg);
        }
        if (a->name[0] != 0) {
            s->axis_of[s->there.n] = k;
            s->there.names[s->there.n++] = a->name;
        }
    }
    return s->there.n > 0 ? GONIO_OK
                          : gonio_fail(error, GONIO_E_INPUT,
                                       "[axis ...] name: no axis has the name that the motion controller gives it");
}

gonio_status gonio_stage_lines_open(const gonio_stage_lines_config *config, void **device, gonio_error *error) {
    stage *s = calloc(1, sizeof *s);
    if (s == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a stage");
    }
    s->config = *config;
    gonio_status status = find_axes(s, error);
    status = status == GONIO_OK ? gonio_lines_table_read(config->table, &s->table, error) : status;
    if (status == GONIO_OK) {
        status = gonio_line_open(&config->line, config->record, config->replay, &s->line, error);
    }
    state now;
    status = status == GONIO_OK && s->table.open[0] != 0
                 ? command(s, s->table.open, &s->there, config->line.timeout_ms, error)
                 : status;
    status = status == GONIO_OK ? read_state(s, &now, error) : status; // does anybody answer?
    if (status != GONIO_OK) {
        stage_close(s);
        return status;
    }
    *device = s;
    return GONIO_OK;
}

typedef gonio_stage_lines_config settings;

GONIO_KEY_NAMES(parities, "N", "E", "O")
#define KEY(text, kind, member) .section = "stage", GONIO_KEY_NAMED(settings, member, text, kind)
#define ONE(number, title, text, kind, member)                                                                         \
    .section = title, GONIO_KEY_NAMED(settings, axes[number].member, text, kind)
#define AXIS(title, number)                                                                                            \
    {ONE(number, title, "name", LINE, name)}, {ONE(number, title, "units_per_deg", REAL, units_per_deg), -1e9, 1e9},   \
        {ONE(number, title, "speed_deg_per_s", REAL, speed_deg_per_s), 1e-3, 1e4, .shared = true},                     \
        {ONE(number, title, "min_deg", REAL, min_deg), -3600, 3600, .shared = true},                                   \
        {ONE(number, title, "max_deg", REAL, max_deg), -3600, 3600, .shared = true},                                   \
        {ONE(number, title, "backlash_deg", REAL, backlash_deg), -45, 45, .shared = true},                             \
        {ONE(number, title, "zero_deg", REAL, zero_deg), -3600, 3600},                                                 \
        {ONE(number, title, "fixed_deg", REAL, fixed_deg), -360, 360}, {                                               \
        ONE(number, title, "invert", BOOLEAN, invert)                                                                  \
    }
static const gonio_key keys[] = {{KEY("port", LINE, line.port)},
                                 {KEY("baud", INTEGER, line.baud), 1200, 921600},
                                 {KEY("parity", CHOICE, line.parity), .names = parities},
                                 {KEY("timeout_ms", INTEGER, line.timeout_ms), 10, 100000},
                                 {KEY("retries", INTEGER, retries), 0, 100},
                                 {KEY("table", LINE, table)},
                                 {KEY("absolute", BOOLEAN, absolute)},
                                 {KEY("record", LINE, record)},
                                 {KEY("replay", LINE, replay)},
                                 AXIS("axis light_theta", GONIO_LIGHT_THETA),
                                 AXIS("axis light_phi", GONIO_LIGHT_PHI),
                                 AXIS("axis camera_theta", GONIO_CAMERA_THETA),
                                 AXIS("axis camera_phi", GONIO_CAMERA_PHI),
                                 {0}};

static void defaults(void *config) { gonio_stage_lines_defaults(config); }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    settings *s = config;
    s->interlock = context->interlock;
    s->interlock_device = context->interlock_device;
    s->cancelled = context->cancelled;
    s->cancelled_context = context->event_context;
    return gonio_stage_lines_open(s, device, error);
}

const gonio_driver gonio_driver_stage_lines = {.name = "lines",
                                               .device = GONIO_DEVICE_STAGE,
                                               .summary = "axes of a motion controller with commands in text",
                                               .keys = keys,
                                               .settings = sizeof(settings),
                                               .defaults = defaults,
                                               .ops = &gonio_stage_lines,
                                               .open = make};
