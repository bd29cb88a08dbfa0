// SPDX-License-Identifier: BSD-3-Clause
#include "host/acquire/rig_text.h"

#include <ctype.h>
#include <ini.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"

#define FILE_MAX_BYTES (1 << 20)

// inih cuts lines at its buffer without a word, so longer ones are refused before.
gonio_status gonio_rig_text_check(const char *text, const char *name, gonio_error *error) {
    long long line = 1;
    while (*text != 0) {
        const size_t length = strcspn(text, "\n");
        if (length > INI_MAX_LINE - 3) {
            return gonio_fail_line(error, GONIO_E_INPUT, name, line, "a line of %zu bytes; at most %d are possible",
                                   length, INI_MAX_LINE - 3);
        }
        text += length + (text[length] == '\n');
        line++;
    }
    return GONIO_OK;
}

// The comment behind a value begins with ; or # after a blank; inih knows the ; alone. And to inih an indented line
// goes on with the value before, which no rig file means.
static void plain_lines(char *text) {
    char *to = text;
    for (const char *from = text; *from != 0;) {
        from += strspn(from, " \t");
        const size_t length = strcspn(from, "\n") + (strchr(from, '\n') != NULL);
        memmove(to, from, length);
        from += length;
        to += length;
    }
    *to = 0;
    for (char *mark = text; (mark = strchr(mark, '#')) != NULL; mark++) {
        if (mark > text && (mark[-1] == ' ' || mark[-1] == '\t')) {
            *mark = ';';
        }
    }
}

gonio_status gonio_rig_text_read(const char *path, char **text, gonio_error *error) {
    gonio_text file;
    gonio_status status = gonio_text_open(path, FILE_MAX_BYTES, &file, error);
    if (status == GONIO_OK && memchr(file.next, 0, (size_t)(file.end - file.next)) != NULL) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a rig file: a text without zero bytes is expected");
    }
    *text = status == GONIO_OK ? strdup(file.next) : NULL;
    gonio_text_free(&file);
    if (status == GONIO_OK && *text == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", path);
    }
    if (status == GONIO_OK) {
        plain_lines(*text);
    }
    return status;
}

// Where the next section.key= begins after a comma; values may hold commas themselves.
static const char *next_setting(const char *text) {
    for (const char *comma = strchr(text, ','); comma != NULL; comma = strchr(comma + 1, ',')) {
        const char *c = comma + 1;
        const char *dot = NULL;
        while (isalnum((unsigned char)*c) || *c == '_' || *c == ' ' || *c == '.') {
            dot = *c == '.' ? c : dot;
            c++;
        }
        if (*c == '=' && dot != NULL) {
            return comma;
        }
    }
    return text + strlen(text);
}

// One setting as a line of its own, which is how the journal keeps it. Its value is taken as it stands: nothing in it
// is a comment, as it would be in a rig file.
static gonio_status append_setting(FILE *stream, const char *setting, size_t length, gonio_error *error) {
    static const char sync[] = "sync="; // of the session, which has no other key: its section need not be told
    if (length >= sizeof sync - 1 && strncmp(setting, sync, sizeof sync - 1) == 0) {
        fprintf(stream, "session.%.*s\n", (int)length, setting);
        return GONIO_OK;
    }
    const char *equals = memchr(setting, '=', length);
    const char *dot = equals;
    while (dot != NULL && dot > setting && *dot != '.') {
        dot--;
    }
    if (equals == NULL || dot == setting || memchr(setting, '\n', length) != NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "setting: found '%.*s', expected SECTION.KEY=VALUE", (int)length,
                          setting);
    }
    fprintf(stream, "%.*s\n", (int)length, setting);
    return GONIO_OK;
}

// The settings of the options as lines.
gonio_status gonio_rig_text_settings(const gonio_rig_file_options *options, char **lines, gonio_error *error) {
    size_t size;
    FILE *stream = open_memstream(lines, &size);
    if (stream == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < options->n_settings; i++) {
        const char *setting = options->settings[i];
        while (status == GONIO_OK && *setting != 0) {
            const char *end = next_setting(setting);
            status = append_setting(stream, setting, (size_t)(end - setting), error);
            setting = *end == ',' ? end + 1 : end;
        }
    }
    fclose(stream);
    return status;
}

// The fragments, one behind the other.
gonio_status gonio_rig_text_fragments(const gonio_rig_file_options *options, char **text, gonio_error *error) {
    size_t size;
    FILE *stream = open_memstream(text, &size);
    if (stream == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < options->n_fragments; i++) {
        char *fragment;
        status = gonio_rig_text_read(options->fragments[i], &fragment, error);
        if (status == GONIO_OK) {
            fprintf(stream, "%s\n", fragment);
            free(fragment);
        }
    }
    fclose(stream);
    return status;
}

int gonio_rig_text_lines(const char *text) {
    int lines = text != NULL ? 1 : 0;
    for (; text != NULL && *text != 0; text++) {
        lines += *text == '\n';
    }
    return lines;
}
