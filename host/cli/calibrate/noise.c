// SPDX-License-Identifier: BSD-3-Clause
// gonio calibrate noise: photon transfer on a list of frames, or on frames taken by a rig looking at its reference.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#include "gonio/output.h"
#include "gonio/session_calibration.h"
#include "host/cli/calibrate/calibrate.h"
#include "host/cli/rig_file.h"

#define TIMEOUT_S 600
#define LONG_DARK_S 5.0 // the lit exposures are too short to show the dark current

typedef struct settings {
    const cli_common *common;
    const char *list, *out;
    int bits, steps, frames;
    cli_rig_options rig;
} settings;

// ---- frames from files ----

static gonio_status add_file(gonio_noise **noise, const settings *s, const frame_row *row, frame_top *top, int *width,
                             int *height, gonio_error *error) {
    gonio_image image;
    gonio_status status = frame_image_read(row, true, s->bits, top, &image, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (*noise == NULL) {
        *width = image.width;
        *height = image.height;
        status = gonio_noise_new(image.width, image.height, image.bits, noise, error);
    } else if (image.width != *width || image.height != *height) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, s->list, row->line, "%d x %d pixels; the first frame has %d x %d",
                            image.width, image.height, *width, *height);
    }
    status = status == GONIO_OK ? gonio_noise_add(*noise, image.pixels, row->exposure_s, row->lit, error) : status;
    gonio_image_free(&image);
    return status;
}

static gonio_status from_files(const settings *s, gonio_noise **noise, int *width, int *height, gonio_error *error) {
    frame_row *rows;
    size_t n;
    frame_top top = {0};
    gonio_status status = frame_list_read(s->common, s->list, &rows, &n, error);
    for (size_t i = 0; status == GONIO_OK && i < n; i++) {
        status = add_file(noise, s, &rows[i], &top, width, height, error);
    }
    free(rows);
    return status == GONIO_OK ? frame_top_check(s->list, &top, error) : status;
}

// ---- frames from a rig ----

typedef struct camera_run {
    gonio_rig *rig;
    gonio_camera_info info;
    gonio_window window;
    gonio_stamp stamp;
    uint16_t *pixels;
} camera_run;

static gonio_status take(camera_run *run, double exposure_s, bool lit, gonio_error *error) {
    gonio_rig *rig = run->rig;
    gonio_frame frame = {.pixels = run->pixels};
    gonio_status status = rig->lamp->set_shutter(rig->lamp_device, lit, error);
    if (status == GONIO_OK) {
        status = rig->camera->capture(rig->camera_device, &run->window, exposure_s, 0, &run->stamp,
                                      exposure_s + TIMEOUT_S, &frame, error);
    }
    run->stamp.frame++;
    run->stamp.clock_s += exposure_s + run->info.read_out_s;
    return status;
}

static double mean(const camera_run *run) {
    const size_t n = (size_t)run->window.width * (size_t)run->window.height;
    double sum = 0;
    for (size_t p = 0; p < n; p++) {
        sum += run->pixels[p];
    }
    return sum / (double)n;
}

// The exposure that fills the range: from one that gives between a quarter and two thirds of it.
static gonio_status find_range(camera_run *run, double *full_s, gonio_error *error) {
    const double top = (1 << run->info.bits) - 1;
    gonio_status status = take(run, run->info.exposure_min_s, false, error);
    const double black = mean(run);
    double exposure_s = fmax(run->info.exposure_min_s, 1e-3);
    for (int i = 0; status == GONIO_OK && i < 24; i++) {
        status = take(run, exposure_s, true, error);
        const double share = (mean(run) - black) / (top - black);
        if (share >= 0.25 && share <= 0.67) {
            *full_s = exposure_s / share;
            return status;
        }
        const double factor = share > 0.67 ? 0.25 : share > 0.02 ? 0.5 / share : 16;
        const double next_s = fmin(fmax(exposure_s * factor, run->info.exposure_min_s), run->info.exposure_max_s);
        if (next_s == exposure_s) {
            break;
        }
        exposure_s = next_s;
    }
    return status != GONIO_OK ? status
                              : gonio_fail(error, GONIO_E_DEVICE,
                                           "no exposure between %g and %g s lights the reference "
                                           "to half of the range; is the lamp on?",
                                           run->info.exposure_min_s, run->info.exposure_max_s);
}

// So many frames of one exposure.
static gonio_status take_all(camera_run *run, double exposure_s, bool lit, int frames, gonio_noise *noise,
                             gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < frames; i++) {
        status = take(run, exposure_s, lit, error);
        status = status == GONIO_OK ? gonio_noise_add(noise, run->pixels, exposure_s, lit, error) : status;
    }
    return status;
}

