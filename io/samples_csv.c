// SPDX-License-Identifier: BSD-3-Clause
// Gonio's own samples file, read and written (docs/formats.md).
//
//   theta_i,phi_i,theta_o,phi_o,<channels...>[,sigma_<channel>...]
//       [,sigma_random_<channel>...,sigma_systematic_<channel>...[,systematic_group]]
//
// Angles in degrees, f_r in 1/sr. sigma_<channel> is the combined standard uncertainty. The two parts follow where the
// systematic one is not zero throughout; a reader takes them then and the combined one only where they are missing. The
// systematic part is common to the rows of one systematic_group: sets of several sessions have several. The comment
// "# anisotropic" says that the geometry does not reduce to the difference of azimuths.
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "io/format.h"

#define COLUMNS_MAX (4 + 4 * GONIO_CHANNELS_MAX + 1)
#define GROUP "systematic_group"
#define ANISOTROPIC "# anisotropic"

// Where each channel's columns stand; -1: absent.
typedef struct layout {
    int columns, channels;
    int sigma[GONIO_CHANNELS_MAX], random[GONIO_CHANNELS_MAX], systematic[GONIO_CHANNELS_MAX];
    bool with_sigma, with_parts, with_group; // the group is the last column
} layout;

// A header that holds one of the angles: what else is wrong with it, this reader says best.
static bool recognise(const gonio_source *source) {
    long long number;
    static const char *const angles[] = {"theta_i", "phi_i", "theta_o", "phi_o"};
    char line[256];
    const char *first = gonio_source_first_line(source, line, sizeof line, &number);
    if (strncasecmp(first, "VARS", 4) == 0) {
        return false; // ASTM's
    }
    for (size_t k = 0; k < sizeof angles / sizeof *angles; k++) {
        if (strstr(first, angles[k]) != NULL) {
            return true;
        }
    }
    return false;
}

// ---- reading ----

static int find_channel(char *const *fields, int channels, const char *name) {
    for (int c = 0; c < channels; c++) {
        if (strcmp(fields[4 + c], name) == 0) {
            return c;
        }
    }
    return -1;
}

static const char *after(const char *field, const char *prefix) {
    const size_t length = strlen(prefix);
    return strncmp(field, prefix, length) == 0 ? field + length : NULL;
}

static gonio_status check_channels(const gonio_text *text, char *const *fields, int channels, gonio_error *error) {
    if (channels < 1 || channels > GONIO_CHANNELS_MAX) {
        return gonio_text_fail(text, error, "%d value columns after phi_o; expected 1 to %d", channels,
                               GONIO_CHANNELS_MAX);
    }
    for (int c = 0; c < channels; c++) {
        const char *name = fields[4 + c];
        if (name[0] == 0 || strlen(name) >= GONIO_CHANNEL_NAME_MAX) {
            return gonio_text_fail(text, error,
                                   "column %d: expected a channel name of 1 to %d characters, found '%.60s'", 5 + c,
                                   GONIO_CHANNEL_NAME_MAX - 1, name);
        }
        if (find_channel(fields, c, name) >= 0) {
            return gonio_text_fail(text, error, "channel '%s' stands twice in the header", name);
        }
    }
    return GONIO_OK;
}

// The header's fields -> the layout.
static gonio_status parse_header(const gonio_text *text, char **fields, int columns, layout *l, gonio_error *error) {
    if (!gonio_text_is_pair_header(fields, columns)) {
        return gonio_text_fail(
            text, error, "expected a header that begins with " GONIO_PAIR_HEADER ", found '%.60s' first", fields[0]);
    }
    *l = (layout){.columns = columns};
    while (4 + l->channels < columns && after(fields[4 + l->channels], "sigma_") == NULL) {
        l->channels++;
    }
    gonio_status status = check_channels(text, fields, l->channels, error);
    if (status != GONIO_OK) {
        return status;
    }
    int *const lists[3] = {l->random, l->systematic, l->sigma};
    static const char *const prefixes[3] = {"sigma_random_", "sigma_systematic_", "sigma_"};
    int found[3] = {0};
    memset(l->sigma, -1, sizeof l->sigma);
    memset(l->random, -1, sizeof l->random);
    memset(l->systematic, -1, sizeof l->systematic);
    l->with_group = columns > 4 + 3 * l->channels && strcmp(fields[columns - 1], GROUP) == 0;
    for (int k = 4 + l->channels; k < columns - l->with_group; k++) {
        int list = 0, channel = -1;
        for (; list < 3 && channel < 0; list++) {
            const char *name = after(fields[k], prefixes[list]);
            channel = name != NULL ? find_channel(fields, l->channels, name) : -1;
        }
        if (channel < 0 || lists[list - 1][channel] >= 0) {
            return gonio_text_fail(text, error, "column %d: expected sigma_<channel> of a channel once, found '%.60s'",
                                   k + 1, fields[k]);
        }
        lists[list - 1][channel] = k;
        found[list - 1]++;
    }
    for (int list = 0; list < 3; list++) {
        if (found[list] != 0 && found[list] != l->channels) {
            return gonio_text_fail(text, error, "%s columns for %d of %d channels; expected all or none",
                                   prefixes[list], found[list], l->channels);
        }
    }
    l->with_parts = found[0] > 0 && found[1] > 0;
    l->with_sigma = l->with_parts || found[2] > 0;
    if (!l->with_sigma && found[0] + found[1] > 0) {
        return gonio_text_fail(text, error, "sigma_random_ and sigma_systematic_ columns must stand together");
    }
    return l->with_group && !l->with_parts
               ? gonio_text_fail(text, error, GROUP ": of what is common to a group sigma_systematic_ columns tell")
               : GONIO_OK;
}

