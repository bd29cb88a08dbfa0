// SPDX-License-Identifier: BSD-3-Clause
// The computer: a measure or its continuation, with the real drivers for stage, lamp, meter and camera. What the camera
// sees and the meter reads is simulated, for the arms where they truly stand and the lamp as it truly burns.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/acquire/acquire.h"
#include "host/drivers/hardware.h"
#include "sim/internal.h"
#include "tests/faults/world.h"

static struct {
    gonio_sim *sim;
    gonio_stamp stamp; // of the capture or reading under way
    double integration_s;
    const gonio_camera_ops *camera;
    void *camera_device;
    const gonio_meter_ops *meter;
    void *meter_device;
} bench;

// ---- the truth behind the devices ----

// Degrees by which an axis stands elsewhere than the controller counts; a step either way is what homing leaves.
static double slip_deg(int k) {
    const struct fw_core *core = &w->machine.core;
    const int64_t slip = w->machine.axis[k].steps - core->step.position[k];
    return core->axis.under_way || llabs(slip) <= 1 ? 0 : (double)slip / 100;
}

typedef struct truth {
    double angles_rad[GONIO_AXES], lamp_level;
    bool shutter_open;
} truth;

static truth enter_truth(void) {
    gonio_sim *sim = bench.sim;
    truth kept = {.lamp_level = sim->lamp_level, .shutter_open = sim->shutter_open};
    memcpy(kept.angles_rad, sim->actual_rad, sizeof kept.angles_rad);
    for (int k = 0; k < GONIO_AXES; k++) {
        sim->actual_rad[k] += gonio_radians(slip_deg(k));
    }
    sim->lamp_level = w->machine.lamp / 10000.0;
    sim->shutter_open = w->machine.shutter;
    return kept;
}

static void leave_truth(const truth *kept) {
    memcpy(bench.sim->actual_rad, kept->angles_rad, sizeof kept->angles_rad);
    bench.sim->lamp_level = kept->lamp_level;
    bench.sim->shutter_open = kept->shutter_open;
}

// What a frame depends on: frames that the driver discards after a change of exposure are the same picture again.
typedef struct picture {
    gonio_stamp stamp;
    double exposure_s, angles_rad[GONIO_AXES], lamp_level;
    bool shutter_open;
    gonio_target target;
} picture;

static void render(double exposure_s, uint16_t *pixels) {
    static uint16_t last_pixels[CAMERA_WIDTH * CAMERA_HEIGHT];
    static picture last;
    const gonio_window all = {0, 0, CAMERA_WIDTH, CAMERA_HEIGHT};
    gonio_frame frame = {.pixels = pixels};
    const truth kept = enter_truth();
    gonio_error error = {0};
    picture now;
    memset(&now, 0, sizeof now);
    now.stamp.pose = bench.stamp.pose;
    now.stamp.frame = bench.stamp.frame;
    now.stamp.clock_s = bench.stamp.clock_s;
    now.exposure_s = exposure_s;
    memcpy(now.angles_rad, bench.sim->actual_rad, sizeof now.angles_rad);
    now.lamp_level = bench.sim->lamp_level;
    now.shutter_open = bench.sim->shutter_open;
    now.target = bench.sim->target;
    if (memcmp(&now, &last, sizeof now) == 0) {
        memcpy(pixels, last_pixels, sizeof last_pixels);
    } else if (gonio_sim_camera_ops.capture(bench.sim, &all, exposure_s, 0, &bench.stamp, 1e9, &frame, &error) !=
               GONIO_OK) {
        world_trouble("no frame: %s; ", error.message);
    } else {
        last = now;
        memcpy(last_pixels, pixels, sizeof last_pixels);
    }
    leave_truth(&kept);
}

static double power(void) {
    double value = 0, sigma = 0;
    const truth kept = enter_truth();
    gonio_sim_meter_ops.read(bench.sim, &bench.stamp, bench.integration_s, &value, &sigma, NULL);
    leave_truth(&kept);
    return value;
}

// ---- devices that tell which stamp is under way ----

static gonio_status camera_info(void *device, gonio_camera_info *info, gonio_error *error) {
    (void)device;
    return bench.camera->info(bench.camera_device, info, error);
}

