// SPDX-License-Identifier: BSD-3-Clause
#include "host/acquire/rig_change.h"

#include <ini.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "host/acquire/rig_text.h"

// Keys that say where and how a device is reached, and nothing of what it then does.
static const char *const reach[] = {"port", "device", "baud", "parity", "timeout_ms", "retries", "replug_s"};

// Sections that name no device.
static bool is_of_host(const char *section) {
    static const char *const own[] = {"rig", "scan", "sample", "session"};
    bool is = strncmp(section, "axis ", 5) == 0 || strncmp(section, "keep-out", 8) == 0;
    for (size_t i = 0; i < sizeof own / sizeof *own; i++) {
        is = is || strcmp(section, own[i]) == 0;
    }
    return is;
}

typedef struct entry {
    char *section, *key, *values[2]; // in the file, over it; NULL: not given there
    bool told;                       // by the new file
} entry;

typedef struct change {
    entry *known;
    size_t n;
    FILE *out;
    gonio_error why;
} change;

static bool is_reach(const char *section, const char *key) {
    bool is = strcmp(section, "controller") == 0 && strcmp(key, "slave") == 0;
    for (size_t i = 0; i < sizeof reach / sizeof *reach; i++) {
        is = is || strcmp(key, reach[i]) == 0;
    }
    return is;
}

static entry *find(const change *c, const char *section, const char *key) {
    for (size_t i = 0; i < c->n; i++) {
        if (strcmp(c->known[i].section, section) == 0 && strcmp(c->known[i].key, key) == 0) {
            return &c->known[i];
        }
    }
    return NULL;
}

// A later value of a key counts.
static bool learn(change *c, const char *section, const char *key, const char *value, bool over) {
    entry *e = find(c, section, key);
    if (e == NULL) {
        entry *more = realloc(c->known, (c->n + 1) * sizeof *more);
        if (more == NULL) {
            return false;
        }
        c->known = more;
        e = &c->known[c->n++];
        *e = (entry){.section = strdup(section), .key = strdup(key)};
    }
    free(e->values[over]);
    e->values[over] = strdup(value);
    return e->section != NULL && e->key != NULL && e->values[over] != NULL;
}

static int on_known(void *user, const char *section, const char *key, const char *value) {
    return learn(user, section, key, value, false);
}

static gonio_status learn_settings(change *c, const char *settings, gonio_error *error) {
    char *copy = strdup(settings), *rest = copy, *line;
    bool fits = copy != NULL;
    while (fits && (line = strsep(&rest, "\n")) != NULL) {
        char *equals = strchr(line, '=');
        char *dot = equals;
        while (dot != NULL && dot > line && *dot != '.') {
            dot--;
        }
        if (dot != NULL && dot > line) {
            *equals = *dot = 0;
            fits = learn(c, line, dot + 1, equals + 1, true);
        }
    }
    free(copy);
    return fits ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
}

static bool same(const char *a, const char *b) {
    char *end_a, *end_b;
    if (a == NULL) {
        return false;
    }
    const double x = gonio_number_parse(a, &end_a), y = gonio_number_parse(b, &end_b);
    return strcmp(a, b) == 0 || (end_a != a && end_b != b && *end_a == 0 && *end_b == 0 && x == y);
}

static int on_new(void *user, const char *section, const char *key, const char *value) {
    change *c = user;
    if (c->why.status != GONIO_OK) {
        return 1; // inih goes on after an error; the first one counts
    }
    entry *e = find(c, section, key);
    if (e != NULL) {
        e->told = true;
    }
    if (e != NULL && (same(e->values[false], value) || same(e->values[true], value))) {
        return 1;
    }
    if (is_reach(section, key)) {
        fprintf(c->out, "%s.%s=%s\n", section, key, value);
        return 1;
    }
    char was[100] = "not given";
    if (e != NULL) {
        snprintf(was, sizeof was, "'%.80s'", e->values[e->values[true] != NULL]);
    }
    c->why.status = gonio_fail(&c->why, GONIO_E_INPUT,
                               "[%.60s] %.60s is '%.80s', and was %s when the session was begun; only where a device "
                               "is reached may be another",
                               section, key, value, was);
    return 0;
}

static gonio_status compare(change *c, const char *text, const char *path, gonio_error *error) {
    const int line = ini_parse_string(text, on_new, c);
    if (line == 0) {
        return GONIO_OK;
    }
    return c->why.status != GONIO_OK
               ? gonio_fail_line(error, GONIO_E_INPUT, path, line, "%s", c->why.message)
               : gonio_fail_line(error, GONIO_E_INPUT, path, line, "expected [section], key = value, or a comment");
}

static void forget(change *c, bool *whole) {
    *whole = true;
    for (size_t i = 0; i < c->n; i++) {
        const entry *e = &c->known[i];
        *whole = *whole && (e->told || is_of_host(e->section));
        free(e->section);
        free(e->key);
        free(e->values[false]);
        free(e->values[true]);
    }
    free(c->known);
}

// *lines: what the file changes; the caller frees it.
static gonio_status find_changes(const char *text, const char *settings, const char *path, char **lines, bool *whole,
                                 gonio_error *error) {
    change c = {.why = {.line = -1, .byte = -1}};
    size_t size;
    char *file = NULL;
    c.out = open_memstream(lines, &size);
    gonio_status status = c.out != NULL && ini_parse_string(text, on_known, &c) == 0
                              ? learn_settings(&c, settings, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    status = status == GONIO_OK ? gonio_rig_text_read(path, &file, error) : status;
    status = status == GONIO_OK ? gonio_rig_text_check(file, path, error) : status;
    status = status == GONIO_OK ? compare(&c, file, path, error) : status;
    forget(&c, whole);
    free(file);
    if (c.out != NULL) {
        fclose(c.out);
    }
    return status;
}

gonio_status gonio_rig_journalled(gonio_session *session, char **text, char **settings, gonio_error *error) {
    *settings = NULL;
    gonio_status status = gonio_session_get(session, "rig.ini", text, error);
    status = status == GONIO_OK ? gonio_session_find(session, "rig.settings", settings, error) : status;
    if (status == GONIO_OK && *settings == NULL) {
        *settings = strdup("");
        status = *settings != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    return status == GONIO_OK ? gonio_rig_text_check(*text, "the journalled rig file", error) : status;
}

gonio_status gonio_rig_change(gonio_session *session, const char *path, char **extra, bool *whole, gonio_error *error) {
    char *text = NULL, *settings = NULL, *lines = NULL, *both = NULL;
    gonio_status status = gonio_rig_journalled(session, &text, &settings, error);
    status = status == GONIO_OK ? find_changes(text, settings, path, &lines, whole, error) : status;
    if (status == GONIO_OK && asprintf(&both, "%s%s", lines, *extra) < 0) {
        both = NULL;
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    if (status == GONIO_OK) {
        free(*extra);
        *extra = both;
    }
    free(text);
    free(settings);
    free(lines);
    return status;
}
