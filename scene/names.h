// SPDX-License-Identifier: BSD-3-Clause
// What the files of scenes and patches name.
#ifndef GONIO_SCENE_NAMES_H
#define GONIO_SCENE_NAMES_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/status.h"

// A path as a file means it, relative to its own folder; empty and absolute ones stay. GONIO_E_INPUT where it is longer
// than size.
gonio_status gonio_scene_beside(const char *file, char *path, size_t size, gonio_error *error);
// Is it a spec without its mark? "ggx:alpha=0.2" is, whatever follows; all else is a path or says itself that it is
// one.
bool gonio_scene_is_spec(const char *text);
// A model's name for gonio_model_resolve: a spec gets its mark, a path is one beside the file.
gonio_status gonio_scene_model_name(const char *file, char *name, size_t size, gonio_error *error);

#endif
