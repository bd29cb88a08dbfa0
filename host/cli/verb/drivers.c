// SPDX-License-Identifier: BSD-3-Clause
// gonio drivers: the drivers of a rig's devices, and the keys of a rig file that belong to each.
#include <stdio.h>
#include <string.h>

#include "host/cli/cli.h"
#include "host/drivers/driver.h"

static void add_keys(json_t *keys, const gonio_key *table) {
    for (const gonio_key *key = table; key != NULL && key->name != NULL; key++) {
        char expected[96];
        gonio_key_expected(key, expected, sizeof expected);
        json_array_append_new(keys,
                              json_pack("{s:s,s:s,s:s}", "section", key->section, "key", key->name, "value", expected));
    }
}

static json_t *to_json(const gonio_driver *d) {
    json_t *keys = json_array();
    add_keys(keys, d->keys);
    if (d->controller) {
        add_keys(keys, gonio_controller_keys);
    }
    return json_pack("{s:s,s:s,s:s,s:o}", "device", gonio_device_name(d->device), "driver", d->name, "summary",
                     d->summary, "keys", keys);
}

// One line a key; the four axes have the same ones.
static void print_keys(const gonio_key *table) {
    for (const gonio_key *key = table; key != NULL && key->name != NULL; key++) {
        const bool axis = strncmp(key->section, "axis ", 5) == 0;
        char place[64], expected[96];
        if (axis && strcmp(key->section, "axis light_theta") != 0) {
            continue;
        }
        snprintf(place, sizeof place, "[%s] %s", axis ? "axis NAME" : key->section, key->name);
        gonio_key_expected(key, expected, sizeof expected);
        printf("    %-38s %s\n", place, expected);
    }
}

static int run(int argc, char **argv) {
    extern const cli_verb cmd_drivers;
    const cli_option options[] = {{0}};
    cli_common common;
    int count;
    if (!cli_parse(&cmd_drivers, options, argc, argv, NULL, 0, 0, &count, &common)) {
        return 2;
    }
    json_t *all = json_array();
    bool controller = false;
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *d = gonio_driver_at(i);
        json_array_append_new(all, to_json(d));
        if (!common.json) {
            printf("[%s] driver = %s: %s%s\n", gonio_device_name(d->device), d->name, d->summary,
                   d->controller ? "; keys of [controller] as well" : "");
            print_keys(d->keys);
            controller = controller || d->controller;
        }
    }
    if (common.json) {
        return cli_json(json_pack("{s:o}", "drivers", all));
    }
    json_decref(all);
    if (controller) {
        puts("[controller]");
        print_keys(gonio_controller_keys);
    }
    return 0;
}

const cli_verb cmd_drivers = {"drivers", "", "the drivers of a rig's devices and their keys of a rig file", run};
