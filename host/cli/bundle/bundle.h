// SPDX-License-Identifier: BSD-3-Clause
// A folder with all that a colleague needs of one model: what stands in it, and who writes which part.
#ifndef GONIO_CLI_BUNDLE_H
#define GONIO_CLI_BUNDLE_H

#include "gonio/output.h"
#include "gonio/render.h"
#include "host/cli/export.h"

enum { CLI_BUNDLE_FILES = 48, CLI_BUNDLE_FOLDER = 4096, CLI_BUNDLE_PATH = CLI_BUNDLE_FOLDER + 128 };

// One table or material of formats/.
typedef struct cli_bundle_file {
    char format[32], name[64]; // "rgl"; "rgl-rgb.bsdf"
    bool written;              // else refused says why not
    char refused[512];
    double seconds;
    cli_export_result result;
} cli_bundle_file;

typedef struct cli_bundle {
    const gonio_model *model;
    const gonio_samples *samples; // that the model was made of; NULL: none
    const char *source;           // of the model, as the user named it
    const char *folder;           // while it is made
    const cli_common *common;
    const json_t *fitted; // how samples became the model; NULL
    cli_bundle_file files[CLI_BUNDLE_FILES];
    int n;
    bool has_model;     // model.gonio; a table that was read has none
    size_t sampled;     // rows of samples.csv
    size_t max_bytes;   // of a table whose size can be chosen; 0: each format's own
    int side;           // of pictures and scenes, pixels
    double exposure_ev; // of pictures/sphere.png, and of the scenes
    char strip[400];    // what pictures/formats.png shows, from the left
} cli_bundle;

// The light and the eye of pictures and scenes, those of `gonio render`: a sphere of radius 1, seen from z = 4 with y
// up, and one distant light.
#define CLI_BUNDLE_EYE 4.0
#define CLI_BUNDLE_FOV_DEG 30.615  // of a square picture: 2 atan(1.06 tan(asin(1/4)))
gonio_vec3 cli_bundle_light(void); // toward it
// Irradiance on a surface that faces the light: then a picture's linear values are those of pictures/sphere.png.
double cli_bundle_irradiance(const cli_bundle *bundle);
// The first file of the format (and of that name, unless NULL) that was written; NULL.
const cli_bundle_file *cli_bundle_find(const cli_bundle *bundle, const char *format, const char *name);
// A file of the folder to write to: "scenes/pbrt.pbrt". The caller ends with cli_bundle_close.
gonio_status cli_bundle_open(const cli_bundle *bundle, const char *name, gonio_output **out, gonio_error *error);
gonio_status cli_bundle_close(gonio_output *output, const char *name, gonio_error *error);

gonio_status cli_bundle_formats(cli_bundle *bundle, const char *list, gonio_error *error); // formats.c
gonio_status cli_bundle_scenes(const cli_bundle *bundle, gonio_error *error);              // scenes.c
gonio_status cli_bundle_frame(const cli_bundle *bundle, gonio_error *error);               // frame.c: frame.svg
gonio_status cli_bundle_readme(const cli_bundle *bundle, gonio_error *error);              // readme.c
// Is every name of the list that of a format which is written from a model? GONIO_E_USAGE with those there are.
gonio_status cli_bundle_check_list(const char *list, gonio_error *error);

#endif
