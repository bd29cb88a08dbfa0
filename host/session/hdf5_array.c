// SPDX-License-Identifier: BSD-3-Clause
// Arrays of an HDF5 file: in chunks, shuffled and deflated, moved by rows of the first dimension.
#include <stdio.h>
#include <string.h>

#include "host/session/hdf5.h"

// deflate cannot make more than 1032 bytes of one (two bits for 258 bytes): an array that claims more holds something
// else than it says.
#define DEFLATE_MOST 1032
// The largest chunk that a reader takes into memory, in bytes: a frame of 500 megapixels.
#define CHUNK_MAX ((hsize_t)1000 << 20)
#define ROWS_MAX ((hsize_t)1 << 40)

static const struct {
    H5T_class_t class;
    size_t size; // 0: of any
    const char *name;
} kinds[] = {
    [H5_I64] = {H5T_INTEGER, 8, "64-bit integers"},
    [H5_F64] = {H5T_FLOAT, 8, "64-bit floating point numbers"},
    [H5_U8] = {H5T_INTEGER, 1, "bytes"},
    [H5_U16] = {H5T_INTEGER, 2, "16-bit integers"},
    [H5_TEXT] = {H5T_STRING, 0, "texts of a fixed length"},
};

// A type that is the caller's to close; files are little-endian on every machine.
static hid_t type_of(h5_type kind, size_t width) {
    const hid_t type = kind == H5_I64   ? H5Tcopy(H5T_STD_I64LE)
                       : kind == H5_F64 ? H5Tcopy(H5T_IEEE_F64LE)
                       : kind == H5_U8  ? H5Tcopy(H5T_STD_U8LE)
                       : kind == H5_U16 ? H5Tcopy(H5T_STD_U16LE)
                                        : H5Tcopy(H5T_C_S1);
    if (kind == H5_TEXT) {
        H5Tset_size(type, width > 0 ? width : 1);
        H5Tset_strpad(type, H5T_STR_NULLPAD);
        H5Tset_cset(type, H5T_CSET_UTF8);
    }
    return type;
}

static void set_sizes(h5_array *array) {
    array->row_bytes = H5Tget_size(array->type);
    for (int k = 1; k < array->rank; k++) {
        array->row_bytes *= (size_t)array->dims[k];
    }
}

size_t gonio_h5_piece(size_t row_bytes) {
    const size_t rows = row_bytes > 0 ? H5_PIECE_BYTES / row_bytes : H5_PIECE_BYTES;
    return rows < 1 ? 1 : rows;
}

// ---- writing ----

static hid_t creation_list(const h5_array *array, size_t chunk_rows) {
    hsize_t chunk[3] = {chunk_rows < array->dims[0] ? chunk_rows : array->dims[0], array->dims[1], array->dims[2]};
    const hid_t list = H5Pcreate(H5P_DATASET_CREATE);
    bool empty = false;
    for (int k = 0; k < array->rank; k++) {
        empty = empty || array->dims[k] == 0;
    }
    if (!empty) { // of nothing there are no chunks
        H5Pset_chunk(list, array->rank, chunk);
        H5Pset_shuffle(list);
        H5Pset_deflate(list, 1); // frames are mostly shot noise, in which a longer search finds nothing
        H5Pset_fletcher32(list);
    }
    return list;
}

gonio_status gonio_h5_array_create(const h5_file *file, const char *path, h5_type kind, size_t width, int rank,
                                   const hsize_t *dims, size_t chunk_rows, const char *units, h5_array *array,
                                   gonio_error *error) {
    *array = (h5_array){.file = file, .kind = kind, .rank = rank, .dataset = -1, .type = type_of(kind, width)};
    snprintf(array->path, sizeof array->path, "%s", path);
    memcpy(array->dims, dims, (size_t)rank * sizeof *dims);
    set_sizes(array);
    const hid_t space = H5Screate_simple(rank, dims, NULL), list = creation_list(array, chunk_rows);
    array->dataset = H5Dcreate2(file->id, path, array->type, space, H5P_DEFAULT, list, H5P_DEFAULT);
    gonio_status status = GONIO_OK;
    if (array->dataset < 0) {
        status = gonio_h5_fail(file, GONIO_E_IO, error, "cannot write %s", path);
    }
    H5Pclose(list);
    H5Sclose(space);
    if (status == GONIO_OK && units != NULL) {
        status = gonio_h5_attribute(file, path, "units", units, error);
    }
    if (status != GONIO_OK) {
        gonio_h5_array_close(array);
    }
    return status;
}

// ---- reading ----

static gonio_status refuse(const h5_array *array, gonio_error *error, const char *what) {
    H5Eclear2(H5E_DEFAULT);
    return gonio_fail_line(error, GONIO_E_INPUT, array->file->path, -1, "%s: %s", array->path, what);
}

// Where the values lie: in this file, in chunks of a sensible size behind filters that every libhdf5 has, or plainly.
static bool layout_sound(hid_t list, int rank, size_t element) {
    const H5D_layout_t layout = H5Pget_layout(list);
    bool sound = H5Pget_external_count(list) == 0 &&
                 (layout == H5D_CHUNKED || layout == H5D_CONTIGUOUS || layout == H5D_COMPACT);
    hsize_t chunk[3] = {1, 1, 1}, bytes = element;
    if (sound && layout == H5D_CHUNKED) {
        sound = H5Pget_chunk(list, 3, chunk) == rank;
        for (int k = 0; sound && k < rank; k++) {
            sound = chunk[k] > 0 && chunk[k] <= CHUNK_MAX / bytes;
            bytes *= chunk[k];
        }
    }
    const int filters = H5Pget_nfilters(list);
    sound = sound && filters >= 0 && filters <= 4;
    for (int k = 0; sound && k < filters; k++) {
        unsigned flags, config;
        size_t values = 0;
        const H5Z_filter_t filter = H5Pget_filter2(list, (unsigned)k, &flags, &values, NULL, 0, NULL, &config);
        sound = filter == H5Z_FILTER_DEFLATE || filter == H5Z_FILTER_SHUFFLE || filter == H5Z_FILTER_FLETCHER32;
    }
    return sound;
}

