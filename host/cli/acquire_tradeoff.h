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

// The rows, measured one after the other; told on stderr as they come. GONIO_E_USAGE for a list that cannot be. The
// caller frees *rows, also on failure.
gonio_status cli_acquire_run(const cli_acquire_request *request, cli_acquire_row **rows, size_t *n, gonio_error *error);
// Error against poses (minutes: against the rig's), as SVG.
gonio_status cli_acquire_plot(const cli_acquire_row *rows, size_t n, bool minutes, const char *path,
                              gonio_error *error);

#endif
