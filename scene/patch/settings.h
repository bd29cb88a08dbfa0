// SPDX-License-Identifier: BSD-3-Clause
// What a patch is made of, as text.
#ifndef GONIO_SCENE_PATCH_SETTINGS_H
#define GONIO_SCENE_PATCH_SETTINGS_H

#include <stdint.h>

#include "gonio/status.h"

typedef enum patch_shape { PATCH_SAWTOOTH, PATCH_CYLINDERS, PATCH_VELVET, PATCH_HEIGHTS, PATCH_MESH } patch_shape;

#define PATCH_MATERIALS_MAX 16
#define PATCH_TEXT_MAX 512

// Lengths are in units of the tile's side unless `width` says otherwise.
typedef struct patch_settings {
    int shape;             // patch_shape
    double slope, slope_2; // deg from the plane, of the sawtooth's sides that face -x and +x
    double radius, gap;    // of a cylinder or fibre, in the pitch of two neighbours; between the cylinders
    int count;             // cylinders across a tile; fibres along a side of it
    double vary;           // how far the cylinders' heights vary, in radii
    int segments;          // facets of half a cylinder, or round a fibre
    double length, lean;   // of a fibre, in pitches; largest angle from the normal, deg
    uint64_t seed;         // of what is random in the shape
    double width, height;  // of a tile of heights or mesh
    double depth;          // z of white
    char file[PATCH_TEXT_MAX], materials_file[PATCH_TEXT_MAX];
    char rho[PATCH_TEXT_MAX], rho_2[PATCH_TEXT_MAX];    // Lambert albedos instead of materials 1 and 2
    char material[PATCH_MATERIALS_MAX][PATCH_TEXT_MAX]; // specs or paths of models; "": none
} patch_settings;

// See gonio_patch_open. Paths in a file are relative to the file's folder.
gonio_status gonio_patch_settings_read(const char *text, patch_settings *settings, gonio_error *error);

#endif
