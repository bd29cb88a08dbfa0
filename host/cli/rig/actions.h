// SPDX-License-Identifier: BSD-3-Clause
// What `gonio rig` does to the devices of a rig, one function an action.
#ifndef GONIO_HOST_CLI_RIG_ACTIONS_H
#define GONIO_HOST_CLI_RIG_ACTIONS_H

#include "host/cli/rig_file.h"

enum { RIG_ARGUMENTS = 32 };

typedef struct rig_request {
    const char *arguments[RIG_ARGUMENTS];
    int n;
    bool dial;          // positions are the controller's own
    bool home;          // selftest: home as well
    bool slow;          // jog: an axis that need not be homed
    double exposure_s;  // capture
    const char *output; // capture
} rig_request;

typedef struct rig_action {
    const char *name, *arguments, *help;
    int minimum, maximum; // arguments
    gonio_status (*run)(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error);
    void (*print)(json_t *out); // for a terminal; NULL: name and value a line
} rig_action;

extern const rig_action rig_actions[]; // ends with a NULL name
extern const char *const rig_axes[GONIO_AXES];

// Frames at the camera's own rate into a new session: FRAMES SESSION.
gonio_status rig_burst(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error);

// The controller's parameters: [NAME ...]; [AXIS.]NAME=VALUE ...; keep them.
gonio_status rig_parameters(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error);
gonio_status rig_set(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error);
gonio_status rig_save(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error);
void rig_print_parameters(json_t *out);

// Makes a rig: asks, shows the inputs, moves an axis a little, homes it, writes the rig file.
gonio_status rig_setup(const char *path, json_t **out, gonio_error *error);
// Works without a rig: what a V4L2 device offers and whether it is fit for radiometry; USBTMC instruments.
gonio_status rig_camera_report(const char *path, json_t **out, gonio_error *error);
gonio_status rig_usb_report(json_t **out, gonio_error *error);

#endif
