// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/input.h"

#include <stdio.h>
#include <string.h>

#include "base/channel.h"
#include "base/keys.h"
#include "gonio/session.h"
#include "host/cli/hdf5_input.h"
#include "io/map_file.h"
#include "io/table.h"

// A wavelength is given in nm; nobody measures below 20 nm or beyond 20 um, so a small number is in um.
static double wavelength_nm(double given) { return given < 20 ? 1000 * given : given; }

// ---- the options of the formats ----

static void append(char *text, const char *more) {
    const size_t used = strlen(text);
    snprintf(text + used, CLI_INPUT_HELP - used, "%s", more);
}

// The help of an option, then the formats that have it and its standard with each: "... (merl: 0; rgl: 100k)".
static void put_help(const char *name, char *text) {
    const char *standard = NULL;
    gonio_format_facts f;
    text[0] = 0;
    for (int i = 0; gonio_format_get(i, &f); i++) {
        for (const gonio_format_option *o = f.options; o->name != NULL; o++) {
            if (strcmp(o->name, name) != 0) {
                continue;
            }
            if (standard == NULL) {
                append(text, o->help);
                append(text, " (");
            } else if (strcmp(standard, o->standard) == 0) {
                append(text, ", ");
            } else {
                append(text, ": ");
                append(text, standard);
                append(text, "; ");
            }
            append(text, f.name);
            standard = o->standard;
        }
    }
    append(text, ": ");
    append(text, standard);
    append(text, ")");
}

static bool has_row(const cli_option *rows, int n, const char *name) {
    for (int k = 0; k < n; k++) {
        if (strcmp(rows[k].name, name) == 0) {
            return true;
        }
    }
    return false;
}

cli_option *cli_input_table(cli_input *in) {
    int n = 0;
    in->rows[n++] = (cli_option){"channel", 0, CLI_TEXT, &in->channel, NULL, "NAME", "only this channel"};
    in->rows[n++] = (cli_option){"wavelength",
                                 0,
                                 CLI_DOUBLE,
                                 &in->wavelength,
                                 NULL,
                                 "NM",
                                 "only this wavelength, or the nearest within half the spacing"};
    in->rows[n++] = (cli_option){"save-map",
                                 0,
                                 CLI_FLAG,
                                 &in->save_map,
                                 NULL,
                                 NULL,
                                 "keep the mapping of a table beside it, as INPUT.gonio-map"};
    gonio_format_facts f;
    for (int i = 0; gonio_format_get(i, &f); i++) {
        for (const gonio_format_option *o = f.options; o->name != NULL && n + 1 < CLI_INPUT_ROWS; o++) {
            if (!has_row(in->rows, n, o->name)) {
                put_help(o->name, in->help[n]);
                in->rows[n] = o->type == GONIO_FORMAT_FLAG
                                  ? (cli_option){o->name, 0, CLI_FLAG, &in->flags[n], NULL, NULL, in->help[n]}
                                  : (cli_option){o->name, 0, CLI_TEXT, &in->given[n], NULL, o->argument, in->help[n]};
                n++;
            }
        }
    }
    in->rows[n] = (cli_option){0};
    return in->rows;
}

static const char *value_of(const cli_input *in, int k) { return in->flags[k] ? "yes" : in->given[k]; }

gonio_status cli_input_refuse(const cli_input *in, const char *what, gonio_error *error) {
    for (int k = 0; k < CLI_INPUT_ROWS && in->rows[k].name != NULL; k++) {
        if (value_of(in, k) != NULL || (in->save_map && in->rows[k].value == &in->save_map)) {
            return gonio_fail(error, GONIO_E_USAGE, "%s: no option of %s; it belongs to file formats: `gonio formats`",
                              in->rows[k].name, what);
        }
    }
    return GONIO_OK;
}

static gonio_read_options options_of(const cli_input *in, const cli_common *common) {
    gonio_read_options options = {
        .seed = common->seed, .threads = common->threads, .wavelength_nm = wavelength_nm(in->wavelength)};
    int n = 0;
    for (int k = 0; k < CLI_INPUT_ROWS && in->rows[k].name != NULL && n < GONIO_FORMAT_SETTINGS_MAX; k++) {
        if (value_of(in, k) != NULL) {
            options.settings[n++] = (gonio_format_setting){in->rows[k].name, value_of(in, k)};
        }
    }
    return options;
}

// ---- reading ----

