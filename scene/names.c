// SPDX-License-Identifier: BSD-3-Clause
#include "scene/names.h"

#include <stdio.h>
#include <string.h>

#define WHOLE_MAX 1536

gonio_status gonio_scene_beside(const char *file, char *path, size_t size, gonio_error *error) {
    const char *slash = strrchr(file, '/');
    char whole[WHOLE_MAX];
    if (path[0] == 0 || path[0] == '/' || slash == NULL) {
        return GONIO_OK;
    }
    const int length = snprintf(whole, sizeof whole, "%.*s/%s", (int)(slash - file), file, path);
    if (length < 0 || (size_t)length >= size || (size_t)length >= sizeof whole) {
        return gonio_fail_line(error, GONIO_E_INPUT, file, -1, "the path of '%.80s' is longer than %zu bytes", path,
                               size - 1);
    }
    memcpy(path, whole, (size_t)length + 1);
    return GONIO_OK;
}

bool gonio_scene_is_spec(const char *text) {
    const size_t word = strspn(text, "abcdefghijklmnopqrstuvwxyz-");
    return word > 0 && text[word] == ':' && strncmp(text, "spec:", 5) != 0;
}

gonio_status gonio_scene_model_name(const char *file, char *name, size_t size, gonio_error *error) {
    if (strncmp(name, "spec:", 5) == 0) {
        return GONIO_OK;
    }
    if (!gonio_scene_is_spec(name)) {
        return gonio_scene_beside(file, name, size, error);
    }
    const size_t length = strlen(name);
    if (length + sizeof "spec:" > size) {
        return gonio_fail_line(error, GONIO_E_INPUT, file, -1, "the model '%.80s' is longer than %zu bytes", name,
                               size - sizeof "spec:");
    }
    memmove(name + 5, name, length + 1);
    memcpy(name, "spec:", 5);
    return GONIO_OK;
}
