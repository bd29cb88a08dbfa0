// SPDX-License-Identifier: BSD-3-Clause
// What a verb writes is none of what it reads, and lies in no session. Files are compared by device and inode, so that
// links and other spellings of a path are seen through.
#include "host/cli/apart.h"

#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/text.h"
#include "gonio/session.h"
#include "io/map_file.h"

#define INI_MAX_BYTES ((size_t)1 << 20)

// Devices and pipes may well be both: a terminal is.
static bool look(const char *path, struct stat *facts) {
    return stat(path, facts) == 0 && (S_ISREG(facts->st_mode) || S_ISDIR(facts->st_mode));
}

static bool same(const char *a, const char *b) {
    struct stat left, right;
    return look(a, &left) && look(b, &right) && left.st_dev == right.st_dev && left.st_ino == right.st_ino;
}

// Does the text name that file: as a whole, or behind a mark as in spec:file:PATH,shape=sphere and camera.flat=PATH?
// folder (NULL: none): where it may be named from, too.
static bool names(const char *text, const char *path, const char *folder) {
    char part[PATH_MAX], within[2 * PATH_MAX + 2];
    for (const char *from = text; from != NULL; from = strpbrk(from, ":=,"), from += from != NULL) {
        const char *to = from + strlen(from);
        while (to > from) {
            snprintf(part, sizeof part, "%.*s", (int)(to - from), from);
            snprintf(within, sizeof within, "%s/%s", folder != NULL ? folder : "", part);
            if (same(part, path) || (folder != NULL && same(within, path))) {
                return true;
            }
            do {
                to--;
            } while (to > from && *to != ',');
        }
    }
    return false;
}

// Does a value of that INI file name it?
static bool names_within(const char *ini, const char *path) {
    struct stat facts;
    char *data;
    size_t size;
    if (!look(ini, &facts) || !S_ISREG(facts.st_mode) ||
        gonio_file_read(ini, INI_MAX_BYTES, &data, &size, NULL) != GONIO_OK) {
        return false;
    }
    gonio_text text = gonio_text_begin(ini, data, size);
    bool found = false;
    char copy[PATH_MAX];
    snprintf(copy, sizeof copy, "%s", ini);
    const char *folder = dirname(copy); // a scene's and a patch's paths are relative to their file
    for (char *line; !found && (line = gonio_text_content(&text)) != NULL;) {
        const char *equals = strchr(line, '=');
        found = equals != NULL && names(equals + 1 + strspn(equals + 1, " \t"), path, folder);
    }
    free(data);
    return found;
}

// The session that holds this path, "" where none does.
static void session_around(const char *path, char folder[PATH_MAX]) {
    char copy[PATH_MAX];
    snprintf(copy, sizeof copy, "%s", path);
    if (realpath(gonio_session_is(path) ? path : dirname(copy), folder) == NULL) {
        folder[0] = 0;
    }
    while (folder[0] != 0 && !gonio_session_is(folder)) {
        *strrchr(folder, '/') = 0;
    }
}

// A session's own model has its place there. The session may not be there yet.
static bool is_model_of(const char *path, const char *session) {
    char expected[PATH_MAX];
    size_t length = strlen(session);
    while (length > 1 && session[length - 1] == '/') {
        length--;
    }
    snprintf(expected, sizeof expected, "%.*s/model.gonio", (int)length, session);
    char a[PATH_MAX], b[PATH_MAX], left[PATH_MAX], right[PATH_MAX];
    snprintf(a, sizeof a, "%s", path);
    snprintf(b, sizeof b, "%s", path);
    const bool named = strcmp(basename(a), "model.gonio") == 0;
    return strcmp(path, expected) == 0 || (named && realpath(dirname(b), left) != NULL &&
                                           realpath(session, right) != NULL && strcmp(left, right) == 0);
}

// Is it within a session that this verb will only make?
static bool is_within(const char *path, const char *session) {
    size_t length = strlen(session);
    while (length > 1 && session[length - 1] == '/') {
        length--;
    }
    return strncmp(path, session, length) == 0 && path[length] == '/';
}

