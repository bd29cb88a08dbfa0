// SPDX-License-Identifier: BSD-3-Clause
// Settings -> the triangles of one tile.
#ifndef GONIO_SCENE_PATCH_GEOMETRY_H
#define GONIO_SCENE_PATCH_GEOMETRY_H

#include "gonio/status.h"
#include "scene/patch/patch_mesh.h"
#include "scene/patch/settings.h"

// GONIO_E_INPUT for files that cannot be used. The caller frees the mesh, also after a failure.
gonio_status gonio_patch_mesh_make(const patch_settings *settings, patch_mesh *mesh, gonio_error *error);

#endif