// The group of the sample that was read last.
static gonio_status parse_group(const gonio_text *text, const char *field, gonio_samples *samples, gonio_error *error) {
    size_t group;
    if (!gonio_text_count(field, &group) || group < 1 || group > UINT16_MAX) {
        return gonio_text_fail(text, error, GROUP ": expected 1 to %d, found '%.60s'", UINT16_MAX, field);
    }
    return gonio_samples_set_group(samples, samples->n - 1, (uint16_t)group, error);
}

static gonio_status parse_sigma(const gonio_text *text, const char *field, double *sigma, gonio_error *error) {
    const gonio_status status = gonio_text_number(text, field, "sigma", sigma, error);
    if (status == GONIO_OK && *sigma < 0) {
        return gonio_text_fail(text, error, "sigma: expected 0 or more, found %s", field);
    }
    return status;
}

// One row's numbers; values, random, systematic have room for every channel.
static gonio_status parse_row(const gonio_text *text, char **fields, const layout *l, char (*names)[32],
                              gonio_pair *pair, double *values, double *random, double *systematic,
                              gonio_error *error) {
    gonio_status status = gonio_text_pair(text, fields, pair, error);
    for (int c = 0; c < l->channels && status == GONIO_OK; c++) {
        status = gonio_text_number(text, fields[4 + c], names[c], &values[c], error);
        if (status == GONIO_OK && l->with_sigma) {
            systematic[c] = 0;
            status = parse_sigma(text, fields[l->with_parts ? l->random[c] : l->sigma[c]], &random[c], error);
        }
        if (status == GONIO_OK && l->with_parts) {
            status = parse_sigma(text, fields[l->systematic[c]], &systematic[c], error);
        }
    }
    return status;
}

static gonio_status read_rows(gonio_text *text, char **fields, const layout *l, gonio_row_collector *collector,
                              gonio_error *error) {
    double *numbers = malloc(3 * (size_t)l->channels * sizeof *numbers);
    if (numbers == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
    }
    double *random = numbers + l->channels, *systematic = random + l->channels;
    gonio_status status = GONIO_OK;
    for (char *line; status == GONIO_OK && (line = gonio_text_row(text)) != NULL;) {
        const int n = gonio_text_split(line, ',', fields, COLUMNS_MAX);
        gonio_pair pair;
        if (n != l->columns) {
            status = gonio_text_fail(text, error, "expected %d columns as in the header, found %d", l->columns, n);
        } else {
            status = parse_row(text, fields, l, collector->samples->channel_names, &pair, numbers, random, systematic,
                               error);
        }
        if (status == GONIO_OK) {
            const bool sigma = l->with_sigma;
            status = gonio_row_collector_add(collector, &pair, numbers, sigma ? random : NULL,
                                             sigma ? systematic : NULL, error);
        }
        if (status == GONIO_OK && l->with_group) {
            status = parse_group(text, fields[n - 1], collector->samples, error);
        }
    }
    free(numbers);
    return status;
}

// Up to the header; *anisotropic tells whether the comment was seen.
static char *find_header(gonio_text *text, bool *anisotropic) {
    char *line;
    *anisotropic = false;
    while ((line = gonio_text_line(text)) != NULL && (line[0] == 0 || line[0] == '#')) {
        *anisotropic = *anisotropic || strcmp(line, ANISOTROPIC) == 0;
    }
    return gonio_text_commas(line);
}

