// SPDX-License-Identifier: BSD-3-Clause
// Poses of a session that reach over the sample's edge.
#include <stdio.h>

#include "host/acquire/acquire.h"

void gonio_scan_edges(const gonio_setup *setup, const gonio_step *steps, size_t n, gonio_edges_report *report) {
    char text[256];
    *report = (gonio_edges_report){0};
    for (size_t i = 0; i < n; i++) {
        if (steps[i].kind != GONIO_STEP_SAMPLE) {
            continue;
        }
        const int flags = gonio_calib_edges(&setup->camera, &setup->facts, &steps[i].pose, text);
        report->excluded += (flags & (GONIO_EDGE_REGION | GONIO_EDGE_UNLIT)) != 0;
        report->spilled += flags == GONIO_EDGE_SPILL;
        if (flags != 0 && report->told < GONIO_EDGES_TOLD) {
            snprintf(report->text[report->told++], sizeof report->text[0], "step %zu: %s", i, text);
        }
    }
}
