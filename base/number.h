// SPDX-License-Identifier: BSD-3-Clause
// Numbers in files, settings and replies: with a decimal point, whatever locale the process has set (in many a comma is
// the decimal point, and here it separates fields). Only the calling thread's locale is touched, and only for the call.
#ifndef GONIO_BASE_NUMBER_H
#define GONIO_BASE_NUMBER_H

#include <stddef.h>
#include <stdio.h>

// strtod in the C locale.
double gonio_number_parse(const char *text, char **end);
// snprintf and fprintf in the C locale; they return what those return.
int gonio_number_format(char *buffer, size_t size, const char *format, ...) __attribute__((format(printf, 3, 4)));
int gonio_number_write(FILE *stream, const char *format, ...) __attribute__((format(printf, 2, 3)));

#endif
