// MODEL of the command line: a model file, or spec:SPEC.
#include <string.h>

#include "gonio/model.h"

gonio_status gonio_model_resolve(const char *name, gonio_model **out, gonio_error *error) {
    return strncmp(name, "spec:", 5) == 0 ? gonio_model_from_spec(name + 5, out, error)
                                          : gonio_model_open(name, out, error);
}
