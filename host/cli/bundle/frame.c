// SPDX-License-Identifier: BSD-3-Clause
// frame.svg: the frame of directions, drawn.
#include <math.h>

#include "host/cli/bundle/bundle.h"

#define WIDTH 620
#define HEIGHT 436
#define RADIUS 200.0

typedef struct point {
    double x, y;
} point;

// Orthographic, seen from theta 62 deg, phi -60 deg of the sample, z upward.
static point seen(gonio_vec3 v) {
    const double theta = gonio_radians(62), phi = gonio_radians(-60);
    const double right = -sin(phi) * v.x + cos(phi) * v.y;
    const double up = -cos(theta) * (cos(phi) * v.x + sin(phi) * v.y) + sin(theta) * v.z;
    return (point){300 + RADIUS * right, 270 - RADIUS * up};
}

static gonio_vec3 longer(gonio_vec3 v, double by) { return (gonio_vec3){by * v.x, by * v.y, by * v.z}; }

static void arrow(FILE *out, gonio_vec3 to, const char *colour, const char *label) {
    const point from = seen((gonio_vec3){0, 0, 0}), tip = seen(to), text = seen(longer(to, 1.09));
    fprintf(out,
            "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"%s\" stroke-width=\"2\" "
            "marker-end=\"url(#tip)\"/>\n<text x=\"%.1f\" y=\"%.1f\" fill=\"%s\" text-anchor=\"middle\">%s</text>\n",
            from.x, from.y, tip.x, tip.y, colour, text.x, text.y + 5, colour, label);
}

// From direction a to b, at a share of the radius.
static void arc(FILE *out, double theta_a, double phi_a, double theta_b, double phi_b, double radius,
                const char *colour, const char *label) {
    enum { STEPS = 32 };
    fprintf(out, "<polyline fill=\"none\" stroke=\"%s\" points=\"", colour);
    for (int k = 0; k <= STEPS; k++) {
        const double t = (double)k / STEPS;
        const point p = seen(longer(gonio_direction(gonio_radians(theta_a + t * (theta_b - theta_a)),
                                                    gonio_radians(phi_a + t * (phi_b - phi_a))),
                                    radius));
        fprintf(out, "%.1f,%.1f ", p.x, p.y);
    }
    const point middle = seen(longer(
        gonio_direction(gonio_radians((theta_a + theta_b) / 2), gonio_radians((phi_a + phi_b) / 2)), radius + 0.09));
    fprintf(out, "\"/>\n<text x=\"%.1f\" y=\"%.1f\" fill=\"%s\" text-anchor=\"middle\">%s</text>\n", middle.x,
            middle.y + 5, colour, label);
}

static void draw(FILE *out) {
    fprintf(out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" font-family=\"sans-serif\" "
            "font-size=\"14\">\n<title>Directions in the frame of the sample</title>\n<defs><marker id=\"tip\" "
            "viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" markerWidth=\"7\" markerHeight=\"7\" orient=\"auto\"><path "
            "d=\"M0,0 L8,4 L0,8 z\" fill=\"#333\"/></marker></defs>\n<rect width=\"100%%\" height=\"100%%\" "
            "fill=\"white\"/>\n<polygon fill=\"#eee\" stroke=\"#bbb\" points=\"",
            WIDTH, HEIGHT);
    for (int k = 0; k < 4; k++) { // the sample, a square
        const point p = seen((gonio_vec3){k == 0 || k == 3 ? 0.9 : -0.9, k < 2 ? 0.9 : -0.9, 0});
        fprintf(out, "%.1f,%.1f ", p.x, p.y);
    }
    fputs("\"/>\n", out);
    arrow(out, (gonio_vec3){0, 0, 1.15}, "#333", "z, the normal");
    arrow(out, (gonio_vec3){1.15, 0, 0}, "#333", "x, the mark");
    arrow(out, (gonio_vec3){0, 1.15, 0}, "#333", "y");
    arrow(out, gonio_direction(gonio_radians(50), gonio_radians(25)), "#c60", "light");
    arrow(out, gonio_direction(gonio_radians(50), gonio_radians(205)), "#999", "mirror direction");
    arrow(out, gonio_direction(gonio_radians(60), gonio_radians(150)), "#06c", "camera");
    arc(out, 0, 25, 50, 25, 0.5, "#c60", "&#952;_i");
    arc(out, 90, 0, 90, 25, 0.6, "#c60", "&#966;_i");
    arc(out, 0, 150, 60, 150, 0.5, "#06c", "&#952;_o");
    arc(out, 90, 0, 90, 150, 0.75, "#06c", "&#966;_o");
    fputs("<text x=\"12\" y=\"404\">Both directions point away from the sample.</text>\n<text x=\"12\" y=\"424\">With "
          "&#966;_i = 0 the mirror direction is at &#966;_o = 180 deg.</text>\n</svg>\n",
          out);
}

gonio_status cli_bundle_frame(const cli_bundle *bundle, gonio_error *error) {
    gonio_output *output;
    const gonio_status status = cli_bundle_open(bundle, "frame.svg", &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    draw(gonio_output_stream(output));
    return cli_bundle_close(output, "frame.svg", error);
}