// What follows --rig or its like, and what is called .ini, is an INI file that names further inputs.
static const char *ini_of(const cli_common *common, int i) {
    static const char *const options[] = {"--rig", "--with", "--check"};
    for (size_t k = 0; k < sizeof options / sizeof *options; k++) {
        const size_t length = strlen(options[k]);
        if (i > 0 && strcmp(common->argv[i - 1], options[k]) == 0) {
            return common->argv[i];
        }
        if (strncmp(common->argv[i], options[k], length) == 0 && common->argv[i][length] == '=') {
            return common->argv[i] + length + 1;
        }
    }
    const char *dot = strrchr(common->argv[i], '.');
    return dot != NULL && strcmp(dot, ".ini") == 0 ? common->argv[i] : NULL;
}

static bool is_part(const char *part, const char *word) { return part >= word && part <= word + strlen(word); }

// The word that names a target itself names no input.
static bool names_target(const cli_common *common, const char *output, const char *word) {
    bool is = is_part(output, word);
    for (int k = 0; k < common->written.n; k++) {
        is = is || is_part(common->written.items[k], word);
    }
    return is;
}

static bool outside_sessions(const cli_common *common, const char *output) {
    char session[PATH_MAX];
    session_around(output, session);
    if (session[0] != 0) {
        cli_usage(common, "%s would be written into the session %s; write elsewhere", output, session);
    }
    return session[0] == 0;
}

// Is it the map file of that input?
static bool is_map_of(const char *word, const char *output) {
    char map[PATH_MAX];
    return (size_t)snprintf(map, sizeof map, "%s" GONIO_MAP_ENDING, word) < sizeof map && same(map, output);
}

bool cli_apart(const cli_common *common, const char *output) {
    for (int i = 1; i < common->argc; i++) {
        const char *word = common->argv[i], *ini = ini_of(common, i);
        if (!names_target(common, output, word) &&
            (names(word, output, NULL) || is_map_of(word, output) || (ini != NULL && names_within(ini, output)))) {
            cli_usage(common, "%s would be written over, and is read too (%s); write elsewhere", output, word);
            return false;
        }
    }
    const char *usual = getenv("GONIO_RIG"); // stands in for --rig
    if (usual != NULL && (same(usual, output) || names_within(usual, output))) {
        cli_usage(common, "%s would be written over, and is read too (GONIO_RIG=%s); write elsewhere", output, usual);
        return false;
    }
    return outside_sessions(common, output);
}

bool cli_apart_session(const cli_common *common, const char *session) {
    char parent[PATH_MAX];
    snprintf(parent, sizeof parent, "%s", session);
    char *folder = dirname(parent);
    return !gonio_session_is(folder) || outside_sessions(common, folder);
}

bool cli_apart_model(const cli_common *common, const char *output, const char *session) {
    if (output == NULL || is_model_of(output, session)) {
        return true;
    }
    if (is_within(output, session)) {
        cli_usage(common, "%s would be written into the session %s; write elsewhere", output, session);
        return false;
    }
    return cli_apart(common, output);
}

bool cli_apart_all(const cli_common *common) {
    for (int i = 0; i < common->written.n; i++) {
        const char *output = common->written.items[i];
        if (!cli_apart(common, output)) {
            return false;
        }
        for (int k = 0; k < i; k++) {
            if (strcmp(common->written.items[k], output) == 0 || same(common->written.items[k], output)) {
                cli_usage(common, "%s would be written twice", output);
                return false;
            }
        }
        if (!cli_ending(common, output, common->written_as.items[i])) {
            return false;
        }
    }
    return true;
}

gonio_status cli_apart_input(const cli_common *common, const char *path, gonio_error *error) {
    for (int i = 0; i < common->written.n; i++) {
        if (same(common->written.items[i], path)) {
            return gonio_fail(error, GONIO_E_USAGE, "%s would be written over, and is read too; write elsewhere",
                              common->written.items[i]);
        }
    }
    for (const char *const *f = common->folder_files; common->folder != NULL && *f != NULL; f++) {
        char target[PATH_MAX];
        snprintf(target, sizeof target, "%s/%s", common->folder, *f);
        if (same(target, path)) {
            return gonio_fail(error, GONIO_E_USAGE, "%s would be written over, and is read too; write elsewhere",
                              target);
        }
    }
    return GONIO_OK;
}

bool cli_apart_folder(cli_common *common, const char *folder, const char *const *files) {
    char path[PATH_MAX];
    common->folder = folder;
    common->folder_files = files;
    for (; folder != NULL && *files != NULL; files++) {
        snprintf(path, sizeof path, "%s/%s", folder, *files);
        if (!cli_apart(common, path)) {
            return false;
        }
    }
    return true;
}
