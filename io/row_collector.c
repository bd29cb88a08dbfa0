// SPDX-License-Identifier: BSD-3-Clause
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/mueller.h"
#include "base/number.h"
#include "gonio/plan.h"
#include "io/columns.h"
#include "io/format.h"

static bool name_is_sound(const char *name) {
    const size_t length = strnlen(name, GONIO_CHANNEL_NAME_MAX);
    if (length == 0 || length == GONIO_CHANNEL_NAME_MAX || strncmp(name, "sigma_", 6) == 0 ||
        strcmp(name, GONIO_COLUMN_GROUP) == 0 ||
        (gonio_column_role_of(name) != GONIO_COLUMN_CHANNEL && gonio_column_role_of(name) != GONIO_COLUMN_UNKNOWN)) {
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

// Would a samples file take d for the uncertainty of c?
static bool is_sigma_of(const char *d, const char *c) {
    size_t length;
    const char *channel = gonio_column_sigma_of(d, &length);
    return channel != NULL && strlen(c) == length && strncmp(c, channel, length) == 0;
}

gonio_status gonio_channel_names_check(const char *path, const char (*names)[GONIO_CHANNEL_NAME_MAX], int n,
                                       gonio_error *error) {
    for (int c = 0; c < n; c++) {
        if (!name_is_sound(names[c])) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "channel %d: '%.31s' is no name of f_r in 1/sr",
                                   c + 1, names[c]);
        }
        for (int d = 0; d < n; d++) {
            if (d < c && strcmp(names[c], names[d]) == 0) {
                return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "channels %d and %d are both named '%s'", d + 1,
                                       c + 1, names[c]);
            }
            if (is_sigma_of(names[d], names[c])) {
                return gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                                       "channel %d: '%s' is the uncertainty of '%s' by its name", d + 1, names[d],
                                       names[c]);
            }
        }
    }
    return GONIO_OK;
}

static void parse_missing(const gonio_format_values *values, const gonio_declared *declared, gonio_missing *missing) {
    const char *text = values->at[GONIO_TEXT_MISSING].text;
    char *end;
    *missing = (gonio_missing){.automatic = strcmp(text, "auto") == 0};
    if (missing->automatic && declared->has_missing) {
        *missing = (gonio_missing){.has_number = true, .number = declared->missing};
    } else if (!missing->automatic && strcmp(text, "none") != 0) {
        missing->number = gonio_number_parse(text, &end);
        missing->has_number = end != text && *end == 0 && isfinite(missing->number);
        missing->word = missing->has_number ? NULL : text;
    }
}

gonio_status gonio_row_collector_begin(gonio_row_collector *collector, gonio_text *text, const gonio_source *source,
                                       const gonio_format_values *values, const gonio_declaration *own,
                                       const char *format, gonio_error *error) {
    *collector = (gonio_row_collector){
        .text = text, .policy = (gonio_negatives)values->at[GONIO_TEXT_NEGATIVES].choice, .declared = {.factor = 1}};
    collector->report.first_negative_line = -1;
    collector->report.open_end = text->next < text->end && text->end[-1] != '\n';
    snprintf(collector->report.format, sizeof collector->report.format, "%s", format);
    gonio_status status = values->at[GONIO_TEXT_DECLARED].choice == 0
                              ? gonio_declarations_read(source, own, &collector->declared, error)
                              : GONIO_OK;
    collector->declared.transmission |= values->at[GONIO_TEXT_TRANSMISSION].choice == 1;
    if (status == GONIO_OK && own != NULL) { // the others tell their halves themselves
        status = gonio_declarations_transmit(source, &collector->declared, error);
    }
    text->transmission = collector->declared.transmission;
    parse_missing(values, &collector->declared, &collector->missing);
    return status;
}

gonio_status gonio_row_collector_number(const gonio_row_collector *collector, const char *field, const char *what,
                                        double *value, gonio_error *error) {
    if (collector->missing.word != NULL && strcasecmp(field, collector->missing.word) == 0) {
        *value = NAN;
        return GONIO_OK;
    }
    return gonio_text_number(collector->text, field, what, value, error);
}

static bool is_signed(const gonio_row_collector *collector, int channel) {
    return collector->is_signed != NULL && collector->is_signed[channel];
}

