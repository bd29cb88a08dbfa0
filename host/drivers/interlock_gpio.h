// SPDX-License-Identifier: BSD-3-Clause
// Emergency stop and door contacts on GPIO lines of the host.
#ifndef GONIO_DRIVERS_INTERLOCK_GPIO_H
#define GONIO_DRIVERS_INTERLOCK_GPIO_H

#include "gonio/rig.h"
#include "host/drivers/debounce.h"
#include "host/transport/gpio.h"

enum { GONIO_CONTACTS_MAX = 4 };

typedef struct gonio_contact_config {
    char name[32];        // "emergency stop", as it is told
    char line[64];        // GPIO line; empty: not wired
    bool normally_closed; // a closed contact pulls the line low, so that a cut wire reads as active; the default
    gonio_gpio_bias bias; // pull up by default
} gonio_contact_config;

typedef struct gonio_interlock_gpio_config {
    gonio_contact_config contacts[GONIO_CONTACTS_MAX];
    double debounce_s; // 0.005
    double watch_s;    // a thread of the interlock's own reads the levels this often; 0: only check does. 0.05
} gonio_interlock_gpio_config;

void gonio_interlock_gpio_defaults(gonio_interlock_gpio_config *config);

extern const gonio_interlock_ops gonio_interlock_gpio;
// check tells every contact that is active or has been since the check before, even if it is closed again. As long as
// the interlock is open the levels are read every watch_s, whatever the caller waits for: that bounds how long an
// opening may be that leaves no edge in the queue and yet is seen. `io` is then used from two threads, never at once.
gonio_status gonio_interlock_gpio_open(const gonio_interlock_gpio_config *config, const gonio_gpio_io *io, void *state,
                                       void **device, gonio_error *error);
// The contact's filter, for the tests and `gonio rig status`; NULL past the last.
const gonio_debounce *gonio_interlock_gpio_contact(const void *device, int index, const char **name);

#endif
