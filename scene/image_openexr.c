// SPDX-License-Identifier: BSD-3-Clause
// OpenEXR pictures, by the C interface of OpenEXR's library: 32-bit floats of the channels R, G and B.
#include <OpenEXR/openexr.h>
#include <errno.h>
#include <stdint.h>
#include <string.h>
#include <sys/stat.h>

#include "scene/image_formats.h"

// What the library is told of the file, and why that failed; NULL: it did not.
typedef struct exr_file {
    FILE *file;
    exr_context_t context;
    const char *failure;
} exr_file;

static int64_t fail_with(exr_file *exr, const char *failure) {
    exr->failure = failure;
    return -1;
}

static int64_t read_at(exr_const_context_t context, void *user, void *buffer, uint64_t size, uint64_t offset,
                       exr_stream_error_func_ptr_t fail) {
    (void)context;
    (void)fail;
    FILE *file = ((exr_file *)user)->file;
    if (offset > INT64_MAX || fseeko(file, (off_t)offset, SEEK_SET) != 0) {
        return fail_with(user, "it points outside itself");
    }
    return (int64_t)fread(buffer, 1, size, file);
}

static int64_t write_at(exr_const_context_t context, void *user, const void *buffer, uint64_t size, uint64_t offset,
                        exr_stream_error_func_ptr_t fail) {
    (void)context;
    (void)fail;
    FILE *file = ((exr_file *)user)->file;
    if (ftello(file) < 0) {
        return fail_with(user, "an EXR file cannot go to a pipe");
    }
    if (fseeko(file, (off_t)offset, SEEK_SET) != 0 || fwrite(buffer, 1, size, file) != size) {
        return fail_with(user, strerror(errno));
    }
    return (int64_t)size;
}

static int64_t size_of(exr_const_context_t context, void *user) {
    (void)context;
    struct stat s;
    return fstat(fileno(((exr_file *)user)->file), &s) == 0 && S_ISREG(s.st_mode) ? (int64_t)s.st_size : -1;
}

// Without one the library prints; while it runs, the context is locked.
static void say_nothing(exr_const_context_t context, exr_result_t code, const char *message) {
    (void)context;
    (void)code;
    (void)message;
}

static exr_context_initializer_t initializer(exr_file *exr) {
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = say_nothing;
    init.user_data = exr;
    init.read_fn = read_at;
    init.write_fn = write_at;
    init.size_fn = size_of;
    init.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    return init;
}

static const char *reason(const exr_file *exr, exr_result_t code) {
    return exr->failure != NULL                      ? exr->failure
           : code == EXR_ERR_FEATURE_NOT_IMPLEMENTED ? "DWAA, DWAB and channels of fewer pixels are not read"
                                                     : exr_get_default_error_message(code);
}

// ---- reading ----

// Which channel of the file goes to which of the picture's; -1: to none.
typedef struct planes {
    const char *names[3];
    int n; // 1: one for all three
} planes;

// The channels that are red, green and blue: of those names, else one for all, luminance or the first there is.
static bool find_planes(const exr_attr_chlist_t *list, planes *p) {
    static const char *const rgb[] = {"R", "G", "B"};
    *p = (planes){.n = 0};
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < list->num_channels; c++) {
            if (strcmp(list->entries[c].name.str, rgb[k]) == 0) {
                p->names[k] = rgb[k];
                p->n++;
            }
        }
    }
    if (p->n == 3 || list->num_channels < 1) {
        return p->n == 3;
    }
    *p = (planes){.names = {list->entries[0].name.str}, .n = 1};
    for (int c = 0; c < list->num_channels; c++) {
        if (strcmp(list->entries[c].name.str, "Y") == 0) {
            p->names[0] = "Y";
        }
    }
    return true;
}

// Rows and columns of the picture that a chunk holds.
typedef struct place {
    int x, y, tile_x, tile_y;
} place;

