// SPDX-License-Identifier: BSD-3-Clause
// What the verbs of the command line share: options, results, progress. Only under host/cli is anything printed.
#ifndef GONIO_CLI_H
#define GONIO_CLI_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/check.h"
#include "gonio/coverage.h"
#include "gonio/metrics.h"
#include "gonio/status.h"
#include "host/control/control.h"

typedef enum cli_kind {
    CLI_FLAG,
    CLI_INT,
    CLI_U64,
    CLI_SIZE,
    CLI_DOUBLE,
    CLI_TEXT,
    CLI_OUTPUT,
    CLI_LIST,
    CLI_TABLE
} cli_kind;

// The texts of an option that may be repeated, in their order; borrowed from argv.
typedef struct cli_list {
    const char *items[64];
    int n;
} cli_list;

// One option: where its value goes and what --help says. A table ends with {0}. CLI_FLAG: bool *, CLI_INT: int *,
// CLI_U64: uint64_t *, CLI_SIZE: size_t * (suffixes k, M, G), CLI_DOUBLE: double *, CLI_TEXT: const char **,
// CLI_OUTPUT: const char **, a file that the verb writes, which is none of its inputs (apart.h), CLI_LIST: cli_list *,
// one item each time the option is given. CLI_TABLE: const cli_option *, the rows of another table, which stand here;
// only value counts, and name is not NULL.
typedef struct cli_option {
    const char *name; // "hold-out"
    char letter;      // 'o', or 0
    cli_kind kind;
    void *value;
    bool *given;          // set when the option is given; may be NULL
    const char *argument; // "FRACTION"; NULL for flags
    const char *help;
} cli_option;

// Options that every verb has.
typedef struct cli_common {
    bool json;
    uint64_t seed; // 1 by default
    int threads;   // 0: all
    // For apart.h: what was given, and which of it are files to be written.
    int argc;
    char *const *argv;
    cli_list written, written_as;    // paths, and the options' arguments, which say what is written
    const char *folder;              // in which the verb writes the files; NULL: none
    const char *const *folder_files; // NULL ends them
} cli_common;

typedef struct cli_verb {
    const char *name;
    const char *arguments;             // "INPUT -o MODEL [options]"
    const char *summary;               // one line
    int (*run)(int argc, char **argv); // argv[0] is the verb; returns the exit status
} cli_verb;

// Parse argv[1..] of a verb: options in any place, `--` ends them. positionals[minimum..maximum] are filled in order
// and *count set. Prints help (and exits 0) for --help. Returns false after having reported wrong usage: return 2 then.
bool cli_parse(const cli_verb *verb, const cli_option *options, int argc, char **argv, const char **positionals,
               int minimum, int maximum, int *count, cli_common *common);

// A text of a file, a device or a session as it may be printed: gonio_text_printable. Of the last 8 calls of a thread.
const char *cli_text(const char *text);
// The same, line by line.
void cli_print_lines(const char *text);
// Report a failed call on stderr, or as {"error":...} on stdout with --json; returns the exit status.
int cli_fail(const cli_common *common, const gonio_error *error);
// Wrong usage found after parsing; returns 2.
int cli_usage(const cli_common *common, const char *format, ...) __attribute__((format(printf, 2, 3)));
// Print the object as one line on stdout and release it; returns 0, or 1 where there was no memory for it (NULL).
int cli_json(json_t *object);
// Jansson's json_string and json_pack for what comes from outside, and in their place everywhere here. A byte that is
// not UTF-8 becomes U+FFFD, a number that is not finite null, NULL null. pack knows { } [ ] s s? i I b f o O.
json_t *cli_json_string(const char *text);
json_t *cli_json_pack(const char *format, ...);
#define json_string cli_json_string
#define json_pack cli_json_pack
json_t *cli_json_real(double value);     // null for NaN and infinities
json_t *cli_json_text(const char *text); // null for the empty text
// A number of a struct, by name; a table of them ends with {0}.
typedef struct cli_figure {
    const char *name;
    size_t offset; // of a double in the struct
} cli_figure;
#define CLI_FIGURE(type, member)                                                                                       \
    { #member, offsetof(type, member) }
double cli_figure_of(const cli_figure *figure, const void *object);
json_t *cli_json_figures(const cli_figure *figures, const void *object);
extern const cli_figure cli_figures[];               // those of gonio_errors
extern const cli_figure cli_blur_figures[];          // those of gonio_blur that the rig alone gives
json_t *cli_json_errors(const gonio_errors *errors); // {"rmse", "max_abs" ...}: "train" and "held_out" of fit
// What a set of samples covers, and for what of it errors speak.
json_t *cli_json_coverage(const gonio_coverage *coverage);
// Are Mueller matrices among the channels, and are they realisable? null, or nothing printed, where there are none.
json_t *cli_json_mueller(const gonio_mueller_report *report);
void cli_print_mueller(const gonio_mueller_report *report);
void cli_print_coverage(const gonio_coverage *coverage);
void cli_print_errors(const char *label, const gonio_errors *errors);

// Progress on stderr: one line that rewrites itself on a TTY, else a plain line now and then. error_now may be NaN.
typedef struct cli_progress {
    const char *what;
    double started_s, last_s;
    bool tty, shown;
    double total; // units of work; 0: unknown
} cli_progress;
void cli_progress_start(cli_progress *progress, const char *what, double total);
void cli_progress_update(cli_progress *progress, double done, const char *detail, double error_now);
void cli_progress_end(cli_progress *progress);

// Ctrl-C, SIGTERM, a terminal that is gone (SIGHUP, unless it is ignored, as under nohup) and an output that nobody
// reads any more (SIGPIPE): the first asks to stop at the next checkpoint. A second Ctrl-C or SIGTERM ends the process
// at once with status 4.
void cli_catch_interrupts(void);
bool cli_interrupted(void);
// What this program drives may be stopped from another terminal too, which then counts as Ctrl-C; NULL: no longer.
void cli_steered_by(const gonio_control *control);

#endif
