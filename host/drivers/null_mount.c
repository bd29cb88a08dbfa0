// A sample changer without samples.
#include <stddef.h>

#include "host/drivers/null.h"

static gonio_status mount(void *device, gonio_target target, gonio_error *error) {
    (void)device, (void)target, (void)error;
    return GONIO_OK;
}

static void nothing_to_close(void *device) { (void)device; }

static const gonio_mount_ops ops = {
    .api_version = GONIO_RIG_API_VERSION, .name = "null sample changer", .mount = mount, .close = nothing_to_close};

gonio_status gonio_null_mount_open(gonio_rig *rig, gonio_error *error) {
    (void)error;
    rig->mount = &ops;
    rig->mount_device = NULL;
    return GONIO_OK;
}