gonio_status gonio_row_collector_named(gonio_row_collector *collector, gonio_error *error) {
    const gonio_samples *s = collector->samples;
    collector->is_signed = malloc((size_t)s->channels * sizeof *collector->is_signed);
    if (collector->is_signed == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the channels");
    }
    gonio_mueller_signed((const char(*)[GONIO_CHANNEL_NAME_MAX])s->channel_names, s->channels, collector->is_signed);
    return GONIO_OK;
}

static bool accepts(const gonio_row_collector *collector, double value, double sigma) {
    return collector->policy == GONIO_NEGATIVES_CLAMP || collector->policy == GONIO_NEGATIVES_KEEP ||
           (collector->policy == GONIO_NEGATIVES_NOISE && -value <= GONIO_NOISE_SIGMAS * sigma);
}

static void refuse_value(gonio_row_collector *collector, long long line, int channel, double value, double sigma,
                         size_t count) {
    if (collector->refused == 0 || line < collector->refused_line) {
        collector->refused_line = line;
        collector->refused_channel = channel;
        collector->refused_value = value;
        collector->refused_sigma = sigma;
    }
    collector->refused += count;
}

static void note_negative(gonio_row_collector *collector, int channel, double value, double sigma) {
    if (collector->report.negatives++ == 0) {
        collector->report.first_negative_line = collector->text->line;
    }
    collector->report.noise += -value <= GONIO_NOISE_SIGMAS * sigma;
    if (!accepts(collector, value, sigma)) {
        refuse_value(collector, collector->text->line, channel, value, sigma, 1);
    }
}

static bool is_in(const double *numbers, double value) {
    while (*numbers != 0 && *numbers != value) {
        numbers++;
    }
    return *numbers != 0;
}

// Is it a number that instruments and programs write where they have none?
static bool is_sentinel(const gonio_row_collector *collector, double value, double sigma) {
    // SCPI's not-a-number and infinity, netCDF's and other fills, the largest floats as printed.
    static const double huge[] = {9.9e37,
                                  9.91e37,
                                  1e30,
                                  1e31,
                                  1e32,
                                  1e33,
                                  1e34,
                                  1e35,
                                  1e36,
                                  1e37,
                                  1e38,
                                  9.96921e36,
                                  9.969209968386869e36,
                                  3.4e38,
                                  3.4028e38,
                                  3.40282e38,
                                  3.402823e38,
                                  3.4028235e38,
                                  3.402823466e38,
                                  3.4028234663852886e38,
                                  1.7976931348623157e308,
                                  0};
    static const double negative[] = {-1, -9, -99, -999, -9999, -99999, -32768, 0};
    if (!collector->missing.automatic) {
        return false;
    }
    return is_in(huge, fabs(value)) ||
           (is_in(negative, value) && collector->policy == GONIO_NEGATIVES_NOISE && !accepts(collector, value, sigma));
}

static void note_missing(gonio_row_collector *collector, double number, int channel, double sigma) {
    gonio_missing *m = &collector->missing;
    int k = 0;
    while (k < m->n_found && m->found[k].number != number && !(isnan(number) && isnan(m->found[k].number))) {
        k++;
    }
    if (k == m->n_found && k + 1 < (int)(sizeof m->found / sizeof *m->found)) {
        m->found[m->n_found++].number = number;
        m->found[k].line = collector->text->line;
        m->found[k].channel = channel;
        m->found[k].sigma = sigma;
    }
    m->found[k < m->n_found ? k : m->n_found - 1].count++;
}

// Does the row hold a value that is none? Then it is counted and left out.
static bool leaves_out(gonio_row_collector *collector, const double *values, const double *random,
                       const double *systematic) {
    const gonio_missing *m = &collector->missing;
    for (int c = 0; c < collector->samples->channels; c++) {
        const double sigma = random != NULL ? hypot(random[c], systematic[c]) : (double)NAN;
        const bool natural = is_signed(collector, c) && fabs(values[c]) < 9;
        if (isnan(values[c]) || (m->has_number && values[c] == m->number) ||
            (!natural && is_sentinel(collector, values[c], sigma))) {
            note_missing(collector, values[c], c, sigma);
            return true;
        }
    }
    return false;
}

