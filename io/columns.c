// SPDX-License-Identifier: BSD-3-Clause
// A column is a channel only if it can be one: names of other things are never taken for a BRDF.
#include "io/columns.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

static const char *const wavelengths[] = {"wavelength", "wavelengths", "lambda", "wl", "wvl", "wave", "nm", "um", NULL};
static const char *const sigmas[] = {"std",
                                     "stdev",
                                     "stddev",
                                     "sd",
                                     "unc",
                                     "uncertainty",
                                     "err",
                                     "error",
                                     "sigma",
                                     "u",
                                     "sem",
                                     "standarddeviation",
                                     "standarduncertainty",
                                     NULL};
static const char *const asides[] = {
    "id",       "index",    "idx",      "no",        "nr",    "row",         "sample",   "name",       "date",
    "time",     "utc",      "stamp",    "timestamp", "temp",  "temperature", "humidity", "rh",         "operator",
    "comment",  "note",     "notes",    "remark",    "run",   "repeat",      "scan",     "step",       "frame",
    "file",     "filename", "exposure", "gain",      "flag",  "flags",       "quality",  "instrument", "detector",
    "count",    "weight",   "dphi",     "phi",       "theta", "azimuth",     "zenith",   "aspecular",  "scattering",
    "pressure", "lamp",     "current",  NULL};
static const char *const foreign[] = {"percent", "pct",   "cos",     "cosine", "ccbrdf",        "btdf",       "brf",
                                      "log",     "log10", "ln",      "db",     "counts",        "dn",         "adu",
                                      "volt",    "volts", "voltage", "raw",    "transmittance", "absorbance", NULL};

static bool is_in(const char *const *words, const char *word) {
    for (int k = 0; words[k] != NULL; k++) {
        if (strcmp(words[k], word) == 0) {
            return true;
        }
    }
    return false;
}

// The name's words in lower case, cut at _ - . and blanks; what stands in brackets, its unit, goes to `unit`.
typedef struct words {
    char text[96], unit[32];
    char *items[8];
    int n;
} words;

static void cut(const char *name, words *w) {
    *w = (words){.n = 0};
    const size_t bracket = strcspn(name, "([");
    snprintf(w->text, sizeof w->text, "%.*s", (int)bracket, name);
    if (name[bracket] != 0) {
        snprintf(w->unit, sizeof w->unit, "%.*s", (int)strcspn(name + bracket + 1, ")]"), name + bracket + 1);
    }
    char *rest;
    for (char *c = w->text; *c != 0; c++) {
        *c = (char)tolower((unsigned char)*c);
    }
    for (char *item = strtok_r(w->text, "_-. ", &rest); item != NULL && w->n < 8;
         item = strtok_r(NULL, "_-. ", &rest)) {
        w->items[w->n++] = item;
    }
}

static bool is_unit(const char *word) {
    static const char *const units[] = {"nm", "um", "deg", "rad", "c", "k", "s", "ms", "celsius", NULL};
    return is_in(units, word);
}

gonio_column_role gonio_column_role_of(const char *name) {
    words w;
    cut(name, &w);
    if (strchr(name, '%') != NULL) {
        return GONIO_COLUMN_FOREIGN;
    }
    for (int k = 0; k < w.n; k++) {
        if (is_in(foreign, w.items[k])) {
            return GONIO_COLUMN_FOREIGN;
        }
    }
    const bool single = w.n == 1 || (w.n == 2 && is_unit(w.items[1]));
    if (single && is_in(wavelengths, w.items[0])) {
        return GONIO_COLUMN_WAVELENGTH;
    }
    if (single && is_in(sigmas, w.items[0])) {
        return GONIO_COLUMN_SIGMA;
    }
    const bool aside = w.n > 0 && (is_in(asides, w.items[0]) || is_in(asides, w.items[w.n - 1]));
    return aside ? GONIO_COLUMN_ASIDE : GONIO_COLUMN_CHANNEL;
}

// ---- channels ----

static int find_channel(char *const *fields, const gonio_columns *l, const char *name, size_t length) {
    for (int c = 0; c < l->channels; c++) {
        const char *own = fields[l->value[c]];
        if (strlen(own) == length && strncmp(own, name, length) == 0) {
            return c;
        }
    }
    return -1;
}

