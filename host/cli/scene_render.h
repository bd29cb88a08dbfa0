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
    const char *map, *show; // a characteristic point map to render by, and what to show of it
    bool exposure_auto;
    double exposure_ev; // 0: light of 1 is white
} scene_request;

// Is it a scene's file, by its ending?
bool cli_is_scene(const char *name);
// "N" or "WIDTHxHEIGHT".
bool cli_parse_size(const char *text, int *width, int *height);
int cli_scene_render(const scene_request *request, const cli_common *common);

#endif
