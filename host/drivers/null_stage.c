// SPDX-License-Identifier: BSD-3-Clause
// A stage that is wherever it was told to be.
#include <stdlib.h>
#include <string.h>

#include "host/drivers/driver.h"

typedef struct null_stage {
    double position_rad[GONIO_AXES];
} null_stage;

static gonio_status stage_home(void *device, double timeout_s, gonio_error *error) {
    (void)timeout_s, (void)error;
    *(null_stage *)device = (null_stage){0};
    return GONIO_OK;
}

static gonio_status stage_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                               double timeout_s, gonio_error *error) {
    (void)id, (void)stamp, (void)timeout_s, (void)error;
    memcpy(((null_stage *)device)->position_rad, target_rad, sizeof(double[GONIO_AXES]));
    return GONIO_OK;
}

static gonio_status stage_position(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    (void)error;
    memcpy(position_rad, ((null_stage *)device)->position_rad, sizeof(double[GONIO_AXES]));
    return GONIO_OK;
}

static gonio_status stage_stop(void *device, gonio_error *error) {
    (void)device, (void)error;
    return GONIO_OK;
}

static double stage_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES]) {
    (void)device, (void)from_rad, (void)to_rad;
    return 0;
}

static const gonio_stage_ops ops = {.name = "null stage",
                                    .home = stage_home,
                                    .move = stage_move,
                                    .position = stage_position,
                                    .stop = stage_stop,
                                    .duration_s = stage_duration_s,
                                    .close = free};

static gonio_status make(void *settings, const gonio_driver_context *context, void **device, gonio_error *error) {
    (void)settings, (void)context;
    *device = calloc(1, sizeof(null_stage));
    return *device != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a null stage");
}

const gonio_driver gonio_driver_null_stage = {.name = "null",
                                              .device = GONIO_DEVICE_STAGE,
                                              .summary = "axes that are wherever they were told to be",
                                              .ops = &ops,
                                              .open = make};
