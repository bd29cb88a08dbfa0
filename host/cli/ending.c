// SPDX-License-Identifier: BSD-3-Clause
// A file whose name promises another kind of file than it holds misleads every program that goes by names.
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "gonio/io.h"
#include "host/cli/apart.h"

// What the options call a kind of file, its ending, and what the file is.
static const struct {
    const char *what, *ending, *is;
} kinds[] = {{"MODEL", ".gonio", "a model file"},
             {"OUT", ".gonio", "a model file"},
             {"model", ".gonio", "a model file"},
             {"CSV", ".csv", "a CSV"},
             {"IMAGE.png", ".png", "a PNG picture"},
             {"INI", ".ini", "a rig file"},
             {"PGM", ".pgm", "a PGM picture"},
             {"FILE.svg|png", ".svg .png", "a picture"},
             {"FILE.png", ".png", "a PNG picture"},
             {"IMAGE", ".png", "a PNG picture"},
             {"CSV|MODEL", ".csv .gonio", "samples or a model"}};
#define KINDS (sizeof kinds / sizeof *kinds)

static bool ends_with(const char *path, const char *ending, size_t n) {
    const size_t length = strlen(path);
    return length > n && strncasecmp(path + length - n, ending, n) == 0;
}

// Has the path one of these, blanks between them?
static bool has_ending(const char *path, const char *endings) {
    for (const char *e = endings; *e != 0; e += strspn(e, " ")) {
        const size_t n = strcspn(e, " ");
        if (ends_with(path, e, n)) {
            return true;
        }
        e += n;
    }
    return false;
}

bool cli_ending(const cli_common *common, const char *output, const char *what) {
    const char *foreign = NULL;
    bool own = output == NULL;
    for (size_t k = 0; k < KINDS && !own; k++) {
        if (has_ending(output, kinds[k].ending)) {
            own = strcmp(what, kinds[k].what) == 0;
            foreign = kinds[k].is;
        }
    }
    gonio_format_facts f;
    for (int i = 0; gonio_format_get(i, &f) && !own; i++) {
        if (has_ending(output, f.extensions)) {
            own = strcmp(what, f.name) == 0;
            foreign = foreign == NULL ? f.summary : foreign;
        }
    }
    if (own || foreign == NULL) {
        return true;
    }
    cli_usage(common, "%s: the ending promises %s, but %s would be written; choose another name", output, foreign,
              what);
    return false;
}
