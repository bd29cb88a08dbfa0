// INPUT of a verb: a session's folder, a samples file or any BRDF file that can be read.
#ifndef GONIO_CLI_INPUT_H
#define GONIO_CLI_INPUT_H

#include "gonio/io.h"
#include "host/cli/cli.h"

// What the options below fill; zero-initialise it.
typedef struct cli_input {
    const char *negatives, *mueller, *channel;
    double wavelength;
    size_t limit;
} cli_input;

// The options of every verb that takes INPUT; rows of its table.
#define CLI_INPUT_OPTIONS(in)                                                                                          \
    {"negatives",                                                                                                      \
     0,                                                                                                                \
     CLI_TEXT,                                                                                                         \
     &(in).negatives,                                                                                                  \
     NULL,                                                                                                             \
     "noise|reject|clamp|keep",                                                                                        \
     "negative values (noise: kept within 5 sigma of 0, else refused)"},                                               \
        {"channel", 0, CLI_TEXT, &(in).channel, NULL, "NAME", "only this channel"},                                    \
        {"wavelength", 0, CLI_DOUBLE, &(in).wavelength, NULL, "NM", "only this wavelength"},                           \
        {"mueller", 0, CLI_TEXT, &(in).mueller, NULL, "ELEMENT", "Mueller element of NIST data (f_r11)"}, {            \
        "limit", 0, CLI_SIZE, &(in).limit, NULL, "N", "at most about N samples of a table (MERL: all, RGL: 100k)"      \
    }

// Read INPUT; what was clamped or left out is told on stderr. The caller frees the samples.
gonio_status cli_input_read(const char *path, const cli_input *in, const cli_common *common, gonio_samples **out,
                            gonio_error *error);
// Use the number of threads that the user asked for.
void cli_use_threads(const cli_common *common);

#endif
