// SPDX-License-Identifier: BSD-3-Clause
#include "base/head.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/sample.h"

// Without what would end the line or steer a terminal; the blanks around it do not count.
static void clean(char *text) {
    size_t n = 0;
    for (const char *c = text; *c != 0; c++) {
        const unsigned char byte = (unsigned char)*c;
        const bool control = byte < 0x20 || byte == 0x7f || (byte == 0xc2 && ((unsigned char)c[1] & 0xe0) == 0x80);
        text[n] = control ? ' ' : *c;
        c += control && byte == 0xc2;
        n += n > 0 || text[n] != ' ';
    }
    while (n > 0 && text[n - 1] == ' ') {
        n--;
    }
    text[n] = 0;
}

gonio_status gonio_head_add(char **head, const char *key, const char *value, gonio_error *error) {
    const size_t used = *head != NULL ? strlen(*head) : 0, more = strlen(key) + strlen(value) + 8;
    char *text = strdup(value), *larger = NULL;
    if (text != NULL) {
        clean(text);
    }
    if (text != NULL && (text[0] == 0 || used + more > GONIO_HEAD_MAX)) {
        free(text);
        return GONIO_OK;
    }
    if (text == NULL || (larger = realloc(*head, used + more)) == NULL) {
        free(text);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what is known of a measurement");
    }
    snprintf(larger + used, more, "%.*s = %s\n", GONIO_HEAD_KEY_MAX - 1, key, text);
    *head = larger;
    free(text);
    return GONIO_OK;
}

gonio_status gonio_head_copy(const char *head, char **to, gonio_error *error) {
    *to = head != NULL ? strdup(head) : NULL;
    return head == NULL || *to != NULL
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_MEMORY, "no memory for what is known of a measurement");
}

bool gonio_head_next(const char **at, char *key, char *value, size_t size) {
    if (*at == NULL || **at == 0) {
        return false;
    }
    const size_t length = strcspn(*at, "\n");
    const char *sign = memmem(*at, length, " = ", 3);
    const size_t n = sign != NULL ? (size_t)(sign - *at) : length;
    snprintf(key, GONIO_HEAD_KEY_MAX, "%.*s", (int)(n < GONIO_HEAD_KEY_MAX ? n : GONIO_HEAD_KEY_MAX - 1), *at);
    const size_t rest = sign != NULL ? length - n - 3 : 0;
    snprintf(value, size, "%.*s", (int)(rest < size ? rest : size - 1), sign != NULL ? sign + 3 : "");
    *at += length;
    *at += **at == '\n';
    return true;
}

bool gonio_head_find(const char *head, const char *key, char *value, size_t size) {
    char own[GONIO_HEAD_KEY_MAX];
    for (const char *at = head; gonio_head_next(&at, own, value, size);) {
        if (strcmp(own, key) == 0) {
            return true;
        }
    }
    value[0] = 0;
    return false;
}

gonio_status gonio_samples_tell(gonio_samples *samples, const char *key, const char *value, gonio_error *error) {
    return gonio_head_add(&samples->head, key, value, error);
}
