// SPDX-License-Identifier: BSD-3-Clause
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "gonio/version.h"
#include "host/cli/cli.h"
#include "host/cli/verbs.h"

#define X(name) extern const cli_verb cmd_##name;
CLI_VERBS(X)
#undef X

static const cli_verb *const verbs[] = {
#define X(name) &cmd_##name,
    CLI_VERBS(X)
#undef X
        NULL};

static void usage(FILE *stream) {
    fputs("usage: gonio VERB ...\n\n", stream);
    for (const cli_verb *const *v = verbs; *v != NULL; v++) {
        fprintf(stream, "  %-10s %s\n", (*v)->name, (*v)->summary);
    }
    fputs("\n`gonio VERB --help` tells all about one.\n"
          "Exit status: 0 done, 1 the work failed, 2 wrong usage, 3 bad input, 4 interrupted.\n",
          stream);
}

// What went to standard output must have arrived: a full disk there is a failure like any other.
static int flushed(int status) {
    if (fflush(stdout) == 0 && !ferror(stdout)) {
        return status;
    }
    fprintf(stderr, "gonio: cannot write standard output: %s\n", strerror(errno));
    return status == 0 ? gonio_status_exit(GONIO_E_IO) : status;
}

static int run(int argc, char **argv) {
    if (argc < 2) {
        usage(stderr);
        return 2;
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "help") == 0) {
        usage(stdout);
        return 0;
    }
    if (strcmp(argv[1], "--version") == 0) {
        puts("gonio " GONIO_VERSION);
        return 0;
    }
    for (const cli_verb *const *v = verbs; *v != NULL; v++) {
        if (strcmp(argv[1], (*v)->name) == 0) {
            return flushed((*v)->run(argc - 1, argv + 1));
        }
    }
    fprintf(stderr, "gonio: unknown verb '%s'; `gonio --help` lists them\n", argv[1]);
    return 2;
}

// Everything is written and closed by now, and the libraries' own ends are not waited for: OpenBLAS, which others load,
// joins its threads there, and one that found no memory for its buffer tries for it for ever.
int main(int argc, char **argv) {
    const int status = run(argc, argv);
#ifndef __SANITIZE_ADDRESS__ // whose leaks are told in the end
    fflush(NULL);
    _exit(status);
#endif
    return status;
}