static gonio_status read_with(gonio_text *text, char **fields, layout *l, gonio_row_collector *collector,
                              gonio_error *error) {
    bool anisotropic;
    char *header = find_header(text, &anisotropic);
    if (header == NULL) {
        return gonio_text_fail(text, error, "no header; expected " GONIO_PAIR_HEADER ",...");
    }
    const int columns = gonio_text_split(header, ',', fields, COLUMNS_MAX);
    if (columns > COLUMNS_MAX) {
        return gonio_text_fail(text, error, "%d columns; at most %d are read", columns, COLUMNS_MAX);
    }
    gonio_status status = parse_header(text, fields, columns, l, error);
    status = status == GONIO_OK ? gonio_samples_new(l->channels, l->with_sigma, &collector->samples, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    collector->samples->isotropic = !anisotropic;
    for (int c = 0; c < l->channels; c++) {
        if (!gonio_text_is_printable(fields[4 + c])) {
            return gonio_text_fail(text, error, "column %d: found a control character in its name", 5 + c);
        }
        snprintf(collector->samples->channel_names[c], GONIO_CHANNEL_NAME_MAX, "%s", fields[4 + c]);
    }
    return read_rows(text, fields, l, collector, error);
}

static gonio_status read_samples(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                                 gonio_read_report *report, gonio_error *error) {
    char **fields = malloc(COLUMNS_MAX * sizeof *fields);
    layout *l = malloc(sizeof *l);
    gonio_text text = gonio_text_begin(source->path, source->data, source->size);
    gonio_row_collector collector = gonio_row_collector_begin(&text, (gonio_negatives)values->at[0].choice, "samples");
    gonio_status status = GONIO_OK;
    if (fields == NULL || l == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", source->path);
    } else {
        status = read_with(&text, fields, l, &collector, error);
    }
    free(l);
    free(fields);
    return gonio_row_collector_end(&collector, status, out, report, error);
}

// ---- writing ----

static void put_number(FILE *stream, double value) {
    char text[32];
    gonio_text_shortest(value, text);
    fputc(',', stream);
    fputs(text, stream);
}

static bool has_systematic(const gonio_samples *s) {
    for (size_t i = 0; s->sigma_systematic != NULL && i < s->n * (size_t)s->channels; i++) {
        if (s->sigma_systematic[i] != 0) {
            return true;
        }
    }
    return false;
}

static void put_header(const gonio_samples *s, bool systematic, FILE *stream) {
    if (!s->isotropic) {
        fputs(ANISOTROPIC "\n", stream);
    }
    fputs(GONIO_PAIR_HEADER, stream);
    static const char *const prefixes[4] = {"", "sigma_", "sigma_random_", "sigma_systematic_"};
    const int groups = s->sigma_random == NULL ? 1 : systematic ? 4 : 2;
    for (int group = 0; group < groups; group++) {
        for (int c = 0; c < s->channels; c++) {
            fprintf(stream, ",%s%s", prefixes[group], s->channel_names[c]);
        }
    }
    fputs(systematic && s->group != NULL ? "," GROUP : "", stream);
    fputc('\n', stream);
}

static void put_row(const gonio_samples *s, size_t i, bool systematic, FILE *stream) {
    const gonio_pair *p = &s->pairs[i];
    const size_t at = i * (size_t)s->channels;
    char text[32];
    gonio_text_shortest(gonio_degrees(p->theta_i), text);
    fputs(text, stream);
    put_number(stream, gonio_degrees(p->phi_i));
    put_number(stream, gonio_degrees(p->theta_o));
    put_number(stream, gonio_degrees(p->phi_o));
    for (int c = 0; c < s->channels; c++) {
        put_number(stream, s->values[at + (size_t)c]);
    }
    for (int c = 0; c < s->channels && s->sigma_random != NULL; c++) {
        put_number(stream, gonio_samples_sigma(s, i, c));
    }
    for (int c = 0; c < s->channels && systematic; c++) {
        put_number(stream, s->sigma_random[at + (size_t)c]);
    }
    for (int c = 0; c < s->channels && systematic; c++) {
        put_number(stream, s->sigma_systematic[at + (size_t)c]);
    }
    if (systematic && s->group != NULL) {
        fprintf(stream, ",%u", (unsigned)s->group[i]);
    }
    fputc('\n', stream);
}

static gonio_status write_samples(const gonio_samples *samples, FILE *stream, gonio_error *error) {
    const gonio_status status = gonio_channel_names_check(
        NULL, (const char(*)[GONIO_CHANNEL_NAME_MAX])samples->channel_names, samples->channels, error);
    if (status != GONIO_OK) {
        return status;
    }
    const bool systematic = has_systematic(samples);
    put_header(samples, systematic, stream);
    for (size_t i = 0; i < samples->n && !ferror(stream); i++) {
        put_row(samples, i, systematic, stream);
    }
    return GONIO_OK;
}

static const gonio_format_option options[] = {GONIO_OPTION_NEGATIVES, {0}};

const gonio_format gonio_format_samples = {.name = "samples",
                                           .summary = "samples CSV (header " GONIO_PAIR_HEADER ",...)",
                                           .extensions = ".csv",
                                           .recognise = recognise,
                                           .read = read_samples,
                                           .write = write_samples,
                                           .options = options};
