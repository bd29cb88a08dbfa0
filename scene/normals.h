// SPDX-License-Identifier: BSD-3-Clause
// Smooth normals for meshes that come without.
#ifndef GONIO_SCENE_NORMALS_H
#define GONIO_SCENE_NORMALS_H

#include "scene/mesh.h"

// Sets the normal of every vertex, each of which belongs to one face of the file: the area-weighted mean over the faces
// that meet at its position at less than 80 deg to its own; zero where none has an area.
gonio_status gonio_scene_normals_smooth(scene_mesh *mesh, gonio_error *error);

#endif
