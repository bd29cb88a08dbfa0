// SPDX-License-Identifier: BSD-3-Clause
// "adaptive:N,until=X,batch=N,share=X,first=N,theta_max=DEG,scene=NEEDS,codes=X,anisotropic=1"
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "base/number.h"
#include "host/acquire/adaptive.h"

#define POSES_MAX 20000 // each batch asks a fit of all samples so far; more poses need no choice
#define SHARE 0.4
#define THETA_MAX 85

bool gonio_adaptive_is(const char *plan) { return strncmp(plan, "adaptive:", 9) == 0; }

typedef struct option {
    const char *name, *expected;
    size_t offset;
    enum { COUNT, REAL, FLAG, FILE_NAME } kind;
    double low, high;
} option;

static const option options[] = {
    {"until", "a relative error above 0, below 1", offsetof(gonio_adaptive_plan, until), REAL, 1e-6, 0.999},
    {"batch", "1 to 5000 poses", offsetof(gonio_adaptive_plan, batch), COUNT, 1, 5000},
    {"share", "a share of 0.05 to 1", offsetof(gonio_adaptive_plan, share), REAL, 0.05, 1},
    {"first", "8 to 5000 poses", offsetof(gonio_adaptive_plan, first), COUNT, 8, 5000},
    {"theta_max", "5 to 90 degrees", offsetof(gonio_adaptive_plan, theta_max_deg), REAL, 5, 90},
    {"scene", "a file of `gonio scene needs`", offsetof(gonio_adaptive_plan, scene), FILE_NAME, 0, 0},
    {"codes", "8-bit codes of the pictures, 0.01 to 100", offsetof(gonio_adaptive_plan, codes), REAL, 0.01, 100},
    {"anisotropic", "0 or 1", offsetof(gonio_adaptive_plan, anisotropic), FLAG, 0, 1},
};
#define OPTIONS (sizeof options / sizeof *options)

static gonio_status unknown(const char *plan, const char *at, gonio_error *error) {
    char list[256] = "";
    for (size_t k = 0; k < OPTIONS; k++) {
        const size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s=", k > 0 ? ", " : "", options[k].name);
    }
    return gonio_fail(error, GONIO_E_USAGE, "plan '%.80s', character %zu: found '%.40s', expected one of %s", plan,
                      (size_t)(at - plan) + 1, at, list);
}

// One item up to the next comma or the end; *at moves behind it.
static gonio_status take(const char *plan, const char **at, gonio_adaptive_plan *out, gonio_error *error) {
    const char *item = *at;
    size_t k = 0;
    while (k < OPTIONS &&
           (strncmp(item, options[k].name, strlen(options[k].name)) != 0 || item[strlen(options[k].name)] != '=')) {
        k++;
    }
    if (k == OPTIONS) {
        return unknown(plan, item, error);
    }
    const option *o = &options[k];
    const char *value = item + strlen(o->name) + 1;
    char *end;
    if (o->kind == FILE_NAME && strcspn(value, ",") > 0 && strcspn(value, ",") < sizeof out->scene) {
        snprintf(out->scene, sizeof out->scene, "%.*s", (int)strcspn(value, ","), value);
        *at = value + strcspn(value, ",");
        return GONIO_OK;
    }
    const double number = gonio_number_parse(value, &end);
    if (o->kind == FILE_NAME || end == value || (*end != 0 && *end != ',') ||
        !(number >= o->low && number <= o->high) || (o->kind != REAL && number != floor(number))) {
        return gonio_fail(error, GONIO_E_USAGE, "plan '%.80s', character %zu: found %s=%.*s, expected %s", plan,
                          (size_t)(value - plan) + 1, o->name, (int)strcspn(value, ","), value, o->expected);
    }
    void *member = (char *)out + o->offset;
    if (o->kind == REAL) {
        *(double *)member = number;
    } else if (o->kind == COUNT) {
        *(size_t *)member = (size_t)number;
    } else {
        *(bool *)member = number == 1;
    }
    *at = end;
    return GONIO_OK;
}

gonio_status gonio_adaptive_parse(const char *plan, gonio_adaptive_plan *out, gonio_error *error) {
    *out = (gonio_adaptive_plan){.share = SHARE, .theta_max_deg = THETA_MAX};
    const char *at = plan + strlen("adaptive:");
    char *end;
    const double poses = gonio_number_parse(at, &end);
    if (end == at || (*end != 0 && *end != ',') || !(poses >= 8 && poses <= POSES_MAX) || poses != floor(poses)) {
        return gonio_fail(error, GONIO_E_USAGE, "plan '%.80s', character %zu: found '%.*s', expected 8 to %d poses",
                          plan, (size_t)(at - plan) + 1, (int)strcspn(at, ","), at, POSES_MAX);
    }
    out->poses = (size_t)poses;
    gonio_status status = GONIO_OK;
    for (at = end; status == GONIO_OK && *at == ',';) {
        at++;
        status = take(plan, &at, out, error);
    }
    if (status == GONIO_OK && out->codes > 0 && out->scene[0] == 0) {
        status = gonio_fail(error, GONIO_E_USAGE, "plan '%.80s': codes= is of the pictures of scene=NEEDS", plan);
    }
    return status;
}
