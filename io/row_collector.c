// SPDX-License-Identifier: BSD-3-Clause
#include <math.h>
#include <string.h>

#include "io/format.h"

static bool name_is_sound(const char *name) {
    const size_t length = strnlen(name, GONIO_CHANNEL_NAME_MAX);
    if (length == 0 || length == GONIO_CHANNEL_NAME_MAX || strncmp(name, "sigma_", 6) == 0) {
        return false;
    }
    for (size_t k = 0; k < length; k++) {
        const unsigned char c = (unsigned char)name[k];
        if (c < ' ' || c == 127 || c == ',' || c == '"' || (c == ' ' && (k == 0 || k + 1 == length))) {
            return false;
        }
    }
    return true;
}

gonio_status gonio_channel_names_check(const char *path, const char (*names)[GONIO_CHANNEL_NAME_MAX], int n,
                                       gonio_error *error) {
    for (int c = 0; c < n; c++) {
        if (!name_is_sound(names[c])) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                                   "channel %d: the name '%.31s' cannot stand in a header", c + 1, names[c]);
        }
        for (int d = 0; d < c; d++) {
            if (strcmp(names[c], names[d]) == 0) {
                return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "channels %d and %d are both named '%s'", d + 1,
                                       c + 1, names[c]);
            }
        }
    }
    return GONIO_OK;
}

gonio_row_collector gonio_row_collector_begin(const gonio_text *text, gonio_negatives policy, const char *format) {
    gonio_row_collector collector = {.text = text, .policy = policy};
    collector.report.first_negative_line = -1;
    collector.report.open_end = text->next < text->end && text->end[-1] != '\n';
    snprintf(collector.report.format, sizeof collector.report.format, "%s", format);
    return collector;
}

static void note_negative(gonio_row_collector *collector, int channel, double value, double sigma) {
    const bool noise = -value <= GONIO_NOISE_SIGMAS * sigma;
    if (collector->report.negatives++ == 0) {
        collector->report.first_negative_line = collector->text->line;
    }
    collector->report.noise += noise;
    const bool accepted = collector->policy == GONIO_NEGATIVES_CLAMP || collector->policy == GONIO_NEGATIVES_KEEP ||
                          (collector->policy == GONIO_NEGATIVES_NOISE && noise);
    if (!accepted && collector->refused++ == 0) {
        collector->refused_line = collector->text->line;
        collector->refused_channel = channel;
        collector->refused_value = value;
        collector->refused_sigma = sigma;
    }
}

gonio_status gonio_row_collector_add(gonio_row_collector *collector, const gonio_pair *pair, double *values,
                                     const double *sigma_random, const double *sigma_systematic, gonio_error *error) {
    for (int c = 0; c < collector->samples->channels; c++) {
        if (values[c] < 0) {
            note_negative(collector, c, values[c],
                          sigma_random != NULL ? hypot(sigma_random[c], sigma_systematic[c]) : (double)NAN);
            if (collector->policy == GONIO_NEGATIVES_CLAMP) {
                values[c] = 0;
                collector->report.clamped++;
            }
        }
    }
    collector->report.rows++;
    return gonio_samples_add(collector->samples, pair, values, sigma_random, sigma_systematic, error);
}

static gonio_status refuse(const gonio_row_collector *collector, gonio_error *error) {
    char beyond[64] = "", sigma[48] = "";
    if (collector->policy == GONIO_NEGATIVES_NOISE && isfinite(collector->refused_sigma)) {
        snprintf(beyond, sizeof beyond, " more than %d sigma below 0", GONIO_NOISE_SIGMAS);
        snprintf(sigma, sizeof sigma, " with sigma %g", collector->refused_sigma);
    }
    return gonio_fail_line(error, GONIO_E_INPUT, collector->text->path, collector->refused_line,
                           "%zu negative values%s, the first here: %s = %g%s; `--negatives clamp` raises them to 0, "
                           "`--negatives keep` takes them as they are",
                           collector->refused, beyond, collector->samples->channel_names[collector->refused_channel],
                           collector->refused_value, sigma);
}

gonio_status gonio_row_collector_end(gonio_row_collector *collector, gonio_status status, gonio_samples **out,
                                     gonio_read_report *report, gonio_error *error) {
    if (status == GONIO_OK && collector->report.rows == 0) {
        status = gonio_text_fail(collector->text, error, "no samples in it");
    }
    status = status == GONIO_OK && collector->refused > 0 ? refuse(collector, error) : status;
    if (report != NULL) {
        *report = collector->report;
    }
    if (status != GONIO_OK) {
        gonio_samples_free(collector->samples);
        collector->samples = NULL;
    }
    *out = collector->samples;
    return status;
}

gonio_status gonio_polar_rad(const gonio_text *text, const char *what, double rad, double *theta, gonio_error *error) {
    const double horizon = GONIO_PI / 2, rounding = 1e-6; // files give six decimals
    if (!(rad >= 0 && rad <= horizon + rounding)) {
        return gonio_text_fail(text, error, "%s: expected 0 to pi/2 radians, found %.9g", what, rad);
    }
    *theta = gonio_angle_canonical(fmin(rad, horizon));
    return GONIO_OK;
}
