// SPDX-License-Identifier: BSD-3-Clause
// Table-driven options: every verb states its table once; parsing and --help both come from it.
#include "host/cli/cli.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/keys.h"
#include "host/cli/apart.h"

static void help_rows(const cli_option *options) {
    for (const cli_option *o = options; o != NULL && o->name != NULL; o++) {
        if (o->kind == CLI_TABLE) {
            help_rows(o->value);
            continue;
        }
        char left[64];
        snprintf(left, sizeof left, "--%s%s%s%s", o->name, o->argument ? " " : "", o->argument ? o->argument : "",
                 o->letter ? (char[]){',', ' ', '-', o->letter, 0} : "");
        printf("  %-32s %s\n", left, o->help);
    }
}

static void help(const cli_verb *verb, const cli_option *options) {
    printf("usage: gonio %s %s\n%s\n\n", verb->name, verb->arguments, verb->summary);
    help_rows(options);
    printf("  %-32s %s\n  %-32s %s\n  %-32s %s\n", "--json", "one JSON object on stdout", "--seed N",
           "seed of everything random (1)", "--threads N", "threads to use (all); results do not depend on it");
}

static const cli_option *find(const cli_option *options, const char *name, size_t length, char letter) {
    for (const cli_option *o = options; o != NULL && o->name != NULL; o++) {
        if (o->kind == CLI_TABLE) {
            const cli_option *nested = find(o->value, name, length, letter);
            if (nested != NULL) {
                return nested;
            }
        } else if (name != NULL ? strlen(o->name) == length && strncmp(o->name, name, length) == 0
                                : o->letter == letter) {
            return o;
        }
    }
    return NULL;
}

// How texts become numbers; the other kinds are taken as they are.
static const gonio_key numbers[] = {
    [CLI_INT] = {.name = "", .kind = GONIO_KEY_INTEGER, .size = sizeof(int)},
    [CLI_U64] = {.name = "", .kind = GONIO_KEY_SEED, .size = sizeof(uint64_t)},
    [CLI_SIZE] = {.name = "", .kind = GONIO_KEY_SIZE, .size = sizeof(size_t)},
    [CLI_DOUBLE] = {.name = "", .kind = GONIO_KEY_REAL, .size = sizeof(double)},
};

// A number, or one over another: exposures are 1/60 to photographers.
static bool store_real(double *value, const char *text) {
    const char *slash = strchr(text, '/');
    char first[64];
    double over = 1, number;
    snprintf(first, sizeof first, "%.*s", (int)(slash != NULL ? slash - text : (long)strlen(text)), text);
    const gonio_key *real = &numbers[CLI_DOUBLE];
    if (gonio_key_parse(real, &number, first, NULL) != GONIO_OK ||
        (slash != NULL && (gonio_key_parse(real, &over, slash + 1, NULL) != GONIO_OK || over == 0))) {
        return false;
    }
    *value = number / over;
    return true;
}

static bool store(const cli_option *option, const char *text) {
    cli_list *list = option->value;
    switch (option->kind) {
    case CLI_FLAG:
        *(bool *)option->value = true;
        return true;
    case CLI_DOUBLE:
        return store_real(option->value, text);
    case CLI_INT:
    case CLI_U64:
    case CLI_SIZE:
        return gonio_key_parse(&numbers[option->kind], option->value, text, NULL) == GONIO_OK;
    case CLI_TEXT:
    case CLI_OUTPUT:
        *(const char **)option->value = text;
        return true;
    case CLI_LIST:
        if (list->n == (int)(sizeof list->items / sizeof *list->items)) {
            return false;
        }
        list->items[list->n++] = text;
        return true;
    case CLI_TABLE: // never found
        break;
    }
    return false;
}

// One argument that begins with '-'; *i moves on when the value is a word of its own.
static bool parse_one(const cli_verb *verb, const cli_option *options, int argc, char **argv, int *i,
                      cli_common *common) {
    const char *argument = argv[*i];
    const bool is_long = argument[1] == '-';
    const char *equals = is_long ? strchr(argument, '=') : NULL;
    const size_t length = equals != NULL ? (size_t)(equals - argument - 2) : strlen(argument + 1) - 1;
    const cli_option *option = is_long ? find(options, argument + 2, length, 0) : find(options, NULL, 0, argument[1]);
    if (option == NULL) {
        cli_usage(common, "%s: unknown option %s; `gonio %s --help` lists them", verb->name, argument, verb->name);
        return false;
    }
    const char *text = equals != NULL ? equals + 1 : NULL;
    if (option->kind == CLI_FLAG) {
        if (text != NULL) {
            cli_usage(common, "%s: --%s takes no value", verb->name, option->name);
            return false;
        }
    } else if (text == NULL && !is_long && argument[2] != 0) {
        text = argument + 2;
    } else if (text == NULL) {
        if (*i + 1 >= argc) {
            cli_usage(common, "%s: --%s needs %s", verb->name, option->name, option->argument);
            return false;
        }
        text = argv[++*i];
    }
    if (!store(option, text)) {
        cli_usage(common, "%s: --%s: expected %s, found '%s'", verb->name, option->name, option->argument, text);
        return false;
    }
    if (option->given != NULL) {
        *option->given = true;
    }
    if (option->kind == CLI_OUTPUT && common->written.n < (int)(sizeof common->written.items / sizeof(char *))) {
        common->written.items[common->written.n++] = text;
        common->written_as.items[common->written_as.n++] = option->argument;
    }
    return true;
}

static bool wants_json(int argc, char **argv) {
    for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++) {
        if (strcmp(argv[i], "--json") == 0) {
            return true;
        }
    }
    return false;
}

bool cli_parse(const cli_verb *verb, const cli_option *options, int argc, char **argv, const char **positionals,
               int minimum, int maximum, int *count, cli_common *common) {
    *common = (cli_common){.json = wants_json(argc, argv), .seed = 1, .argc = argc, .argv = argv};
    const cli_option own[] = {{"json", 0, CLI_FLAG, &common->json, NULL, NULL, ""},
                              {"seed", 0, CLI_U64, &common->seed, NULL, "N", ""},
                              {"threads", 0, CLI_INT, &common->threads, NULL, "N", ""},
                              {0}};
    int found = 0;
    bool options_end = false;
    for (int i = 1; i < argc; i++) {
        const char *argument = argv[i];
        if (!options_end && strcmp(argument, "--help") == 0) {
            help(verb, options);
            exit(0);
        }
        if (!options_end && strcmp(argument, "--") == 0) {
            options_end = true;
        } else if (!options_end && argument[0] == '-' && argument[1] != 0) {
            const char *name = argument[1] == '-' ? argument + 2 : NULL;
            const bool is_own = name != NULL && find(own, name, strcspn(name, "="), 0) != NULL;
            if (!parse_one(verb, is_own ? own : options, argc, argv, &i, common)) {
                return false;
            }
        } else if (found < maximum) {
            positionals[found++] = argument;
        } else {
            cli_usage(common, "%s: unexpected argument '%s'; usage: gonio %s %s", verb->name, argument, verb->name,
                      verb->arguments);
            return false;
        }
    }
    if (found < minimum) {
        cli_usage(common, "usage: gonio %s %s", verb->name, verb->arguments);
        return false;
    }
    if (common->threads < 0 || common->threads > 4096) {
        cli_usage(common, "%s: --threads: expected 0 (all) to 4096, found %d", verb->name, common->threads);
        return false;
    }
    *count = found;
    return cli_apart_all(common);
}
