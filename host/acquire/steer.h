// SPDX-License-Identifier: BSD-3-Clause
// The checkpoints of a measurement: tell how far it is, and stop, pause or wait for room on the disk where that is due.
#ifndef GONIO_HOST_ACQUIRE_STEER_H
#define GONIO_HOST_ACQUIRE_STEER_H

#include "host/acquire/rig_file.h"

typedef struct gonio_steer {
    gonio_session *session;
    const gonio_rig_file *rig;
    const gonio_measure_options *options;
    double started_s, paused_s; // of the run: when it began, and how long it stood still
    char *place;                // the session's real path; owned
    char what[192];             // a pause waits for; empty: none
    int64_t needed_bytes;       // room for the next step
} gonio_steer;

// Take the session's name, so that `gonio status`, `pause` and `stop` reach this run. A name that cannot be had is told
// and survived.
void gonio_steer_begin(gonio_steer *steer, gonio_session *session, const gonio_rig_file *rig,
                       const gonio_measure_options *options);
void gonio_steer_end(gonio_steer *steer);
// Between two steps, and now and then in a fit: GONIO_OK to go on, at once or after a pause. GONIO_E_INTERRUPTED: stop.
// In a pause the shutter is closed and the stage is asked where it stands, which feeds its dead-man; what that finds to
// be wrong ends the pause.
gonio_status gonio_steer_checkpoint(gonio_steer *steer, const gonio_measure_progress *now, gonio_error *error);
// The session's steps from this one on are done: the largest of all decides how much room the next one needs.
gonio_status gonio_steer_stored(gonio_steer *steer, int64_t from, gonio_error *error);
// Whether the disk has less than that.
bool gonio_steer_no_room(const gonio_steer *steer);

#endif
