// SPDX-License-Identifier: BSD-3-Clause
// A file's first line of content, by which text formats are recognised.
#include <stdio.h>
#include <string.h>

#include "io/format.h"

const char *gonio_source_first_line(const gonio_source *source, char *buffer, size_t size, long long *number) {
    long long line = 1;
    buffer[0] = 0;
    *number = 0;
    const size_t looked_at = source->size < 65536 ? source->size : 65536;
    const char *at = source->data, *end = source->data + looked_at;
    if (memchr(at, 0, looked_at) != NULL) {
        return buffer;
    }
    if (looked_at >= 3 && memcmp(at, "\xef\xbb\xbf", 3) == 0) {
        at += 3;
    }
    while (at < end) {
        for (size_t blanks = strspn(at, " \t\r\n"); blanks > 0; blanks--) {
            line += *at++ == '\n';
        }
        if (*at != '#' && *at != 0) {
            *number = line;
            snprintf(buffer, size, "%.*s", (int)strcspn(at, "\r\n"), at);
            return gonio_text_trim(buffer);
        }
        at += strcspn(at, "\n");
    }
    return buffer;
}