static gonio_status series(camera_run *run, const settings *s, double full_s, gonio_noise *noise, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int step = 1; status == GONIO_OK && step <= s->steps; step++) {
        // The last step is half as long again as what fills the range: it saturates everywhere.
        const double share = step == s->steps ? 1.6 : (double)step / s->steps;
        const double exposure_s = fmin(share * full_s, run->info.exposure_max_s);
        status = take_all(run, exposure_s, true, s->frames, noise, error);
        status = status == GONIO_OK ? take_all(run, exposure_s, false, s->frames, noise, error) : status;
    }
    const double dark_s = fmin(LONG_DARK_S, run->info.exposure_max_s);
    return status == GONIO_OK ? take_all(run, dark_s, false, s->frames, noise, error) : status;
}

static gonio_status place_reference(camera_run *run, gonio_error *error) {
    gonio_rig *rig = run->rig;
    const double target[GONIO_AXES] = {[GONIO_LIGHT_THETA] = gonio_radians(GONIO_REFERENCE_THETA_I_DEG)};
    double waited_s = 0;
    gonio_status status = rig->stage->home(rig->stage_device, TIMEOUT_S, error);
    if (status == GONIO_OK) {
        status = rig->stage->move(rig->stage_device, target, 1, &run->stamp, TIMEOUT_S, error);
    }
    if (status == GONIO_OK && rig->mount != NULL) {
        status = rig->mount->mount(rig->mount_device, GONIO_TARGET_REFERENCE, error);
    } else if (status == GONIO_OK) {
        fputs("Put the white reference on the table, then press Enter.\n", stderr);
        while (getchar() != '\n' && !feof(stdin)) {
        }
    }
    status = status == GONIO_OK ? rig->lamp->set_level(rig->lamp_device, 1, error) : status;
    if (status == GONIO_OK) {
        status = rig->lamp->wait_ready(rig->lamp_device, &run->stamp, 2 * TIMEOUT_S, &waited_s, error);
        run->stamp.clock_s += waited_s;
    }
    return status;
}

static gonio_status from_rig(const settings *s, gonio_noise **noise, int *width, int *height, gonio_error *error) {
    cli_rig opened = {0};
    camera_run run = {.rig = &opened.rig};
    double full_s = 0;
    gonio_status status = cli_rig_open(&s->rig, &opened, error);
    status = status == GONIO_OK ? opened.rig.camera->info(opened.rig.camera_device, &run.info, error) : status;
    if (status == GONIO_OK) {
        run.window = (gonio_window){0, 0, *width = run.info.width, *height = run.info.height};
        run.pixels = malloc((size_t)*width * (size_t)*height * sizeof *run.pixels);
        status = run.pixels == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for a frame")
                                    : gonio_noise_new(*width, *height, run.info.bits, noise, error);
    }
    status = status == GONIO_OK ? place_reference(&run, error) : status;
    status = status == GONIO_OK ? find_range(&run, &full_s, error) : status;
    status = status == GONIO_OK ? series(&run, s, full_s, *noise, error) : status;
    if (opened.rig.lamp != NULL) {
        opened.rig.lamp->set_shutter(opened.rig.lamp_device, false, NULL);
    }
    free(run.pixels);
    cli_rig_close(&opened);
    return status;
}

// ---- results ----

static gonio_status write_defects(const char *path, const gonio_noise *noise, int width, int height,
                                  gonio_error *error) {
    static const char *const kinds[] = {"", "hot", "noisy", "dead"};
    gonio_output *output;
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    const uint8_t *defects = gonio_noise_defects(noise);
    fputs("u,v,kind\n", gonio_output_stream(output));
    for (int p = 0; p < width * height; p++) {
        if (defects[p] != 0) {
            fprintf(gonio_output_stream(output), "%d,%d,%s\n", p % width, p / width, kinds[defects[p]]);
        }
    }
    return gonio_output_commit(output, error);
}

static const char *const files[] = {"dsnu.tiff", "prnu.tiff", "defects.csv", NULL};

static gonio_status write_maps(const settings *s, const gonio_noise *noise, int width, int height, gonio_error *error) {
    char path[1100];
    struct stat found;
    if (mkdir(s->out, 0777) != 0 && (stat(s->out, &found) != 0 || !S_ISDIR(found.st_mode))) {
        return gonio_fail_line(error, GONIO_E_IO, s->out, -1, "cannot make this folder");
    }
    snprintf(path, sizeof path, "%s/%s", s->out, files[0]);
    gonio_status status = gonio_map_write(path, width, height, gonio_noise_dsnu_map(noise), error);
    if (status == GONIO_OK) {
        snprintf(path, sizeof path, "%s/%s", s->out, files[1]);
        status = gonio_map_write(path, width, height, gonio_noise_prnu_map(noise), error);
    }
    if (status == GONIO_OK) {
        snprintf(path, sizeof path, "%s/%s", s->out, files[2]);
        status = write_defects(path, noise, width, height, error);
    }
    return status;
}

