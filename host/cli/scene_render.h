// SPDX-License-Identifier: BSD-3-Clause
// gonio render SCENE.ini.
#ifndef GONIO_CLI_SCENE_RENDER_H
#define GONIO_CLI_SCENE_RENDER_H

#include "host/cli/cli.h"

typedef struct scene_request {
    const char *scene, *image; // image NULL: only compared
    int width, height;         // 0: what the file says
    int samples;               // the same
    bool interreflection;
    const char *camera, *reference, *difference;
    bool exposure_auto;
    double exposure_ev; // 0: light of 1 is white
} scene_request;

// Is it a scene's file, by its ending?
bool cli_is_scene(const char *name);
int cli_scene_render(const scene_request *request, const cli_common *common);

#endif