static bool begins(const char *name, const char *prefix) { return strncmp(name, prefix, strlen(prefix)) == 0; }

const char *gonio_column_sigma_of(const char *name, size_t *length) {
    words w;
    cut(name, &w);
    const char *first = strchr(name, '_'), *last = strrchr(name, '_');
    if (first == NULL || w.n < 2) {
        return NULL;
    }
    if (is_in(sigmas, w.items[0])) {
        *length = strlen(first + 1);
        return first + 1;
    }
    *length = (size_t)(last - name);
    return is_in(sigmas, w.items[w.n - 1]) ? name : NULL;
}

// Of which channel is it the uncertainty? -1: of none.
static int sigma_of_channel(char *const *fields, const gonio_columns *l, const char *name) {
    size_t length;
    const char *channel = gonio_column_sigma_of(name, &length);
    return channel != NULL ? find_channel(fields, l, channel, length) : -1;
}

static gonio_status add_channel(const gonio_text *text, char *const *fields, int column, gonio_columns *l,
                                gonio_error *error) {
    const char *name = fields[column];
    if (name[0] == 0 || strlen(name) >= GONIO_CHANNEL_NAME_MAX) {
        return gonio_text_fail(text, error, "column %d: expected a channel name of 1 to %d characters, found '%.60s'",
                               column + 1, GONIO_CHANNEL_NAME_MAX - 1, name);
    }
    if (find_channel(fields, l, name, strlen(name)) >= 0) {
        return gonio_text_fail(text, error, "channel '%s' stands twice in the header", name);
    }
    if (l->channels < GONIO_CHANNELS_MAX) {
        l->value[l->channels] = column;
    }
    l->channels++;
    return GONIO_OK;
}

static gonio_status set_wavelength(const gonio_text *text, const char *name, int column, gonio_columns *l,
                                   gonio_error *error) {
    if (l->wavelength >= 0) {
        return gonio_text_fail(text, error, "column %d: a second column of wavelengths, '%.60s'", column + 1, name);
    }
    words w;
    cut(name, &w);
    const char *unit = w.unit[0] != 0 ? w.unit : w.n > 0 ? w.items[w.n - 1] : "";
    const bool um = strcmp(unit, "um") == 0 || strcmp(unit, "\xc2\xb5m") == 0 || strcmp(unit, "\xce\xbcm") == 0;
    if (w.unit[0] != 0 && !um && strcmp(unit, "nm") != 0) {
        return gonio_text_fail(text, error, "column %d: wavelengths in '%.30s'; nm and um are read", column + 1, unit);
    }
    l->wavelength = column;
    l->to_um = um ? 1 : strcmp(unit, "nm") == 0 ? 1e-3 : 0;
    return GONIO_OK;
}

// First the channels and what is none; sigmas need the channels.
static gonio_status find_channels(const gonio_text *text, char *const *fields, gonio_columns *l, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int pass = 0; pass < 2 && status == GONIO_OK; pass++) {
        for (int k = 4; k < l->columns && status == GONIO_OK; k++) {
            if (k == l->group) {
                continue;
            }
            const gonio_column_role r =
                begins(fields[k], "sigma_") ? GONIO_COLUMN_SIGMA : gonio_column_role_of(fields[k]);
            words w;
            cut(fields[k], &w);
            // "r_std" is known only by its channel: channels of plain names come first.
            const bool compound = w.n > 1 && (is_in(sigmas, w.items[0]) || is_in(sigmas, w.items[w.n - 1]));
            if (r == GONIO_COLUMN_FOREIGN) {
                return gonio_text_fail(text, error, "column %d: '%.60s' is no f_r in 1/sr; rename it if it is", k + 1,
                                       fields[k]);
            }
            if (r == GONIO_COLUMN_CHANNEL && pass == (compound ? 1 : 0) && sigma_of_channel(fields, l, fields[k]) < 0) {
                status = add_channel(text, fields, k, l, error);
            } else if (r == GONIO_COLUMN_WAVELENGTH && pass == 0) {
                status = set_wavelength(text, fields[k], k, l, error);
            } else if (r == GONIO_COLUMN_ASIDE && pass == 0) {
                gonio_text_append(l->aside, sizeof l->aside, "%s%s", l->aside[0] != 0 ? " " : "", fields[k]);
            }
        }
    }
    if (status == GONIO_OK && (l->channels < 1 || l->channels > GONIO_CHANNELS_MAX)) {
        status = gonio_text_fail(text, error, "%d value columns after phi_o; expected 1 to %d", l->channels,
                                 GONIO_CHANNELS_MAX);
    }
    if (status == GONIO_OK && l->wavelength >= 0 && l->channels > 1) {
        status = gonio_text_fail(text, error, "a column of wavelengths goes with one column of values, found %d",
                                 l->channels);
    }
    return status;
}

