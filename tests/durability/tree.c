// SPDX-License-Identifier: BSD-3-Clause
#include "tests/durability/tree.h"

#include <dirent.h>
#include <fcntl.h>
#include <ftw.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

uint32_t tree_random(uint64_t *state) {
    // SplitMix64's mix of a counter.
    uint64_t x = *state += UINT64_C(0x9e3779b97f4a7c15);
    x = (x ^ x >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    x = (x ^ x >> 27) * UINT64_C(0x94d049bb133111eb);
    return (uint32_t)((x ^ x >> 31) >> 32);
}

uint32_t tree_below(uint64_t *state, uint32_t n) { return (uint32_t)((uint64_t)tree_random(state) * n >> 32); }
bool tree_chance(uint64_t *state, uint32_t one_in) { return tree_below(state, one_in) == 0; }

static void give_up(const char *what, const char *path) {
    fprintf(stderr, "the harness cannot %s ", what);
    perror(path);
    exit(1);
}

static int remove_one(const char *path, const struct stat *info, int kind, struct FTW *walk) {
    (void)info;
    (void)kind;
    (void)walk;
    return remove(path);
}

void tree_remove(const char *path) { nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS); }

tree_bytes tree_read(const char *path) {
    tree_bytes bytes = {0};
    struct stat info;
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
    if (fd >= 0 && fstat(fd, &info) == 0 && S_ISREG(info.st_mode)) {
        bytes.data = malloc((size_t)info.st_size + 1);
        ssize_t got;
        while (bytes.data != NULL && bytes.size < (size_t)info.st_size &&
               (got = read(fd, bytes.data + bytes.size, (size_t)info.st_size - bytes.size)) > 0) {
            bytes.size += (size_t)got;
        }
    }
    if (fd >= 0) {
        close(fd);
    }
    return bytes;
}

void tree_write(const char *path, const void *data, size_t size) {
    const int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (fd < 0 || (size > 0 && write(fd, data, size) != (ssize_t)size)) {
        give_up("write", path);
    }
    close(fd);
}

static void copy_folder(const char *from, const char *to, bool live);

static void copy_entry(const char *from, const char *to, bool live) {
    struct stat info;
    if (lstat(from, &info) != 0) {
        if (!live) {
            give_up("copy", from);
        }
        return;
    }
    if (S_ISDIR(info.st_mode)) {
        copy_folder(from, to, live);
    } else if (S_ISREG(info.st_mode)) {
        const tree_bytes bytes = tree_read(from);
        tree_write(to, bytes.data, bytes.size);
        free(bytes.data);
    }
}

static void copy_folder(const char *from, const char *to, bool live) {
    if (mkdir(to, 0755) != 0) {
        give_up("make", to);
    }
    DIR *folder = opendir(from);
    const struct dirent *entry;
    while (folder != NULL && (entry = readdir(folder)) != NULL) {
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0) {
            char *a, *b;
            if (asprintf(&a, "%s/%s", from, entry->d_name) < 0 || asprintf(&b, "%s/%s", to, entry->d_name) < 0) {
                abort();
            }
            copy_entry(a, b, live);
            free(a);
            free(b);
        }
    }
    if (folder == NULL) {
        give_up("list", from);
    }
    closedir(folder);
}

void tree_copy(const char *from, const char *to) { copy_folder(from, to, false); }
void tree_copy_live(const char *from, const char *to) { copy_folder(from, to, true); }

uint64_t tree_hash(const void *data, size_t size) {
    const unsigned char *bytes = data;
    uint64_t hash = UINT64_C(0xcbf29ce484222325) ^ size;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ bytes[i]) * UINT64_C(0x100000001b3);
    }
    return hash != 0 ? hash : 1;
}

// ---- pictures ----

typedef struct reading {
    const tree_bytes *file;
    size_t at;
} reading;

static void read_bytes(png_structp png, png_bytep out, size_t n) {
    reading *r = png_get_io_ptr(png);
    if (n > r->file->size - r->at) {
        png_error(png, "the file ends");
    }
    memcpy(out, r->file->data + r->at, n);
    r->at += n;
}

static void be_silent(png_structp png, png_const_charp text) {
    (void)png;
    (void)text;
}

static void fail_silently(png_structp png, png_const_charp text) {
    (void)text;
    png_longjmp(png, 1);
}

enum { PIXELS_MAX = 1 << 24 };