static gonio_status camera_capture(void *device, const gonio_window *window, double exposure_s, double gain_db,
                                   const gonio_stamp *stamp, double timeout_s, gonio_frame *frame, gonio_error *error) {
    (void)device;
    bench.stamp = *stamp;
    camera_asked_us = w->now_us;
    return bench.camera->capture(bench.camera_device, window, exposure_s, gain_db, stamp, timeout_s, frame, error);
}

static void camera_close(void *device) {
    (void)device;
    bench.camera->close(bench.camera_device);
}

static gonio_status meter_read(void *device, const gonio_stamp *stamp, double integration_s, double *value,
                               double *sigma, gonio_error *error) {
    (void)device;
    bench.stamp = *stamp;
    bench.integration_s = integration_s;
    return bench.meter->read(bench.meter_device, stamp, integration_s, value, sigma, error);
}

static void meter_close(void *device) {
    (void)device;
    bench.meter->close(bench.meter_device);
}

static const gonio_camera_ops camera_ops = {
    .name = "v4l2", .info = camera_info, .capture = camera_capture, .close = camera_close};
static const gonio_meter_ops meter_ops = {.name = "usbtmc", .read = meter_read, .close = meter_close};

// ---- the rig ----

static void tell(void *context, const char *kind, const char *text) {
    gonio_session *session = *(gonio_session **)context;
    if (w->verbose) {
        printf("%10.3f s  %s: %s\n", (double)w->now_us * 1e-6, kind, text);
    }
    if (session != NULL) {
        gonio_session_event(session, kind, text, NULL);
    }
}

static bool cancelled(void *context) {
    (void)context;
    return w->interrupted;
}

static const char *const sim_keys[][3] = {
    {"camera", "width", "44"},
    {"camera", "height", "44"},
    {"camera", "white_e_per_s", "4e6"},
    {"camera", "exposure_max_s", "0.06"},
    {"camera", "exposure_min_s", "1e-6"},
    {"sample", "region_radius_mm", "1"},
    {"camera", "read_out_s", "0.001"},
};

static const char *const hardware_keys[][3] = {
    {"stage", "driver", "modbus"},        {"lamp", "driver", "modbus"},
    {"meter", "driver", "usbtmc"},        {"controller", "port", "/sim/controller"},
    {"lamp", "shutter_settle_s", "0.02"}, {"meter", "vendor", "1313"},
};

static const char *const axis_keys[][2] = {
    {"steps_per_deg", "100"},      {"speed_deg_per_s", "300"}, {"acceleration_deg_per_s2", "2000"},
    {"jerk_deg_per_s3", "40000"},  {"home_deg", "-10"},        {"home_fast_deg_per_s", "200"},
    {"home_slow_deg_per_s", "10"}, {"backlash_deg", "0.2"},
};

static gonio_status set_hardware(gonio_hardware *hardware, const char *section, const char *key, const char *value) {
    bool taken, shared;
    gonio_error error = {0};
    const gonio_status status = gonio_hardware_set(hardware, section, key, value, &taken, &shared, &error);
    if (status != GONIO_OK || !taken) {
        world_trouble("[%s] %s: %s; ", section, key, error.message);
    }
    return status;
}

static void set_axes(gonio_hardware *hardware) {
    static const char *const names[GONIO_AXES] = {"axis light_theta", "axis light_phi", "axis camera_theta",
                                                  "axis camera_phi"};
    for (int k = 0; k < GONIO_AXES; k++) {
        for (size_t i = 0; i < sizeof axis_keys / sizeof *axis_keys; i++) {
            set_hardware(hardware, names[k], axis_keys[i][0], axis_keys[i][1]);
        }
        set_hardware(hardware, names[k], "min_deg", "-5");
        set_hardware(hardware, names[k], "max_deg", k % 2 == 0 ? "95" : "365");
        char section[40], slave[8];
        snprintf(section, sizeof section, "encoder %s", names[k] + strlen("axis "));
        snprintf(slave, sizeof slave, "%d", 11 + k);
        if (w->encoders) {
            set_hardware(hardware, section, "encoder_deg", "0.1");
            set_hardware(hardware, section, "slave", slave);
            set_hardware(hardware, section, "register", "2");
            set_hardware(hardware, section, "counts_per_deg", "100");
        }
    }
}

