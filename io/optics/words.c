// SPDX-License-Identifier: BSD-3-Clause
#include <string.h>
#include <strings.h>

#include "io/optics/grid.h"

gonio_words gonio_words_begin(const gonio_source *source, const char *comment) {
    return (gonio_words){.text = gonio_text_begin(source->path, source->data, source->size),
                         .comment = comment,
                         .open_end = source->size > 0 && source->data[source->size - 1] != '\n'};
}

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// Go to the next word's first character; false at the end of the text.
static bool to_word(gonio_words *words) {
    for (;;) {
        while (words->rest != NULL && is_blank(*words->rest)) {
            words->rest++;
        }
        if (words->rest != NULL && *words->rest != 0 &&
            strncmp(words->rest, words->comment, strlen(words->comment)) != 0) {
            return true;
        }
        words->rest = gonio_text_line(&words->text);
        if (words->rest == NULL) {
            return false;
        }
    }
}

char *gonio_word(gonio_words *words) {
    if (!to_word(words)) {
        return NULL;
    }
    char *word = words->rest;
    while (*words->rest != 0 && !is_blank(*words->rest)) {
        words->rest++;
    }
    if (*words->rest != 0) {
        *words->rest++ = 0;
    }
    return word;
}

char *gonio_words_line(gonio_words *words) {
    static char nothing[1];
    char *line = words->rest != NULL ? words->rest : nothing;
    words->rest = NULL;
    return line;
}

gonio_status gonio_word_number(gonio_words *words, const char *what, double *value, gonio_error *error) {
    const char *word = gonio_word(words);
    return word != NULL ? gonio_text_number(&words->text, word, what, value, error)
                        : gonio_text_fail(&words->text, error, "%s: expected a number, found the file's end", what);
}

gonio_status gonio_word_choice(gonio_words *words, const char *what, const char *list, int *choice,
                               gonio_error *error) {
    const char *word = gonio_word(words);
    const size_t length = word != NULL ? strlen(word) : 0;
    *choice = 0;
    for (const char *one = list; length > 0; (*choice)++) {
        const size_t n = strcspn(one, "|");
        if (n == length && strncasecmp(one, word, n) == 0) {
            return GONIO_OK;
        }
        if (one[n] == 0) {
            break;
        }
        one += n + 1;
    }
    return gonio_text_fail(&words->text, error, "%s: expected %s, found '%.40s'", what, list,
                           word != NULL ? word : "the file's end");
}

bool gonio_source_begins(const gonio_source *source, const char *comment, const char *word) {
    const char *at = source->data, *end = at + source->size;
    if (source->size >= 3 && memcmp(at, "\xef\xbb\xbf", 3) == 0) {
        at += 3;
    }
    while (at < end) {
        if (is_blank(*at) || *at == '\n') {
            at++;
        } else if (strncmp(at, comment, strlen(comment)) == 0) {
            at += strcspn(at, "\n");
            if (*at == 0) {
                return false;
            }
        } else {
            const size_t n = strlen(word);
            return strncmp(at, word, n) == 0 && (is_blank(at[n]) || at[n] == '\n');
        }
    }
    return false;
}
