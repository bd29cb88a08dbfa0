// SPDX-License-Identifier: BSD-3-Clause
// What a transform costs to look at: spheres before and after it, their difference, lobes as solids, and curves.
#ifndef GONIO_CLI_CHECK_PICTURES_H
#define GONIO_CLI_CHECK_PICTURES_H

#include "gonio/check.h"

enum { CLI_CHECK_NAME = 32 };

// The error of a picture: 8-bit sRGB, over the pixels of the sphere's tile.
typedef struct cli_picture_error {
    char name[CLI_CHECK_NAME]; // of the transform, as its files have it: "separable-5"
    double mean, rms, largest;
} cli_picture_error;

// NAME.png (before | after), NAME-difference.png (8 times the difference, grey: none), NAME-lobe.svg and .png of every
// change; albedo.svg, .png and separability.svg, .png of the report. errors: [n].
gonio_status cli_check_pictures(const char *folder, const gonio_model *model, const gonio_change *changes, int n,
                                const gonio_check_report *report, int threads, cli_picture_error *errors,
                                gonio_error *error);

// ---- plots (check_plots.c), each as SVG and PNG: path without its ending ----

gonio_status cli_plot_lobes(const char *path, const gonio_model *before, const gonio_model *after, double theta_i_rad,
                            gonio_error *error);
gonio_status cli_plot_albedo(const char *path, const gonio_check_report *report, gonio_error *error);
gonio_status cli_plot_separability(const char *path, const gonio_check_report *report, gonio_error *error);

#endif