static gonio_status note_line(gonio_row_collector *collector, gonio_error *error) {
    const size_t n = collector->samples->n;
    if (n == collector->lines_capacity) {
        const size_t larger = 2 * n + 256;
        long long *lines = realloc(collector->lines, larger * sizeof *lines);
        if (lines == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu rows", larger);
        }
        collector->lines = lines;
        collector->lines_capacity = larger;
    }
    collector->lines[n] = collector->text->line;
    return GONIO_OK;
}

// At the horizon f_r cos(theta_o) says nothing of f_r.
#define COSINE_MIN 1e-6

gonio_status gonio_row_collector_add(gonio_row_collector *collector, const gonio_pair *pair, double *values,
                                     const double *sigma_random, const double *sigma_systematic, gonio_error *error) {
    const int channels = collector->samples->channels;
    if (leaves_out(collector, values, sigma_random, sigma_systematic)) {
        return GONIO_OK;
    }
    const double divisor = (collector->declared.cosine ? fabs(cos(pair->theta_o)) : 1) * collector->declared.factor;
    if (divisor < COSINE_MIN) {
        collector->horizon++;
        return GONIO_OK;
    }
    double *sigmas = collector->sigmas;
    for (int c = 0; c < channels; c++) {
        values[c] /= divisor;
        if (sigma_random != NULL) {
            sigmas[c] = sigma_random[c] / divisor;
            sigmas[channels + c] = sigma_systematic[c] / divisor;
        }
        if (values[c] < 0 && !is_signed(collector, c)) {
            note_negative(collector, c, values[c],
                          sigma_random != NULL ? hypot(sigmas[c], sigmas[channels + c]) : (double)NAN);
            if (collector->policy == GONIO_NEGATIVES_CLAMP) {
                values[c] = 0;
                collector->report.clamped++;
            }
        }
    }
    collector->report.rows++;
    const gonio_status status = note_line(collector, error);
    const bool with = sigma_random != NULL;
    return status == GONIO_OK ? gonio_samples_add(collector->samples, pair, values, with ? sigmas : NULL,
                                                  with ? sigmas + channels : NULL, error)
                              : status;
}

static gonio_status refuse(const gonio_row_collector *collector, gonio_error *error) {
    char beyond[64] = "", sigma[48] = "";
    if (collector->policy == GONIO_NEGATIVES_NOISE && isfinite(collector->refused_sigma)) {
        snprintf(beyond, sizeof beyond, " more than %d sigma below 0", GONIO_NOISE_SIGMAS);
        snprintf(sigma, sizeof sigma, " with sigma %g", collector->refused_sigma);
    }
    return gonio_fail_line(
        error, GONIO_E_INPUT, collector->text->path, collector->refused_line,
        "%zu negative values%s, the first here: %s = %g%s; `--negatives clamp` raises them to 0, "
        "`--negatives keep` takes them as they are, `--missing %.10g` leaves out the rows of that value",
        collector->refused, beyond, collector->samples->channel_names[collector->refused_channel],
        collector->refused_value, sigma, collector->refused_value);
}

// A single -1 is a negative value like any other; said twice it stands for something.
static void settle_missing(gonio_row_collector *collector) {
    gonio_missing *m = &collector->missing;
    int kept = 0;
    for (int k = 0; k < m->n_found; k++) {
        if (m->automatic && m->found[k].count == 1 && fabs(m->found[k].number) < 10) {
            refuse_value(collector, m->found[k].line, m->found[k].channel, m->found[k].number, m->found[k].sigma, 1);
        } else {
            m->found[kept++] = m->found[k];
        }
    }
    m->n_found = kept;
}