#define FIGURE(member) CLI_FIGURE(gonio_noise_report, member)
static const cli_figure figures[] = {FIGURE(gain_e_per_dn),
                                     FIGURE(gain_relative_sigma),
                                     FIGURE(read_noise_dn),
                                     FIGURE(read_noise_e),
                                     FIGURE(read_noise_relative_sigma),
                                     FIGURE(dark_e_per_s),
                                     FIGURE(dark_e_per_s_sigma),
                                     FIGURE(black_dn),
                                     FIGURE(saturation_dn),
                                     FIGURE(saturation_e),
                                     FIGURE(linearity_error),
                                     FIGURE(linearity_error_max),
                                     FIGURE(dsnu_e),
                                     FIGURE(prnu),
                                     FIGURE(snr_max),
                                     FIGURE(dynamic_range),
                                     {0}};

static json_t *as_json(const gonio_noise_report *r) {
    json_t *o = cli_json_figures(figures, r);
    json_object_set_new(o, "saturation_measured", json_boolean(r->saturation_measured));
    json_object_set_new(o, "hot", json_integer(r->hot));
    json_object_set_new(o, "dead", json_integer(r->dead));
    json_object_set_new(o, "points", json_integer(r->points));
    return o;
}

static void print(const gonio_noise_report *r) {
    printf("gain           %.4f e-/DN +- %.2g %% (%d exposures)\n", r->gain_e_per_dn, 100 * r->gain_relative_sigma,
           r->points);
    printf("read noise     %.3f e- +- %.2g %%  (%.3f DN)\n", r->read_noise_e, 100 * r->read_noise_relative_sigma,
           r->read_noise_dn);
    printf("dark current   %.3f e-/s +- %.2g\n", r->dark_e_per_s, r->dark_e_per_s_sigma);
    printf("black level    %.2f DN\n", r->black_dn);
    printf("saturation     %.0f DN, %.0f e-%s\n", r->saturation_dn, r->saturation_e,
           r->saturation_measured ? "" : " (not reached: the full scale is assumed)");
    printf("linearity      mean error %.3f %%, at most %.3f %%\n", 100 * r->linearity_error,
           100 * r->linearity_error_max);
    printf("DSNU           %.2f e-\nPRNU           %.3f %%\n", r->dsnu_e, 100 * r->prnu);
    printf("SNR at most    %.0f\ndynamic range  %.0f (%.1f dB)\n", r->snr_max, r->dynamic_range,
           20 * log10(r->dynamic_range));
    printf("defects        %d hot, %d dead\n", r->hot, r->dead);
}

static gonio_status calibrate(const settings *s, gonio_noise_report *report, gonio_error *error) {
    gonio_noise *noise = NULL;
    int width = 0, height = 0;
    gonio_status status =
        s->list != NULL ? from_files(s, &noise, &width, &height, error) : from_rig(s, &noise, &width, &height, error);
    status = status == GONIO_OK ? gonio_noise_solve(noise, report, error) : status;
    status = status == GONIO_OK && s->out != NULL ? write_maps(s, noise, width, height, error) : status;
    gonio_noise_free(noise);
    return status;
}

int calibrate_noise(int argc, char **argv) {
    cli_common common;
    settings s = {.common = &common, .steps = 12, .frames = 4};
    const cli_option options[] = {
        CLI_RIG_OPTIONS(s.rig),
        {"steps", 0, CLI_INT, &s.steps, NULL, "N", "rig: exposures, from dark to saturation (12)"},
        {"frames", 0, CLI_INT, &s.frames, NULL, "N", "rig: lit frames, and dark frames, at each exposure (4)"},
        {"bits", 0, CLI_INT, &s.bits, NULL, "N", "list: bits that carry information (the files' 8 or 16)"},
        {"out", 'o', CLI_TEXT, &s.out, NULL, "FOLDER", "write dsnu.tiff, prnu.tiff and defects.csv there"},
        {0}};
    static const cli_verb verb = {"calibrate noise", "[LIST.csv | --rig sim|RIG.ini] [-o FOLDER]",
                                  "EMVA 1288 style photon transfer; LIST.csv: file,exposure_s,light", NULL};
    int count;
    if (!cli_parse(&verb, options, argc, argv, &s.list, 0, 1, &count, &common) ||
        !cli_apart_folder(&common, s.out, files)) {
        return 2;
    }
    if (s.bits != 0 && (s.bits < 8 || s.bits > 16)) {
        return cli_usage(&common, "8 to 16 bits are possible");
    }
    if (s.steps < 4 || s.steps > 30 || s.frames < 2 || s.frames > 1000) {
        return cli_usage(&common, "4 to 30 steps of 2 to 1000 frames, please");
    }
    cli_rig_any_sample(&s.rig, &common);
    gonio_error error = {.line = -1, .byte = -1};
    gonio_noise_report report;
    if (calibrate(&s, &report, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(as_json(&report));
    }
    print(&report);
    return 0;
}
