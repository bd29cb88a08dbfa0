// SPDX-License-Identifier: BSD-3-Clause
// An open rig of a rig file, for those who need more of it than its devices.
#ifndef GONIO_HOST_ACQUIRE_RIG_FILE_H
#define GONIO_HOST_ACQUIRE_RIG_FILE_H

#include "gonio/acquire.h"
#include "gonio/sim.h"
#include "host/acquire/acquire.h"
#include "host/acquire/sources.h"
#include "host/control/control.h"
#include "host/drivers/hardware.h"

struct gonio_rig_file {
    gonio_rig rig;
    gonio_sim *sim;           // NULL: not the simulator
    gonio_hardware *hardware; // real devices
    gonio_scan_options scan;
    char driver[16];
    char spec[256];         // of the simulated sample
    uint64_t seed;          // of the simulator
    gonio_session *journal; // where the devices' events go; NULL: nowhere. Borrowed
    int retries;            // journalled so far
    char *text;             // the rig file as read, every fragment appended; owned
    char *settings;         // over it, a line of section.key=value each; owned
    gonio_sources sources;  // the files that it was read from
    void (*event)(void *context, const char *kind, const char *text);
    bool (*cancelled)(void *context);
    void *context;
    char *path;             // the rig file's real path; NULL: none. Owned
    bool steered;           // other programs may ask and steer
    gonio_control *control; // through this; NULL: not now
};

// gonio_rig_file_open, _reopen and _close in place: the struct must stay where it is until gonio_rig_file_release,
// which is due on failure too.
gonio_status gonio_rig_file_fill(const gonio_rig_file_options *options, gonio_rig_file *rig, gonio_error *error);
gonio_status gonio_rig_file_refill(gonio_session *session, const gonio_rig_file_options *options, gonio_rig_file *rig,
                                   gonio_error *error);
void gonio_rig_file_release(gonio_rig_file *rig);
// Journal what gonio_rig_file_reopen needs.
gonio_status gonio_rig_file_put(gonio_session *session, const gonio_rig_file *rig, gonio_error *error);

#endif
