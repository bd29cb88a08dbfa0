// SPDX-License-Identifier: BSD-3-Clause
#include "io/table_columns.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "io/columns.h"

// ---- angles by name ----

static bool is_one_of(const char *word, const char *const *words) {
    for (int k = 0; words[k] != NULL; k++) {
        if (strcmp(word, words[k]) == 0) {
            return true;
        }
    }
    return false;
}

// The stem that the word begins with; NULL: none. What is left of it may tell the side: "thetai".
static const char *after_stem(const char *word, const char *const *stems) {
    for (int k = 0; stems[k] != NULL; k++) {
        const size_t n = strlen(stems[k]);
        if (strncmp(word, stems[k], n) == 0) {
            return word + n;
        }
    }
    return NULL;
}

typedef struct evidence {
    bool polar, azimuth, in, out, relative;
} evidence;

static void weigh(const char *word, evidence *e) {
    static const char *const polar[] = {"theta",     "zenith", "polar",    "angle", "winkel",
                                        "elevation", "aoi",    "\xce\xb8", NULL};
    static const char *const azimuth[] = {"phi", "azimuth", "azimut", "azi", "\xcf\x86", "\xcf\x95", NULL};
    static const char *const in[] = {"i",   "in",   "inc",   "incident", "incidence", "incoming", "illumination",
                                     "ill", "illu", "light", "lamp",     "source",    "src",      "sun",
                                     "l",   "aoi",  "solar", "einfall",  NULL};
    static const char *const out[] = {
        "o",           "out",       "r",        "ref",         "refl",        "reflected", "s",      "scatter",
        "scat",        "scattered", "sc",       "v",           "view",        "viewing",   "viewer", "observer",
        "observation", "obs",       "d",        "det",         "detector",    "e",         "em",     "emission",
        "exit",        "measure",   "measured", "measurement", "receiver",    "camera",    "sensor", "outgoing",
        "exitant",     "detection", "ausfall",  "ausfalls",    "beobachtung", NULL};
    static const char *const relative[] = {"d", "delta", "rel", "relative", "diff", "dphi", "difference", NULL};
    const char *rest, *winkel = strstr(word, "swinkel"); // Einfallswinkel, Ausfallswinkel, Beobachtungswinkel
    if (winkel != NULL && winkel[7] == 0 && winkel > word) {
        e->polar = true;
        e->in = e->in || strncmp(word, "einfall", 7) == 0;
        e->out = e->out || strncmp(word, "ausfall", 7) == 0 || strncmp(word, "beobachtung", 11) == 0;
        return;
    }
    if ((rest = after_stem(word, polar)) != NULL) {
        e->polar = true;
        e->in = e->in || strncmp(word, "aoi", 3) == 0;
    } else if ((rest = after_stem(word, azimuth)) != NULL) {
        e->azimuth = true;
    } else {
        rest = word;
    }
    e->azimuth = e->azimuth || strcmp(word, "dphi") == 0;
    e->relative = e->relative || is_one_of(word, relative);
    e->in = e->in || is_one_of(rest, in);
    e->out = e->out || is_one_of(rest, out);
}

bool gonio_table_angle_of_name(const char *name, gonio_mapped_role *role) {
    static const struct {
        const char *name;
        gonio_mapped_role role;
    } short_names[] = {{"sza", GONIO_MAPPED_THETA_I}, {"saa", GONIO_MAPPED_PHI_I}, {"vza", GONIO_MAPPED_THETA_O},
                       {"vaa", GONIO_MAPPED_PHI_O},   {"raa", GONIO_MAPPED_PHI},   {"incidence", GONIO_MAPPED_THETA_I}};
    char text[96], *rest;
    size_t n = 0;
    for (const char *c = name; *c != 0 && strchr("[(,", *c) == NULL && n + 1 < sizeof text; c++) {
        text[n++] = (char)tolower((unsigned char)*c);
    }
    text[n] = 0;
    evidence e = {0};
    char *word = strtok_r(text, "_-. /", &rest);
    for (size_t k = 0; word != NULL && k < sizeof short_names / sizeof *short_names; k++) {
        if (strcmp(word, short_names[k].name) == 0 && *rest == 0) {
            *role = short_names[k].role;
            return true;
        }
    }
    for (; word != NULL; word = strtok_r(NULL, "_-. /", &rest)) {
        weigh(word, &e);
    }
    if (e.azimuth) {
        *role = e.relative || e.in == e.out ? GONIO_MAPPED_PHI : e.in ? GONIO_MAPPED_PHI_I : GONIO_MAPPED_PHI_O;
    } else {
        *role = e.in ? GONIO_MAPPED_THETA_I : GONIO_MAPPED_THETA_O;
    }
    // "Detector, deg": its unit makes it an angle.
    return e.azimuth || ((e.polar || strcasestr(name, "deg") != NULL) && e.in != e.out);
}