static gonio_status open_camera(gonio_rig *rig, gonio_error *error) {
    gonio_camera_v4l2_config config;
    gonio_camera_v4l2_defaults(&config);
    config.exposure_unit_s = 1e-6;
    config.bits = 12;
    gonio_sim_camera_describe(bench.sim, &config.info);
    void *device;
    const gonio_status status = gonio_camera_v4l2_open(&config, &camera_model_io, NULL, &device, error);
    if (status == GONIO_OK) {
        rig->camera->close(rig->camera_device);
        bench.camera = &gonio_camera_v4l2;
        bench.camera_device = device;
        rig->camera = &camera_ops;
        rig->camera_device = &bench;
    }
    return status;
}

static gonio_status open_rig(gonio_hardware **hardware, gonio_session **session, gonio_rig *rig, gonio_error *error) {
    gonio_status status = gonio_sim_new("ward:rho_d=0.3,rho_s=0.2,alpha=0.3", 1, &bench.sim, error);
    for (size_t i = 0; i < sizeof sim_keys / sizeof *sim_keys && status == GONIO_OK; i++) {
        status = gonio_sim_set(bench.sim, sim_keys[i][0], sim_keys[i][1], sim_keys[i][2], error);
    }
    if (status == GONIO_OK) {
        status = gonio_sim_open(bench.sim, 1, rig, error);
    }
    const gonio_hardware_hooks hooks = {tell, session, cancelled};
    if (status == GONIO_OK) {
        status = gonio_hardware_new(&hooks, hardware, error);
    }
    for (size_t i = 0; i < sizeof hardware_keys / sizeof *hardware_keys && status == GONIO_OK; i++) {
        status = set_hardware(*hardware, hardware_keys[i][0], hardware_keys[i][1], hardware_keys[i][2]);
    }
    if (status != GONIO_OK) {
        return status;
    }
    set_axes(*hardware);
    camera_render = render;
    usb_power = power;
    status = gonio_hardware_open(*hardware, rig, true, error);
    // The one thread of this process (clock.c) is that which feeds the dead-man.
    status = status == GONIO_OK ? gonio_controller_claim(gonio_hardware_controller(*hardware), error) : status;
    if (status == GONIO_OK) {
        bench.meter = rig->meter;
        bench.meter_device = rig->meter_device;
        rig->meter = &meter_ops;
        rig->meter_device = &bench;
        status = open_camera(rig, error);
    }
    return status;
}

// ---- the session ----

static gonio_status begin(const gonio_rig *rig, gonio_session **session, gonio_error *error) {
    gonio_scan_options options;
    gonio_scan_options_default(&options);
    options.dark_frames = 4;
    options.reference_frames = 4;
    options.settle_s = SETTLE_US * 1e-6;
    options.audit_poses = 12;
    gonio_setup setup = {0};
    gonio_fit_options_default(&setup.fit);
    setup.fit.method = "mba";
    setup.fit.level = 2;
    setup.fit.hold_out = 0;
    setup.fit.threads = 1;
    gonio_plan *plan = NULL;
    gonio_step *steps = NULL;
    size_t n = 0;
    gonio_status status = gonio_setup_of_rig(rig, &options, &setup, error);
    if (status == GONIO_OK) {
        status = gonio_plan_make("nusselt:31", 1, &plan, error);
    }
    if (status == GONIO_OK) {
        status = gonio_scan_steps(rig, &options, plan, &steps, &n, error);
        gonio_plan_free(plan);
    }
    if (status == GONIO_OK) {
        status = gonio_session_create(w->folder, session, error);
    }
    if (status == GONIO_OK) {
        status = gonio_session_begin(*session, error);
    }
    if (status == GONIO_OK) {
        status = gonio_setup_put(*session, &setup, error);
        status = status == GONIO_OK ? gonio_session_put_steps(*session, steps, n, error) : status;
        if (status == GONIO_OK) {
            status = gonio_session_commit(*session, error);
        } else {
            gonio_session_rollback(*session);
        }
    }
    free(steps);
    return status;
}

