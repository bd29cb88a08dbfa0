// SPDX-License-Identifier: BSD-3-Clause
// What the devices of a rig say they are.
#include "host/acquire/identity.h"

#include <stdio.h>
#include <stdlib.h>

#include "host/drivers/controller_map.h"

static const char *const patterns[] = {"mono", "rggb", "bggr", "grbg", "gbrg"};

static const char *or_none(const char *name) { return name != NULL ? name : "none"; }

gonio_status gonio_rig_describe(const gonio_rig_file *rig, json_t **out, gonio_error *error) {
    gonio_camera_info camera;
    const gonio_rig *r = &rig->rig;
    const gonio_status status = r->camera->info(r->camera_device, &camera, error);
    if (status != GONIO_OK) {
        return status;
    }
    *out = json_pack("{s:s,s:s,s:s,s:s,s:s,s:s,s:s,s:s}", "driver", rig->driver, "stage", r->stage->name, "lamp",
                     r->lamp->name, "camera", r->camera->name, "meter", or_none(r->meter ? r->meter->name : NULL),
                     "interlock", or_none(r->interlock ? r->interlock->name : NULL), "mount",
                     or_none(r->mount ? r->mount->name : NULL), "serials", r->facts.serials);
    json_object_set_new(*out, "sensor",
                        json_pack("{s:s,s:s,s:i,s:i,s:i,s:s,s:f,s:f}", "name", camera.name, "serial", camera.serial,
                                  "width", camera.width, "height", camera.height, "bits", camera.bits, "pattern",
                                  patterns[camera.pattern], "exposure_min_s", camera.exposure_min_s, "exposure_max_s",
                                  camera.exposure_max_s));
    const gonio_controller *controller = gonio_hardware_controller(rig->hardware);
    if (controller != NULL) {
        const gonio_controller_identity *c = gonio_controller_identify(controller);
        char version[32];
        snprintf(version, sizeof version, "%u.%u.%u", c->version >> 16 & 255, c->version >> 8 & 255, c->version & 255);
        json_object_set_new(*out, "controller",
                            json_pack("{s:s,s:i,s:i,s:i}", "firmware", version, "protocol", c->protocol, "board",
                                      c->board, "axes", c->axes));
    }
    if (gonio_hardware_meter(rig->hardware) != NULL) {
        json_object_set_new(*out, "meter_identity", json_string(gonio_hardware_meter(rig->hardware)));
    }
    return GONIO_OK;
}

gonio_status gonio_rig_identity_text(const gonio_rig_file *rig, char **text, gonio_error *error) {
    json_t *object;
    *text = NULL;
    const gonio_status status = gonio_rig_describe(rig, &object, error);
    if (status != GONIO_OK) {
        return status;
    }
    json_object_set_new(object, "regmap", json_integer(CONTROLLER_INITIAL_protocol)); // the host's own table
    *text = json_dumps(object, JSON_COMPACT | JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(17));
    json_decref(object);
    return *text != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for the devices' names");
}
