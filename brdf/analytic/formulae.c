// SPDX-License-Identifier: BSD-3-Clause
// The table of analytic formulae.
#include <string.h>

#include "brdf/analytic/formula.h"

#define X(name) extern const gonio_formula gonio_formula_##name;
#include "brdf/analytic/formulae.def"
#undef X

static const gonio_formula *const formulae[] = {
#define X(name) &gonio_formula_##name,
#include "brdf/analytic/formulae.def"
#undef X
    NULL};

const gonio_formula *const *gonio_formulae(void) { return formulae; }

const gonio_formula *gonio_formula_find(const char *name) {
    for (const gonio_formula *const *f = formulae; *f != NULL; f++) {
        if (strcmp((*f)->name, name) == 0) {
            return *f;
        }
    }
    return NULL;
}

const gonio_formula *gonio_formula_of_file(const char name[GONIO_FORMULA_FILE_NAME_MAX]) {
    if (name[GONIO_FORMULA_FILE_NAME_MAX - 1] != 0) {
        return NULL;
    }
    for (const gonio_formula *const *f = formulae; *f != NULL; f++) {
        if (strncmp((*f)->name, name, GONIO_FORMULA_FILE_NAME_MAX - 1) == 0) {
            return *f;
        }
    }
    return NULL;
}
