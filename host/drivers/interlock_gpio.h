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
} gonio_interlock_gpio_config;

void gonio_interlock_gpio_defaults(gonio_interlock_gpio_config *config);

extern const gonio_interlock_ops gonio_interlock_gpio;
// check tells every contact that is active or has been since the check before, even if it is closed again. It is quick
// and is to be called at least every 50 ms while something moves: that bounds how long a lost edge goes unseen.
gonio_status gonio_interlock_gpio_open(const gonio_interlock_gpio_config *config, const gonio_gpio_io *io, void *state,
                                       void **device, gonio_error *error);
// The contact's filter, for the tests and `gonio rig status`; NULL past the last.
const gonio_debounce *gonio_interlock_gpio_contact(const void *device, int index, const char **name);

#endif
