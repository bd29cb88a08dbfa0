// SPDX-License-Identifier: BSD-3-Clause
// Which format a file has, by its content, and the calls that do not depend on it.
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "io/map_file.h"
#include "io/table.h"

void gonio_read_options_default(gonio_read_options *options) { *options = (gonio_read_options){.seed = 1}; }

#define MODEL_MAGIC "GONIOMDL"

bool gonio_model_file_is(const char *path) {
    struct stat facts;
    char head[8] = "";
    if (stat(path, &facts) != 0 || !S_ISREG(facts.st_mode)) {
        return false;
    }
    FILE *file = fopen(path, "rbe");
    const bool is = file != NULL && fread(head, 1, 8, file) == 8 && memcmp(head, MODEL_MAGIC, 8) == 0;
    if (file != NULL) {
        fclose(file);
    }
    return is;
}

static gonio_status unknown_format(const gonio_source *source, const char *expected, gonio_error *error) {
    const unsigned char *d = (const unsigned char *)source->data;
    static const struct {
        const char *mark;
        size_t size;
        const char *name;
    } packed[] = {{"\xfd"
                   "7zXZ",
                   5, "xz"},
                  {"\x1f\x8b", 2, "gzip"},
                  {"\x28\xb5\x2f\xfd", 4, "zstd"},
                  {"PK\3\4", 4, "zip"}};
    for (size_t i = 0; i < sizeof packed / sizeof *packed; i++) {
        if (source->size >= packed[i].size && memcmp(d, packed[i].mark, packed[i].size) == 0) {
            return gonio_fail_byte(error, GONIO_E_INPUT, source->path, 0, "it is compressed (%s); unpack it first",
                                   packed[i].name);
        }
    }
    if (source->size >= 8 && memcmp(d, MODEL_MAGIC, 8) == 0) {
        return gonio_fail_byte(error, GONIO_E_INPUT, source->path, 0,
                               "it is a fitted model; expected samples or a measured table");
    }
    char line[81];
    long long number;
    if (gonio_source_first_line(source, line, sizeof line, &number)[0] != 0) {
        return gonio_fail_line(
            error, GONIO_E_INPUT, source->path, number,
            "unknown text, beginning with '%s'; `gonio look` proposes how a table may be read; expected%s", line,
            expected);
    }
    return gonio_fail_byte(error, GONIO_E_INPUT, source->path, 0, "no BRDF file of a known format; expected%s",
                           expected);
}

// wanted: which formats the caller can use, for the message. mapped: a text is a table that a mapping describes.
static gonio_status open_source(const char *path, bool (*wanted)(const gonio_format *format), bool mapped,
                                gonio_source *source, const gonio_format **format, gonio_error *error) {
    *source = (gonio_source){.path = path};
    char expected[400];
    gonio_format_summaries(wanted, expected, sizeof expected);
    gonio_status status = gonio_file_read(path, 0, &source->data, &source->size, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (source->size == 0) {
        status = gonio_fail_byte(error, GONIO_E_INPUT, path, 0, "the file is empty; expected%s", expected);
    } else {
        status = gonio_text_check(path, source->data, source->size, error);
    }
    if (status == GONIO_OK && mapped && gonio_table_may_be(source)) {
        *format = &gonio_format_table;
        return GONIO_OK;
    }
    if (status == GONIO_OK) {
        for (int i = 0; (*format = gonio_format_at(i)) != NULL; i++) {
            if ((*format)->recognise(source)) {
                return GONIO_OK;
            }
        }
        status = unknown_format(source, expected, error);
    }
    free(source->data);
    return status;
}

static bool any(const gonio_format *format) { return format->read != NULL; }
static bool tables(const gonio_format *format) { return format->table != NULL; }

// Which file told the mapping, before what it said.
static void note_map(const char *path, gonio_read_report *report) {
    char notes[sizeof report->notes];
    snprintf(notes, sizeof notes, "%s", report->notes);
    snprintf(report->notes, sizeof report->notes, "read as %.200s says\n", path);
    gonio_text_append(report->notes, sizeof report->notes, "%s", notes);
}

gonio_status gonio_read(const char *path, const gonio_read_options *options, gonio_samples **out,
                        gonio_read_report *report, gonio_error *error) {
    *out = NULL;
    gonio_source source;
    const gonio_format *format;
    gonio_map map;
    gonio_status status = gonio_map_load(path, options, &map, error);
    status = status == GONIO_OK ? open_source(path, any, map.applies, &source, &format, error) : status;
    if (status != GONIO_OK) {
        gonio_map_free(&map);
        return status;
    }
    gonio_format_values values;
    status = gonio_format_parse(format, format->by_mapping ? &map.options : options, &values, error);
    status = status == GONIO_OK ? format->read(&source, &values, out, report, error) : status;
    if (status == GONIO_OK && format->by_mapping && map.path[0] != 0 && report != NULL) {
        note_map(map.path, report);
    }
    gonio_map_free(&map);
    free(source.data);
    if (status == GONIO_OK) {
        status = gonio_channel_names_check(path, (const char(*)[GONIO_CHANNEL_NAME_MAX])(*out)->channel_names,
                                           (*out)->channels, error);
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}

bool gonio_format_is_table(const char *path) {
    gonio_source source;
    const gonio_format *format;
    if (open_source(path, tables, false, &source, &format, NULL) != GONIO_OK) {
        return false;
    }
    free(source.data);
    return format->table != NULL;
}

gonio_status gonio_read_table(const char *path, gonio_model **out, gonio_error *error) {
    *out = NULL;
    gonio_source source;
    const gonio_format *format;
    gonio_status status = open_source(path, tables, false, &source, &format, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (format->table != NULL) {
        status = format->table(&source, out, error);
    } else {
        status = gonio_fail_byte(error, GONIO_E_INPUT, path, -1,
                                 "it holds scattered samples (%s), neither a model nor a table; `gonio fit` makes a "
                                 "model of them",
                                 format->name);
    }
    free(source.data);
    return status;
}