static gonio_status check_type(h5_array *array, gonio_error *error) {
    char what[96];
    const hid_t type = H5Dget_type(array->dataset);
    const size_t size = type >= 0 ? H5Tget_size(type) : 0;
    bool good = type >= 0 && H5Tget_class(type) == kinds[array->kind].class &&
                (kinds[array->kind].size == 0 ? size > 0 && size <= H5_TEXT_MAX : size == kinds[array->kind].size);
    good = good && (array->kind != H5_TEXT || H5Tis_variable_str(type) == 0);
    H5Tclose(type);
    snprintf(what, sizeof what, "%s are expected", kinds[array->kind].name);
    if (good) {
        array->type = type_of(array->kind, size);
    }
    return good ? GONIO_OK : refuse(array, error, what);
}

static gonio_status check_extent(h5_array *array, gonio_error *error) {
    const hid_t space = H5Dget_space(array->dataset);
    const bool ranked = space >= 0 && H5Sget_simple_extent_ndims(space) == array->rank;
    const bool known = ranked && H5Sget_simple_extent_dims(space, array->dims, NULL) == array->rank;
    H5Sclose(space);
    if (!known) {
        return refuse(array, error, "it has another number of dimensions");
    }
    hsize_t bytes = H5Tget_size(array->type);
    for (int k = 0; k < array->rank; k++) {
        if (array->dims[k] > ROWS_MAX || (bytes > 0 && array->dims[k] > ((hsize_t)1 << 50) / bytes)) {
            return refuse(array, error, "its size is impossible");
        }
        bytes *= array->dims[k];
    }
    const hsize_t stored = H5Dget_storage_size(array->dataset);
    if (bytes > 0 && (stored == 0 || bytes / DEFLATE_MOST > stored)) {
        return refuse(array, error, "it claims to hold more than the file can");
    }
    set_sizes(array);
    return GONIO_OK;
}

gonio_status gonio_h5_array_open(const h5_file *file, const char *path, h5_type kind, int rank, h5_array *array,
                                 gonio_error *error) {
    *array = (h5_array){.file = file, .kind = kind, .rank = rank, .dataset = -1, .type = -1};
    snprintf(array->path, sizeof array->path, "%s", path);
    array->dataset = gonio_h5_exists(file, path) ? H5Dopen2(file->id, path, H5P_DEFAULT) : -1;
    gonio_status status = GONIO_OK;
    if (array->dataset < 0) {
        status = gonio_h5_fail(file, GONIO_E_INPUT, error, "%s: there is no such array that can be read", path);
    }
    status = status == GONIO_OK ? check_type(array, error) : status;
    status = status == GONIO_OK ? check_extent(array, error) : status;
    if (status == GONIO_OK) {
        const hid_t list = H5Dget_create_plist(array->dataset);
        if (!layout_sound(list, rank, H5Tget_size(array->type))) {
            status = refuse(array, error, "it is stored in a way that Gonio does not write");
        }
        H5Pclose(list);
    }
    if (status != GONIO_OK) {
        gonio_h5_array_close(array);
    }
    return status;
}

// ---- moving rows ----

// The rows' part of the array, and as much memory; false on failure.
static bool choose(const h5_array *array, hsize_t first, hsize_t n, hid_t *memory, hid_t *place) {
    const hsize_t start[3] = {first, 0, 0}, count[3] = {n, array->dims[1], array->dims[2]};
    *place = H5Dget_space(array->dataset);
    *memory = H5Screate_simple(array->rank, count, NULL);
    return *place >= 0 && *memory >= 0 && H5Sselect_hyperslab(*place, H5S_SELECT_SET, start, NULL, count, NULL) >= 0;
}

gonio_status gonio_h5_array_write(h5_array *array, hsize_t first, hsize_t n, const void *data, gonio_error *error) {
    if (n == 0 || array->row_bytes == 0) {
        return GONIO_OK;
    }
    hid_t memory, place;
    const bool good = choose(array, first, n, &memory, &place) &&
                      H5Dwrite(array->dataset, array->type, memory, place, H5P_DEFAULT, data) >= 0;
    const gonio_status status =
        good ? GONIO_OK : gonio_h5_fail(array->file, GONIO_E_IO, error, "cannot write %s", array->path);
    H5Sclose(memory);
    H5Sclose(place);
    return status;
}

gonio_status gonio_h5_array_read(h5_array *array, hsize_t first, hsize_t n, void *data, gonio_error *error) {
    if (first > array->dims[0] || n > array->dims[0] - first) {
        return refuse(array, error, "it has fewer rows than the journal needs");
    }
    if (n == 0 || array->row_bytes == 0) {
        return GONIO_OK;
    }
    hid_t memory, place;
    const bool good = choose(array, first, n, &memory, &place) &&
                      H5Dread(array->dataset, array->type, memory, place, H5P_DEFAULT, data) >= 0;
    const gonio_status status =
        good ? GONIO_OK : gonio_h5_fail(array->file, GONIO_E_INPUT, error, "cannot read %s", array->path);
    H5Sclose(memory);
    H5Sclose(place);
    return status;
}

void gonio_h5_array_close(h5_array *array) {
    if (array->file != NULL) {
        if (array->dataset >= 0) {
            H5Dclose(array->dataset);
        }
        if (array->type >= 0) {
            H5Tclose(array->type);
        }
        *array = (h5_array){0};
    }
}
