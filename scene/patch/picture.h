// SPDX-License-Identifier: BSD-3-Clause
// Pictures that are tables of numbers: heights and material numbers.
#ifndef GONIO_SCENE_PATCH_PICTURE_H
#define GONIO_SCENE_PATCH_PICTURE_H

#include <stdint.h>

#include "gonio/status.h"

#define PATCH_PICTURE_SIDE_MAX 2048

// Codes as they stand in the file, no colour management: grey, or the red of a coloured picture.
typedef struct patch_picture {
    int width, height, bits; // bits: 8 or 16
    uint16_t *codes;         // rows from the top
} patch_picture;

// A PNG file. GONIO_E_INPUT names it and what is wrong. The caller frees codes.
gonio_status gonio_patch_picture_read(const char *path, patch_picture *picture, gonio_error *error);

#endif