// ---- uncertainties ----

static gonio_status find_sigmas(const gonio_text *text, char *const *fields, gonio_columns *l, int found[3],
                                gonio_error *error) {
    int *const lists[3] = {l->random, l->systematic, l->sigma};
    static const char *const prefixes[3] = {"sigma_random_", "sigma_systematic_", "sigma_"};
    for (int k = 4; k < l->columns; k++) {
        if (k == l->group) {
            continue;
        }
        const bool own = begins(fields[k], "sigma_");
        const gonio_column_role r = own ? GONIO_COLUMN_SIGMA : gonio_column_role_of(fields[k]);
        int list = 2, channel = -1;
        if (own) {
            for (int p = 0; p < 3 && channel < 0; p++) {
                const size_t length = strlen(prefixes[p]);
                list = p;
                channel = begins(fields[k], prefixes[p])
                              ? find_channel(fields, l, fields[k] + length, strlen(fields[k] + length))
                              : -1;
            }
        } else if (r == GONIO_COLUMN_SIGMA) {
            channel = l->channels == 1 ? 0 : -1;
        } else if (r == GONIO_COLUMN_CHANNEL && (channel = sigma_of_channel(fields, l, fields[k])) < 0) {
            continue;
        } else if (r != GONIO_COLUMN_CHANNEL) {
            continue;
        }
        if (channel < 0 || lists[list][channel] >= 0) {
            return gonio_text_fail(text, error, "column %d: expected sigma_<channel> of a channel once, found '%.60s'",
                                   k + 1, fields[k]);
        }
        lists[list][channel] = k;
        found[list]++;
    }
    for (int list = 0; list < 3; list++) {
        if (found[list] != 0 && found[list] != l->channels) {
            return gonio_text_fail(text, error, "%s columns for %d of %d channels; expected all or none",
                                   prefixes[list], found[list], l->channels);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_columns_read(const gonio_text *text, char *const *fields, int columns, gonio_columns *l,
                                gonio_error *error) {
    *l = (gonio_columns){.columns = columns, .group = -1, .wavelength = -1};
    memset(l->sigma, -1, sizeof l->sigma);
    memset(l->random, -1, sizeof l->random);
    memset(l->systematic, -1, sizeof l->systematic);
    for (int k = 4; k < columns; k++) {
        if (!gonio_text_is_printable(fields[k])) {
            return gonio_text_fail(text, error, "column %d: found a control character in its name", k + 1);
        }
        l->group = strcmp(fields[k], GONIO_COLUMN_GROUP) == 0 ? k : l->group;
    }
    int found[3] = {0};
    gonio_status status = find_channels(text, fields, l, error);
    status = status == GONIO_OK ? find_sigmas(text, fields, l, found, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    l->with_parts = found[0] > 0 && found[1] > 0;
    l->with_sigma = l->with_parts || found[2] > 0;
    if (l->group >= 0 && (!l->with_parts || l->wavelength >= 0)) {
        return gonio_text_fail(text, error,
                               GONIO_COLUMN_GROUP ": of what is common to a group sigma_systematic_ columns tell, in a "
                                                  "table with a row a sample");
    }
    return l->with_sigma || found[0] + found[1] == 0
               ? GONIO_OK
               : gonio_text_fail(text, error, "sigma_random_ and sigma_systematic_ columns must stand together");
}
