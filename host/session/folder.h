// SPDX-License-Identifier: BSD-3-Clause
// Folders and files by descriptor, with one rule: a name that is taken is never taken away, and no link is followed.
#ifndef GONIO_SESSION_FOLDER_H
#define GONIO_SESSION_FOLDER_H

#include <dirent.h>
#include <stdbool.h>
#include <sys/stat.h>

#include "gonio/status.h"

enum { FOLDER_NAME = 256 }; // a file's name with its end, as Linux bounds it

// A folder within a folder, as a descriptor for openat; -1 with errno. A symbolic link is ELOOP or ENOTDIR.
int gonio_folder_open(int folder, const char *name);
// The entries of a folder, from its beginning; the caller closes it. NULL with errno.
DIR *gonio_folder_list(int folder);
// The next entry that is not "." or ".."; NULL at the end (errno 0) or at a failure (errno).
const char *gonio_folder_next(DIR *list);
// Rename without replacing: -1 with EEXIST where the new name is taken.
int gonio_folder_rename(int from, const char *old_name, int to, const char *new_name);
// Swap what two names of one folder stand for, at once. -1 with EINVAL, ENOSYS or EOPNOTSUPP where the file system
// cannot.
int gonio_folder_exchange(int folder, const char *a, const char *b);
// Make a folder, or a file, whose name is the prefix and random hexadecimal digits, five of a folder, which
// SESSION_PATH_BYTES counts on, six of a file; the whole name goes to name.
int gonio_folder_make(int parent, const char *prefix, char name[FOLDER_NAME]);
int gonio_folder_temporary(int folder, const char *prefix, char name[FOLDER_NAME]);
// A new file: mode and owner are those of like (NULL: the umask's). -1 with EEXIST where the name is taken.
int gonio_folder_create(int folder, const char *name, const struct stat *like);
// Copy a regular file under a name that is not taken, and sync it. -1 with errno; *reading tells whether it was the
// reading that failed. Half a copy does not stay.
int gonio_folder_copy(int from, const char *name, int to, const char *new_name, bool *reading);
// A second name for a file, or where that cannot be a copy; *copied tells which.
int gonio_folder_link(int from, const char *name, int to, const char *new_name, bool *copied, bool *reading);
// Remove a folder that the caller has just made, with all that it has put in.
void gonio_folder_discard(int parent, const char *name);
// Sync a folder and all folders within it: their files keep their names.
int gonio_folder_sync(int folder);
// Give a folder or file the mode and, where that is permitted, the owner of another.
int gonio_folder_like(int fd, const struct stat *like);

#endif
