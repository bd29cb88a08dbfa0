// SPDX-License-Identifier: BSD-3-Clause
// What the firmware's tests share: a machine with quick axes.
#ifndef FW_RIG_H
#define FW_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "firmware/board/posix/machine.h"

enum { MINUTE_US = 60000000 };

static inline struct machine *rig_new(void) {
    struct machine *m = malloc(sizeof *m);
    gonio_machine_new(m);
    gonio_machine_start(m, FW_CAUSE_POWER);
    struct fw_registers *r = &m->core.registers;
    for (unsigned i = 0; i < FW_AXES; i++) {
        r->speed_max[i] = 20000;
        r->acceleration[i] = 200000;
        r->jerk[i] = 20000000;
        r->home_fast[i] = 10000;
        r->home_slow[i] = 500;
        r->home_order[i] = (uint16_t)(i + 1);
    }
    r->settle[0] = 1;
    return m;
}

// The same, homed by hand at where the motors stand.
static inline struct machine *rig_homed(void) {
    struct machine *m = rig_new();
    for (unsigned i = 0; i < FW_AXES; i++)
        m->core.step.position[i] = m->axis[i].steps;
    m->core.known = 15;
    return m;
}

// No step was lost or made up: the controller's count is where the motors are.
static inline void rig_check_positions(const struct machine *m) {
    for (unsigned i = 0; i < FW_AXES; i++)
        assert_true(m->core.step.position[i] == m->axis[i].steps);
    assert_true(m->wrong_edges == 0);
}

#endif
