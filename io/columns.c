// SPDX-License-Identifier: BSD-3-Clause
#include "io/columns.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

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
    char unit[32];
    if (l->wavelength >= 0) {
        return gonio_text_fail(text, error, "column %d: a second column of wavelengths, '%.60s'", column + 1, name);
    }
    l->to_um = gonio_column_um(name, unit, sizeof unit);
    l->wavelength = column;
    return isnan(l->to_um)
               ? gonio_text_fail(text, error, "column %d: wavelengths in '%.30s'; nm and um are read", column + 1, unit)
               : GONIO_OK;
}

// Is the name one of the list "a,b,c"?
static bool is_listed(const char *list, const char *name) {
    const size_t length = strlen(name);
    for (const char *item = list; item != NULL; item = strchr(item, ',')) {
        item += strspn(item, ", \t");
        const size_t n = strcspn(item, ",");
        if (strncmp(item, name, length) == 0 && length <= n && strspn(item + length, " \t\r") >= n - length) {
            return true;
        }
    }
    return false;
}

static bool has_own_sigma(char *const *fields, const gonio_columns *l, const char *name) {
    for (int k = 4; k < l->columns; k++) {
        if (begins(fields[k], "sigma_") && strcmp(fields[k] + 6, name) == 0) {
            return true;
        }
    }
    return false;
}

// What column k is beside the others. Names that say nothing are channels where there are no others, where the file
// says so, or where they have an uncertainty.
static gonio_column_role role_among(char *const *fields, const gonio_columns *l, int k) {
    if (begins(fields[k], "sigma_")) {
        return GONIO_COLUMN_SIGMA;
    }
    const gonio_column_role own = gonio_column_role_of(fields[k]);
    if (l->declared != NULL) {
        const bool value = own == GONIO_COLUMN_CHANNEL || own == GONIO_COLUMN_UNKNOWN || own == GONIO_COLUMN_FOREIGN;
        return is_listed(l->declared, fields[k]) ? GONIO_COLUMN_CHANNEL : value ? GONIO_COLUMN_ASIDE : own;
    }
    return own == GONIO_COLUMN_UNKNOWN && (!l->named || has_own_sigma(fields, l, fields[k])) ? GONIO_COLUMN_CHANNEL
                                                                                             : own;
}

static gonio_status refuse_column(const gonio_text *text, const char *name, int column, gonio_column_role role,
                                  gonio_error *error) {
    if (role == GONIO_COLUMN_OTHER_SIGMA) {
        return gonio_text_fail(text, error,
                               "column %d: '%.60s' is an uncertainty, but by its name no standard uncertainty in 1/sr; "
                               "rename it if it is",
                               column + 1, name);
    }
    if (name[0] == 0) {
        return gonio_text_fail(text, error, "column %d: expected a channel name, found none", column + 1);
    }
    return role == GONIO_COLUMN_FOREIGN
               ? gonio_text_fail(text, error, "column %d: '%.60s' is no f_r in 1/sr; rename it if it is", column + 1,
                                 name)
               : gonio_text_fail(text, error,
                                 "column %d: '%.60s' may be a channel or not; a comment line '# channels = a,b,c' says "
                                 "which columns are",
                                 column + 1, name);
}

static bool is_compound(const char *name) {
    size_t length;
    return gonio_column_sigma_of(name, &length) != NULL;
}

// First the channels and what is none; sigmas need the channels. "r_std" is known only by its channel: channels of
// plain names come first.
static gonio_status find_channel_columns(const gonio_text *text, char *const *fields, gonio_columns *l, int pass,
                                         gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 4; k < l->columns && status == GONIO_OK; k++) {
        const gonio_column_role r = role_among(fields, l, k);
        const bool refused = r == GONIO_COLUMN_FOREIGN || r == GONIO_COLUMN_OTHER_SIGMA || r == GONIO_COLUMN_UNKNOWN;
        const bool value = refused || r == GONIO_COLUMN_CHANNEL;
        if (k == l->group ||
            (value && (pass != (is_compound(fields[k]) ? 1 : 0) || sigma_of_channel(fields, l, fields[k]) >= 0))) {
            continue;
        }
        if (refused) {
            return refuse_column(text, fields[k], k, r, error);
        }
        if (value) {
            status = add_channel(text, fields, k, l, error);
        } else if (r == GONIO_COLUMN_WAVELENGTH && pass == 0) {
            status = set_wavelength(text, fields[k], k, l, error);
        } else if (r == GONIO_COLUMN_ASIDE && pass == 0) {
            gonio_text_append(l->aside, sizeof l->aside, "%s%s", l->aside[0] != 0 ? " " : "", fields[k]);
        }
    }
    return status;
}

static gonio_status find_channels(const gonio_text *text, char *const *fields, gonio_columns *l, gonio_error *error) {
    for (int k = 4; k < l->columns && !l->named; k++) {
        l->named = k != l->group && gonio_column_role_of(fields[k]) == GONIO_COLUMN_CHANNEL;
    }
    gonio_status status = find_channel_columns(text, fields, l, 0, error);
    status = status == GONIO_OK ? find_channel_columns(text, fields, l, 1, error) : status;
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
        const gonio_column_role r = role_among(fields, l, k);
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
        } else if ((r != GONIO_COLUMN_CHANNEL && r != GONIO_COLUMN_UNKNOWN) ||
                   (channel = sigma_of_channel(fields, l, fields[k])) < 0) {
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

bool gonio_columns_are_plain(const gonio_samples *samples) {
    int named = 0, unknown = 0;
    for (int c = 0; c < samples->channels; c++) {
        const gonio_column_role role = gonio_column_role_of(samples->channel_names[c]);
        named += role == GONIO_COLUMN_CHANNEL;
        unknown += role == GONIO_COLUMN_UNKNOWN;
    }
    return named + unknown == samples->channels && (named == 0 || unknown == 0);
}

gonio_status gonio_columns_read(const gonio_text *text, char *const *fields, int columns, const char *channels,
                                gonio_columns *l, gonio_error *error) {
    *l = (gonio_columns){.columns = columns, .group = -1, .wavelength = -1, .declared = channels};
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
