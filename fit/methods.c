// The table of methods.
#include "fit/methods.h"

#include <string.h>

#include "fit/method.h"

#define X(identifier, name) extern const gonio_fit_method gonio_method_##identifier;
GONIO_FIT_METHODS(X)
#undef X

#define X(identifier, name) &gonio_method_##identifier,
static const gonio_fit_method *const methods[] = {GONIO_FIT_METHODS(X)};
#undef X

#define X(identifier, name) name,
static const char *const names[] = {GONIO_FIT_METHODS(X) NULL};
#undef X

const gonio_fit_method *gonio_fit_method_find(const char **name) {
    const char *wanted = *name != NULL ? *name : "auto";
    for (size_t i = 0; names[i] != NULL; i++) {
        if (strcmp(names[i], wanted) == 0) {
            *name = names[i];
            return methods[i];
        }
    }
    if (*name != NULL) {
        return NULL;
    }
    *name = names[0];
    return methods[0];
}

const char *const *gonio_fit_methods(void) { return names; }
