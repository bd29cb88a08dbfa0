// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/controller_internal.h"

#include "host/transport/clock.h"

enum { POLL_MS = 20, BLOCK_WORDS = CONTROLLER_command + 1 - CONTROLLER_heartbeat };

typedef struct command_block {
    uint16_t words[BLOCK_WORDS]; // from the heartbeat on
} command_block;

// Who does not hold the rig gives no number: STOP is free to all.
static gonio_modbus_fault once_command(gonio_controller *c, void *request) {
    enum { BARE = CONTROLLER_SIZE_heartbeat };
    const uint16_t *words = ((command_block *)request)->words;
    if (!c->holds) {
        return gonio_modbus_write(c->modbus, CONTROLLER_command_id, BLOCK_WORDS - BARE, words + BARE);
    }
    const gonio_modbus_fault fault = gonio_modbus_write(c->modbus, CONTROLLER_heartbeat, BLOCK_WORDS, words);
    c->last_fed_ms = fault == GONIO_MODBUS_GOOD ? gonio_clock_ms() : c->last_fed_ms;
    return fault;
}

static void fill_block(const gonio_controller *c, command_block *block, int command, unsigned axes,
                       const int64_t *targets) {
    uint16_t *w = block->words + (CONTROLLER_command_id - CONTROLLER_heartbeat);
    gonio_controller_pack(block->words, CONTROLLER_SIZE_heartbeat, c->number);
    gonio_controller_pack(w, CONTROLLER_SIZE_command_id, c->last_id);
    w[CONTROLLER_command_axes - CONTROLLER_command_id] = (uint16_t)axes;
    w[CONTROLLER_command_speed - CONTROLLER_command_id] = (uint16_t)CONTROLLER_INITIAL_command_speed;
    for (int k = 0; k < GONIO_CONTROLLER_AXES; k++) {
        gonio_controller_pack(w + (CONTROLLER_target - CONTROLLER_command_id) + k * CONTROLLER_EACH_target,
                              CONTROLLER_EACH_target, targets != NULL ? targets[k] : 0);
    }
    w[CONTROLLER_command - CONTROLLER_command_id] = (uint16_t)command;
}

