// SPDX-License-Identifier: BSD-3-Clause
// The list of methods.
#include <pthread.h>
#include <string.h>

#include "fit/method.h"

#define DEFAULT_METHOD "auto"

#define METHOD(x) extern const gonio_method gonio_method_##x;
#include "fit/methods.def"
#undef METHOD

#define METHOD(x) &gonio_method_##x,
static const gonio_method *const methods[] = {
#include "fit/methods.def"
};
#undef METHOD
#define METHODS (sizeof methods / sizeof *methods)

const gonio_method *gonio_method_at(int index) { return index >= 0 && (size_t)index < METHODS ? methods[index] : NULL; }

const gonio_method *gonio_method_find(const char **name) {
    *name = *name != NULL ? *name : DEFAULT_METHOD;
    for (size_t i = 0; i < METHODS; i++) {
        if (strcmp(methods[i]->name, *name) == 0) {
            *name = methods[i]->name;
            return methods[i];
        }
    }
    return NULL;
}

// The names once more, as an array: filled on the first call, constant from then on.
static const char *names[METHODS + 1];
static pthread_once_t names_once = PTHREAD_ONCE_INIT;

static void fill_names(void) {
    for (size_t i = 0; i < METHODS; i++) {
        names[i] = methods[i]->name;
    }
}

const char *const *gonio_fit_methods(void) {
    pthread_once(&names_once, fill_names);
    return names;
}
