// SPDX-License-Identifier: BSD-3-Clause
#include "scene/cpm/map.h"

#include <stdlib.h>

gonio_status gonio_cpm_open(const char *folder, const gonio_scene *scene, gonio_cpm **out, gonio_error *error) {
    *out = NULL;
    gonio_cpm *cpm = calloc(1, sizeof *cpm);
    if (cpm == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a map");
    }
    cpm->scene = scene;
    gonio_status status = gonio_cpm_store_open(folder, &cpm->store, error);
    if (status == GONIO_OK && cpm->store.head.scene != gonio_cpm_scene_fingerprint(scene)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, folder, -1,
                                 "the map is of other meshes or materials than the scene's");
    }
    if (status != GONIO_OK) {
        gonio_cpm_free(cpm);
        return status;
    }
    cpm->most_points = cpm->store.head.most_points;
    gonio_cpm_seconds_tell(folder, &cpm->store.head.facts);
    *out = cpm;
    return GONIO_OK;
}

void gonio_cpm_free(gonio_cpm *cpm) {
    if (cpm != NULL) {
        gonio_cpm_store_release(&cpm->store);
        free(cpm);
    }
}

void gonio_cpm_describe(const gonio_cpm *cpm, gonio_cpm_facts *facts) { *facts = cpm->store.head.facts; }
