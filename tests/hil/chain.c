// SPDX-License-Identifier: BSD-3-Clause
// A USB serial adapter to the controller: libmodbus, tty, ftdi_sio, USB, and the firmware behind it.
// usage: chain TTY BOARD HOME_ORDER    home_order 0: axes without a home switch are at home where they stand
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/stage_modbus.h"
#include "tests/hil/tap.h"

int main(int argc, char **argv) {
    if (argc != 4) {
        return 2;
    }
    gonio_controller_config config;
    gonio_controller_defaults(&config);
    snprintf(config.modbus.port, sizeof config.modbus.port, "%s", argv[1]);
    // The emulated UART drops a frame whose bytes come too far apart in its time: asked again, soon and often.
    config.modbus.timeout_ms = 300;
    config.retries = 40;
    config.deadman_s = 60;
    gonio_stage_modbus_config axes;
    gonio_stage_modbus_defaults(&axes);
    const int order = atoi(argv[3]);
    for (int i = 0; i < GONIO_AXES; i++) {
        axes.axes[i] =
            (gonio_axis_config){100, 300, 2000, 40000, -180, 180, 0, NAN, NAN, NAN, NAN, NAN, order, 0, 0, 1};
    }
    gonio_controller *controller = NULL;
    gonio_error error = {0};
    if (!check(gonio_controller_open(&config, &controller, &error) == GONIO_OK,
               "the controller answers over a USB serial adapter", "%s", error.message)) {
        return 1;
    }
    const gonio_controller_identity *identity = gonio_controller_identify(controller);
    check(identity->board == atoi(argv[2]), "it is the expected board", "board %d", identity->board);
    void *stage = NULL;
    const bool there = gonio_stage_modbus_open(&axes, controller, &stage, &error) == GONIO_OK &&
                       gonio_stage_modbus_apply(stage, &error) == GONIO_OK;
    if (check(there, "its parameters are written and read back", "%s", error.message)) {
        const double to[GONIO_AXES] = {0.2, -0.15, 0.1, -0.05};
        const gonio_stamp stamp = {0};
        double at[GONIO_AXES] = {NAN, NAN, NAN, NAN};
        check(gonio_stage_modbus.home(stage, 60, &error) == GONIO_OK, "it homes", "%s", error.message);
        check(gonio_stage_modbus.move(stage, to, 1, &stamp, 60, &error) == GONIO_OK &&
                  gonio_stage_modbus.position(stage, at, &error) == GONIO_OK,
              "it moves", "%s", error.message);
        bool same = true;
        for (int i = 0; i < GONIO_AXES; i++) {
            same = same && fabs(at[i] - to[i]) <= 0.5 / 100 * GONIO_PI / 180 * 1.01; // half a step
        }
        check(same, "four axes stand where they were sent", "%g %g %g %g rad", at[0], at[1], at[2], at[3]);
        gonio_stage_modbus.close(stage);
    }
    gonio_controller_counts counts;
    gonio_controller_count(controller, &counts);
    printf("# %lld exchanges, %lld retries\n", (long long)counts.exchanges, (long long)counts.retries);
    gonio_controller_release(controller);
    return failures > 0;
}