static void tell(gonio_row_collector *collector) {
    char *notes = collector->report.notes;
    const size_t size = sizeof collector->report.notes;
    for (int k = 0; k < collector->missing.n_found; k++) {
        char number[32] = "NaN";
        if (!isnan(collector->missing.found[k].number)) {
            gonio_text_shortest(collector->missing.found[k].number, number);
        }
        gonio_text_append(notes, size,
                          "%zu rows with %s, which stands for a missing value, are left out (the first at "
                          "line %lld)\n",
                          collector->missing.found[k].count,
                          !isnan(collector->missing.found[k].number) ? number
                          : collector->missing.word != NULL          ? collector->missing.word
                                                                     : "an empty field",
                          collector->missing.found[k].line);
    }
    if (collector->by_mapping && collector->horizon > 0) {
        gonio_text_append(notes, size, "%zu rows at the horizon, where f_r cos(theta_o) says nothing, are left out\n",
                          collector->horizon);
    } else if (collector->declared.cosine && !collector->by_mapping) {
        gonio_text_append(notes, size,
                          "its values are declared to hold cos(theta_o) and were divided by it; %zu rows at "
                          "the horizon are left out\n",
                          collector->horizon);
    }
    if (collector->declared.factor != 1 && !collector->by_mapping) {
        gonio_text_append(notes, size, "its values are declared as reflectance factors and were divided by pi\n");
    }
}

gonio_status gonio_row_collector_room(gonio_row_collector *collector, int channels, bool with_sigma,
                                      gonio_error *error) {
    collector->sigmas = malloc(2 * (size_t)channels * sizeof *collector->sigmas);
    const gonio_status status = gonio_samples_new(channels, with_sigma, &collector->samples, error);
    if (status == GONIO_OK && collector->sigmas == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
    }
    if (status == GONIO_OK) {
        collector->samples->isotropic = !collector->declared.anisotropic;
        collector->samples->head = collector->declared.head;
        collector->declared.head = NULL;
        collector->samples->transmission = collector->declared.transmission;
    }
    return status;
}

// A table of transmission alone may count theta_o from the normal of the side where the light leaves: then none is
// beyond 90 deg, and there is no other reading.
static void turn_through(gonio_row_collector *collector) {
    gonio_samples *s = collector->samples;
    if (!collector->declared.through || s == NULL || gonio_pairs_transmit(s->pairs, s->n)) {
        return;
    }
    for (size_t i = 0; i < s->n; i++) {
        s->pairs[i] = gonio_pair_lowered(s->pairs[i], GONIO_TRANSMISSION);
    }
    gonio_text_append(collector->report.notes, sizeof collector->report.notes,
                      "it declares transmission, and every theta_o is up to 90 deg: taken from the normal of the side "
                      "where the light leaves\n");
}

gonio_status gonio_row_collector_end(gonio_row_collector *collector, gonio_status status, gonio_samples **out,
                                     gonio_read_report *report, gonio_error *error) {
    settle_missing(collector);
    // Rows that the reader itself left out, below the horizon, count as rows and are no samples.
    if (status == GONIO_OK && (collector->samples == NULL || collector->samples->n == 0) && collector->refused == 0) {
        status = gonio_text_fail(collector->text, error, "no samples in it");
    }
    status = status == GONIO_OK && collector->refused > 0 ? refuse(collector, error) : status;
    if (status == GONIO_OK) {
        tell(collector);
        turn_through(collector);
        status = gonio_repeats_look(collector->samples, collector->lines, collector->report.notes,
                                    sizeof collector->report.notes, error);
    }
    if (status == GONIO_OK) {
        status = gonio_missing_look(&collector->samples, collector->lines, collector->missing.automatic,
                                    collector->report.notes, sizeof collector->report.notes, error);
    }
    if (report != NULL) {
        *report = collector->report;
    }
    if (status != GONIO_OK) {
        gonio_samples_free(collector->samples);
        collector->samples = NULL;
    }
    free(collector->lines);
    free(collector->sigmas);
    free(collector->is_signed);
    free(collector->declared.head);
    free(collector->declared.channels);
    *out = collector->samples;
    return status;
}

gonio_status gonio_polar_rad(const gonio_text *text, const char *what, double rad, double *theta, gonio_error *error) {
    const double horizon = GONIO_PI / 2, rounding = 1e-6; // files give six decimals
    if (!(rad >= 0 && rad <= horizon * (text->transmission ? 2 : 1) + rounding)) {
        return gonio_text_fail(text, error, "%s: expected 0 to %s radians, found %.9g", what,
                               text->transmission ? "pi" : "pi/2", rad);
    }
    *theta = gonio_angle_canonical(rad <= horizon + rounding ? fmin(rad, horizon) : fmin(rad, GONIO_PI));
    return GONIO_OK;
}
