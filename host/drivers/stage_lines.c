// SPDX-License-Identifier: BSD-3-Clause
// Questions are repeated when an answer is missing or makes no sense; moves have absolute targets, so that a repeated
// one harms nothing, but they are not repeated by themselves: what happened to the first one is asked instead.
#include "host/drivers/stage_lines.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "host/drivers/driver.h"

typedef gonio_free_state state;

typedef struct stage {
    gonio_free_stage free;
    gonio_stage_lines_config config;
    gonio_lines_table table;
    gonio_line *line;
    gonio_lines_axes there;    // those that exist
    int axis_of[GONIO_AXES];   // of there: which of ours
    int number_of[GONIO_AXES]; // of ours: which of there
} stage;

static stage *stage_of(gonio_free_stage *free) { return (stage *)free; }

void gonio_stage_lines_defaults(gonio_stage_lines_config *config) {
    *config = (gonio_stage_lines_config){.line = {.baud = 115200, .timeout_ms = 1000}, .table = "grbl", .retries = 3};
    for (int k = 0; k < GONIO_AXES; k++) {
        config->axes[k] = (gonio_lines_axis){.free = gonio_free_axis_default()};
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

static bool accept_state(const stage *s, int axis, const char *answer, void *out) {
    const char *name = axis < s->there.n ? s->there.names[axis] : NULL;
    // A hold that has come to rest is both stopped and, to a move that waits, busy: which counts is the caller's
    // matter.
    const struct {
        const char *patterns;
        state state;
    } states[] = {{s->table.unhomed, GONIO_FREE_UNHOMED},
                  {s->table.stopped, GONIO_FREE_STOPPED},
                  {s->table.idle, GONIO_FREE_IDLE},
                  {s->table.busy, GONIO_FREE_BUSY}};
    for (size_t k = 0; k < sizeof states / sizeof *states; k++) {
        if (gonio_lines_match(states[k].patterns, name, answer)) {
            *(state *)out = states[k].state == GONIO_FREE_STOPPED && gonio_lines_match(s->table.idle, name, answer)
                                ? GONIO_FREE_IDLE
                                : states[k].state;
            return true;
        }
    }
    return false;
}

// The state of all: busy where one is, else the worst of them.
static gonio_status read_state(stage *s, state *all, gonio_error *error) {
    const bool each = gonio_lines_each(s->table.state);
    *all = GONIO_FREE_IDLE;
    for (int k = 0; k < (each ? s->there.n : 1); k++) {
        state one;
        const gonio_status status = ask(s, s->table.state, k, accept_state, &one, error);
        if (status != GONIO_OK) {
            return status;
        }
        *all = *all == GONIO_FREE_BUSY || one == GONIO_FREE_BUSY ? GONIO_FREE_BUSY : one > *all ? one : *all;
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

// ---- what the axes do with it ----

static bool accept_position(const stage *s, int axis, const char *answer, void *out) {
    return gonio_lines_number_in(&s->table, s->table.position_answer, s->there.names[axis], axis, answer, out);
}

static gonio_status drive_position(gonio_free_stage *free, int axis, double *units, gonio_error *error) {
    stage *s = stage_of(free);
    return ask(s, s->table.position, s->number_of[axis], accept_position, units, error);
}

static gonio_status drive_state(gonio_free_stage *free, gonio_free_state *now, gonio_error *error) {
    return read_state(stage_of(free), now, error);
}

static bool drive_tells_homed(const gonio_free_stage *free) { return ((const stage *)free)->table.unhomed[0] != 0; }

static gonio_status drive_home(gonio_free_stage *free, double timeout_s, gonio_error *error) {
    stage *s = stage_of(free);
    const double bound = s->table.home_timeout_s > 0 ? s->table.home_timeout_s : timeout_s;
    return command(s, s->table.home, &s->there, (int)(1000 * fmin(bound, 3600)), error);
}

static gonio_status drive_go(gonio_free_stage *free, const double units[GONIO_AXES], gonio_error *error) {
    stage *s = stage_of(free);
    gonio_lines_axes axes = s->there;
    for (int k = 0; k < axes.n; k++) {
        axes.values[k] = units[s->axis_of[k]];
    }
    return command(s, s->table.move, &axes, s->config.line.timeout_ms, error);
}

// To rest, and where that takes a second step ready for the next command.
static gonio_status drive_stop(gonio_free_stage *free, gonio_error *error) {
    stage *s = stage_of(free);
    if (s->table.stop[0] == 0) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "stage: this motion controller knows no stop; it ends its move");
    }
    gonio_status status = command(s, s->table.stop, &s->there, s->config.line.timeout_ms, error);
    if (status != GONIO_OK || s->table.stopped[0] == 0) {
        return status;
    }
    gonio_free_state now;
    status = gonio_free_come_to_rest(free, &now, error);
    return status == GONIO_OK && now == GONIO_FREE_STOPPED
               ? command(s, s->table.release, &s->there, s->config.line.timeout_ms, error)
               : status;
}

static void drive_close(gonio_free_stage *free_stage) {
    stage *s = stage_of(free_stage);
    gonio_line_close(s->line);
    free(s);
}

static const gonio_free_drive drive = {drive_home,     drive_go,    drive_stop,       drive_state,
                                       drive_position, drive_close, drive_tells_homed};

const gonio_stage_ops gonio_stage_lines = {.name = "lines", GONIO_FREE_STAGE_OPS};

// ---- opening ----

static void find_axes(stage *s) {
    for (int k = 0; k < GONIO_AXES; k++) {
        const gonio_lines_axis *a = &s->config.axes[k];
        s->free.axes[k] = a->free;
        s->free.axes[k].there = a->name[0] != 0;
        if (s->free.axes[k].there) {
            s->number_of[k] = s->there.n;
            s->axis_of[s->there.n] = k;
            s->there.names[s->there.n++] = a->name;
        }
    }
}

gonio_status gonio_stage_lines_open(const gonio_stage_lines_config *config, const gonio_driver_context *context,
                                    void **device, gonio_error *error) {
    stage *s = calloc(1, sizeof *s);
    if (s == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a stage");
    }
    s->config = *config;
    s->free.drive = &drive;
    s->free.absolute = config->absolute;
    gonio_free_watch(&s->free, context);
    find_axes(s);
    gonio_status status =
        gonio_free_check_config(s->free.axes, "name: no axis has the name that the motion controller gives it", error);
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
        drive_close(&s->free);
        return status;
    }
    *device = s;
    return GONIO_OK;
}

typedef gonio_stage_lines_config settings;

GONIO_KEY_NAMES(parities, "N", "E", "O")
#define KEY(text, kind, member) .section = "stage", GONIO_KEY_NAMED(settings, member, text, kind)
#define AXIS(title, number)                                                                                            \
    {.section = title, GONIO_KEY_NAMED(settings, axes[number].name, "name", LINE)},                                    \
        GONIO_FREE_KEYS(settings, title, axes[number].free)
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
    return gonio_stage_lines_open(config, context, device, error);
}

const gonio_driver gonio_driver_stage_lines = {.name = "lines",
                                               .device = GONIO_DEVICE_STAGE,
                                               .summary = "axes of a motion controller with commands in text",
                                               .keys = keys,
                                               .settings = sizeof(settings),
                                               .defaults = defaults,
                                               .ops = &gonio_stage_lines,
                                               .open = make};