static exr_result_t read_chunk(exr_file *exr, const planes *p, bool tiled, place at, exr_decode_pipeline_t *decode,
                               int first_line, gonio_picture *image) {
    exr_chunk_info_t info;
    exr_result_t code = tiled ? exr_read_tile_chunk_info(exr->context, 0, at.tile_x, at.tile_y, 0, 0, &info)
                              : exr_read_scanline_chunk_info(exr->context, 0, first_line + at.y, &info);
    const bool fresh = decode->channels == NULL;
    if (code == EXR_ERR_SUCCESS) {
        code = fresh ? exr_decoding_initialize(exr->context, 0, &info, decode)
                     : exr_decoding_update(exr->context, 0, &info, decode);
    }
    if (code != EXR_ERR_SUCCESS) {
        return code;
    }
    if (info.height > image->height - at.y || info.width > image->width - at.x) {
        return EXR_ERR_BAD_CHUNK_LEADER;
    }
    float *origin = image->rgb + 3 * ((size_t)at.y * (size_t)image->width + (size_t)at.x);
    for (int c = 0; c < decode->channel_count; c++) {
        exr_coding_channel_info_t *channel = &decode->channels[c];
        channel->decode_to_ptr = NULL;
        for (int k = 0; k < p->n; k++) {
            if (strcmp(channel->channel_name, p->names[k]) == 0) {
                if (channel->x_samples != 1 || channel->y_samples != 1) {
                    return EXR_ERR_FEATURE_NOT_IMPLEMENTED;
                }
                channel->decode_to_ptr = (uint8_t *)(origin + k);
                channel->user_data_type = EXR_PIXEL_FLOAT;
                channel->user_bytes_per_element = sizeof(float);
                channel->user_pixel_stride = 3 * (int32_t)sizeof(float);
                channel->user_line_stride = 3 * (int32_t)sizeof(float) * image->width;
            }
        }
    }
    code = fresh ? exr_decoding_choose_default_routines(exr->context, 0, decode) : EXR_ERR_SUCCESS;
    return code == EXR_ERR_SUCCESS ? exr_decoding_run(exr->context, 0, decode) : code;
}

static exr_result_t read_chunks(exr_file *exr, const planes *p, bool tiled, int first_line, gonio_picture *image) {
    int32_t width = image->width, height = 0;
    exr_result_t code = tiled ? exr_get_tile_sizes(exr->context, 0, 0, 0, &width, &height)
                              : exr_get_scanlines_per_chunk(exr->context, 0, &height);
    if (code == EXR_ERR_SUCCESS && (width < 1 || height < 1)) {
        code = EXR_ERR_BAD_CHUNK_LEADER;
    }
    exr_decode_pipeline_t decode = EXR_DECODE_PIPELINE_INITIALIZER;
    for (place at = {0}; at.y < image->height && code == EXR_ERR_SUCCESS; at.y += height, at.tile_y++) {
        for (at.x = 0, at.tile_x = 0; at.x < image->width && code == EXR_ERR_SUCCESS; at.x += width, at.tile_x++) {
            code = read_chunk(exr, p, tiled, at, &decode, first_line, image);
        }
    }
    exr_decoding_destroy(exr->context, &decode);
    for (size_t i = 0; p->n == 1 && i < (size_t)image->width * (size_t)image->height; i++) {
        image->rgb[3 * i + 1] = image->rgb[3 * i + 2] = image->rgb[3 * i];
    }
    return code;
}

static gonio_status read_picture(exr_file *exr, const char *path, gonio_picture **out, gonio_error *error) {
    exr_attr_box2i_t box;
    exr_storage_t storage;
    const exr_attr_chlist_t *channels;
    exr_result_t code = exr_get_data_window(exr->context, 0, &box);
    code = code == EXR_ERR_SUCCESS ? exr_get_storage(exr->context, 0, &storage) : code;
    code = code == EXR_ERR_SUCCESS ? exr_get_channels(exr->context, 0, &channels) : code;
    if (code != EXR_ERR_SUCCESS) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not an EXR picture that can be read: %.200s",
                               reason(exr, code));
    }
    const double width = (double)box.max.x - box.min.x + 1, height = (double)box.max.y - box.min.y + 1;
    if (!(width >= 1 && height >= 1 && width <= SCENE_IMAGE_SIDE_MAX && height <= SCENE_IMAGE_SIDE_MAX)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "a picture of %g x %g pixels", width, height);
    }
    planes p;
    if (!find_planes(channels, &p) || (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "an EXR picture %s",
                               channels->num_channels < 1 ? "without channels" : "of several depths a pixel");
    }
    gonio_status status = gonio_scene_picture_new((int)width, (int)height, out, error);
    if (status != GONIO_OK) {
        return status;
    }
    code = read_chunks(exr, &p, storage == EXR_STORAGE_TILED, box.min.y, *out);
    return code == EXR_ERR_SUCCESS ? GONIO_OK
           : code == EXR_ERR_OUT_OF_MEMORY
               ? gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", path)
               : gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not an EXR picture that can be read: %.200s",
                                 reason(exr, code));
}