// The session that is there, or a new one where none has come as far as its steps.
static gonio_status open_session(const gonio_rig *rig, gonio_session **session, gonio_error *error) {
    gonio_step *steps = NULL;
    size_t n = 0;
    if (gonio_session_is(w->folder)) {
        gonio_status status = gonio_session_open(w->folder, true, session, error);
        if (status == GONIO_OK) {
            status = gonio_session_steps(*session, &steps, &n, error);
            free(steps);
        }
        if (status != GONIO_OK || n > 0) {
            return status;
        }
        gonio_session_close(*session);
        *session = NULL;
    }
    return begin(rig, session, error);
}

static gonio_status finish(gonio_session *session, gonio_scan *scan, gonio_error *error) {
    gonio_outcome outcome;
    char path[200];
    snprintf(path, sizeof path, "%s/model.gonio", w->folder);
    const gonio_finish_options options = {.threads = 1, .model_path = path};
    gonio_status status = gonio_finish(session, gonio_scan_process(scan), &options, &outcome, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_session_put(session, "result.model_path", "model.gonio", error);
    if (status == GONIO_OK) {
        status = gonio_outcome_put(session, &outcome, error);
    }
    memcpy(w->sha256, outcome.samples_sha256, sizeof w->sha256);
    w->samples = (long long)outcome.samples->n;
    gonio_outcome_free(&outcome);
    return status;
}

static gonio_status step(gonio_scan *scan, gonio_error *error) {
    const gonio_samples *samples;
    const gonio_status status = gonio_scan_step(scan, &samples, error);
    if (w->verbose) {
        const gonio_process *process = gonio_scan_process(scan);
        size_t done = 0;
        for (size_t i = 0; i < process->n; i++) {
            done += process->steps[i].done;
        }
        printf("%10.3f s  %zu of %zu steps done, homed %d\n", (double)w->now_us * 1e-6, done, process->n,
               w->machine.core.known);
    }
    return status;
}

static void note(void *context, const char *text) {
    (void)context;
    w->taken_back += strstr(text, "steps are measured again") != NULL;
    if (w->verbose) {
        printf("%10.3f s  %s\n", (double)w->now_us * 1e-6, text);
    }
}

static gonio_status measure(const gonio_rig *rig, gonio_session *session, gonio_error *error) {
    const gonio_scan_hooks hooks = {.note = note};
    gonio_scan *scan = NULL;
    gonio_status status = gonio_scan_new(session, rig, &hooks, &scan, error);
    while (status == GONIO_OK && !gonio_scan_done(scan)) {
        status = w->interrupted ? gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted") : step(scan, error);
    }
    if (status == GONIO_OK) {
        status = finish(session, scan, error);
    }
    if (status != GONIO_OK) {
        gonio_session_event(session, "stopped", error->message, NULL);
    }
    gonio_scan_free(scan);
    return status;
}

void host_run(void) {
    gonio_hardware *hardware = NULL;
    gonio_session *session = NULL;
    gonio_rig rig = {0};
    gonio_error error = {.line = -1, .byte = -1};
    w->finished = w->interrupted = false;
    w->message[0] = 0;
    clock_forget_threads();
    usb_model_reset();
    gonio_status status = open_rig(&hardware, &session, &rig, &error);
    if (status == GONIO_OK) {
        status = open_session(&rig, &session, &error);
    }
    if (status == GONIO_OK) {
        status = measure(&rig, session, &error);
    }
    w->status = status;
    w->finished = status == GONIO_OK;
    snprintf(w->message, sizeof w->message, "%s", status == GONIO_OK ? "" : error.message);
    if (w->verbose) {
        printf("%10.3f s  host: %s %s\n", (double)w->now_us * 1e-6, gonio_status_name(status), w->message);
    }
    gonio_rig_close(&rig);
    gonio_hardware_free(hardware);
    gonio_session_close(session);
    gonio_sim_free(bench.sim);
}

void host_doctor(void) {
    gonio_doctor_report report;
    gonio_error error = {.line = -1, .byte = -1};
    if (!gonio_session_is(w->folder)) {
        return;
    }
    const gonio_status status = gonio_session_doctor(w->folder, false, &report, &error);
    if (status != GONIO_OK) {
        world_trouble("doctor: %s; ", error.message);
    } else if (!report.database_ok || report.frames_bad > 0 || report.samples_bad > 0 || report.steps_lost > 0 ||
               !report.results_ok || (w->finished && report.flagged > 0)) {
        world_trouble("the session is not sound: %.300s; ", report.detail);
    }
}
