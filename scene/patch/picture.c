// SPDX-License-Identifier: BSD-3-Clause
#include "scene/patch/picture.h"

#include <errno.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <png.h>

typedef struct reading {
    png_structp png;
    png_infop info;
    char message[200];
} reading;

static void on_error(png_structp png, png_const_charp message) {
    reading *r = png_get_error_ptr(png);
    snprintf(r->message, sizeof r->message, "%s", message);
    longjmp(png_jmpbuf(png), 1);
}

static void on_warning(png_structp png, png_const_charp message) {
    (void)png;
    (void)message;
}

static void copy_rows(reading *r, patch_picture *p) {
    png_bytepp rows = png_get_rows(r->png, r->info);
    const size_t step = (size_t)png_get_channels(r->png, r->info) * (size_t)(p->bits / 8);
    for (int y = 0; y < p->height; y++) {
        for (int x = 0; x < p->width; x++) {
            const png_byte *at = rows[y] + step * (size_t)x;
            p->codes[(size_t)y * (size_t)p->width + (size_t)x] =
                (uint16_t)(p->bits == 16 ? (at[0] << 8) + at[1] : at[0]);
        }
    }
}

// libpng comes back here by longjmp, so nothing that it may change lives in this function's own variables.
static gonio_status read_rows(reading *r, FILE *file, const char *path, patch_picture *p, gonio_error *error) {
    if (setjmp(png_jmpbuf(r->png)) != 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a PNG picture that can be read: %s", r->message);
    }
    png_init_io(r->png, file);
    png_set_user_limits(r->png, PATCH_PICTURE_SIDE_MAX, PATCH_PICTURE_SIDE_MAX);
    png_read_png(r->png, r->info, PNG_TRANSFORM_EXPAND | PNG_TRANSFORM_STRIP_ALPHA, NULL);
    p->width = (int)png_get_image_width(r->png, r->info);
    p->height = (int)png_get_image_height(r->png, r->info);
    p->bits = png_get_bit_depth(r->png, r->info);
    p->codes = malloc((size_t)p->width * (size_t)p->height * sizeof *p->codes);
    if (p->codes == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", path);
    }
    copy_rows(r, p);
    return GONIO_OK;
}

gonio_status gonio_patch_picture_read(const char *path, patch_picture *picture, gonio_error *error) {
    memset(picture, 0, sizeof *picture);
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(errno));
    }
    reading r = {.message = ""};
    r.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &r, on_error, on_warning);
    r.info = r.png != NULL ? png_create_info_struct(r.png) : NULL;
    const gonio_status status = r.info != NULL ? read_rows(&r, file, path, picture, error)
                                               : gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", path);
    png_destroy_read_struct(&r.png, &r.info, NULL);
    fclose(file);
    return status;
}
