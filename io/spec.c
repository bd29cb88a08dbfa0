// SPDX-License-Identifier: BSD-3-Clause
// "FORMULA:..." -> an analytic model; "sgd:NAME" and the like -> a published fit; "file:PATH" -> a model file or a
// measured table; each may be followed by keys of the sample's body, which the simulator takes and which mean nothing
// to a BRDF.
#include "io/spec.h"

#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "brdf/kind/analytic.h"
#include "gonio/io.h"
#include "io/published.h"

char *gonio_spec_take_body(char *text, const char **key) {
    static const char *const keys[] = {"shape", "radius_mm", "plate_mm"};
    char *comma = strrchr(text, ','), *start = comma != NULL ? comma : strchr(text, ':');
    for (size_t k = 0; start != NULL && k < sizeof keys / sizeof *keys; k++) {
        const size_t length = strlen(keys[k]);
        if (strncmp(start + 1, keys[k], length) == 0 && start[1 + length] == '=') {
            *key = keys[k];
            *start = 0;
            return start + 2 + length;
        }
    }
    return NULL;
}

static gonio_status check_body(const char *key, const char *value, gonio_error *error) {
    if (strcmp(key, "shape") == 0) {
        const bool known = strcmp(value, "flat") == 0 || strcmp(value, "sphere") == 0;
        return known ? GONIO_OK : gonio_fail(error, GONIO_E_USAGE, "shape=%s; expected flat or sphere", value);
    }
    char *end;
    const double mm = gonio_number_parse(value, &end);
    return end != value && *end == 0 && mm > 0 && mm <= 1e5
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE, "%s=%s; expected a number above 0, up to 100000", key, value);
}

static gonio_status parse(char *text, gonio_model **out, gonio_error *error) {
    const char *key;
    for (const char *value; (value = gonio_spec_take_body(text, &key)) != NULL;) {
        const gonio_status status = check_body(key, value, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    if (gonio_published_is(text)) {
        return gonio_published_open(text, out, error);
    }
    if (strncmp(text, "file:", 5) != 0 && strcmp(text, "file") != 0) {
        return gonio_analytic_from_spec(text, out, error);
    }
    const char *path = text + strlen("file") + (text[4] == ':');
    if (path[0] == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "file: the path is missing");
    }
    return gonio_model_file_is(path) ? gonio_model_open(path, out, error) : gonio_read_table(path, out, error);
}

gonio_status gonio_model_from_spec(const char *spec, gonio_model **out, gonio_error *error) {
    *out = NULL;
    char *text = strdup(spec);
    if (text == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a spec");
    }
    const gonio_status status = parse(text, out, error);
    free(text);
    return status;
}