// The one channel that the user wants, if any: replaces *samples.
static gonio_status choose_channel(const char *path, const cli_input *in, gonio_samples **samples, gonio_error *error) {
    char wanted[64];
    if (in->channel != NULL) {
        snprintf(wanted, sizeof wanted, "%s", in->channel);
    } else {
        snprintf(wanted, sizeof wanted, "%.10gnm", wavelength_nm(in->wavelength));
    }
    char list[200] = "";
    int nearest = -1;
    if (in->channel == NULL) {
        double nm[GONIO_CHANNELS_MAX];
        for (int c = 0; c < (*samples)->channels; c++) {
            nm[c] = gonio_samples_wavelength_nm(*samples, c);
        }
        nearest = gonio_wavelength_nearest(nm, (*samples)->channels, wavelength_nm(in->wavelength));
    }
    for (int c = 0; c < (*samples)->channels; c++) {
        const char *name = (*samples)->channel_names[c];
        if (c == nearest || (nearest < 0 && strcmp(name, wanted) == 0)) {
            if (strcmp(name, wanted) != 0) {
                fprintf(stderr, "gonio: %s: no channel of %s: %s, the nearest, is taken\n", path, wanted, name);
            }
            gonio_samples *one;
            const gonio_status status = gonio_samples_channel(*samples, c, &one, error);
            gonio_samples_free(*samples);
            *samples = status == GONIO_OK ? one : NULL;
            return status;
        }
        const size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, " %s", name);
    }
    gonio_samples_free(*samples);
    *samples = NULL;
    return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "no channel '%s'; there are%s", wanted, list);
}

void cli_input_tell(const char *path, const gonio_read_report *report) {
    if (report->negatives > 0) {
        fprintf(stderr, "gonio: %s: %zu negative values %s (first at line %lld)\n", path, report->negatives,
                report->clamped > 0                  ? "raised to 0"
                : report->noise == report->negatives ? "within 5 sigma of 0 kept, as noise about zero"
                                                     : "kept",
                report->first_negative_line);
    }
    if (report->invalid > 0) {
        fprintf(stderr, "gonio: %s: %zu of %zu entries are not valid and left out\n", path, report->invalid,
                report->rows);
    }
    for (const char *note = report->notes; *note != 0; note += strcspn(note, "\n"), note += *note == '\n') {
        fprintf(stderr, "gonio: %s: %.*s\n", path, (int)strcspn(note, "\n"), note);
    }
    if (report->open_end) {
        fprintf(stderr, "gonio: %s: its last line has no line end; is the file whole?\n", path);
    }
}

// A table with Gonio's own header and another convention is read in silence otherwise.
static void tell_mirror(const char *path, const gonio_samples *samples, const gonio_read_report *report) {
    double means[2];
    if (strcmp(report->format, "samples") == 0 && gonio_mirror_of_samples(samples, means) == 0) {
        fprintf(stderr,
                "gonio: %s: the largest values stand on the light's own side, at azimuth 0: a retro-reflector, or a "
                "table whose "
                "mirror direction is there (--columns auto --mirror-at 0)\n",
                path);
    }
}

bool cli_input_maps(const char *path, const cli_input *in) {
    const cli_common nothing = {0};
    const gonio_read_options options = options_of(in, &nothing);
    gonio_map map;
    const gonio_status status = gonio_map_load(path, &options, &map, NULL);
    gonio_map_free(&map);
    return status != GONIO_OK || map.applies;
}

// What was given, and what a map file told beside it, goes into INPUT.gonio-map.
static gonio_status keep_map(const char *path, const gonio_read_options *options, gonio_error *error) {
    gonio_map map;
    gonio_status status = gonio_map_load(path, options, &map, error);
    status = status == GONIO_OK ? gonio_map_save(path, &map.options, error) : status;
    gonio_map_free(&map);
    if (status == GONIO_OK) {
        fprintf(stderr, "gonio: %s: its mapping is kept in %s" GONIO_MAP_ENDING "\n", path, path);
    }
    return status;
}

gonio_status cli_input_read(const char *path, const cli_input *in, const cli_common *common, gonio_samples **out,
                            gonio_error *error) {
    gonio_read_report report;
    return cli_input_read_reported(path, in, common, out, &report, error);
}

gonio_status cli_input_read_reported(const char *path, const cli_input *in, const cli_common *common,
                                     gonio_samples **out, gonio_read_report *report, gonio_error *error) {
    *out = NULL;
    gonio_status status;
    *report = (gonio_read_report){.format = "session"};
    if (gonio_session_is(path)) {
        status = cli_input_refuse(in, "a session", error);
        status = status == GONIO_OK ? gonio_session_read(path, out, error) : status;
    } else if (gonio_session_is_hdf5(path)) {
        status = cli_input_refuse(in, "a session", error);
        status = status == GONIO_OK ? cli_hdf5_read(path, out, error) : status;
        snprintf(report->format, sizeof report->format, "hdf5");
    } else {
        const gonio_read_options options = options_of(in, common);
        status = gonio_read(path, &options, out, report, error);
        if (status == GONIO_OK) {
            cli_input_tell(path, report);
            tell_mirror(path, *out, report);
            status = in->save_map ? keep_map(path, &options, error) : GONIO_OK;
        }
        if (status != GONIO_OK) {
            gonio_samples_free(*out);
            *out = NULL;
        }
    }
    // Of a Mueller matrix the reader has taken the wavelength already.
    const bool chosen = strcmp(report->format, "nist") == 0;
    const bool choose =
        in->channel != NULL || (in->wavelength > 0 && !chosen && status == GONIO_OK && (*out)->channels > 1);
    return status == GONIO_OK && choose ? choose_channel(path, in, out, error) : status;
}
