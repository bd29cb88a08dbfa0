// SPDX-License-Identifier: BSD-3-Clause
// A temporary file with given bytes, for tests of readers.
#ifndef GONIO_TESTS_SCRATCH_H
#define GONIO_TESTS_SCRATCH_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// Fills path (at least 64 bytes) with the new file's name.
static inline void scratch_file(char *path, const void *data, size_t size) {
    const char *folder = getenv("TMPDIR");
    snprintf(path, 64, "%.40s/gonio-test-XXXXXX", folder != NULL ? folder : "/tmp");
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_true(write(fd, data, size) == (ssize_t)size);
    close(fd);
}

#endif