// ---- columns by the mapping ----

typedef struct finder {
    const gonio_source *source;
    const gonio_mapping *mapping;
    const gonio_table_layout *layout;
    gonio_table_columns *columns;
    bool *taken; // of each column
} finder;

static gonio_status fail_at(const finder *f, gonio_error *error, const char *what, const char *name) {
    return gonio_fail_line(error, GONIO_E_INPUT, f->source->path,
                           f->layout->header_line > 0 ? f->layout->header_line : f->layout->first_row, what, name,
                           f->layout->columns);
}

static gonio_status take(const finder *f, const char *name, int number, int *column, gonio_error *error) {
    char text[32];
    snprintf(text, sizeof text, "#%d", number);
    *column = number > 0 ? number - 1 : gonio_table_find_name(f->layout->names, f->layout->columns, name);
    if (*column < 0 || *column >= f->layout->columns) {
        return fail_at(f, error, "no column '%.60s' among the table's %d", number > 0 ? text : name);
    }
    if (f->taken[*column]) {
        return fail_at(f, error, "column '%.60s' is to be two things at once", number > 0 ? text : name);
    }
    f->taken[*column] = true;
    return GONIO_OK;
}

// A name under which a samples file can hold the channel; else one of our own.
static void name_channel(const finder *f, int column, char name[GONIO_CHANNEL_NAME_MAX]) {
    char *end;
    const char *own = f->layout->names[column];
    const double nm = gonio_number_parse(own, &end);
    if (end != own && (*end == 0 || strcmp(end, " nm") == 0) && nm >= 200 && nm <= 20000) {
        gonio_number_format(name, GONIO_CHANNEL_NAME_MAX, "%.10gnm", nm);
        return;
    }
    char plain[GONIO_CHANNEL_NAME_MAX];
    size_t n = 0;
    for (const char *c = own; *c != 0 && strchr("[(,\"", *c) == NULL && n + 1 < sizeof plain; c++) {
        plain[n++] = *c;
    }
    plain[n] = 0;
    const char *kept = gonio_text_trim(plain);
    const gonio_column_role role = gonio_column_role_of(kept);
    const bool sound = kept[0] != 0 && gonio_text_is_printable(kept) && strncmp(kept, "sigma_", 6) != 0 &&
                       (role == GONIO_COLUMN_CHANNEL || role == GONIO_COLUMN_UNKNOWN);
    snprintf(name, GONIO_CHANNEL_NAME_MAX, sound ? "%s" : "value", kept);
    for (int c = 0; c < f->columns->channels; c++) {
        if (strcmp(f->columns->names[c], name) == 0) {
            snprintf(name, GONIO_CHANNEL_NAME_MAX, "column%d", column + 1);
        }
    }
}

static gonio_status add_channel(const finder *f, int column, const char *key, gonio_error *error) {
    gonio_table_columns *c = f->columns;
    if (c->channels == GONIO_CHANNELS_MAX) {
        return fail_at(f, error, "too many value columns, with '%.60s'", f->layout->names[column]);
    }
    const gonio_column_role role = key != NULL ? gonio_column_role_of(key) : GONIO_COLUMN_CHANNEL;
    if (key == NULL) {
        name_channel(f, column, c->names[c->channels]);
    } else if (role != GONIO_COLUMN_CHANNEL && role != GONIO_COLUMN_UNKNOWN) {
        return gonio_fail(error, GONIO_E_USAGE, "columns: '%.60s' can be no channel's name", key);
    } else {
        snprintf(c->names[c->channels], GONIO_CHANNEL_NAME_MAX, "%s", key);
    }
    c->value[c->channels++] = column;
    return GONIO_OK;
}

static gonio_status take_sigma(const finder *f, const char *key, int column, gonio_error *error) {
    gonio_table_columns *c = f->columns;
    int channel = c->channels == 1 && strcmp(key, "sigma") == 0 ? 0 : -1;
    for (int n = 0; n < c->channels && channel < 0; n++) {
        channel = strncmp(key, "sigma_", 6) == 0 && strcmp(key + 6, c->names[n]) == 0 ? n : -1;
    }
    if (channel < 0) {
        return gonio_fail(error, GONIO_E_USAGE, "columns: %s is of no channel", key);
    }
    c->sigma[channel] = column;
    c->with_sigma = true;
    return GONIO_OK;
}

