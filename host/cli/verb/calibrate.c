// SPDX-License-Identifier: BSD-3-Clause
// gonio calibrate: dispatch to the device's own calibration.
#include <stdio.h>
#include <string.h>

#include "host/cli/calibrate/calibrate.h"

static int run(int argc, char **argv) {
    static const struct {
        const char *name;
        int (*run)(int argc, char **argv);
    } kinds[] = {{"camera", calibrate_camera}, {"noise", calibrate_noise}, {"response", calibrate_response},
                 {"rig", calibrate_rig},       {"flat", calibrate_flat},   {"reference", calibrate_reference}};
    for (size_t k = 0; argc > 1 && k < sizeof kinds / sizeof *kinds; k++) {
        if (strcmp(argv[1], kinds[k].name) == 0) {
            return kinds[k].run(argc - 1, argv + 1);
        }
    }
    const bool help = argc > 1 && strcmp(argv[1], "--help") == 0;
    fputs("usage: gonio calibrate camera|noise|response|rig|flat|reference ... (each has its own --help)\n"
          "  camera    intrinsics and distortion from photographs of a chessboard or ChArUco board\n"
          "  noise     gain, read noise, dark current, saturation, linearity, DSNU, PRNU by photon transfer\n"
          "  response  the curve of a camera that is not linear, from an exposure series\n"
          "  rig       the true axes of the arms, from frames of a board, a polished ball and a mirror\n"
          "  flat      flat field and vignetting, for sessions whose reference shall tell the scale only\n"
          "  reference a white standard's certificate in the camera's channels, and its own BRDF\n"
          "Dark frames, light trap, white reference and, without a file, the flat field are measured within\n"
          "each session by gonio measure.\n",
          help ? stdout : stderr);
    return help ? 0 : 2;
}

const cli_verb cmd_calibrate = {"calibrate", "camera|noise|response|rig|flat|reference ...",
                                "calibrate a device apart from a scan", run};
