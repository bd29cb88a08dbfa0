// SPDX-License-Identifier: BSD-3-Clause
// Rows of the picture are latitudes from the zenith down, columns longitudes; its middle lies toward -z (with up = z:
// toward +x), and columns go to the right of someone inside who looks there. A pixel has one radiance all over, so the
// density that directions are drawn with is exactly proportional to what is integrated.
#include "scene/world/environment.h"

#include <math.h>
#include <stdlib.h>

#include "base/vector.h"
#include "scene/image.h"

struct world_environment {
    gonio_picture *picture;
    double scale[3], turn;
    bool z_up, visible;
    double total;    // of the weights
    double *rows;    // [height + 1]: cumulated weights of the rows
    double *columns; // [height][width + 1]: of the pixels of each
    double *solid;   // [height]: of a pixel of the row, sr
};

void gonio_world_environment_free(world_environment *e) {
    if (e != NULL) {
        gonio_picture_free(e->picture);
        free(e->rows);
        free(e->columns);
        free(e->solid);
        free(e);
    }
}

bool gonio_world_environment_visible(const world_environment *e) { return e->visible; }

// ---- directions and pixels ----

static void pixel_of(const world_environment *e, gonio_vec3 w, int *x, int *y) {
    const double height = e->z_up ? w.z : w.y, ahead = e->z_up ? w.x : -w.z, right = e->z_up ? -w.y : w.x;
    const double theta = acos(fmax(-1, fmin(1, height)));
    double u = 0.5 + (atan2(right, ahead) - e->turn) / (2 * GONIO_PI);
    u -= floor(u);
    *x = (int)(u * e->picture->width);
    *y = (int)(theta / GONIO_PI * e->picture->height);
    *x = *x < e->picture->width ? *x : e->picture->width - 1;
    *y = *y < e->picture->height ? *y : e->picture->height - 1;
}

static gonio_vec3 direction_of(const world_environment *e, double u, double cosine) {
    const double angle = (u - 0.5) * 2 * GONIO_PI + e->turn, sine = sqrt(fmax(0, 1 - cosine * cosine));
    const double ahead = sine * cos(angle), right = sine * sin(angle);
    return e->z_up ? (gonio_vec3){ahead, -right, cosine} : (gonio_vec3){right, cosine, -ahead};
}

static const float *at(const world_environment *e, int x, int y) {
    return e->picture->rgb + 3 * ((size_t)y * (size_t)e->picture->width + (size_t)x);
}

static double weight_at(const world_environment *e, int x, int y) {
    const float *p = at(e, x, y);
    return (e->scale[0] * (double)p[0] + e->scale[1] * (double)p[1] + e->scale[2] * (double)p[2]) * e->solid[y];
}

void gonio_world_environment_radiance(const world_environment *e, gonio_vec3 toward, double rgb[3]) {
    int x, y;
    pixel_of(e, toward, &x, &y);
    for (int c = 0; c < 3; c++) {
        rgb[c] = e->scale[c] * (double)at(e, x, y)[c];
    }
}

double gonio_world_environment_pdf(const world_environment *e, gonio_vec3 toward) {
    int x, y;
    pixel_of(e, toward, &x, &y);
    return e->total > 0 ? weight_at(e, x, y) / (e->total * e->solid[y]) : 0;
}

// The step of a cumulated table that holds a value, and how far inside it (0 to 1) the value lies.
static int find_step(const double *table, int n, double value, double *inside) {
    int low = 0, high = n;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (table[middle] <= value) {
            low = middle;
        } else {
            high = middle;
        }
    }
    const double width = table[low + 1] - table[low];
    *inside = width > 0 ? fmin((value - table[low]) / width, 1) : 0.5;
    return low;
}

double gonio_world_environment_sample(const world_environment *e, const double u[2], gonio_vec3 *toward,
                                      double rgb[3]) {
    const int width = e->picture->width, height = e->picture->height;
    double inside_row, inside_column;
    if (!(e->total > 0)) {
        return 0;
    }
    const int y = find_step(e->rows, height, u[0] * e->total, &inside_row);
    const double *columns = e->columns + (size_t)y * (size_t)(width + 1);
    const int x = find_step(columns, width, u[1] * columns[width], &inside_column);
    const double top = cos(GONIO_PI * y / height), bottom = cos(GONIO_PI * (y + 1) / height);
    *toward = direction_of(e, (x + inside_column) / width, top + (bottom - top) * inside_row);
    for (int c = 0; c < 3; c++) {
        rgb[c] = e->scale[c] * (double)at(e, x, y)[c];
    }
    return weight_at(e, x, y) / (e->total * e->solid[y]);
}

// ---- making one ----

static bool tabulate(world_environment *e) {
    const int width = e->picture->width, height = e->picture->height;
    e->rows = malloc((size_t)(height + 1) * sizeof *e->rows);
    e->solid = malloc((size_t)height * sizeof *e->solid);
    e->columns = malloc((size_t)height * (size_t)(width + 1) * sizeof *e->columns);
    if (e->rows == NULL || e->solid == NULL || e->columns == NULL) {
        return false;
    }
    e->rows[0] = 0;
    for (int y = 0; y < height; y++) {
        double *columns = e->columns + (size_t)y * (size_t)(width + 1);
        e->solid[y] = (cos(GONIO_PI * y / height) - cos(GONIO_PI * (y + 1) / height)) * 2 * GONIO_PI / width;
        columns[0] = 0;
        for (int x = 0; x < width; x++) {
            columns[x + 1] = columns[x] + weight_at(e, x, y);
        }
        e->rows[y + 1] = e->rows[y] + columns[width];
    }
    e->total = e->rows[height];
    return true;
}

static gonio_status check_light(const world_environment *e, const char *path, gonio_error *error) {
    for (size_t i = 0; i < 3 * (size_t)e->picture->width * (size_t)e->picture->height; i++) {
        if (e->picture->rgb[i] < 0) {
            const size_t pixel = i / 3, width = (size_t)e->picture->width;
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                                   "column %zu, row %zu: found %g, expected light of 0 or more", pixel % width,
                                   pixel / width, (double)e->picture->rgb[i]);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_world_environment_new(const scene_light_settings *light, world_environment **out,
                                         gonio_error *error) {
    *out = NULL;
    world_environment *e = calloc(1, sizeof *e);
    if (e == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for an environment");
    }
    *e = (world_environment){.scale = {light->intensity[0], light->intensity[1], light->intensity[2]},
                             .turn = gonio_radians(light->turn),
                             .z_up = light->up == SCENE_UP_Z,
                             .visible = light->visible};
    gonio_status status = light->file[0] != 0 ? gonio_picture_read(light->file, &e->picture, error)
                                              : gonio_scene_picture_new(4, 2, &e->picture, error);
    for (int i = 0; status == GONIO_OK && light->file[0] == 0 && i < 24; i++) {
        e->picture->rgb[i] = 1;
    }
    status = status == GONIO_OK ? check_light(e, light->file, error) : status;
    if (status == GONIO_OK && !tabulate(e)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for an environment");
    }
    if (status != GONIO_OK) {
        gonio_world_environment_free(e);
        return status;
    }
    *out = e;
    return GONIO_OK;
}
