// SPDX-License-Identifier: BSD-3-Clause
// Channels that are the elements of one Mueller matrix: sixteen names that differ in the two digits at their ends,
// f_r11 to f_r44.
#ifndef GONIO_BASE_MUELLER_H
#define GONIO_BASE_MUELLER_H

#include <stdbool.h>

#include "gonio/sample.h"

typedef struct gonio_mueller_set {
    int channel[16]; // row by row
} gonio_mueller_set;

// The matrix of which channel c is the element 11; false where c is none, or not all sixteen are there.
bool gonio_mueller_find(const char (*names)[GONIO_CHANNEL_NAME_MAX], int n, int c, gonio_mueller_set *set);
// Which channels are signed by nature, because they are elements of such a matrix beyond its first.
void gonio_mueller_signed(const char (*names)[GONIO_CHANNEL_NAME_MAX], int n, bool *is_signed);

#endif
