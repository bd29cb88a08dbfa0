// SPDX-License-Identifier: BSD-3-Clause
// One frame <-> one PNG, in memory; its name and its hash.
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "base/number.h"
#include "host/session/internal.h"

void gonio_session_frame_name(int64_t step, int frame, char name[SESSION_FRAME_NAME]) {
    snprintf(name, SESSION_FRAME_NAME, "%06lld-%02d.png", (long long)step, frame);
}

gonio_status gonio_session_frame_hash(const gonio_frame *frame, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    const size_t pixels = (size_t)frame->window.width * (size_t)frame->window.height;
    return gonio_sha256(frame->pixels, pixels * sizeof *frame->pixels, hex, error);
}

// libpng reports through longjmp; its text is kept for the gonio_error. No caller's local changes after setjmp.
typedef struct png_context {
    jmp_buf jump;
    char message[128];
    session_png *png; // being written, or read from `at`
    size_t at;
    bool plain; // being written uncompressed
} png_context;

static void on_error(png_structp png, png_const_charp message) {
    png_context *context = png_get_error_ptr(png);
    snprintf(context->message, sizeof context->message, "%s", message);
    longjmp(context->jump, 1);
}

static void on_warning(png_structp png, png_const_charp message) { (void)png, (void)message; }

static void write_bytes(png_structp png, png_bytep data, size_t size) {
    session_png *to = ((png_context *)png_get_io_ptr(png))->png;
    if (to->size + size > to->capacity) {
        const size_t capacity = 2 * to->capacity + size;
        unsigned char *larger = realloc(to->data, capacity);
        if (larger == NULL) {
            png_error(png, "out of memory");
        }
        to->data = larger;
        to->capacity = capacity;
    }
    memcpy(to->data + to->size, data, size);
    to->size += size;
}

static void flush_nothing(png_structp png) { (void)png; }

static void read_bytes(png_structp png, png_bytep data, size_t size) {
    png_context *context = png_get_io_ptr(png);
    if (size > context->png->size - context->at) {
        png_error(png, "the file is truncated");
    }
    memcpy(data, context->png->data + context->at, size);
    context->at += size;
}

// What the journal holds stands in every file too, so that a frame explains itself without its session.
static void write_texts(png_structp png, png_infop info, const gonio_frame *frame) {
    char values[6][40];
    snprintf(values[0], sizeof values[0], "%lld", (long long)frame->stamp.pose);
    snprintf(values[1], sizeof values[1], "%d", frame->stamp.frame);
    gonio_number_format(values[2], sizeof values[2], "%.17g", frame->stamp.clock_s);
    gonio_number_format(values[3], sizeof values[3], "%.17g", frame->exposure_s);
    gonio_number_format(values[4], sizeof values[4], "%.17g", frame->gain_db);
    snprintf(values[5], sizeof values[5], "%d,%d", frame->window.x, frame->window.y);
    static const char *const keys[6] = {"step", "frame", "clock_s", "exposure_s", "gain_db", "window_origin_px"};
    png_text texts[6];
    memset(texts, 0, sizeof texts);
    for (int i = 0; i < 6; i++) {
        texts[i].compression = PNG_TEXT_COMPRESSION_NONE;
        texts[i].key = (png_charp)keys[i];
        texts[i].text = values[i];
    }
    png_set_text(png, info, texts, 6);
    png_write_info(png, info);
}

// Big-endian words with the sensor's bits at the top; false where a pixel has more bits than it may.
static bool pack_row(const uint16_t *pixels, int width, int bits, unsigned char *row) {
    unsigned over = 0;
    for (int x = 0; x < width; x++) {
        const unsigned word = (unsigned)pixels[x] << (16 - bits);
        over |= word >> 16;
        row[2 * x] = (unsigned char)(word >> 8);
        row[2 * x + 1] = (unsigned char)word;
    }
    return over == 0;
}

// Frames are mostly shot noise: the longer search of higher levels finds nothing in it, and storing must keep up with
// the camera. At 60 megapixels a second not even the shortest search does: such frames are stored as they are, in
// large chunks, which is still a PNG to every reader.
static void choose_compression(png_structp png, bool plain) {
    png_set_compression_level(png, plain ? Z_NO_COMPRESSION : Z_BEST_SPEED);
    png_set_filter(png, 0, plain ? PNG_FILTER_NONE : PNG_FILTER_SUB);
    if (plain) {
        png_set_compression_buffer_size(png, 1 << 18);
    }
}

