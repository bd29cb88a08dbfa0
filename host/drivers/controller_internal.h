// SPDX-License-Identifier: BSD-3-Clause
// Shared by controller.c (requests), controller_motion.c (commands) and controller_open.c (a connection's life).
#ifndef GONIO_DRIVERS_CONTROLLER_INTERNAL_H
#define GONIO_DRIVERS_CONTROLLER_INTERNAL_H

#include <pthread.h>

#include "host/drivers/controller.h"
#include "host/drivers/controller_map.h"

struct gonio_controller {
    gonio_controller_config config;
    gonio_modbus *modbus;
    gonio_controller_identity identity;
    pthread_mutex_t lock; // of everything below, and of the line
    pthread_cond_t wake;  // of the feeder
    pthread_t feeder;
    bool feeding, closing;
    uint32_t number; // this program's, as the controller knows it (firmware/core/owner.h)
    bool holds;      // it has claimed the rig
    gonio_status (*claim)(gonio_controller *controller, gonio_error *error); // before the first write
    int64_t last_fed_ms;
    int users;
    uint16_t token;
    uint32_t last_id;
    int64_t last_time_us; // controller's clock at the last status: going back means that it restarted
    int64_t last_call_ms; // host's clock: the last exchange that was not the feeder's
    bool restarted;       // since it was opened
    bool commanded;       // it has taken a command of ours: its accepted_id is 0 only after a restart
    int alarm_told;
    bool resting; // nothing was asked to move since the axes stood at `rest`
    int64_t rest[GONIO_CONTROLLER_AXES];
    gonio_controller_counts counts;
    pthread_mutex_t last_lock; // of the two below, held for moments alone
    gonio_controller_status last;
    int64_t last_ms; // host's clock; 0: none yet
};

// One request, repeated within bounds; the lock must not be held. `once` does one exchange. Exceptions end the repeats,
// except BUSY; *exception (may be NULL) then tells the code.
typedef gonio_modbus_fault (*controller_exchange)(gonio_controller *controller, void *request);
gonio_status gonio_controller_request(gonio_controller *controller, const char *what, controller_exchange once,
                                      void *request, int *exception, gonio_error *error);
// Who answers: the identity registers. Called when a line was opened; also within a request, after a replug.
gonio_status gonio_controller_greet(gonio_controller *controller, gonio_error *error);
// One exchange, repeated by nobody, with the lock held: what claims the rig and feeds the dead-man.
gonio_modbus_fault gonio_controller_feed(gonio_controller *controller);
// The same where the last is long enough ago, left off the tape: its moment is chance.
void gonio_controller_feed_when_due(gonio_controller *controller);
int64_t gonio_controller_feed_period_ms(const gonio_controller *controller);
void gonio_controller_pause(const gonio_controller *controller, int ms); // not in a replay

#endif
