// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/shadow.h"

#include <stdlib.h>

typedef struct stage {
    const gonio_stage_ops *real, *simulated;
    void *real_device, *simulated_device;
    bool following; // the simulated arms have been homed; the real ones may have been in a process before this one
    bool together;  // ... and moved with them, since
    gonio_stage_ops ops;
} stage;

static gonio_status follow_home(stage *s, double timeout_s, gonio_error *error) {
    const gonio_status status = s->simulated->home(s->simulated_device, timeout_s, error);
    s->following = status == GONIO_OK;
    s->together = false;
    return status;
}

static gonio_status stage_home(void *device, double timeout_s, gonio_error *error) {
    stage *s = device;
    const gonio_status status = s->real->home(s->real_device, timeout_s, error);
    return status == GONIO_OK ? follow_home(s, timeout_s, error) : status;
}

static gonio_status stage_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                               double timeout_s, gonio_error *error) {
    stage *s = device;
    gonio_status status = s->real->move(s->real_device, target_rad, id, stamp, timeout_s, error);
    status = status == GONIO_OK && !s->following ? follow_home(s, timeout_s, error) : status;
    if (status == GONIO_OK) {
        status = s->simulated->move(s->simulated_device, target_rad, id, stamp, timeout_s, error);
        s->together = status == GONIO_OK;
    }
    return status;
}

// The real one is asked too, for its faults, and because the simulated one may not stand there yet.
static gonio_status stage_position(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    const stage *s = device;
    const gonio_status status = s->real->position(s->real_device, position_rad, error);
    return status == GONIO_OK && s->together ? s->simulated->position(s->simulated_device, position_rad, error)
                                             : status;
}

static gonio_status stage_stop(void *device, gonio_error *error) {
    const stage *s = device;
    s->simulated->stop(s->simulated_device, NULL);
    return s->real->stop(s->real_device, error);
}

static double stage_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES]) {
    const stage *s = device;
    return s->simulated->duration_s(s->simulated_device, from_rad, to_rad);
}

static gonio_status stage_check(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                                gonio_error *error) {
    const stage *s = device;
    return s->real->check != NULL ? s->real->check(s->real_device, from_rad, to_rad, error) : GONIO_OK;
}

static bool stage_turns(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                        double turn_rad[GONIO_AXES]) {
    const stage *s = device;
    return s->real->turns != NULL && s->real->turns(s->real_device, from_rad, to_rad, turn_rad);
}

static gonio_status stage_audit(void *device, double timeout_s, double difference_rad[GONIO_AXES], gonio_error *error) {
    stage *s = device;
    const gonio_status status = s->real->audit(s->real_device, timeout_s, difference_rad, error);
    if (status != GONIO_OK && status != GONIO_E_MISMATCH) {
        return status;
    }
    const gonio_status followed = follow_home(s, timeout_s, error);
    return followed == GONIO_OK ? status : followed;
}

static gonio_status stage_encoders(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    const stage *s = device;
    return s->real->encoders(s->real_device, position_rad, error);
}

static void stage_close(void *device) {
    stage *s = device;
    s->real->close(s->real_device);
    s->simulated->close(s->simulated_device);
    free(s);
}

static const gonio_stage_ops stage_ops = {.name = "modbus, followed by the simulation",
                                          .home = stage_home,
                                          .move = stage_move,
                                          .position = stage_position,
                                          .stop = stage_stop,
                                          .duration_s = stage_duration_s,
                                          .close = stage_close,
                                          .check = stage_check,
                                          .turns = stage_turns};

gonio_status gonio_shadow_stage(gonio_rig *rig, const gonio_stage_ops *real, void *device, gonio_error *error) {
    stage *s = malloc(sizeof *s);
    if (s == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a stage");
    }
    *s = (stage){real, rig->stage, device, rig->stage_device, false, false, stage_ops};
    s->ops.real = real->real;
    s->ops.independent = real->independent;
    s->ops.audit = real->audit != NULL ? stage_audit : NULL;
    s->ops.encoders = real->encoders != NULL ? stage_encoders : NULL;
    rig->stage = &s->ops;
    rig->stage_device = s;
    return GONIO_OK;
}

typedef struct lamp {
    const gonio_lamp_ops *real, *simulated;
    void *real_device, *simulated_device;
} lamp;

static gonio_status lamp_set_level(void *device, double level, gonio_error *error) {
    const lamp *l = device;
    const gonio_status status = l->real->set_level(l->real_device, level, error);
    return status == GONIO_OK ? l->simulated->set_level(l->simulated_device, level, error) : status;
}

static gonio_status lamp_set_shutter(void *device, bool open, gonio_error *error) {
    const lamp *l = device;
    const gonio_status status = l->real->set_shutter(l->real_device, open, error);
    return status == GONIO_OK ? l->simulated->set_shutter(l->simulated_device, open, error) : status;
}

static gonio_status lamp_wait_ready(void *device, const gonio_stamp *stamp, double timeout_s, double *waited_s,
                                    gonio_error *error) {
    const lamp *l = device;
    const gonio_status status = l->real->wait_ready(l->real_device, stamp, timeout_s, waited_s, error);
    return status == GONIO_OK ? l->simulated->wait_ready(l->simulated_device, stamp, timeout_s, waited_s, error)
                              : status;
}

static void lamp_close(void *device) {
    lamp *l = device;
    l->real->close(l->real_device);
    l->simulated->close(l->simulated_device);
    free(l);
}

static const gonio_lamp_ops lamp_ops = {.name = "real, followed by the simulation",
                                        .set_level = lamp_set_level,
                                        .set_shutter = lamp_set_shutter,
                                        .wait_ready = lamp_wait_ready,
                                        .close = lamp_close};

gonio_status gonio_shadow_lamp(gonio_rig *rig, const gonio_lamp_ops *real, void *device, gonio_error *error) {
    lamp *l = malloc(sizeof *l);
    if (l == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a lamp");
    }
    *l = (lamp){real, rig->lamp, device, rig->lamp_device};
    rig->lamp = &lamp_ops;
    rig->lamp_device = l;
    return GONIO_OK;
}