gonio_status gonio_scene_exr_read(FILE *file, const char *path, gonio_picture **out, gonio_error *error) {
    exr_file exr = {.file = file};
    const exr_context_initializer_t init = initializer(&exr);
    const exr_result_t code = exr_start_read(&exr.context, path, &init);
    if (code != EXR_ERR_SUCCESS) {
        exr_finish(&exr.context);
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not an EXR picture that can be read: %.200s",
                               reason(&exr, code));
    }
    const gonio_status status = read_picture(&exr, path, out, error);
    exr_finish(&exr.context);
    return status;
}

// ---- writing ----

static const char *const written[] = {"B", "G", "R"}; // in the order of their names, as the file has them

static exr_result_t write_header(exr_file *exr, const gonio_picture *image) {
    int part;
    exr_result_t code = exr_add_part(exr->context, NULL, EXR_STORAGE_SCANLINE, &part);
    if (code == EXR_ERR_SUCCESS) {
        code =
            exr_initialize_required_attr_simple(exr->context, part, image->width, image->height, EXR_COMPRESSION_ZIP);
    }
    for (int c = 0; c < 3 && code == EXR_ERR_SUCCESS; c++) {
        code = exr_add_channel(exr->context, part, written[c], EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    }
    return code == EXR_ERR_SUCCESS ? exr_write_header(exr->context) : code;
}

static exr_result_t write_chunk(exr_file *exr, const gonio_picture *image, int y, exr_encode_pipeline_t *encode) {
    exr_chunk_info_t info;
    exr_result_t code = exr_write_scanline_chunk_info(exr->context, 0, y, &info);
    const bool fresh = encode->channels == NULL;
    if (code == EXR_ERR_SUCCESS) {
        code = fresh ? exr_encoding_initialize(exr->context, 0, &info, encode)
                     : exr_encoding_update(exr->context, 0, &info, encode);
    }
    for (int c = 0; code == EXR_ERR_SUCCESS && c < encode->channel_count; c++) {
        exr_coding_channel_info_t *channel = &encode->channels[c];
        channel->encode_from_ptr = (const uint8_t *)(image->rgb + 3 * (size_t)y * (size_t)image->width + 2 - c);
        channel->user_data_type = EXR_PIXEL_FLOAT;
        channel->user_bytes_per_element = sizeof(float);
        channel->user_pixel_stride = 3 * (int32_t)sizeof(float);
        channel->user_line_stride = 3 * (int32_t)sizeof(float) * image->width;
    }
    if (code == EXR_ERR_SUCCESS && fresh) {
        code = exr_encoding_choose_default_routines(exr->context, 0, encode);
    }
    return code == EXR_ERR_SUCCESS ? exr_encoding_run(exr->context, 0, encode) : code;
}

static exr_result_t write_picture(exr_file *exr, const gonio_picture *image) {
    int32_t lines = 0;
    exr_result_t code = write_header(exr, image);
    code = code == EXR_ERR_SUCCESS ? exr_get_scanlines_per_chunk(exr->context, 0, &lines) : code;
    exr_encode_pipeline_t encode = EXR_ENCODE_PIPELINE_INITIALIZER;
    for (int y = 0; y < image->height && code == EXR_ERR_SUCCESS; y += lines) {
        code = write_chunk(exr, image, y, &encode);
    }
    exr_encoding_destroy(exr->context, &encode);
    return code;
}

gonio_status gonio_scene_exr_write(const gonio_picture *image, FILE *file, const char *path, gonio_error *error) {
    exr_file exr = {.file = file};
    const exr_context_initializer_t init = initializer(&exr);
    exr_result_t code = exr_start_write(&exr.context, path, EXR_WRITE_FILE_DIRECTLY, &init);
    code = code == EXR_ERR_SUCCESS ? write_picture(&exr, image) : code;
    const exr_result_t end = exr_finish(&exr.context);
    code = code == EXR_ERR_SUCCESS ? end : code;
    return code == EXR_ERR_SUCCESS
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write it: %.200s", reason(&exr, code));
}
