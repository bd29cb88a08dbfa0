// SPDX-License-Identifier: BSD-3-Clause
// JSON of what comes from outside. Jansson refuses texts that are not UTF-8 and numbers that are not finite, and with
// them the whole object that they stand in; a path may be any bytes, and a figure may be unknown.
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "host/cli/cli.h"

// Bytes of the UTF-8 character at s; 0: there is none.
static size_t character(const unsigned char *s) {
    const unsigned char first = s[0], low = first == 0xe0 ? 0xa0 : first == 0xf0 ? 0x90 : 0x80;
    const unsigned char high = first == 0xed ? 0x9f : first == 0xf4 ? 0x8f : 0xbf;
    if (first < 0x80) {
        return 1;
    }
    const size_t size = first < 0xc2 ? 0 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : first < 0xf5 ? 4 : 0;
    for (size_t i = 1; i < size; i++) {
        if (s[i] < (i == 1 ? low : 0x80) || s[i] > (i == 1 ? high : 0xbf)) {
            return 0;
        }
    }
    return size;
}

json_t *cli_json_string(const char *text) {
    char *clean = text != NULL ? malloc(3 * strlen(text) + 1) : NULL;
    if (clean == NULL) {
        return text == NULL ? json_null() : NULL;
    }
    size_t n = 0;
    for (const unsigned char *s = (const unsigned char *)text; *s != 0;) {
        const size_t size = character(s);
        memcpy(clean + n, size > 0 ? (const char *)s : "\xef\xbf\xbd", size > 0 ? size : 3);
        n += size > 0 ? size : 3;
        s += size > 0 ? size : 1;
    }
    json_t *string = json_stringn(clean, n);
    free(clean);
    return string;
}

json_t *cli_json_real(double value) { return isfinite(value) ? json_real(value) : json_null(); }

json_t *cli_json_text(const char *text) { return text[0] != 0 ? cli_json_string(text) : json_null(); }

typedef struct packing {
    const char *at;
    va_list values;
} packing;

static json_t *pack(packing *p);

static json_t *pack_object(packing *p) {
    json_t *object = json_object();
    while (*p->at != 0 && *p->at != '}') {
        p->at++; // a separator, or the 's' of the key
        if (p->at[-1] == 's') {
            const char *key = va_arg(p->values, const char *);
            p->at += strspn(p->at, ": ");
            json_object_set_new(object, key, pack(p));
        }
    }
    p->at += *p->at == '}';
    return object;
}

static json_t *pack_array(packing *p) {
    json_t *array = json_array();
    while (*p->at != 0 && *p->at != ']') {
        if (strchr(", ", *p->at) != NULL) {
            p->at++;
        } else {
            json_array_append_new(array, pack(p));
        }
    }
    p->at += *p->at == ']';
    return array;
}

static json_t *pack(packing *p) {
    json_t *value = NULL;
    switch (*p->at++) {
    case '{':
        return pack_object(p);
    case '[':
        return pack_array(p);
    case 's':
        value = cli_json_string(va_arg(p->values, const char *));
        p->at += *p->at == '?'; // null for NULL, as everywhere here
        return value;
    case 'i':
        return json_integer(va_arg(p->values, int));
    case 'I':
        return json_integer(va_arg(p->values, json_int_t));
    case 'b':
        return json_boolean(va_arg(p->values, int));
    case 'f':
        return cli_json_real(va_arg(p->values, double));
    case 'o':
        value = va_arg(p->values, json_t *);
        return value != NULL ? value : json_null();
    case 'O':
        value = va_arg(p->values, json_t *);
        return value != NULL ? json_incref(value) : json_null();
    default:
        return NULL;
    }
}

json_t *cli_json_pack(const char *format, ...) {
    packing p = {.at = format};
    va_start(p.values, format);
    json_t *value = pack(&p);
    va_end(p.values);
    return value;
}
