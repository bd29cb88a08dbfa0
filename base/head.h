// SPDX-License-Identifier: BSD-3-Clause
// What is known of a measurement, as lines "key = value" that sample sets, their files and models carry along.
#ifndef GONIO_BASE_HEAD_H
#define GONIO_BASE_HEAD_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/status.h"

#define GONIO_HEAD_MAX ((size_t)1 << 20) // bytes of such lines; what is beyond is no description any more
#define GONIO_HEAD_KEY_MAX 64

// One line more, to *head, which is allocated anew. Empty values add nothing.
gonio_status gonio_head_add(char **head, const char *key, const char *value, gonio_error *error);
// *to: a copy, or NULL of NULL.
gonio_status gonio_head_copy(const char *head, char **to, gonio_error *error);
// The next line from *at on, cut into key and value, which need GONIO_HEAD_KEY_MAX and `size` bytes; false at the end.
bool gonio_head_next(const char **at, char *key, char *value, size_t size);

#endif
