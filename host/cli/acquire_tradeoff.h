// SPDX-License-Identifier: BSD-3-Clause
// The rows of `gonio tradeoff --acquire`: measures of a known sample on the simulated rig.
#ifndef GONIO_CLI_ACQUIRE_TRADEOFF_H
#define GONIO_CLI_ACQUIRE_TRADEOFF_H

#include "gonio/metrics.h"
#include "host/cli/rig_file.h"

typedef struct cli_acquire_row {
    char kind[16], plan[512];       // "adaptive", "adaptive:80"
    double exposure_s, aperture_mm; // longest exposure, 0: the camera's; the pupil's radius, -1: the rig's
    size_t poses, frames;
    double rig_min, poses_min; // on the nominal clock: all of it, and from the first pose on
    gonio_errors errors;       // of the fit, at directions that nobody measured, against the truth
    double choosing_s;         // an adaptive plan's
    gonio_status status;
    gonio_error error; // where it failed
} cli_acquire_row;

typedef struct cli_acquire_request {
    cli_rig_options rig;
    const char *sample, *plans, *poses, *exposures, *apertures, *needs, *prior; // lists with commas between them
    int threads;
} cli_acquire_request;

// Its options: put them into the verb's table. `a` is a cli_acquire_request.
#define CLI_ACQUIRE_OPTIONS(a)                                                                                         \
    {"plans",                                                                                                          \
     0,                                                                                                                \
     CLI_TEXT,                                                                                                         \
     &(a).plans,                                                                                                       \
     NULL,                                                                                                             \
     "LIST",                                                                                                           \
     "--acquire: of uniform, nusselt, adaptive, scene, prior (all that can be)"},                                      \
        {"poses", 0, CLI_TEXT, &(a).poses, NULL, "LIST", "--acquire: numbers of poses (40,80,160)"},                   \
        {"exposures", 0, CLI_TEXT, &(a).exposures, NULL, "LIST", "--acquire: longest exposures in s (the camera's)"},  \
        {"apertures", 0, CLI_TEXT, &(a).apertures, NULL, "LIST", "--acquire: the pupil's radii in mm (the rig's)"},    \
        {"scene", 0, CLI_TEXT, &(a).needs, NULL, "NEEDS", "--acquire: of `gonio scene needs`, for scene plans"}, {     \
        "prior", 0, CLI_TEXT, &(a).prior, NULL, "PRIOR", "--acquire: of `gonio learn`, for prior plans"                \
    }

// Measure, write to the folder, print; the exit status.
int cli_acquire(cli_acquire_request *request, const char *folder, cli_common *common);
// The rows, measured one after the other; told on stderr as they come. GONIO_E_USAGE for a list that cannot be. The
// caller frees *rows, also on failure.
gonio_status cli_acquire_run(const cli_acquire_request *request, cli_acquire_row **rows, size_t *n, gonio_error *error);
// Error against poses (minutes: against the rig's), as SVG.
gonio_status cli_acquire_plot(const cli_acquire_row *rows, size_t n, bool minutes, const char *path,
                              gonio_error *error);

#endif
