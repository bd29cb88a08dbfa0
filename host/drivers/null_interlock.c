// An interlock that is always closed.
#include <stddef.h>

#include "host/drivers/null.h"

static gonio_status check(void *device, gonio_error *error) {
    (void)device, (void)error;
    return GONIO_OK;
}

static void nothing_to_close(void *device) { (void)device; }

static const gonio_interlock_ops ops = {
    .api_version = GONIO_RIG_API_VERSION, .name = "null interlock", .check = check, .close = nothing_to_close};

gonio_status gonio_null_interlock_open(gonio_rig *rig, gonio_error *error) {
    (void)error;
    rig->interlock = &ops;
    rig->interlock_device = NULL;
    return GONIO_OK;
}
