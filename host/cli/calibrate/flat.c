// SPDX-License-Identifier: BSD-3-Clause
// gonio calibrate flat: flat field and vignetting with their uncertainty, from a rig's white reference or from a list
// of frames of an evenly lit field, into a file for [camera] flat.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "gonio/session_calibration.h"
#include "host/cli/calibrate/calibrate.h"
#include "host/cli/rig_file.h"

typedef struct settings {
    const cli_common *common;
    const char *list, *out, *maps;
    int bits, frames;
    cli_rig_options rig;
} settings;

// ---- frames from files: an even field, so that every pixel sees the same ----

#define FAR_MM 1e9 // no fall-off over the field

static gonio_status new_even(const gonio_image *image, gonio_calib **calib, gonio_error *error) {
    const gonio_camera_info camera = {.name = "files",
                                      .width = image->width,
                                      .height = image->height,
                                      .bits = image->bits,
                                      .exposure_min_s = 1e-9,
                                      .exposure_max_s = 1e9,
                                      .fx = FAR_MM,
                                      .fy = FAR_MM};
    const gonio_rig_facts facts = {.light_distance_mm = FAR_MM,
                                   .camera_distance_mm = FAR_MM,
                                   .region_radius_mm = 1,
                                   .reference_reflectance = {1, 1, 1}};
    return gonio_calib_new(&camera, &facts, &(gonio_window){0, 0, image->width, image->height}, calib, error);
}

