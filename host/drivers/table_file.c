// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/table_file.h"

#include <stdlib.h>
#include <string.h>

#include "base/text.h"

static gonio_status read_line(const gonio_table_form *form, const gonio_text *text, char *line, void *table,
                              gonio_error *error) {
    char *equals = strchr(line, '=');
    if (equals == NULL) {
        return gonio_text_fail(text, error, "expected key = value, found '%.60s'", line);
    }
    char *last = equals;
    while (last > line && (last[-1] == ' ' || last[-1] == '\t')) {
        last--;
    }
    *last = 0;
    const gonio_key *key = gonio_key_find(form->keys, "", line);
    if (key == NULL) {
        char list[400] = "";
        gonio_key_list(form->keys, "", list, sizeof list);
        return gonio_text_fail(text, error, "unknown key '%.40s'; expected one of:%s", line, list);
    }
    gonio_error why = {0};
    return gonio_key_parse(key, table, equals + 1 + strspn(equals + 1, " \t"), &why) == GONIO_OK
               ? GONIO_OK
               : gonio_text_fail(text, error, "%s", why.message);
}

// A comment begins behind blanks, so that ; and # can stand in a command.
static void cut_comment(char *line) {
    for (char *at = line; *at != 0; at++) {
        if ((*at == ';' || *at == '#') && (at == line || at[-1] == ' ' || at[-1] == '\t')) {
            *at = 0;
            break;
        }
    }
    for (char *end = line + strlen(line); end > line && (end[-1] == ' ' || end[-1] == '\t'); end--) {
        end[-1] = 0;
    }
}

static gonio_status read_text(const gonio_table_form *form, const char *path, char *data, size_t size, void *table,
                              gonio_error *error) {
    gonio_text text = gonio_text_begin(path, data, size);
    for (char *line; (line = gonio_text_line(&text)) != NULL;) {
        cut_comment(line);
        const gonio_status status = line[0] != 0 ? read_line(form, &text, line, table, error) : GONIO_OK;
        if (status != GONIO_OK) {
            return status;
        }
    }
    const char *missing = form->lacks(table);
    return missing == NULL ? GONIO_OK : gonio_text_fail(&text, error, "a %s needs %s", form->what, missing);
}

static gonio_status read_own(const gonio_table_form *form, const gonio_table_text *own, void *table,
                             gonio_error *error) {
    char *copy = strdup(own->text);
    const gonio_status status = copy != NULL ? read_text(form, own->name, copy, strlen(copy), table, error)
                                             : gonio_fail(error, GONIO_E_MEMORY, "no memory for a %s", form->what);
    free(copy);
    return status;
}

gonio_status gonio_table_file_read(const gonio_table_form *form, const char *name, void *table, gonio_error *error) {
    char names[100] = "";
    for (const gonio_table_text *own = form->texts; own->name != NULL; own++) {
        if (strcmp(own->name, name) == 0) {
            return read_own(form, own, table, error);
        }
        gonio_text_append(names, sizeof names, " %s", own->name);
    }
    if (strpbrk(name, "./") == NULL) {
        return gonio_fail(error, GONIO_E_INPUT, "%s '%.60s': expected one of:%s, or a file", form->what, name, names);
    }
    char *data;
    size_t size;
    gonio_status status = gonio_file_read(name, 1 << 20, &data, &size, error);
    if (status == GONIO_OK) {
        status = read_text(form, name, data, size, table, error);
        free(data);
    }
    return status;
}
