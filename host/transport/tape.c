// SPDX-License-Identifier: BSD-3-Clause
#include "host/transport/tape.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAGIC "gonio-tape 1\n"

struct gonio_tape {
    FILE *stream;
    char *path, *line;
    size_t capacity;
    long long number;
};

static gonio_status tape_new(const char *path, const char *mode, gonio_tape **out, gonio_error *error) {
    gonio_tape *tape = calloc(1, sizeof *tape);
    if (tape == NULL || (tape->path = strdup(path)) == NULL) {
        free(tape);
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a tape");
    }
    tape->stream = fopen(path, mode);
    if (tape->stream == NULL) {
        gonio_tape_close(tape);
        return gonio_fail_line(error, mode[0] == 'r' ? GONIO_E_INPUT : GONIO_E_IO, path, -1, "cannot be opened: %s",
                               strerror(errno));
    }
    *out = tape;
    return GONIO_OK;
}

gonio_status gonio_tape_choose(const char *record, const char *replay, gonio_tape **out, gonio_error *error) {
    *out = NULL;
    return replay[0] != 0   ? gonio_tape_open(replay, out, error)
           : record[0] != 0 ? gonio_tape_create(record, out, error)
                            : GONIO_OK;
}

gonio_status gonio_tape_create(const char *path, gonio_tape **out, gonio_error *error) {
    const gonio_status status = tape_new(path, "wx", out, error); // never over an earlier record
    if (status == GONIO_OK) {
        fputs(MAGIC, (*out)->stream);
    }
    return status;
}

gonio_status gonio_tape_open(const char *path, gonio_tape **out, gonio_error *error) {
    gonio_tape *tape;
    const gonio_status status = tape_new(path, "r", &tape, error);
    if (status != GONIO_OK) {
        return status;
    }
    tape->number = 1;
    if (getline(&tape->line, &tape->capacity, tape->stream) < 0 || strcmp(tape->line, MAGIC) != 0) {
        gonio_tape_close(tape);
        return gonio_fail_line(error, GONIO_E_INPUT, path, 1, "not a tape: expected '%.12s'", MAGIC);
    }
    *out = tape;
    return GONIO_OK;
}

void gonio_tape_close(gonio_tape *tape) {
    if (tape == NULL) {
        return;
    }
    if (tape->stream != NULL) {
        fclose(tape->stream);
    }
    free(tape->line);
    free(tape->path);
    free(tape);
}

static void put_hex(FILE *stream, const void *bytes, size_t n) {
    static const char digits[] = "0123456789abcdef";
    const unsigned char *b = bytes;
    if (n == 0) {
        putc('-', stream);
    }
    for (size_t i = 0; i < n; i++) {
        putc(digits[b[i] >> 4], stream);
        putc(digits[b[i] & 15], stream);
    }
}

void gonio_tape_put(gonio_tape *tape, const char *kind, const void *request, size_t n, long long result,
                    const void *reply, size_t m) {
    fprintf(tape->stream, "%s ", kind);
    put_hex(tape->stream, request, n);
    fprintf(tape->stream, " %lld ", result);
    put_hex(tape->stream, reply, m);
    putc('\n', tape->stream);
    fflush(tape->stream);
}

static int digit(char c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1; }

// Bytes of a hex word into `bytes`; false where it is none or longer than size.
static bool get_hex(const char *word, unsigned char *bytes, size_t size, size_t *n) {
    const size_t length = strcmp(word, "-") == 0 ? 0 : strlen(word);
    *n = length / 2;
    if (length % 2 != 0 || *n > size) {
        return false;
    }
    for (size_t i = 0; i < *n; i++) {
        const int high = digit(word[2 * i]), low = digit(word[2 * i + 1]);
        if (high < 0 || low < 0) {
            return false;
        }
        bytes[i] = (unsigned char)(high << 4 | low);
    }
    return true;
}

gonio_status gonio_tape_get(gonio_tape *tape, const char *kind, const void *request, size_t n, long long *result,
                            void *reply, size_t size, size_t *m, gonio_error *error) {
    tape->number++;
    if (getline(&tape->line, &tape->capacity, tape->stream) < 0) {
        return gonio_fail_line(error, GONIO_E_MISMATCH, tape->path, tape->number, "the tape ends; asked for: %s", kind);
    }
    tape->line[strcspn(tape->line, "\n")] = 0;
    char *rest = tape->line;
    const char *words[4];
    for (int i = 0; i < 4; i++) {
        words[i] = strsep(&rest, " ");
        if (words[i] == NULL) {
            return gonio_fail_line(error, GONIO_E_INPUT, tape->path, tape->number, "expected four words, found %d", i);
        }
    }
    if (strcmp(words[0], kind) != 0) {
        return gonio_fail_line(error, GONIO_E_MISMATCH, tape->path, tape->number, "recorded %.32s, asked for %s",
                               words[0], kind);
    }
    size_t asked = 0;
    unsigned char *bytes = malloc(n + 1);
    const bool same = bytes != NULL && get_hex(words[1], bytes, n, &asked) && asked == n &&
                      (n == 0 || memcmp(bytes, request, n) == 0);
    free(bytes);
    if (!same) {
        return gonio_fail_line(error, GONIO_E_MISMATCH, tape->path, tape->number, "%s was asked with another request",
                               kind);
    }
    *result = strtoll(words[2], NULL, 10);
    if (!get_hex(words[3], reply, size, m)) {
        return gonio_fail_line(error, GONIO_E_INPUT, tape->path, tape->number,
                               "reply longer than %zu bytes, or not hex", size);
    }
    return GONIO_OK;
}