static gonio_status add_file(const settings *s, const frame_row *row, frame_top *top, int index, gonio_calib **calib,
                             gonio_error *error) {
    gonio_image image;
    gonio_status status = frame_image_read(row, true, s->bits, top, &image, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (*calib == NULL) {
        status = new_even(&image, calib, error);
    }
    const gonio_exposure exposure = {.frame = {.window = {0, 0, image.width, image.height},
                                               .exposure_s = row->exposure_s,
                                               .stamp = {.pose = 0, .frame = index},
                                               .pixels = image.pixels},
                                     .monitor = NAN,
                                     .monitor_sigma = NAN};
    if (status == GONIO_OK) {
        status = row->lit ? gonio_calib_add_reference(*calib, &(gonio_pair){0}, &exposure, error)
                          : gonio_calib_add_dark(*calib, &exposure, error);
    }
    gonio_image_free(&image);
    return status;
}

// The listed file at fault: its frame has the row's number.
static void name_file(const frame_row *rows, size_t n, gonio_error *error) {
    const bool one = error->step == 0 && error->frame >= 0 && (size_t)error->frame < n;
    if (one && strlen(rows[error->frame].path) < sizeof error->file) {
        strcpy(error->file, rows[error->frame].path);
    }
}

// Dark frames first: the lit ones stand on them.
static gonio_status from_files(const settings *s, gonio_calib **calib, gonio_error *error) {
    frame_row *rows;
    size_t n;
    frame_top top = {0};
    gonio_status status = frame_list_read(s->common, s->list, &rows, &n, error);
    for (int lit = 0; lit < 2; lit++) {
        for (size_t i = 0; status == GONIO_OK && i < n; i++) {
            if (rows[i].lit == (lit == 1)) {
                status = add_file(s, &rows[i], &top, (int)i, calib, error);
            }
        }
    }
    status = status == GONIO_OK ? frame_top_check(s->list, &top, error) : status;
    status = status == GONIO_OK ? gonio_calib_prepare(*calib, error) : status;
    if (status != GONIO_OK) {
        name_file(rows, n, error);
    }
    free(rows);
    return status;
}

// ---- frames from a rig: its dark frames, light trap and reference, over the whole sensor ----

static gonio_status add_step(const gonio_rig *rig, const gonio_setup *setup, const gonio_step *step, double *clock_s,
                             gonio_calib *calib, gonio_error *error) {
    const bool trap = step->kind == GONIO_STEP_TRAP, dark = step->kind == GONIO_STEP_DARK;
    double target[GONIO_AXES];
    gonio_scan_target(&step->pose, target);
    gonio_exposures taken = {.clock_s = *clock_s};
    const gonio_stamp stamp = {step->index, 0, *clock_s};
    gonio_status status = rig->stage->move(rig->stage_device, target, (uint32_t)step->index + 1, &stamp, 600, error);
    if (status == GONIO_OK && !dark) {
        status = rig->mount->mount(rig->mount_device, trap ? GONIO_TARGET_TRAP : GONIO_TARGET_REFERENCE, error);
    }
    status = status == GONIO_OK ? rig->lamp->set_shutter(rig->lamp_device, !dark, error) : status;
    status = status == GONIO_OK ? gonio_expose_step(rig, setup, calib, step, 0, &taken, error) : status;
    for (int i = 0; status == GONIO_OK && i < taken.n; i++) {
        status = dark   ? gonio_calib_add_dark(calib, &taken.items[i], error)
                 : trap ? gonio_calib_add_trap(calib, &taken.items[i], error)
                        : gonio_calib_add_reference(calib, &step->pose, &taken.items[i], error);
    }
    *clock_s = taken.clock_s;
    gonio_exposures_free(taken.items, taken.n);
    return status;
}

static gonio_status take_steps(const settings *s, cli_rig *opened, gonio_calib **calib, gonio_error *error) {
    gonio_rig *rig = &opened->rig;
    gonio_setup setup = {0};
    opened->scan.window_width = opened->scan.window_height = -1;
    opened->scan.reference_frames = s->frames;
    gonio_status status = gonio_setup_of_rig(rig, &opened->scan, &setup, error);
    setup.facts.flat_path[0] = 0;
    status = status == GONIO_OK ? gonio_calib_new(&setup.camera, &setup.facts, &setup.window, calib, error) : status;
    if (status == GONIO_OK && rig->mount == NULL) {
        status = gonio_fail(error, GONIO_E_UNSUPPORTED,
                            "a rig without a sample changer: give a list of frames, dark and lit, instead");
    }
    double clock_s = 0;
    status = status == GONIO_OK ? rig->stage->home(rig->stage_device, 600, error) : status;
    status = status == GONIO_OK ? rig->lamp->set_level(rig->lamp_device, 1, error) : status;
    if (status == GONIO_OK) {
        status = rig->lamp->wait_ready(rig->lamp_device, &(gonio_stamp){0}, 7200, &clock_s, error);
    }
    const gonio_step_kind kinds[] = {GONIO_STEP_DARK, GONIO_STEP_TRAP, GONIO_STEP_REFERENCE};
    for (int k = 0; status == GONIO_OK && k < 3; k++) {
        const gonio_step step = {
            .index = k, .kind = kinds[k], .pose = {.theta_i = gonio_radians(GONIO_REFERENCE_THETA_I_DEG)}};
        if (kinds[k] != GONIO_STEP_TRAP || setup.scan.trap_frames > 0) {
            status = add_step(rig, &setup, &step, &clock_s, *calib, error);
        }
    }
    rig->lamp->set_shutter(rig->lamp_device, false, NULL);
    return status;
}

static gonio_status from_rig(const settings *s, gonio_calib **calib, gonio_error *error) {
    cli_rig opened = {0};
    gonio_status status = cli_rig_open(&s->rig, &opened, error);
    status = status == GONIO_OK ? take_steps(s, &opened, calib, error) : status;
    status = status == GONIO_OK ? gonio_calib_prepare(*calib, error) : status;
    cli_rig_close(&opened);
    return status;
}

// ---- results ----

typedef struct summary {
    size_t sound, defective;
    double low, high, sigma; // relative responsivity, least and most; typical relative uncertainty
} summary;

static void summarise(const gonio_calib *calib, size_t pixels, summary *out) {
    const float *flat = gonio_calib_flat(calib);
    const uint8_t *defect = gonio_calib_defects(calib);
    gonio_calib_report report;
    gonio_calib_describe(calib, &report);
    double sum = 0;
    *out = (summary){.low = INFINITY, .sigma = report.flat_relative_sigma};
    for (size_t p = 0; p < pixels; p++) {
        out->defective += defect[p] != 0;
        if (defect[p] == 0) {
            out->sound++;
            sum += flat[p];
            out->low = fmin(out->low, flat[p]);
            out->high = fmax(out->high, flat[p]);
        }
    }
    out->low /= sum / (double)out->sound;
    out->high /= sum / (double)out->sound;
}

#define MAP_FLAT "flat.tiff"
#define MAP_SIGMA "sigma.tiff"

static gonio_status write_maps(const settings *s, const gonio_calib *calib, const gonio_window *w, gonio_error *error) {
    const size_t n = (size_t)w->width * (size_t)w->height;
    float *map = malloc(n * sizeof *map);
    char path[1100];
    struct stat found;
    gonio_status status = GONIO_OK;
    if (map == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a map");
    } else if (mkdir(s->maps, 0777) != 0 && (stat(s->maps, &found) != 0 || !S_ISDIR(found.st_mode))) {
        status = gonio_fail_line(error, GONIO_E_IO, s->maps, -1, "cannot make this folder");
    }
    for (int k = 0; status == GONIO_OK && k < 2; k++) {
        const float *from = k == 0 ? gonio_calib_flat(calib) : gonio_calib_flat_variance(calib);
        for (size_t p = 0; p < n; p++) {
            map[p] = gonio_calib_defects(calib)[p] ? NAN : k == 0 ? from[p] : sqrtf(from[p]);
        }
        snprintf(path, sizeof path, "%s/%s", s->maps, k == 0 ? MAP_FLAT : MAP_SIGMA);
        status = gonio_map_write(path, w->width, w->height, map, error);
    }
    free(map);
    return status;
}

static int report(const settings *s, const gonio_window *w, const summary *m, bool json) {
    if (json) {
        return cli_json(json_pack("{s:i,s:i,s:I,s:I,s:f,s:f,s:f,s:s?}", "width", w->width, "height", w->height, "sound",
                                  (json_int_t)m->sound, "defective", (json_int_t)m->defective, "low", m->low, "high",
                                  m->high, "relative_sigma", m->sigma, "output", s->out));
    }
    printf("flat field   %d x %d pixels, %zu defective\nresponsivity %.4f to %.4f of the mean, each to %.3f %%\n",
           w->width, w->height, m->defective, m->low, m->high, 100 * m->sigma);
    if (s->out != NULL) {
        printf("wrote        %s: gonio measure --set camera.flat=%s\n", s->out, s->out);
    }
    return 0;
}

static gonio_status calibrate(const settings *s, gonio_window *window, summary *m, gonio_error *error) {
    gonio_calib *calib = NULL;
    gonio_status status = s->list != NULL ? from_files(s, &calib, error) : from_rig(s, &calib, error);
    if (status == GONIO_OK) {
        *window = gonio_calib_window(calib);
        summarise(calib, (size_t)window->width * (size_t)window->height, m);
    }
    status = status == GONIO_OK && s->out != NULL ? gonio_calib_flat_save(calib, s->out, error) : status;
    status = status == GONIO_OK && s->maps != NULL ? write_maps(s, calib, window, error) : status;
    gonio_calib_free(calib);
    return status;
}

int calibrate_flat(int argc, char **argv) {
    cli_common common;
    settings s = {.common = &common, .frames = 32};
    const cli_option options[] = {
        CLI_RIG_OPTIONS(s.rig),
        {"frames", 0, CLI_INT, &s.frames, NULL, "N", "rig: frames of the reference (32)"},
        {"bits", 0, CLI_INT, &s.bits, NULL, "N", "list: bits that carry information (the files' 8 or 16)"},
        {"maps", 0, CLI_TEXT, &s.maps, NULL, "FOLDER", "write flat.tiff (DN/s a unit) and sigma.tiff there"},
        {"out", 'o', CLI_OUTPUT, &s.out, NULL, "FLAT", "write the flat field, for [camera] flat of a rig file"},
        {0}};
    static const cli_verb verb = {"calibrate flat", "[LIST.csv | --rig sim|RIG.ini] [-o FLAT]",
                                  "flat field and vignetting; LIST.csv: file,exposure_s,light of an evenly lit field",
                                  NULL};
    static const char *const files[] = {MAP_FLAT, MAP_SIGMA, NULL};
    int count;
    if (!cli_parse(&verb, options, argc, argv, &s.list, 0, 1, &count, &common) ||
        !cli_apart_folder(&common, s.maps, files)) {
        return 2;
    }
    if (s.frames < 2 || s.frames > 48 || (s.bits != 0 && (s.bits < 8 || s.bits > 16))) {
        return cli_usage(&common, "2 to 48 frames and 8 to 16 bits are possible");
    }
    cli_rig_any_sample(&s.rig, &common);
    gonio_error error = {.line = -1, .byte = -1};
    gonio_window window;
    summary m;
    if (calibrate(&s, &window, &m, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    return report(&s, &window, &m, common.json);
}
