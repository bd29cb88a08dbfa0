// SPDX-License-Identifier: BSD-3-Clause
// A folder for one test, and the path of a session in it: cmocka's set_up and tear_down.
#pragma once
#include <stdio.h>
#include <stdlib.h>

static char root[64], path[96];

static int set_up(void **state) {
    (void)state;
    snprintf(root, sizeof root, "%s", "/tmp/gonio-test-XXXXXX");
    if (mkdtemp(root) == NULL) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/s", root);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    char command[128];
    snprintf(command, sizeof command, "rm -rf %s", root);
    return system(command);
}
