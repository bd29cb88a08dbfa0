// SPDX-License-Identifier: BSD-3-Clause
// What drivers without a device of their own open and close.
#include "host/drivers/driver.h"

gonio_status gonio_driver_no_device(void *settings, const gonio_driver_context *context, void **device,
                                    gonio_error *error) {
    (void)settings, (void)context, (void)error;
    *device = NULL;
    return GONIO_OK;
}

void gonio_driver_nothing_to_close(void *device) { (void)device; }