static uint64_t read_pixels(png_structp png, png_infop info, unsigned char **row) {
    if (setjmp(png_jmpbuf(png))) {
        return 0;
    }
    png_read_info(png, info);
    const uint32_t width = png_get_image_width(png, info), height = png_get_image_height(png, info);
    if (png_get_bit_depth(png, info) != 16 || png_get_color_type(png, info) != PNG_COLOR_TYPE_GRAY || width == 0 ||
        height > PIXELS_MAX / width) {
        return 0;
    }
    *row = malloc((size_t)width * height * 2);
    for (uint32_t y = 0; *row != NULL && y < height; y++) {
        png_read_row(png, *row + (size_t)y * width * 2, NULL);
    }
    png_read_end(png, NULL);
    return *row != NULL ? tree_hash(*row, (size_t)width * height * 2) ^ width : 0;
}

uint64_t tree_pixels(const tree_bytes *file) {
    if (file->data == NULL || file->size < 8 || png_sig_cmp(file->data, 0, 8) != 0) {
        return 0;
    }
    reading r = {file, 0};
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, NULL, fail_silently, be_silent);
    png_infop info = png_create_info_struct(png);
    unsigned char *rows = NULL;
    png_set_read_fn(png, &r, read_bytes);
    const uint64_t hash = read_pixels(png, info, &rows);
    png_destroy_read_struct(&png, &info, NULL);
    free(rows);
    return hash;
}

// ---- lists ----

static void list_folder(const char *folder, size_t prefix, tree_list *list) {
    DIR *open_folder = opendir(folder);
    const struct dirent *entry;
    while (open_folder != NULL && (entry = readdir(open_folder)) != NULL) {
        char *path;
        struct stat info;
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0) {
            continue;
        }
        if (asprintf(&path, "%s/%s", folder, entry->d_name) < 0) {
            abort();
        }
        if (lstat(path, &info) == 0 && S_ISDIR(info.st_mode)) {
            list_folder(path, prefix, list);
        } else if (S_ISREG(info.st_mode)) {
            const tree_bytes bytes = tree_read(path);
            list->files = realloc(list->files, (list->n + 1) * sizeof *list->files);
            list->files[list->n++] = (tree_file){strdup(path + prefix), info.st_ino, tree_hash(bytes.data, bytes.size),
                                                 tree_pixels(&bytes), bytes.size};
            free(bytes.data);
        }
        free(path);
    }
    if (open_folder != NULL) {
        closedir(open_folder);
    }
}

tree_list tree_files(const char *folder) {
    tree_list list = {0};
    list_folder(folder, strlen(folder) + 1, &list);
    return list;
}

void tree_files_free(tree_list *list) {
    for (size_t i = 0; i < list->n; i++) {
        free(list->files[i].path);
    }
    free(list->files);
    *list = (tree_list){0};
}

bool tree_has_pixels(const tree_list *list, uint64_t pixels) {
    for (size_t i = 0; i < list->n; i++) {
        if (list->files[i].pixels == pixels) {
            return true;
        }
    }
    return false;
}

static bool has_file(const tree_list *list, const tree_file *file) {
    for (size_t i = 0; i < list->n; i++) {
        if (list->files[i].inode == file->inode && list->files[i].pixels == file->pixels) {
            return true;
        }
    }
    return false;
}

size_t tree_lost(const tree_list *before, const tree_list *after, bool by_pixels, char *lost, size_t room) {
    size_t n = 0;
    for (size_t i = 0; i < before->n; i++) {
        const tree_file *file = &before->files[i];
        if (file->pixels != 0 && !has_file(after, file) && !(by_pixels && tree_has_pixels(after, file->pixels))) {
            if (n++ == 0) {
                snprintf(lost, room, "%s", file->path);
            }
        }
    }
    return n;
}

size_t tree_content_lost(const tree_list *before, const tree_list *after, char *lost, size_t room) {
    size_t n = 0;
    for (size_t i = 0; i < before->n; i++) {
        const char *path = before->files[i].path, *end = strstr(path, "-shm");
        bool found = end != NULL && end[4] == 0; // SQLite's own, made anew at will
        for (size_t k = 0; k < after->n && !found; k++) {
            found =
                after->files[k].content == before->files[i].content && after->files[k].size == before->files[i].size;
        }
        if (!found && n++ == 0) {
            snprintf(lost, room, "%s", path);
        }
    }
    return n;
}
