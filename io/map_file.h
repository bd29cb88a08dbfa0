// SPDX-License-Identifier: BSD-3-Clause
// A mapping kept beside the data: FILE.gonio-map, `key = value` a line.
#ifndef GONIO_IO_MAP_FILE_H
#define GONIO_IO_MAP_FILE_H

#include "io/mapping.h"

// The settings of a read: those given, and those of a map file that they leave open.
typedef struct gonio_map {
    gonio_read_options options;
    bool applies;    // a setting of the format `table` was given, or there is a map file
    char path[4096]; // of the map file; "": none
    char *data;      // its text, which options may point into
} gonio_map;

// path: of the data. given may be NULL. Free the map afterwards, also on failure.
gonio_status gonio_map_load(const char *path, const gonio_read_options *given, gonio_map *map, gonio_error *error);
void gonio_map_free(gonio_map *map);
// Write the settings as PATH.gonio-map. GONIO_E_USAGE where there are none for it.
gonio_status gonio_map_save(const char *path, const gonio_read_options *options, gonio_error *error);

#endif
