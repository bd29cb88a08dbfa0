// SPDX-License-Identifier: BSD-3-Clause
// The table of kinds.
#include <string.h>

#include "brdf/kind.h"

#define X(name) extern const gonio_kind gonio_kind_##name;
#include "brdf/kinds.def"
#undef X

static const gonio_kind *const kinds[] = {
#define X(name) &gonio_kind_##name,
#include "brdf/kinds.def"
#undef X
    NULL};

const gonio_kind *const *gonio_kinds(void) { return kinds; }

const gonio_kind *gonio_kind_find(const char *name) {
    for (const gonio_kind *const *k = kinds; *k != NULL; k++) {
        if (strcmp((*k)->name, name) == 0) {
            return *k;
        }
    }
    return NULL;
}
