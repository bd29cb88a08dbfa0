// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/drawing.h"

#include <cairo-svg.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "gonio/output.h"

void cli_drawing_colour(cairo_t *c, double t) {
    static const double stops[5][3] = {
        {0.27, 0.00, 0.33}, {0.23, 0.32, 0.55}, {0.13, 0.57, 0.55}, {0.37, 0.79, 0.38}, {0.99, 0.91, 0.14}};
    const double x = fmin(fmax(t, 0), 1) * 4;
    const int k = x >= 4 ? 3 : (int)x;
    const double f = x - k;
    cairo_set_source_rgb(c, stops[k][0] + f * (stops[k + 1][0] - stops[k][0]),
                         stops[k][1] + f * (stops[k + 1][1] - stops[k][1]),
                         stops[k][2] + f * (stops[k + 1][2] - stops[k][2]));
}

static cairo_status_t write_bytes(void *closure, const unsigned char *data, unsigned int length) {
    return fwrite(data, 1, length, closure) == length ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

static void begin(cairo_t *c) {
    cairo_set_source_rgb(c, 1, 1, 1);
    cairo_paint(c);
    cairo_set_line_width(c, 1);
    cairo_select_font_face(c, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(c, 12);
}

gonio_status cli_drawing(const char *path, int width, int height, void (*draw)(cairo_t *cairo, void *context),
                         void *context, gonio_error *error) {
    gonio_output *output;
    const gonio_status opened = gonio_output_open(path, &output, error);
    if (opened != GONIO_OK) {
        return opened;
    }
    FILE *stream = gonio_output_stream(output);
    const size_t length = strlen(path);
    const bool svg = length > 4 && strcasecmp(path + length - 4, ".svg") == 0;
    cairo_surface_t *surface = svg ? cairo_svg_surface_create_for_stream(write_bytes, stream, width, height)
                                   : cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height);
    cairo_t *cairo = cairo_create(surface);
    begin(cairo);
    draw(cairo, context);
    cairo_status_t status = cairo_status(cairo);
    cairo_destroy(cairo);
    if (status == CAIRO_STATUS_SUCCESS && !svg) {
        status = cairo_surface_write_to_png_stream(surface, write_bytes, stream);
    }
    cairo_surface_finish(surface);
    status = status == CAIRO_STATUS_SUCCESS ? cairo_surface_status(surface) : status;
    cairo_surface_destroy(surface);
    if (status != CAIRO_STATUS_SUCCESS) {
        gonio_output_abandon(output);
        return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write the picture: %s",
                               cairo_status_to_string(status));
    }
    return gonio_output_commit(output, error);
}
