// SPDX-License-Identifier: BSD-3-Clause
// What is plugged in, without a rig file: cameras and USB instruments.
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>

#include "host/cli/rig/actions.h"
#include "host/drivers/camera_controls.h"
#include "host/drivers/pixels.h"
#include "host/transport/usbtmc.h"

static json_t *describe_format(gonio_v4l2 *device, uint32_t fourcc, gonio_fitness *best) {
    const gonio_pixel_format *format = gonio_pixel_format_of(fourcc);
    const char text[5] = {(char)(fourcc & 0x7f), (char)(fourcc >> 8 & 0x7f), (char)(fourcc >> 16 & 0x7f),
                          (char)(fourcc >> 24 & 0x7f), 0};
    const gonio_fitness fitness = format != NULL ? format->fitness : GONIO_UNFIT;
    *best = fitness < *best ? fitness : *best;
    json_t *sizes = json_array();
    int width, height;
    for (int i = 0; i < 64 && gonio_v4l2_offered_size(device, fourcc, i, &width, &height, NULL) == GONIO_OK; i++) {
        char size[32];
        snprintf(size, sizeof size, "%dx%d", width, height);
        json_array_append_new(sizes, json_string(size));
    }
    return json_pack("{s:s,s:i,s:s,s:s,s:o}", "format", format != NULL ? format->name : text, "bits",
                     format != NULL ? format->bits : 0, "fit",
                     fitness == GONIO_FIT                ? "yes"
                     : fitness == GONIO_FIT_WITH_WARNING ? "with a warning"
                                                         : "no",
                     "why", format != NULL ? format->why : "not a format that Gonio can unpack", "sizes", sizes);
}

static json_t *describe_autos(gonio_v4l2 *device) {
    json_t *autos = json_array();
    for (const gonio_auto_function *f = gonio_auto_functions; f->name != NULL; f++) {
        gonio_v4l2_control control;
        int64_t value = 0;
        if (gonio_camera_has(device, f->id, &control) &&
            gonio_v4l2_get_control(device, f->id, &value, NULL) == GONIO_OK) {
            json_array_append_new(autos, json_pack("{s:s,s:b}", "function", f->name, "on", value != f->off));
        }
    }
    return autos;
}

gonio_status rig_camera_report(const char *path, json_t **out, gonio_error *error) {
    gonio_v4l2 *device;
    gonio_status status = gonio_v4l2_open(&gonio_v4l2_system, NULL, path, &device, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_fitness best = GONIO_UNFIT;
    json_t *formats = json_array();
    uint32_t fourcc;
    for (int i = 0; i < 256 && gonio_v4l2_offered(device, i, &fourcc, NULL) == GONIO_OK; i++) {
        json_array_append_new(formats, describe_format(device, fourcc, &best));
    }
    gonio_camera_controls controls = {0};
    gonio_camera_controls_find(device, 0, &controls, NULL);
    gonio_v4l2_control plain;
    const bool unitless = controls.exposure == 0 && gonio_camera_has(device, V4L2_CID_EXPOSURE, &plain);
    const char *verdict =
        best == GONIO_UNFIT                   ? "no: no format is linear and uncompressed"
        : controls.exposure == 0 && !unitless ? "with fixed_exposure_ms only: there is no exposure control"
        : unitless                            ? "with exposure_unit_us: the exposure control has no unit of its own"
        : best == GONIO_FIT_WITH_WARNING      ? "with a warning: only a processed format, which is not linear"
                                              : "yes";
    *out = json_pack("{s:s,s:s,s:s,s:b,s:s,s:o,s:o}", "device", path, "card", gonio_v4l2_card(device), "bus",
                     gonio_v4l2_bus(device), "multiplanar", gonio_v4l2_multiplanar(device), "fit_for_radiometry",
                     verdict, "formats", formats, "automatic", describe_autos(device));
    if (controls.exposure != 0) {
        json_object_set_new(*out, "exposure_min_s",
                            json_real((double)controls.exposure_min * controls.exposure_unit_s));
        json_object_set_new(*out, "exposure_max_s",
                            json_real((double)controls.exposure_max * controls.exposure_unit_s));
    }
    json_object_set_new(*out, "gain", json_string(controls.gain != 0 ? "yes" : "no control"));
    gonio_v4l2_close(device);
    return GONIO_OK;
}

gonio_status rig_usb_report(json_t **out, gonio_error *error) {
    gonio_usbtmc_info *list = NULL;
    size_t n = 0;
    const gonio_status status = gonio_usbtmc_list(&list, &n, error);
    json_t *found = json_array();
    for (size_t i = 0; i < n; i++) {
        char ids[16];
        snprintf(ids, sizeof ids, "%04x:%04x", (unsigned)list[i].vendor, (unsigned)list[i].product);
        json_array_append_new(found,
                              json_pack("{s:s,s:s,s:s,s:s,s:b}", "id", ids, "manufacturer", list[i].manufacturer,
                                        "model", list[i].model, "serial", list[i].serial, "usb488", list[i].usb488));
    }
    free(list);
    *out = json_pack("{s:o}", "instruments", found);
    return status;
}
