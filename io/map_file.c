// SPDX-License-Identifier: BSD-3-Clause
#include "io/map_file.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "gonio/output.h"
#include "io/table.h"

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
