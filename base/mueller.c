// SPDX-License-Identifier: BSD-3-Clause
#include "base/mueller.h"

#include <string.h>

bool gonio_mueller_find(const char (*names)[GONIO_CHANNEL_NAME_MAX], int n, int c, gonio_mueller_set *set) {
    const size_t length = strnlen(names[c], GONIO_CHANNEL_NAME_MAX);
    if (length < 3 || strcmp(names[c] + length - 2, "11") != 0) {
        return false;
    }
    for (int e = 0; e < 16; e++) {
        set->channel[e] = -1;
        for (int k = 0; k < n; k++) {
            if (strnlen(names[k], GONIO_CHANNEL_NAME_MAX) == length && memcmp(names[k], names[c], length - 2) == 0 &&
                names[k][length - 2] == '1' + e / 4 && names[k][length - 1] == '1' + e % 4) {
                set->channel[e] = k;
            }
        }
        if (set->channel[e] < 0) {
            return false;
        }
    }
    return true;
}

void gonio_mueller_signed(const char (*names)[GONIO_CHANNEL_NAME_MAX], int n, bool *is_signed) {
    gonio_mueller_set set;
    memset(is_signed, 0, (size_t)n * sizeof *is_signed);
    for (int c = 0; c < n; c++) {
        if (gonio_mueller_find(names, n, c, &set)) {
            for (int e = 1; e < 16; e++) {
                is_signed[set.channel[e]] = true;
            }
        }
    }
}
