// SPDX-License-Identifier: BSD-3-Clause
// HDF5 files: open, close, errors; groups, attributes and single values.
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/session/hdf5.h"

#define LINKS_MAX 4096

// ---- errors ----

typedef struct cause {
    char text[300];
} cause;

// The innermost entry of the library's stack says what went wrong; it comes first going upward.
static herr_t innermost(unsigned n, const H5E_error2_t *entry, void *context) {
    if (n == 0 && entry->desc != NULL) {
        snprintf(((cause *)context)->text, sizeof((cause *)context)->text, "%s", entry->desc);
    }
    return 0;
}

gonio_status gonio_h5_fail(const h5_file *file, gonio_status status, gonio_error *error, const char *format, ...) {
    char what[200];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    cause why = {""};
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, innermost, &why);
    // Of "file write failed: time = ..., errno = 28, error message = 'No space left on device', ..." the system's text.
    static const char key[] = "error message = '";
    char *text = strstr(why.text, key);
    if (text != NULL) {
        text += sizeof key - 1;
        text[strcspn(text, "'")] = 0;
        status = GONIO_E_IO;
    } else {
        text = why.text;
    }
    return gonio_fail_line(error, status, file->path, -1, "%s%s%s", what, text[0] != 0 ? ": " : "", text);
}

// ---- open and close ----

static void hush(h5_file *file) {
    H5Eget_auto2(H5E_DEFAULT, &file->print, &file->print_to);
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
}

static hid_t access_list(void) {
    const hid_t list = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_libver_bounds(list, H5F_LIBVER_V110, H5F_LIBVER_V110);
    // What is still open when the file is closed, after a failure, is closed with it.
    H5Pset_fclose_degree(list, H5F_CLOSE_STRONG);
    return list;
}

gonio_status gonio_h5_create(const char *path, const char *name, h5_file *file, gonio_error *error) {
    *file = (h5_file){.id = -1, .path = name};
    hush(file);
    const hid_t list = access_list();
    file->id = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, list);
    H5Pclose(list);
    return file->id >= 0 ? GONIO_OK : gonio_h5_fail(file, GONIO_E_IO, error, "cannot write it");
}

// A file, not a pipe that waits for ever; the library follows names by itself, so there is no more to it.
static gonio_status check_file(const char *path, gonio_error *error) {
    struct stat facts;
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    const bool known = fd >= 0 && fstat(fd, &facts) == 0;
    const int why = errno;
    if (fd >= 0) {
        close(fd);
    }
    if (!known) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(why));
    }
    return S_ISREG(facts.st_mode) ? GONIO_OK : gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a file");
}

gonio_status gonio_h5_open(const char *path, h5_file *file, gonio_error *error) {
    *file = (h5_file){.id = -1, .path = path};
    hush(file);
    gonio_status status = check_file(path, error);
    if (status != GONIO_OK) {
        return status;
    }
    const hid_t list = access_list();
    file->id = H5Fopen(path, H5F_ACC_RDONLY, list);
    H5Pclose(list);
    if (file->id < 0) {
        return gonio_h5_fail(file, GONIO_E_INPUT, error, "not an HDF5 file that can be read");
    }
    H5F_info2_t facts;
    if (H5Fget_info2(file->id, &facts) < 0 || facts.super.version < 2) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                               "an HDF5 file of an old form, without checksums; Gonio reads those that it wrote");
    }
    return GONIO_OK;
}

gonio_status gonio_h5_close(h5_file *file, gonio_status status, gonio_error *error) {
    if (file->id >= 0) {
        const bool flushed = status != GONIO_OK || H5Fflush(file->id, H5F_SCOPE_GLOBAL) >= 0;
        if (!flushed) {
            status = gonio_h5_fail(file, GONIO_E_IO, error, "cannot write it");
        }
        if (H5Fclose(file->id) < 0 && status == GONIO_OK) {
            status = gonio_h5_fail(file, GONIO_E_IO, error, "cannot close it");
        }
        file->id = -1;
    }
    H5Eclear2(H5E_DEFAULT);
    H5Eset_auto2(H5E_DEFAULT, file->print, file->print_to);
    return status;
}

// ---- groups ----

gonio_status gonio_h5_group(const h5_file *file, const char *path, const char *nx_class, gonio_error *error) {
    if (strcmp(path, "/") != 0) {
        // Links stay in the group's own header, under its checksum, however many there are.
        const hid_t list = H5Pcreate(H5P_GROUP_CREATE);
        H5Pset_link_phase_change(list, LINKS_MAX, LINKS_MAX);
        const hid_t group = H5Gcreate2(file->id, path, H5P_DEFAULT, list, H5P_DEFAULT);
        H5Pclose(list);
        if (group < 0) {
            return gonio_h5_fail(file, GONIO_E_IO, error, "cannot write %s", path);
        }
        H5Gclose(group);
    }
    return gonio_h5_attribute(file, path, "NX_class", nx_class, error);
}

// A group whose links stand in its header. Of the other form, a heap, damage makes libhdf5 1.10 free what it never had.
static bool is_compact(const h5_file *file, const char *path) {
    H5G_info_t facts;
    return H5Gget_info_by_name(file->id, path, &facts, H5P_DEFAULT) >= 0 &&
           facts.storage_type == H5G_STORAGE_TYPE_COMPACT;
}