static gonio_status take_item(const finder *f, const gonio_mapped_item *item, gonio_error *error) {
    gonio_table_columns *c = f->columns;
    int column = -1;
    if (item->role < GONIO_MAPPED_ANGLES && !isnan(item->constant)) {
        c->constant[item->role] =
            item->in_degrees && f->mapping->radians ? gonio_radians(item->constant) : item->constant;
        return GONIO_OK;
    }
    const gonio_status status = take(f, item->name, item->number, &column, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (item->role < GONIO_MAPPED_ANGLES) {
        c->angle[item->role] = column;
    } else if (item->role == GONIO_MAPPED_WAVELENGTH) {
        c->wavelength = column;
    } else if (item->role == GONIO_MAPPED_SIGMA) {
        return take_sigma(f, item->key, column, error);
    } else {
        return add_channel(f, column, item->role == GONIO_MAPPED_CHANNEL ? item->key : NULL, error);
    }
    return GONIO_OK;
}

// Values and angles first: sigmas need the channels.
static gonio_status take_items(const finder *f, bool sigmas, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; k < f->mapping->n && status == GONIO_OK; k++) {
        const gonio_mapped_item *item = &f->mapping->items[k];
        if (sigmas == (item->role == GONIO_MAPPED_SIGMA)) {
            status = take_item(f, item, error);
        }
    }
    return status;
}

// ---- what the mapping leaves open ----

static gonio_status take_angles_by_name(const finder *f, gonio_error *error) {
    for (int k = 0; k < f->layout->columns; k++) {
        gonio_mapped_role role;
        if (f->taken[k] || !gonio_table_angle_of_name(f->layout->names[k], &role)) {
            continue;
        }
        if (f->columns->angle[role] >= 0) {
            return fail_at(f, error, "'%.60s' is the second column that could be that angle; --columns says which",
                           f->layout->names[k]);
        }
        f->columns->angle[role] = k;
        f->taken[k] = true;
    }
    return GONIO_OK;
}

// The channel whose uncertainty the column is by its name, "std_r" or "r_unc"; -1: none.
static int channel_of_sigma(const finder *f, const char *name) {
    size_t length;
    const char *channel = gonio_column_sigma_of(name, &length);
    for (int k = 0; channel != NULL && k < f->layout->columns; k++) {
        const char *other = f->layout->names[k];
        if (strlen(other) == length && strncmp(other, channel, length) == 0) {
            for (int c = 0; c < f->columns->channels; c++) {
                if (f->columns->value[c] == k) {
                    return c;
                }
            }
        }
    }
    return -1;
}

static gonio_column_role role_of(const char *name) {
    gonio_mapped_role angle;
    return gonio_table_angle_of_name(name, &angle) ? GONIO_COLUMN_ASIDE : gonio_column_role_of(name);
}

// Is a column a value by its name? What says nothing is one only where none is.
static bool is_value(gonio_column_role role, bool named) {
    return role == GONIO_COLUMN_CHANNEL || role == GONIO_COLUMN_FOREIGN || (role == GONIO_COLUMN_UNKNOWN && !named);
}

// Values whose names may be of an uncertainty come last: they need the others.
static gonio_status take_values(const finder *f, gonio_error *error) {
    gonio_status status = GONIO_OK;
    bool named = false;
    for (int k = 0; k < f->layout->columns; k++) {
        named = named || (!f->taken[k] && is_value(role_of(f->layout->names[k]), true));
    }
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < f->layout->columns && status == GONIO_OK; k++) {
            const char *name = f->layout->names[k];
            size_t length;
            const bool compound = gonio_column_sigma_of(name, &length) != NULL;
            if (!f->taken[k] && compound == (pass == 1) && channel_of_sigma(f, name) < 0 &&
                is_value(role_of(name), named)) {
                f->taken[k] = true;
                status = add_channel(f, k, NULL, error);
            }
        }
    }
    return status;
}

