// SPDX-License-Identifier: BSD-3-Clause
#include "io/mapping.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"

// ---- the columns ----

static const char *const role_names[] = {
    [GONIO_MAPPED_THETA_I] = "theta_i",       [GONIO_MAPPED_PHI_I] = "phi_i", [GONIO_MAPPED_THETA_O] = "theta_o",
    [GONIO_MAPPED_PHI_O] = "phi_o",           [GONIO_MAPPED_PHI] = "phi",     [GONIO_MAPPED_SIGMA] = "sigma",
    [GONIO_MAPPED_WAVELENGTH] = "wavelength", [GONIO_MAPPED_VALUE] = "value"};

const char *gonio_mapped_role_name(gonio_mapped_role role) {
    return role < GONIO_MAPPED_CHANNEL ? role_names[role] : NULL;
}

static gonio_mapped_role role_of_key(const char *key) {
    for (int k = 0; k < GONIO_MAPPED_CHANNEL; k++) {
        if (strcmp(key, role_names[k]) == 0) {
            return (gonio_mapped_role)k;
        }
    }
    return strncmp(key, "sigma_", 6) == 0 ? GONIO_MAPPED_SIGMA : GONIO_MAPPED_CHANNEL;
}

static bool all_digits(const char *text) { return text[0] != 0 && text[strspn(text, "0123456789")] == 0; }

// NAME, #3, 3, 30 or 30deg. A bare number of an angle is a constant until all are known.
static bool parse_column(const char *text, gonio_mapped_item *item) {
    const char *digits = text[0] == '#' ? text + 1 : text;
    char *end;
    item->constant = NAN;
    if (text[0] == 0 || (text[0] == '#' && (!all_digits(digits) || atoi(digits) < 1 || strlen(digits) > 5))) {
        return false;
    }
    const bool angle = item->role < GONIO_MAPPED_ANGLES;
    const double number = gonio_number_parse(text, &end);
    if (angle && end != text && isfinite(number) && (*end == 0 || strcmp(end, "deg") == 0)) {
        item->constant = number;
        item->in_degrees = *end != 0;
    } else if (all_digits(digits) && strlen(digits) < 6 && atoi(digits) > 0) {
        item->number = atoi(digits);
    }
    snprintf(item->name, sizeof item->name, "%s", item->number > 0 ? "" : text);
    return strlen(text) < sizeof item->name;
}

static gonio_status parse_item(char *text, gonio_mapping *m, gonio_error *error) {
    char *equals = strchr(text, '=');
    if (equals == NULL || m->n == GONIO_MAPPED_ITEMS) {
        return gonio_fail(error, GONIO_E_USAGE, "columns: expected at most %d of key=COLUMN, found '%.80s'",
                          GONIO_MAPPED_ITEMS, text);
    }
    *equals = 0;
    const char *key = gonio_text_trim(text), *column = gonio_text_trim(equals + 1);
    gonio_mapped_item *item = &m->items[m->n];
    *item = (gonio_mapped_item){.role = role_of_key(key)};
    if (strlen(key) >= GONIO_CHANNEL_NAME_MAX || key[0] == 0 || !parse_column(column, item)) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "columns: expected theta_i, phi_i, theta_o, phi_o, phi, wavelength, sigma, value or a "
                          "channel's name, =, and a column's name or #number, found '%.60s=%.60s'",
                          key, column);
    }
    snprintf(item->key, sizeof item->key, "%s", key);
    for (int k = 0; k < m->n; k++) {
        if (strcmp(m->items[k].key, key) == 0) {
            return gonio_fail(error, GONIO_E_USAGE, "columns: %s stands there twice", key);
        }
    }
    m->n++;
    return GONIO_OK;
}

static gonio_mapped_item *item_of(gonio_mapping *m, gonio_mapped_role role) {
    for (int k = 0; k < m->n; k++) {
        if (m->items[k].role == role) {
            return &m->items[k];
        }
    }
    return NULL;
}

