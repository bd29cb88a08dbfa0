// SPDX-License-Identifier: BSD-3-Clause
// Tiles from files: a picture of heights, a mesh; and which material lies where.
#ifndef GONIO_SCENE_PATCH_TILE_FILES_H
#define GONIO_SCENE_PATCH_TILE_FILES_H

#include "gonio/status.h"
#include "scene/patch/patch_mesh.h"
#include "scene/patch/settings.h"

// See gonio_patch_mesh_make.
gonio_status gonio_patch_heights_make(const patch_settings *settings, patch_mesh *mesh, gonio_error *error);
gonio_status gonio_patch_file_make(const patch_settings *settings, patch_mesh *mesh, gonio_error *error);

#endif
