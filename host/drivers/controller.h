// SPDX-License-Identifier: BSD-3-Clause
// The motion and lamp controller over Modbus: what stage, lamp and monitor share. One connection, counted users.
//
// Everything that is retried may be repeated without harm: reads; parameters, which are absolute; and commands, which
// carry an id that the controller carries out once. A status read writes a token and gets it back, so that a reply to
// an earlier request shows. The connection may be used from several threads.
//
// Who only reads changes nothing: the first write or command (but STOP) claims the rig for this program, and from then
// on a thread of its own feeds the dead-man. While another program holds the rig, writes are refused.
#ifndef GONIO_DRIVERS_CONTROLLER_H
#define GONIO_DRIVERS_CONTROLLER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "host/drivers/parameters.h"
#include "host/transport/modbus.h"

enum { GONIO_CONTROLLER_AXES = 4 };

typedef struct gonio_controller_config {
    gonio_modbus_config modbus;
    int retries;      // of one request; 6
    double deadman_s; // the controller makes itself safe after this silence; 5
    double feed_s;    // the dead-man is fed without a call for at most so long, so that a hung host does not; 600
    double replug_s;  // wait this long for a lost adapter; 10
    gonio_controller_parameters parameters;
    gonio_tape *tape; // borrowed
    gonio_tape_mode mode;
    // Told of what a session should note, e.g. ("lost-steps", "..."); NULL: nobody.
    void (*event)(void *context, const char *kind, const char *text);
    // Asked while a move is waited for; true stops it. NULL: never.
    bool (*cancelled)(void *context);
    void *event_context; // of both
} gonio_controller_config;

typedef struct gonio_controller_identity {
    int protocol, axes, board;
    uint32_t version, step_rate_max;
} gonio_controller_identity;

typedef struct gonio_controller_status {
    int state, alarm, alarm_axis, refusal;
    unsigned moving, homed, inputs; // bits
    uint32_t accepted_id, finished_id;
    int64_t position[GONIO_CONTROLLER_AXES]; // steps
    int lamp_state, reset_cause;
    double lamp_output, temperature_c, monitor; // fractions of full scale, degrees Celsius
    int64_t monitor_us, time_us;                // the controller's clock
    uint32_t trigger_count;
    uint32_t generation, checksum;                  // of the parameters
    uint32_t owner;                                 // who holds the rig; 0: nobody
    int32_t home_difference[GONIO_CONTROLLER_AXES]; // steps
} gonio_controller_status;

typedef struct gonio_controller_counts {
    int64_t exchanges, silent, noise, stale, lost, retries, reopened, feeds;
} gonio_controller_counts;

void gonio_controller_defaults(gonio_controller_config *config);

// Connect and identify: a slave with another magic number or protocol version is GONIO_E_DEVICE. Nothing is written.
gonio_status gonio_controller_open(const gonio_controller_config *config, gonio_controller **out, gonio_error *error);
gonio_controller *gonio_controller_share(gonio_controller *controller); // one more user
// One user less. The last one lets go of the rig where nothing moves (lamp and shutter stay as they are) and frees it.
// NULL is allowed.
void gonio_controller_release(gonio_controller *controller);
const gonio_controller_identity *gonio_controller_identify(const gonio_controller *controller);
void gonio_controller_count(gonio_controller *controller, gonio_controller_counts *counts);

// Hold the rig from now on; done before the first write anyway. A move that an earlier program left is stopped, and a
// dead-man alarm that it left behind is cleared. GONIO_E_DEVICE where another program holds the rig.
// The configured parameters are then written; each that differs is told as an event "parameters".
gonio_status gonio_controller_claim(gonio_controller *controller, gonio_error *error);
// Whether the configuration says what this register is.
bool gonio_controller_gives(const gonio_controller *controller, int address);

gonio_status gonio_controller_read_status(gonio_controller *controller, gonio_controller_status *status,
                                          gonio_error *error);
// The last status that anybody read, the feeder among them, and how old it is; false: there is none. Nothing goes over
// the line, and no exchange is waited for: for threads that only look.
bool gonio_controller_last(gonio_controller *controller, gonio_controller_status *status, double *age_s);
// The axes have come to rest there: from now on every status, and after a repeated request one is read, is held against
// it until the next command that moves. A difference is a lost-step event and GONIO_E_DEVICE.
void gonio_controller_rest(gonio_controller *controller, const int64_t position[GONIO_CONTROLLER_AXES]);
// Whole values of any registers, in words, high word first.
gonio_status gonio_controller_read(gonio_controller *controller, int address, int n, uint16_t *words,
                                   gonio_error *error);
// Write and read back; GONIO_E_DEVICE where the controller holds something else. Skips what is already so.
gonio_status gonio_controller_write(gonio_controller *controller, int address, int n, const uint16_t *words,
                                    gonio_error *error);
// Registers of another slave on the controller's line, by function 3 or 4.
gonio_status gonio_controller_read_other(gonio_controller *controller, int slave, int function, int address, int n,
                                         uint16_t *words, gonio_error *error);
gonio_status gonio_controller_coil(gonio_controller *controller, int coil, bool on, gonio_error *error);

// Give a command; returns once the controller has taken it, its id in *id (may be NULL). targets: steps, for MOVE only,
// else NULL. A refusal is GONIO_E_RANGE for limits, else GONIO_E_DEVICE.
gonio_status gonio_controller_command(gonio_controller *controller, int command, unsigned axes,
                                      const int64_t targets[GONIO_CONTROLLER_AXES], uint32_t *id, gonio_error *error);
// Wait until the move or homing `id` has ended as it should. On timeout, cancellation (GONIO_E_INTERRUPTED) or where
// `watch` fails (may be NULL; asked every 20 ms), the axes are stopped first.
gonio_status gonio_controller_wait(gonio_controller *controller, uint32_t id, double timeout_s,
                                   gonio_status (*watch)(void *context, gonio_error *error), void *watch_context,
                                   gonio_controller_status *status, gonio_error *error);
// Whether what waits is to end: config.cancelled says so.
bool gonio_controller_cancelled(const gonio_controller *controller);
// CLEAR a standing alarm whose cause is gone; harmless where none stands.
gonio_status gonio_controller_clear(gonio_controller *controller, gonio_error *error);
// GONIO_E_DEVICE where the emergency stop is pressed or the door is open, alarm or not.
gonio_status gonio_controller_contacts(const gonio_controller_status *status, gonio_error *error);
// GONIO_E_DEVICE naming the alarm, its number and its axis, where one stands.
gonio_status gonio_controller_alarm(const gonio_controller_status *status, gonio_error *error);

// One 32- or 64-bit value in words, high word first.
void gonio_controller_pack(uint16_t *words, int n, int64_t value);
int64_t gonio_controller_unpack(const uint16_t *words, int n); // sign of the highest word's

// For events of the drivers above: tells config.event.
void gonio_controller_tell(gonio_controller *controller, const char *kind, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
