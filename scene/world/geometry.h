// SPDX-License-Identifier: BSD-3-Clause
// The scene's meshes as one.
#ifndef GONIO_SCENE_WORLD_GEOMETRY_H
#define GONIO_SCENE_WORLD_GEOMETRY_H

#include "scene/world/world.h"

// Reads every mesh of the settings into its place. GONIO_E_INPUT names the mesh's file, or the scene's line.
gonio_status gonio_world_geometry_read(const char *path, gonio_scene *scene, gonio_error *error);
// The material of that name, -1 where there is none.
int gonio_world_material_find(const scene_settings *settings, const char *name, size_t length);
// Degenerate triangles and open edges of a mesh's share of all triangles; edges meet where their corners' positions are
// the same. false: no memory.
bool gonio_world_geometry_count(const scene_mesh *mesh, size_t first, size_t triangles, size_t *degenerate,
                                size_t *open_edges);

#endif
