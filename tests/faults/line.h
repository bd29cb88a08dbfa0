// SPDX-License-Identifier: BSD-3-Clause
#ifndef GONIO_TESTS_FAULTS_LINE_H
#define GONIO_TESTS_FAULTS_LINE_H

#include <stdbool.h>
#include <sys/types.h>

bool line_is(int fd);            // the open serial line
int line_open(const char *path); // -2: another path
void line_close(int fd);
ssize_t line_or_write(int fd, const void *bytes, size_t n);

#endif
