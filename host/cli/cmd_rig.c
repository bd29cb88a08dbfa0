// gonio rig: ask the devices of a rig.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "host/cli/rig_file.h"

static int run(int argc, char **argv);
const cli_verb cmd_rig = {"rig", "identify|status [--rig sim|RIG.ini]", "ask the devices of a rig", run};

static const char *const axes[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};
static const char *const patterns[] = {"mono", "rggb", "bggr", "grbg", "gbrg"};

static const char *or_none(const char *name) { return name != NULL ? name : "none"; }

static gonio_status identify(const cli_rig *rig, json_t **out, gonio_error *error) {
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
    return GONIO_OK;
}

static gonio_status read_status(const cli_rig *rig, json_t **out, gonio_error *error) {
    const gonio_rig *r = &rig->rig;
    double position[GONIO_AXES];
    gonio_status status = r->stage->position(r->stage_device, position, error);
    if (status != GONIO_OK) {
        return status;
    }
    json_t *positions = json_object();
    for (int k = 0; k < GONIO_AXES; k++) {
        json_object_set_new(positions, axes[k], json_real(gonio_degrees(position[k])));
    }
    *out = json_pack("{s:s,s:o}", "driver", rig->driver, "position_deg", positions);
    gonio_error why = {.line = -1, .byte = -1};
    if (r->interlock != NULL) {
        status = r->interlock->check(r->interlock_device, &why);
        json_object_set_new(*out, "interlock", json_string(status == GONIO_OK ? "closed" : why.message));
    }
    if (r->meter != NULL) {
        const gonio_stamp stamp = {0, 0, 0};
        double value = NAN, sigma = NAN;
        status = r->meter->read(r->meter_device, &stamp, 0.1, &value, &sigma, &why);
        json_object_set_new(*out, "monitor",
                            status == GONIO_OK ? json_pack("[f,f]", value, sigma) : json_string(why.message));
    }
    return GONIO_OK;
}

static void print(const char *prefix, json_t *object) {
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value) {
        char name[64];
        snprintf(name, sizeof name, "%s%s", prefix, key);
        if (json_is_object(value)) {
            print("  ", value);
        } else if (json_is_array(value)) {
            printf("%-16s %.6g +- %.2g\n", name, json_number_value(json_array_get(value, 0)),
                   json_number_value(json_array_get(value, 1)));
        } else if (json_is_number(value)) {
            printf("%-16s %.9g\n", name, json_number_value(value));
        } else {
            printf("%-16s %s\n", name, json_string_value(value));
        }
    }
}

static int run(int argc, char **argv) {
    cli_common common;
    cli_rig_options rig_options = {0};
    const cli_option options[] = {CLI_RIG_OPTIONS(rig_options), {0}};
    const char *action;
    int count;
    if (!cli_parse(&cmd_rig, options, argc, argv, &action, 1, 1, &count, &common)) {
        return 2;
    }
    const bool identifies = strcmp(action, "identify") == 0;
    if (!identifies && strcmp(action, "status") != 0) {
        return cli_usage(&common, "rig: found '%s', expected identify or status", action);
    }
    rig_options.seed = common.seed;
    rig_options.threads = common.threads;
    if (rig_options.sample == NULL && rig_options.rig == NULL) {
        rig_options.sample = "lambert:rho=0.5";
    }
    gonio_error error = {.line = -1, .byte = -1};
    cli_rig rig = {0};
    json_t *answer = NULL;
    gonio_status status = cli_rig_open(&rig_options, &rig, &error);
    if (status == GONIO_OK) {
        status = identifies ? identify(&rig, &answer, &error) : read_status(&rig, &answer, &error);
    }
    cli_rig_close(&rig);
    if (status != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(answer);
    }
    print("", answer);
    json_decref(answer);
    return 0;
}
