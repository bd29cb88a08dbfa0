// SPDX-License-Identifier: BSD-3-Clause
// gonio fit INPUT --scene NEEDS: options, steps and results.
#ifndef GONIO_CLI_SCENE_FIT_H
#define GONIO_CLI_SCENE_FIT_H

#include "gonio/scene_needs.h"
#include "host/cli/cli.h"

typedef struct cli_scene_fit {
    const char *needs, *material, *least;
    bool given[4]; // of --image-error, --psnr, --least, --truth
    gonio_scene_fit_options how;
    gonio_scene_fit_report report;
} cli_scene_fit;

// Rows of the verb's options; f is a cli_scene_fit.
#define CLI_SCENE_FIT_OPTIONS(f)                                                                                       \
    {                                                                                                                  \
        "scene",                                                                                                       \
        0,                                                                                                             \
        CLI_TEXT,                                                                                                      \
        &(f).needs,                                                                                                    \
        NULL,                                                                                                          \
        "NEEDS",                                                                                                       \
        "the smallest model for a scene's pictures (gonio scene needs)"},                                              \
        {"image-error",                                                                                                \
         0,                                                                                                            \
         CLI_DOUBLE,                                                                                                   \
         &(f).how.image_error,                                                                                         \
         &(f).given[0],                                                                                                \
         "E",                                                                                                          \
         "... mean distance of their 8-bit RGB at most"},                                                              \
        {"psnr", 0, CLI_DOUBLE, &(f).how.psnr_db, &(f).given[1], "DB", "... or their PSNR at least"},                  \
        {"material", 0, CLI_TEXT, &(f).material, NULL, "NAME", "... the scene's material that the samples are of"},    \
        {"least", 0, CLI_TEXT, &(f).least, &(f).given[2], "bytes|ns", "... what is to be least (bytes)"},              \
        {"truth",                                                                                                      \
         0,                                                                                                            \
         CLI_TEXT,                                                                                                     \
         &(f).how.truth,                                                                                               \
         &(f).given[3],                                                                                                \
         "MODEL",                                                                                                      \
         "... what the pictures should show (the samples' fit at its best)"},                                          \
    {                                                                                                                  \
        "turn", 0, CLI_DOUBLE, &(f).how.turn_deg, NULL, "DEG",                                                         \
            "... also compared from cameras so far round their targets (5)"                                            \
    }

// False after having reported wrong usage.
bool cli_scene_fit_check(cli_scene_fit *f, const cli_common *common);
gonio_status cli_scene_fit_run(cli_scene_fit *f, const gonio_samples *samples, const gonio_fit_options *options,
                               const cli_common *common, gonio_model **model, gonio_fit_report *report,
                               gonio_error *error);
void cli_scene_fit_print(const cli_scene_fit *f);
json_t *cli_scene_fit_json(const cli_scene_fit *f);

#endif