static void take_rest(const finder *f) {
    gonio_table_columns *c = f->columns;
    const bool stated = c->with_sigma;
    for (int k = 0; k < f->layout->columns; k++) {
        const char *name = f->layout->names[k];
        const gonio_column_role role = role_of(name);
        const int channel = role == GONIO_COLUMN_SIGMA && c->channels == 1 ? 0 : channel_of_sigma(f, name);
        if (f->taken[k]) {
            continue;
        }
        if (role == GONIO_COLUMN_WAVELENGTH && c->wavelength < 0) {
            c->wavelength = k;
        } else if (channel >= 0 && !stated && c->sigma[channel] < 0) {
            c->sigma[channel] = k;
            c->with_sigma = true;
        } else {
            gonio_text_append(c->aside, sizeof c->aside, "%s%s", c->aside[0] != 0 ? ", " : "",
                              name[0] != 0 ? name : "one without a name");
        }
    }
}

// ---- is it whole? ----

static bool known(const gonio_table_columns *c, gonio_mapped_role role) {
    return c->angle[role] >= 0 || !isnan(c->constant[role]);
}

static gonio_status check_angle_units(const finder *f, gonio_error *error) {
    static const char *const degrees[] = {"deg", "degs", "degree", "degrees", "grad", "grd", NULL};
    static const char *const radians[] = {"rad", "rads", "radian", "radians", "bogenmass", NULL};
    static const char *const others[] = {"gon",     "gons",     "mrad", "arcmin", "arcsec",
                                         "gradian", "gradians", "turn", NULL};
    for (int role = 0; role < GONIO_MAPPED_ANGLES; role++) {
        char unit[48];
        const int column = f->columns->angle[role];
        if (column < 0) {
            continue;
        }
        gonio_table_unit(f->layout, column, unit, sizeof unit);
        if (is_one_of(unit, others)) {
            return fail_at(f, error, "angles in '%.40s'; degrees and radians are read", unit);
        }
        if (is_one_of(unit, f->mapping->radians ? degrees : radians)) {
            return fail_at(f, error, "'%.60s' is in another unit by the file; --angles says which",
                           f->layout->names[column]);
        }
    }
    return GONIO_OK;
}

static gonio_status check_names(const finder *f, gonio_error *error) {
    const gonio_table_columns *c = f->columns;
    for (int k = 0; k < c->channels && f->mapping->quantity == GONIO_QUANTITY_UNSTATED; k++) {
        const char *name = f->layout->names[c->value[k]];
        char with_unit[128];
        snprintf(with_unit, sizeof with_unit, "%.60s [%.60s]", name, f->layout->units[c->value[k]]);
        if (gonio_column_role_of(f->layout->units[c->value[k]][0] != 0 ? with_unit : name) == GONIO_COLUMN_FOREIGN) {
            return fail_at(f, error, "'%.60s' is no f_r in 1/sr by its name or unit; --quantity says what it is", name);
        }
    }
    return check_angle_units(f, error);
}

static gonio_status check_whole(const finder *f, gonio_error *error) {
    const gonio_table_columns *c = f->columns;
    for (int k = 0; k < 2; k++) {
        const gonio_mapped_role role = k == 0 ? GONIO_MAPPED_THETA_I : GONIO_MAPPED_THETA_O;
        if (!known(c, role)) {
            return fail_at(f, error,
                           "no column is %s; --columns says which, or that it is constant, as in theta_i=30deg",
                           gonio_mapped_role_name(role));
        }
    }
    if (known(c, GONIO_MAPPED_PHI) && (known(c, GONIO_MAPPED_PHI_I) || known(c, GONIO_MAPPED_PHI_O))) {
        return fail_at(f, error, "%s is the azimuth between the directions; it goes with neither phi_i nor phi_o",
                       "phi");
    }
    if (c->channels == 0) {
        return fail_at(f, error, "no column is %s; --columns says which", "value");
    }
    if (c->wavelength >= 0 && c->channels > 1) {
        return fail_at(f, error, "a column of wavelengths goes with one column of values; '%.60s' is another",
                       f->layout->names[c->value[1]]);
    }
    for (int k = 0; k < c->channels && c->with_sigma; k++) {
        if (c->sigma[k] < 0) {
            return fail_at(f, error, "channel '%.60s' has no sigma, others have", c->names[k]);
        }
    }
    return check_names(f, error);
}

static gonio_status find_wavelength_unit(const finder *f, gonio_error *error) {
    gonio_table_columns *c = f->columns;
    char unit[32] = "", name[128];
    if (c->wavelength >= 0) {
        snprintf(name, sizeof name, "%.60s [%.60s]", f->layout->names[c->wavelength], f->layout->units[c->wavelength]);
        c->to_um = gonio_column_um(f->layout->units[c->wavelength][0] != 0 ? name : f->layout->names[c->wavelength],
                                   unit, sizeof unit);
    }
    return isnan(c->to_um) ? fail_at(f, error, "wavelengths in '%.30s'; nm and um are read", unit) : GONIO_OK;
}