// A table has more than one direction: where both polar angles are bare numbers, these are numbers of columns.
static gonio_status settle_numbers(gonio_mapping *m, gonio_error *error) {
    const gonio_mapped_item *i = item_of(m, GONIO_MAPPED_THETA_I), *o = item_of(m, GONIO_MAPPED_THETA_O);
    const bool numbers = i != NULL && o != NULL && !isnan(i->constant) && !isnan(o->constant);
    for (int k = 0; k < m->n; k++) {
        gonio_mapped_item *item = &m->items[k];
        if (numbers && all_digits(item->name) && strlen(item->name) < 6 && atoi(item->name) > 0) {
            item->number = atoi(item->name);
            item->constant = NAN;
        }
        if (item->number > 0 || !isnan(item->constant)) {
            item->name[0] = 0;
        }
    }
    return !numbers || isnan(o->constant) || isnan(i->constant)
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE,
                            "columns: theta_i and theta_o are both constants; a column's number is written #2");
}

static gonio_status parse_columns(const char *text, gonio_mapping *m, gonio_error *error) {
    if (strcmp(text, "auto") == 0) {
        return GONIO_OK;
    }
    char *copy = strdup(text), *rest;
    if (copy == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the columns");
    }
    gonio_status status = GONIO_OK;
    for (char *item = strtok_r(copy, ",", &rest); item != NULL && status == GONIO_OK;
         item = strtok_r(NULL, ",", &rest)) {
        status = parse_item(item, m, error);
    }
    free(copy);
    return status == GONIO_OK ? settle_numbers(m, error) : status;
}

// ---- the other settings ----

static gonio_status parse_separator(const char *text, char *separator, gonio_error *error) {
    static const struct {
        const char *name;
        char sign;
    } words[] = {{"auto", 0},   {",", ','},   {"comma", ','},  {";", ';'},      {"semicolon", ';'}, {"tab", '\t'},
                 {"\\t", '\t'}, {"\t", '\t'}, {"blanks", ' '}, {"blank", ' '},  {" ", ' '},         {"space", ' '},
                 {"|", '|'},    {":", ':'},   {"bar", '|'},    {"spaces", ' '}, {"colon", ':'}};
    for (size_t k = 0; k < sizeof words / sizeof *words; k++) {
        if (strcmp(text, words[k].name) == 0) {
            *separator = words[k].sign;
            return GONIO_OK;
        }
    }
    return gonio_fail(error, GONIO_E_USAGE,
                      "separator: expected comma, semicolon, tab, blanks, bar, colon or auto, "
                      "found '%.40s'",
                      text);
}

static gonio_status parse_decimal(const char *text, char *decimal, gonio_error *error) {
    const bool point = strcmp(text, ".") == 0 || strcmp(text, "point") == 0;
    const bool comma = strcmp(text, ",") == 0 || strcmp(text, "comma") == 0;
    *decimal = point ? '.' : comma ? ',' : 0;
    return point || comma || strcmp(text, "auto") == 0
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE, "decimal: expected . or , or auto, found '%.40s'", text);
}

gonio_status gonio_mapping_parse(const gonio_format_values *values, gonio_mapping *m, gonio_error *error) {
    const gonio_format_value *at = values->at;
    *m = (gonio_mapping){.is_signed = at[GONIO_TABLE_SIGNED].choice == 1,
                         .radians = at[GONIO_TABLE_ANGLES].choice == 1,
                         .elevation = at[GONIO_TABLE_ELEVATION].choice == 1,
                         .quantity = (gonio_quantity)at[GONIO_TABLE_QUANTITY].choice,
                         .mirror_at = at[GONIO_TABLE_MIRROR_AT].choice};
    const char *wavelength = at[GONIO_TABLE_WAVELENGTH].text;
    m->wavelength = strcmp(wavelength, "auto") != 0 ? wavelength : NULL;
    gonio_status status = parse_columns(at[GONIO_TABLE_COLUMNS].text, m, error);
    status = status == GONIO_OK ? parse_separator(at[GONIO_TABLE_SEPARATOR].text, &m->separator, error) : status;
    status = status == GONIO_OK ? parse_decimal(at[GONIO_TABLE_DECIMAL].text, &m->decimal, error) : status;
    return status; // a comma may be both, between quotes
}
