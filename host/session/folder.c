// SPDX-License-Identifier: BSD-3-Clause
#include "host/session/folder.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

// A kernel or a file system that does not know what it is asked for.
static bool unknown(int code) { return code == EINVAL || code == ENOSYS || code == EOPNOTSUPP; }

int gonio_folder_open(int folder, const char *name) {
    return openat(folder, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
}

DIR *gonio_folder_list(int folder) {
    const int fd = gonio_folder_open(folder, "."); // a position of its own
    DIR *list = fd >= 0 ? fdopendir(fd) : NULL;
    if (list == NULL && fd >= 0) {
        close(fd);
    }
    return list;
}

const char *gonio_folder_next(DIR *list) {
    const struct dirent *entry;
    do {
        errno = 0;
        entry = readdir(list);
    } while (entry != NULL && (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0));
    return entry != NULL ? entry->d_name : NULL;
}

int gonio_folder_rename(int from, const char *old_name, int to, const char *new_name) {
    if (renameat2(from, old_name, to, new_name, RENAME_NOREPLACE) == 0) {
        return 0;
    }
    struct stat facts;
    if (!unknown(errno)) {
        return -1;
    }
    // Such file systems know no rename that never replaces. Only the holder of the session's lock comes here.
    if (fstatat(to, new_name, &facts, AT_SYMLINK_NOFOLLOW) == 0) {
        errno = EEXIST;
        return -1;
    }
    return errno == ENOENT ? renameat(from, old_name, to, new_name) : -1;
}

int gonio_folder_exchange(int folder, const char *a, const char *b) {
    return renameat2(folder, a, folder, b, RENAME_EXCHANGE);
}

// The prefix and random digits; false with errno.
static bool random_name(const char *prefix, int digits, char name[FOLDER_NAME]) {
    uint32_t number;
    if (getrandom(&number, sizeof number, 0) != sizeof number) {
        return false;
    }
    if (snprintf(name, FOLDER_NAME, "%s%0*x", prefix, digits, number & ((1u << 4 * digits) - 1)) >= FOLDER_NAME) {
        errno = ENAMETOOLONG;
        return false;
    }
    return true;
}

int gonio_folder_make(int parent, const char *prefix, char name[FOLDER_NAME]) {
    while (random_name(prefix, 5, name)) {
        if (mkdirat(parent, name, 0700) == 0) {
            const int fd = gonio_folder_open(parent, name);
            if (fd < 0) {
                unlinkat(parent, name, AT_REMOVEDIR);
            }
            return fd;
        }
        if (errno != EEXIST) {
            break;
        }
    }
    return -1;
}

int gonio_folder_temporary(int folder, const char *prefix, char name[FOLDER_NAME]) {
    while (random_name(prefix, 6, name)) {
        const int fd = gonio_folder_create(folder, name, NULL);
        if (fd >= 0 || errno != EEXIST) {
            return fd;
        }
    }
    return -1;
}

int gonio_folder_like(int fd, const struct stat *like) {
    // Only root can give files away; anybody else's are the caller's own, as all that he makes.
    const int given = fchown(fd, like->st_uid, like->st_gid);
    (void)given;
    return fchmod(fd, like->st_mode & 07777);
}

int gonio_folder_create(int folder, const char *name, const struct stat *like) {
    const int fd = openat(folder, name, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (fd >= 0 && like != NULL && gonio_folder_like(fd, like) != 0) {
        const int why = errno;
        close(fd);
        unlinkat(folder, name, 0);
        errno = why;
        return -1;
    }
    return fd;
}

static bool write_all(int fd, const char *data, size_t size) {
    for (size_t at = 0; at < size;) {
        const ssize_t wrote = write(fd, data + at, size - at);
        if (wrote < 0 && errno != EINTR) {
            return false;
        }
        at += wrote > 0 ? (size_t)wrote : 0;
    }
    return true;
}

static int copy_bytes(int in, int out, bool *reading) {
    char buffer[1 << 16];
    ssize_t got;
    while ((got = read(in, buffer, sizeof buffer)) != 0) {
        if (got < 0 && errno == EINTR) {
            continue;
        }
        *reading = got < 0;
        if (got < 0 || !write_all(out, buffer, (size_t)got)) {
            return -1;
        }
    }
    return fsync(out);
}

static int copy_into(int in, int to, const char *new_name, bool *reading) {
    struct stat facts;
    *reading = true;
    if (fstat(in, &facts) != 0 || !S_ISREG(facts.st_mode)) {
        errno = S_ISREG(facts.st_mode) ? errno : EINVAL;
        return -1;
    }
    *reading = false;
    const int out = gonio_folder_create(to, new_name, &facts);
    if (out < 0) {
        return -1;
    }
    const struct timespec times[2] = {facts.st_atim, facts.st_mtim};
    int result = copy_bytes(in, out, reading);
    result = result == 0 ? futimens(out, times) : result;
    const int why = errno;
    if (close(out) != 0 && result == 0) {
        result = -1;
    } else {
        errno = why;
    }
    if (result != 0) {
        unlinkat(to, new_name, 0);
        errno = why;
    }
    return result;
}

int gonio_folder_copy(int from, const char *name, int to, const char *new_name, bool *reading) {
    const int in = openat(from, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (in < 0) {
        *reading = true;
        return -1;
    }
    const int result = copy_into(in, to, new_name, reading);
    const int why = errno;
    close(in);
    errno = why;
    return result;
}

int gonio_folder_link(int from, const char *name, int to, const char *new_name, bool *copied, bool *reading) {
    *copied = *reading = false;
    if (linkat(from, name, to, new_name, 0) == 0) {
        return 0;
    }
    // A file system without links, one whose inode is full of them, or a kernel that gives no links to others' files.
    if (!unknown(errno) && errno != EPERM && errno != EMLINK && errno != EXDEV && errno != EACCES) {
        return -1;
    }
    *copied = true;
    return gonio_folder_copy(from, name, to, new_name, reading);
}

void gonio_folder_discard(int parent, const char *name) {
    const int fd = gonio_folder_open(parent, name);
    DIR *list = fd >= 0 ? gonio_folder_list(fd) : NULL;
    const char *entry;
    while (list != NULL && (entry = gonio_folder_next(list)) != NULL) {
        if (unlinkat(fd, entry, 0) != 0 && (errno == EISDIR || errno == EPERM)) {
            gonio_folder_discard(fd, entry);
        }
    }
    if (list != NULL) {
        closedir(list);
    }
    if (fd >= 0) {
        close(fd);
    }
    unlinkat(parent, name, AT_REMOVEDIR);
}

int gonio_folder_sync(int folder) {
    DIR *list = gonio_folder_list(folder);
    if (list == NULL) {
        return -1;
    }
    int result = 0;
    const char *entry;
    struct stat facts;
    while (result == 0 && (entry = gonio_folder_next(list)) != NULL) {
        if (fstatat(folder, entry, &facts, AT_SYMLINK_NOFOLLOW) == 0 && S_ISDIR(facts.st_mode)) {
            const int fd = gonio_folder_open(folder, entry);
            result = fd >= 0 ? gonio_folder_sync(fd) : -1;
            if (fd >= 0) {
                close(fd);
            }
        }
    }
    closedir(list);
    return result == 0 ? fsync(folder) : result;
}