static gonio_status take_wavelength(const finder *f, gonio_error *error) {
    const char *name = f->mapping->wavelength;
    if (name == NULL) {
        return GONIO_OK;
    }
    if (f->columns->wavelength >= 0) {
        return gonio_fail(error, GONIO_E_USAGE, "wavelength-column: --columns has one too");
    }
    const bool number = name[0] == '#' || (name[0] != 0 && name[strspn(name, "0123456789")] == 0);
    return take(f, name, number ? atoi(name + (name[0] == '#')) : 0, &f->columns->wavelength, error);
}

gonio_status gonio_table_columns_find(const gonio_source *source, const gonio_mapping *mapping,
                                      const gonio_table_layout *layout, gonio_table_columns *c, gonio_error *error) {
    memset(c, 0, sizeof *c);
    memset(c->sigma, -1, sizeof c->sigma);
    c->wavelength = -1;
    for (int k = 0; k < GONIO_MAPPED_ANGLES; k++) {
        c->angle[k] = -1;
        c->constant[k] = NAN;
    }
    const finder f = {source, mapping, layout, c, calloc((size_t)layout->columns, sizeof(bool))};
    gonio_status status =
        f.taken != NULL ? take_items(&f, false, error) : gonio_fail(error, GONIO_E_MEMORY, "no memory for the columns");
    status = status == GONIO_OK ? take_wavelength(&f, error) : status;
    status = status == GONIO_OK && mapping->n == 0 ? take_angles_by_name(&f, error) : status;
    status = status == GONIO_OK && c->channels == 0 ? take_values(&f, error) : status;
    status = status == GONIO_OK ? take_items(&f, true, error) : status;
    if (status == GONIO_OK) {
        take_rest(&f);
    }
    status = status == GONIO_OK ? check_whole(&f, error) : status;
    free(f.taken);
    return status == GONIO_OK ? find_wavelength_unit(&f, error) : status;
}

// ---- in words ----

static void put_angle(const gonio_mapping *m, const gonio_table_layout *l, const gonio_table_columns *c, int role,
                      char *text, size_t size) {
    const char *unit = m->radians ? "radians" : "degrees", *name = gonio_mapped_role_name((gonio_mapped_role)role);
    const bool polar = role == GONIO_MAPPED_THETA_I || role == GONIO_MAPPED_THETA_O;
    const char *start = text[0] != 0 ? "; " : "";
    if (c->angle[role] >= 0) {
        const char *own = l->names[c->angle[role]];
        gonio_text_append(text, size, "%scolumn %d%s%.40s%s is %s in %s%s", start, c->angle[role] + 1,
                          own[0] != 0 ? " '" : "", own, own[0] != 0 ? "'" : "", name, unit,
                          polar && m->is_signed ? ", signed" : "");
    } else if (!isnan(c->constant[role])) {
        gonio_text_append(text, size, "%s%s is %.10g %s throughout", start, name, c->constant[role], unit);
    }
}

void gonio_table_columns_text(const gonio_mapping *m, const gonio_table_layout *l, const gonio_table_columns *c,
                              char *text, size_t size) {
    static const char *const divisors[] = {[GONIO_QUANTITY_UNSTATED] = "",
                                           [GONIO_QUANTITY_F_R] = "",
                                           [GONIO_QUANTITY_BRF] = " / pi",
                                           [GONIO_QUANTITY_PERCENT] = " / 100 / pi",
                                           [GONIO_QUANTITY_F_R_COS] = " / cos(theta_o)"};
    text[0] = 0;
    for (int k = 0; k < GONIO_MAPPED_ANGLES; k++) {
        put_angle(m, l, c, k, text, size);
    }
    if (c->wavelength >= 0) {
        gonio_text_append(text, size, "; column %d is the wavelength", c->wavelength + 1);
    }
    const int last = c->value[c->channels - 1] + 1;
    const char *own = l->names[c->value[0]];
    gonio_text_append(text, size, "; values are f_r = column %d", c->value[0] + 1);
    if (c->channels > 1) {
        gonio_text_append(text, size, " to %d", last);
    } else if (own[0] != 0) {
        gonio_text_append(text, size, " '%.40s'", own);
    }
    gonio_text_append(text, size, "%s%s", divisors[m->quantity], c->with_sigma ? ", with sigma" : "");
}
