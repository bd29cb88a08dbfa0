// SPDX-License-Identifier: BSD-3-Clause
// gonio compare MODEL SCENE.ini|NEEDS: how far pictures with the model lie from those with another.
#ifndef GONIO_CLI_COMPARE_SCENE_H
#define GONIO_CLI_COMPARE_SCENE_H

#include "host/cli/cli.h"

typedef struct compare_request {
    const char *model, *scene, *truth, *material; // truth NULL: the scene's own model; material NULL: the only one
    double turn_deg;
} compare_request;

int cli_compare_scene(const compare_request *request, const cli_common *common);

#endif
