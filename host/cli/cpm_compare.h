// SPDX-License-Identifier: BSD-3-Clause
// gonio cpm compare.
#ifndef GONIO_CLI_CPM_COMPARE_H
#define GONIO_CLI_CPM_COMPARE_H

#include "gonio/cpm.h"
#include "host/cli/cli.h"

typedef struct cpm_compare_request {
    const char *scene, *map, *camera;
    const char *strip; // a picture of all pictures; NULL: none
    gonio_cpm_render_options how;
    int truth;         // paths a pixel
    int width, height; // 0: what the scene says
} cpm_compare_request;

int cli_cpm_compare(const cpm_compare_request *request, const cli_common *common);

#endif