static gonio_status fail_refused(const gonio_controller_status *s, gonio_error *error) {
    const bool limit = s->refusal == CONTROLLER_REFUSAL_SOFT_LIMIT || s->refusal == CONTROLLER_REFUSAL_HARD_LIMIT ||
                       s->refusal == CONTROLLER_REFUSAL_TOO_FAR;
    if (s->refusal == CONTROLLER_REFUSAL_ALARMED || s->refusal == CONTROLLER_REFUSAL_STOPPED) {
        const gonio_status status = gonio_controller_alarm(s, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    return gonio_fail(error, limit ? GONIO_E_RANGE : GONIO_E_DEVICE, "controller refused the command (%d): %s",
                      s->refusal, gonio_controller_refusal_text(s->refusal));
}

gonio_status gonio_controller_command(gonio_controller *c, int command, unsigned axes,
                                      const int64_t targets[GONIO_CONTROLLER_AXES], uint32_t *id, gonio_error *error) {
    command_block block;
    // STOP and HALT act at once, leave no id, and need not hold the rig.
    const bool stops = command == CONTROLLER_COMMAND_STOP || command == CONTROLLER_COMMAND_HALT;
    const gonio_status claimed = stops ? GONIO_OK : c->claim(c, error);
    if (claimed != GONIO_OK) {
        return claimed;
    }
    c->last_id = c->last_id == UINT32_MAX ? 1 : c->last_id + 1;
    fill_block(c, &block, command, axes, targets);
    c->resting = c->resting && command != CONTROLLER_COMMAND_MOVE && command != CONTROLLER_COMMAND_HOME &&
                 command != CONTROLLER_COMMAND_JOG;
    for (int attempt = 0; attempt <= c->config.retries; attempt++) {
        int exception = 0;
        gonio_status status = gonio_controller_request(c, "command", once_command, &block, &exception, error);
        if (status != GONIO_OK && exception == 0) {
            return status;
        }
        // An answer may belong to an earlier request; only a status with a token tells.
        gonio_controller_status now;
        status = gonio_controller_read_status(c, &now, error);
        if (status != GONIO_OK) {
            return status;
        }
        const bool moves = now.state == CONTROLLER_STATE_MOVING || now.state == CONTROLLER_STATE_HOMING;
        if (stops ? !moves : now.accepted_id == c->last_id) {
            c->commanded = c->commanded || !stops;
            if (id != NULL) {
                *id = c->last_id;
            }
            return GONIO_OK;
        }
        // NOT_OWNER to the owner: another program's request was refused after this one.
        const bool others = now.refusal == CONTROLLER_REFUSAL_NOT_OWNER && now.owner == c->number;
        if (exception != 0 && now.refusal != CONTROLLER_REFUSAL_NONE && !others) {
            return fail_refused(&now, error);
        }
        gonio_controller_pause(c, POLL_MS);
    }
    return gonio_fail(error, GONIO_E_DEVICE, "controller %s does not take command %d", c->config.modbus.port, command);
}

gonio_status gonio_controller_clear(gonio_controller *c, gonio_error *error) {
    gonio_controller_status status;
    const gonio_status result = gonio_controller_read_status(c, &status, error);
    if (result != GONIO_OK || (status.state != CONTROLLER_STATE_ALARM && status.state != CONTROLLER_STATE_ESTOP)) {
        return result;
    }
    const gonio_status cleared = gonio_controller_command(c, CONTROLLER_COMMAND_CLEAR, 0, NULL, NULL, error);
    if (cleared == GONIO_OK) {
        gonio_controller_tell(c, "alarm-cleared", "alarm %d %s", status.alarm,
                              gonio_controller_alarm_name(status.alarm));
    }
    return cleared;
}

// Stop the axes and wait until they rest; the reason for it stays the error.
static void stop_axes(gonio_controller *c) {
    gonio_controller_status status;
    if (gonio_controller_command(c, CONTROLLER_COMMAND_STOP, 0, NULL, NULL, NULL) != GONIO_OK) {
        return; // the dead-man does it then
    }
    for (int i = 0; i < 500; i++) {
        if (gonio_controller_read_status(c, &status, NULL) != GONIO_OK || status.moving == 0) {
            return;
        }
        gonio_controller_pause(c, POLL_MS);
    }
}

bool gonio_controller_cancelled(const gonio_controller *c) {
    return c->config.cancelled != NULL && c->config.cancelled(c->config.event_context);
}

// Why the motion must not go on; GONIO_OK: no reason.
static gonio_status reason_to_stop(const gonio_controller *c, gonio_deadline deadline, double timeout_s,
                                   gonio_status (*watch)(void *, gonio_error *), void *context, gonio_error *error) {
    const gonio_status status = watch != NULL ? watch(context, error) : GONIO_OK;
    if (status != GONIO_OK) {
        return status;
    }
    if (gonio_controller_cancelled(c)) {
        return gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted in mid-move; the axes were stopped");
    }
    return gonio_deadline_left_ms(deadline) > 0
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_TIMEOUT, "controller %s: the move did not end within %.3g s; stopped",
                            c->config.modbus.port, timeout_s);
}

gonio_status gonio_controller_wait(gonio_controller *c, uint32_t id, double timeout_s,
                                   gonio_status (*watch)(void *, gonio_error *), void *context,
                                   gonio_controller_status *status, gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_s(timeout_s);
    for (;;) {
        gonio_status result = gonio_controller_read_status(c, status, error);
        if (result == GONIO_OK && status->finished_id == id) {
            return GONIO_OK;
        }
        if (result == GONIO_OK) {
            result = gonio_controller_alarm(status, error);
        }
        if (result == GONIO_OK && status->accepted_id != id) {
            result = gonio_fail(error, GONIO_E_DEVICE,
                                "controller %s: command %u came in between; does another "
                                "program drive it?",
                                c->config.modbus.port, status->accepted_id);
        }
        if (result == GONIO_OK && status->state == CONTROLLER_STATE_IDLE) {
            result = gonio_fail(error, GONIO_E_DEVICE, "controller %s: the move was stopped before its end",
                                c->config.modbus.port);
        }
        if (result != GONIO_OK) {
            return result;
        }
        result = reason_to_stop(c, deadline, timeout_s, watch, context, error);
        if (result != GONIO_OK) {
            stop_axes(c);
            return result;
        }
        gonio_controller_pause(c, POLL_MS);
    }
}
