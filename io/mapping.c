// SPDX-License-Identifier: BSD-3-Clause
#include "io/mapping.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/number.h"
#include "gonio/output.h"

extern const gonio_format gonio_format_table;

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
                         .quantity = (gonio_quantity)at[GONIO_TABLE_QUANTITY].choice,
                         .mirror_at = at[GONIO_TABLE_MIRROR_AT].choice};
    const char *wavelength = at[GONIO_TABLE_WAVELENGTH].text;
    m->wavelength = strcmp(wavelength, "auto") != 0 ? wavelength : NULL;
    gonio_status status = parse_columns(at[GONIO_TABLE_COLUMNS].text, m, error);
    status = status == GONIO_OK ? parse_separator(at[GONIO_TABLE_SEPARATOR].text, &m->separator, error) : status;
    status = status == GONIO_OK ? parse_decimal(at[GONIO_TABLE_DECIMAL].text, &m->decimal, error) : status;
    if (status == GONIO_OK && m->decimal == ',' && m->separator == ',') {
        status = gonio_fail(error, GONIO_E_USAGE, "a comma is either the separator or the decimal sign");
    }
    return status;
}

// ---- kept beside the data ----

// Which option of the format: -1: none.
static int option_of(const char *name) {
    const gonio_format_option *options = gonio_format_table.options;
    for (int k = 0; options[k].name != NULL; k++) {
        if (strcmp(options[k].name, name) == 0) {
            return k;
        }
    }
    return -1;
}

static const char *setting_of(const gonio_read_options *options, const char *name) {
    for (int k = 0; k < GONIO_FORMAT_SETTINGS_MAX && options->settings[k].name != NULL; k++) {
        if (strcmp(options->settings[k].name, name) == 0) {
            return options->settings[k].value;
        }
    }
    return NULL;
}

static bool is_given(const gonio_read_options *options) {
    for (int k = GONIO_TEXT_OPTIONS_N; gonio_format_table.options[k].name != NULL; k++) {
        if (setting_of(options, gonio_format_table.options[k].name) != NULL) {
            return true;
        }
    }
    return false;
}

// One line of the file, which must be a setting of the format that could have been given as an option.
static gonio_status take_line(const gonio_text *text, char *line, const gonio_read_options *given, gonio_map *map,
                              gonio_error *error) {
    char *equals = strchr(line, '=');
    if (equals == NULL) {
        return gonio_text_fail(text, error, "expected key = value, found '%.60s'", line);
    }
    *equals = 0;
    const char *key = gonio_text_trim(line), *value = gonio_text_trim(equals + 1);
    const int option = option_of(key);
    if (option < 0 || option == GONIO_TABLE_MAP) {
        return gonio_text_fail(text, error, "'%.60s' is no setting of a mapping; `gonio formats` lists them", key);
    }
    int n = 0;
    while (n < GONIO_FORMAT_SETTINGS_MAX && map->options.settings[n].name != NULL) {
        n++;
    }
    gonio_error wrong = {.line = -1, .byte = -1};
    gonio_format_values values;
    gonio_mapping mapping;
    const gonio_read_options one = {.settings = {{gonio_format_table.options[option].name, value}}};
    if (gonio_format_parse(&gonio_format_table, &one, &values, &wrong) != GONIO_OK ||
        gonio_mapping_parse(&values, &mapping, &wrong) != GONIO_OK) {
        return gonio_text_fail(text, error, "%s", wrong.message);
    }
    if (setting_of(given, key) == NULL) {
        if (setting_of(&map->options, key) != NULL || n == GONIO_FORMAT_SETTINGS_MAX) {
            return gonio_text_fail(text, error, "%s stands there twice", key);
        }
        map->options.settings[n] = one.settings[0];
    }
    return GONIO_OK;
}

static gonio_status read_file(const gonio_read_options *given, gonio_map *map, gonio_error *error) {
    gonio_text text;
    gonio_status status = gonio_text_open(map->path, (size_t)1 << 20, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    for (char *line; status == GONIO_OK && (line = gonio_text_content(&text)) != NULL;) {
        status = take_line(&text, line, given, map, error);
    }
    map->data = text.data;
    return status;
}

gonio_status gonio_map_load(const char *path, const gonio_read_options *given, gonio_map *map, gonio_error *error) {
    static const gonio_read_options nothing = {.seed = 1};
    given = given != NULL ? given : &nothing;
    *map = (gonio_map){.options = *given};
    const char *named = setting_of(given, gonio_format_table.options[GONIO_TABLE_MAP].name);
    const int length = named != NULL ? snprintf(map->path, sizeof map->path, "%s", named)
                                     : snprintf(map->path, sizeof map->path, "%s" GONIO_MAP_ENDING, path);
    const bool there = (size_t)length < sizeof map->path && strcmp(path, "-") != 0 && access(map->path, F_OK) == 0;
    if (named == NULL && !there) {
        map->path[0] = 0;
    }
    map->applies = is_given(given) || map->path[0] != 0;
    return map->path[0] != 0 ? read_file(given, map, error) : GONIO_OK;
}

void gonio_map_free(gonio_map *map) {
    free(map->data);
    map->data = NULL;
}

gonio_status gonio_map_save(const char *path, const gonio_read_options *options, gonio_error *error) {
    char map[4096];
    if (!is_given(options) || strcmp(path, "-") == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "save-map: there is no mapping to keep beside %s", path);
    }
    if ((size_t)snprintf(map, sizeof map, "%s" GONIO_MAP_ENDING, path) >= sizeof map) {
        return gonio_fail(error, GONIO_E_USAGE, "save-map: the path is too long");
    }
    gonio_output *output;
    const gonio_status status = gonio_output_open(map, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    fputs("# What the columns of the table beside this file mean; options of the command line come before it.\n",
          stream);
    for (int k = 0; k < GONIO_FORMAT_SETTINGS_MAX && options->settings[k].name != NULL; k++) {
        const int option = option_of(options->settings[k].name);
        if (option >= 0 && option != GONIO_TABLE_MAP) {
            const char *value = options->settings[k].value;
            fprintf(stream, "%s = %s\n", options->settings[k].name,
                    strcmp(value, "\t") == 0  ? "tab"
                    : strcmp(value, " ") == 0 ? "blanks"
                                              : value);
        }
    }
    return gonio_output_commit(output, error);
}