bool gonio_h5_exists(const h5_file *file, const char *path) {
    char part[160] = "/";
    for (const char *end = path; end[0] != 0 && end[1] != 0;) { // "/" is always there
        end += 1 + strcspn(end + 1, "/");
        H5L_info_t link;
        if (!is_compact(file, part) ||
            snprintf(part, sizeof part, "%.*s", (int)(end - path), path) >= (int)sizeof part ||
            H5Lget_info(file->id, part, &link, H5P_DEFAULT) < 0 || link.type != H5L_TYPE_HARD) {
            return false;
        }
    }
    return true;
}

// ---- attributes and single values ----

static hid_t text_type(size_t size) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, size > 0 ? size : 1);
    H5Tset_strpad(type, H5T_STR_NULLPAD);
    H5Tset_cset(type, H5T_CSET_UTF8);
    return type;
}

static gonio_status put_attribute(const h5_file *file, const char *path, const char *name, hid_t type,
                                  const void *value, gonio_error *error) {
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t attribute = H5Acreate_by_name(file->id, path, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    const bool good = attribute >= 0 && H5Awrite(attribute, type, value) >= 0;
    const gonio_status status =
        good ? GONIO_OK : gonio_h5_fail(file, GONIO_E_IO, error, "cannot write %s of %s", name, path);
    H5Aclose(attribute);
    H5Sclose(space);
    return status;
}

gonio_status gonio_h5_attribute(const h5_file *file, const char *path, const char *name, const char *text,
                                gonio_error *error) {
    const hid_t type = text_type(strlen(text));
    const gonio_status status = put_attribute(file, path, name, type, text, error);
    H5Tclose(type);
    return status;
}

gonio_status gonio_h5_attribute_integer(const h5_file *file, const char *path, const char *name, int64_t value,
                                        gonio_error *error) {
    return put_attribute(file, path, name, H5T_NATIVE_INT64, &value, error);
}

static gonio_status put_single(const h5_file *file, const char *path, hid_t type, const void *value,
                               gonio_error *error) {
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t dataset = H5Dcreate2(file->id, path, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    const bool good = dataset >= 0 && H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, value) >= 0;
    const gonio_status status = good ? GONIO_OK : gonio_h5_fail(file, GONIO_E_IO, error, "cannot write %s", path);
    H5Dclose(dataset);
    H5Sclose(space);
    return status;
}

gonio_status gonio_h5_text(const h5_file *file, const char *path, const char *text, gonio_error *error) {
    const hid_t type = text_type(strlen(text));
    const gonio_status status = put_single(file, path, type, text, error);
    H5Tclose(type);
    return status;
}

gonio_status gonio_h5_number(const h5_file *file, const char *path, double value, const char *units,
                             gonio_error *error) {
    const gonio_status status = put_single(file, path, H5T_NATIVE_DOUBLE, &value, error);
    return status == GONIO_OK && units != NULL ? gonio_h5_attribute(file, path, "units", units, error) : status;
}

// An attribute that is one value of this class; its type in the file, -1 where it is none.
static hid_t open_attribute(const h5_file *file, const char *path, const char *name, H5T_class_t wanted, hid_t *type) {
    H5Eclear2(H5E_DEFAULT);
    const hid_t attribute =
        gonio_h5_exists(file, path) ? H5Aopen_by_name(file->id, path, name, H5P_DEFAULT, H5P_DEFAULT) : -1;
    *type = attribute >= 0 ? H5Aget_type(attribute) : -1;
    const hid_t space = attribute >= 0 ? H5Aget_space(attribute) : -1;
    const bool good = *type >= 0 && space >= 0 && H5Sget_simple_extent_npoints(space) == 1 &&
                      H5Tget_class(*type) == wanted && H5Tis_variable_str(*type) <= 0;
    H5Sclose(space);
    if (!good) {
        H5Tclose(*type);
        H5Aclose(attribute);
        return -1;
    }
    return attribute;
}

gonio_status gonio_h5_read_integer(const h5_file *file, const char *path, const char *name, int64_t *value,
                                   gonio_error *error) {
    hid_t type;
    const hid_t attribute = open_attribute(file, path, name, H5T_INTEGER, &type);
    const bool good = attribute >= 0 && H5Aread(attribute, H5T_NATIVE_INT64, value) >= 0;
    if (attribute >= 0) {
        H5Tclose(type);
        H5Aclose(attribute);
    }
    return good ? GONIO_OK
                : gonio_fail_line(error, GONIO_E_INPUT, file->path, -1, "%s has no attribute %s, an integer", path,
                                  name);
}

gonio_status gonio_h5_read_text(const h5_file *file, const char *path, const char *name, char **text,
                                gonio_error *error) {
    hid_t type;
    *text = NULL;
    const hid_t attribute = open_attribute(file, path, name, H5T_STRING, &type);
    if (attribute >= 0) {
        const size_t size = H5Tget_size(type);
        *text = size > 0 && size <= 65536 ? calloc(size + 1, 1) : NULL; // what an attribute can hold
        const hid_t memory = text_type(size);
        if (*text != NULL && H5Aread(attribute, memory, *text) < 0) {
            free(*text);
            *text = NULL;
        }
        H5Tclose(memory);
        H5Tclose(type);
        H5Aclose(attribute);
    }
    return *text != NULL
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_INPUT, file->path, -1, "%s has no attribute %s, a text", path, name);
}
