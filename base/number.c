// SPDX-License-Identifier: BSD-3-Clause
#include "base/number.h"

#include <locale.h>
#include <stdarg.h>
#include <stdlib.h>

// glibc hands out one static object for "C", so this allocates nothing and cannot fail.
static locale_t c_locale(void) { return newlocale(LC_ALL_MASK, "C", (locale_t)0); }

double gonio_number_parse(const char *text, char **end) { return strtod_l(text, end, c_locale()); }

int gonio_number_format(char *buffer, size_t size, const char *format, ...) {
    va_list arguments;
    const locale_t before = uselocale(c_locale());
    va_start(arguments, format);
    const int length = vsnprintf(buffer, size, format, arguments);
    va_end(arguments);
    uselocale(before);
    return length;
}

int gonio_number_write(FILE *stream, const char *format, ...) {
    va_list arguments;
    const locale_t before = uselocale(c_locale());
    va_start(arguments, format);
    const int length = vfprintf(stream, format, arguments);
    va_end(arguments);
    uselocale(before);
    return length;
}