static void write_png(png_structp png, png_infop info, const gonio_frame *frame, int bits, unsigned char *row) {
    const gonio_window *w = &frame->window;
    png_set_IHDR(png, info, (png_uint_32)w->width, (png_uint_32)w->height, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    const png_color_8 significant = {.gray = (png_byte)bits};
    png_set_sBIT(png, info, &significant);
    choose_compression(png, ((const png_context *)png_get_error_ptr(png))->plain);
    write_texts(png, info, frame);
    for (int y = 0; y < w->height; y++) {
        if (!pack_row(frame->pixels + (size_t)y * (size_t)w->width, w->width, bits, row)) {
            png_error(png, "a pixel has more bits than the camera states");
        }
        png_write_row(png, row);
    }
    png_write_end(png, info);
}

gonio_status gonio_session_png_encode(const gonio_frame *frame, int bits, bool plain, session_png *out,
                                      gonio_error *error) {
    *out = (session_png){0};
    png_context context = {.png = out, .plain = plain};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &context, on_error, on_warning);
    png_infop info = png != NULL ? png_create_info_struct(png) : NULL;
    unsigned char *row = malloc(2 * (size_t)frame->window.width);
    gonio_status status = GONIO_OK;
    if (info == NULL || row == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to store a frame");
    } else if (setjmp(context.jump) == 0) {
        png_set_write_fn(png, &context, write_bytes, flush_nothing);
        write_png(png, info, frame, bits, row);
    } else {
        status = gonio_fail(error, GONIO_E_DEVICE, "cannot store frame %d of step %lld: %s (%d bits)",
                            frame->stamp.frame, (long long)frame->stamp.pose, context.message, bits);
    }
    png_destroy_write_struct(&png, &info);
    free(row);
    if (status != GONIO_OK) {
        free(out->data);
        *out = (session_png){0};
    }
    return status;
}

// What stands in every PNG's first 33 bytes, looked at before anything is allocated for it.
static bool header_is(const session_png *png, const gonio_window *w) {
    static const unsigned char fixed[16] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n',
                                            0,    0,   0,   13,  'I',  'H',  'D',  'R'};
    // Bits, colour, compression, filter, interlacing: 16-bit grey, without interlacing.
    static const unsigned char form[5] = {16, PNG_COLOR_TYPE_GRAY, 0, 0, PNG_INTERLACE_NONE};
    return png->size >= 33 && memcmp(png->data, fixed, sizeof fixed) == 0 &&
           png_get_uint_32(png->data + 16) == (png_uint_32)w->width &&
           png_get_uint_32(png->data + 20) == (png_uint_32)w->height && memcmp(png->data + 24, form, sizeof form) == 0;
}

// A chunk beside the pixels holds a few words, and there are some ten of them.
static void limit_png(png_structp png, const gonio_window *w) {
    png_set_user_limits(png, (png_uint_32)w->width, (png_uint_32)w->height);
    png_set_chunk_cache_max(png, 64);
    png_set_chunk_malloc_max(png, 1 << 16);
}

static void read_png(png_structp png, png_infop info, int bits, gonio_frame *frame, unsigned char *row) {
    limit_png(png, &frame->window);
    png_read_info(png, info);
    const gonio_window *w = &frame->window;
    for (int y = 0; y < w->height; y++) {
        png_read_row(png, row, NULL);
        uint16_t *to = frame->pixels + (size_t)y * (size_t)w->width;
        for (int x = 0; x < w->width; x++) {
            to[x] = (uint16_t)((row[2 * x] << 8 | row[2 * x + 1]) >> (16 - bits));
        }
    }
    png_read_end(png, NULL);
}

gonio_status gonio_session_png_decode(const session_png *from, const char *file, int bits, gonio_frame *frame,
                                      gonio_error *error) {
    session_png whole = *from;
    png_context context = {.png = &whole};
    const size_t width = (size_t)frame->window.width;
    frame->pixels = NULL;
    if (!header_is(from, &frame->window)) {
        return gonio_fail_line(error, GONIO_E_INPUT, file, -1,
                               "not the frame that was stored: expected a PNG of %d x %d pixels, 16-bit grey",
                               frame->window.width, frame->window.height);
    }
    frame->pixels = calloc(width * (size_t)frame->window.height, sizeof *frame->pixels);
    unsigned char *row = malloc(2 * width);
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &context, on_error, on_warning);
    png_infop info = png != NULL ? png_create_info_struct(png) : NULL;
    gonio_status status = GONIO_OK;
    if (frame->pixels == NULL || row == NULL || info == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to read a frame");
    } else if (setjmp(context.jump) == 0) {
        png_set_read_fn(png, &context, read_bytes);
        read_png(png, info, bits, frame, row);
    } else {
        status = gonio_fail_line(error, GONIO_E_INPUT, file, -1, "not the frame that was stored: %s", context.message);
    }
    png_destroy_read_struct(&png, &info, NULL);
    free(row);
    if (status != GONIO_OK) {
        free(frame->pixels);
        frame->pixels = NULL;
    }
    return status;
}
