// SPDX-License-Identifier: BSD-3-Clause
// CEA's retro-reflection measurements (docs/formats.md): '#' lines, then theta_l, theta_v cos(dphi), theta_v sin(dphi)
// (rad) and a value (1/sr). dphi = 0 is the light's own side: the peak of a retro-reflector stands at theta_v = theta_l
// there.
#include <math.h>
#include <string.h>

#include "io/format.h"

#define MARK "#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI"

static bool recognise(const gonio_source *source) {
    const char *at = source->data + (strncmp(source->data, "\xef\xbb\xbf", 3) == 0 ? 3 : 0);
    char head[4097];
    snprintf(head, sizeof head, "%.4096s", at + strspn(at, " \t\r\n"));
    return head[0] == '#' && strstr(head, MARK) != NULL;
}

static gonio_status read_row(const gonio_text *text, char **fields, gonio_row_collector *collector,
                             gonio_error *error) {
    static const char *const names[4] = {"theta_l", "theta_v cos(dphi)", "theta_v sin(dphi)", "value"};
    double numbers[4];
    gonio_pair pair = {0};
    gonio_status status = GONIO_OK;
    for (int k = 0; k < 4 && status == GONIO_OK; k++) {
        status = k < 3 ? gonio_text_number(text, fields[k], names[k], &numbers[k], error)
                       : gonio_row_collector_number(collector, fields[k], names[k], &numbers[k], error);
    }
    status = status == GONIO_OK ? gonio_polar_rad(text, "theta_l", numbers[0], &pair.theta_i, error) : status;
    if (status == GONIO_OK) {
        status = gonio_polar_rad(text, "theta_v", hypot(numbers[1], numbers[2]), &pair.theta_o, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    pair.phi_o = pair.theta_o > 0 ? gonio_angle_canonical(atan2(numbers[2], numbers[1])) : 0;
    return gonio_row_collector_add(collector, &pair, &numbers[3], NULL, NULL, error);
}

// The files' own: #KEY VALUE. VS: columns of uncertainty behind the values, of which none is read.
static const gonio_declaration declarations[] = {{"PARAM_IN", "ISOTROPIC_TL_TV_PROJ_DPHI", GONIO_DECLARED_NOTHING},
                                                 {"PARAM_OUT", "INV_STERADIAN", GONIO_DECLARED_NOTHING},
                                                 {"PARAM_OUT", "INV_STERADIAN_COSINE_FACTOR", GONIO_DECLARED_COSINE},
                                                 {"DIM", "3 1", GONIO_DECLARED_NOTHING},
                                                 {"VS", "0", GONIO_DECLARED_NOTHING},
                                                 {"radian", NULL, GONIO_DECLARED_NOTHING},
                                                 {"angle_units", "radian|radians|rad", GONIO_DECLARED_NOTHING},
                                                 {0}};

static gonio_status read_retro(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                               gonio_read_report *report, gonio_error *error) {
    gonio_text text = gonio_text_begin(source->path, source->data, source->size);
    gonio_row_collector collector;
    gonio_status status = gonio_row_collector_begin(&collector, &text, source, values, declarations, "retro", error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_row_collector_room(&collector, 1, false, error);
    if (status == GONIO_OK) {
        strcpy(collector.samples->channel_names[0], "value");
    }
    for (char *line; status == GONIO_OK && (line = gonio_text_content(&text)) != NULL;) {
        char *fields[4];
        const int n = gonio_text_split(line, ' ', fields, 4);
        status = n == 4 ? read_row(&text, fields, &collector, error)
                        : gonio_text_fail(&text, error, "expected 4 numbers, found %d", n);
    }
    return gonio_row_collector_end(&collector, status, out, report, error);
}

static const gonio_format_option options[] = {GONIO_TEXT_OPTIONS, {0}};

const gonio_format gonio_format_retro = {.name = "retro",
                                         .summary = "CEA retro-reflection text",
                                         .extensions = ".dat",
                                         .recognise = recognise,
                                         .read = read_retro,
                                         .options = options};
