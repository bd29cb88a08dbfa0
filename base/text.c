// SPDX-License-Identifier: BSD-3-Clause
#include "base/text.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/number.h"

// ---- files ----

static size_t machine_memory(void) {
    const long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
    return pages > 0 && page > 0 ? (size_t)pages * (size_t)page : (size_t)1 << 32;
}

static gonio_status too_large(const char *path, size_t size, size_t limit, gonio_error *error) {
    return gonio_fail_byte(error, GONIO_E_INPUT, path, -1, "%zu bytes or more; at most %zu are read", size, limit);
}

// Read fd to its end into *data, which grows from `expected` bytes.
static gonio_status read_all(int fd, const char *path, size_t expected, size_t limit, char **data, size_t *size,
                             gonio_error *error) {
    size_t capacity = expected + 1, used = 0;
    char *bytes = malloc(capacity);
    for (;;) {
        if (bytes == NULL) {
            return gonio_fail_byte(error, GONIO_E_MEMORY, path, -1, "no memory for %zu bytes", capacity);
        }
        const ssize_t got = read(fd, bytes + used, capacity - used);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got < 0) {
            free(bytes);
            return gonio_fail_byte(error, GONIO_E_INPUT, path, (long long)used, "cannot read it: %s", strerror(errno));
        }
        if (got == 0) {
            break;
        }
        used += (size_t)got;
        if (used > limit) {
            free(bytes);
            return too_large(path, used, limit, error);
        }
        if (used == capacity) {
            capacity += capacity / 2 + 65536;
            char *larger = realloc(bytes, capacity);
            if (larger == NULL) {
                free(bytes);
            }
            bytes = larger;
        }
    }
    bytes[used] = 0; // used < capacity here: a full buffer has grown
    *data = bytes;
    *size = used;
    return GONIO_OK;
}

gonio_status gonio_file_read(const char *path, size_t limit, char **data, size_t *size, gonio_error *error) {
    *data = NULL;
    *size = 0;
    if (limit == 0) {
        limit = machine_memory();
    }
    const bool standard = strcmp(path, "-") == 0;
    const int fd = standard ? STDIN_FILENO : open(path, O_RDONLY | O_CLOEXEC);
    struct stat facts;
    if (fd < 0 || fstat(fd, &facts) != 0) {
        const gonio_status status =
            gonio_fail_byte(error, GONIO_E_INPUT, path, -1, "cannot open it: %s", strerror(errno));
        if (fd >= 0 && !standard) {
            close(fd);
        }
        return status;
    }
    gonio_status status;
    const size_t expected = S_ISREG(facts.st_mode) ? (size_t)facts.st_size : 0;
    if (S_ISDIR(facts.st_mode)) {
        status = gonio_fail_byte(error, GONIO_E_INPUT, path, -1, "it is a folder; expected a file");
    } else if (expected > limit) {
        status = too_large(path, expected, limit, error);
    } else {
        status = read_all(fd, path, expected, limit, data, size, error);
    }
    if (!standard) {
        close(fd);
    }
    return status;
}

// ---- kinds of text ----

// ASCII in 16-bit words without a mark: every other byte is 0.
static bool is_wide(const char *data, size_t size) {
    const size_t n = size < 64 ? size & ~(size_t)1 : 64;
    size_t zeros[2] = {0};
    for (size_t i = 0; i < n; i++) {
        zeros[i % 2] += data[i] == 0;
    }
    return n >= 8 && zeros[0] + zeros[1] == n / 2 && (zeros[0] == 0 || zeros[1] == 0);
}

static const char *wide_kind(const char *data, size_t size) {
    static const struct {
        const char *mark;
        size_t size;
        const char *name;
    } marks[] = {{"\xff\xfe\0\0", 4, "UTF-32"},
                 {"\0\0\xfe\xff", 4, "UTF-32"},
                 {"\xff\xfe", 2, "UTF-16"},
                 {"\xfe\xff", 2, "UTF-16"}};
    for (size_t k = 0; k < sizeof marks / sizeof *marks; k++) {
        if (size >= marks[k].size && memcmp(data, marks[k].mark, marks[k].size) == 0) {
            return marks[k].name;
        }
    }
    return is_wide(data, size) ? "UTF-16" : NULL;
}

gonio_status gonio_text_check(const char *path, const char *data, size_t size, gonio_error *error) {
    const char *wide = wide_kind(data, size);
    if (wide != NULL) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, 0, "it is %s text; expected UTF-8: save it so", wide);
    }
    const char *cr = memchr(data, '\r', size);
    if (cr != NULL && cr + 1 < data + size && memchr(data, '\n', size) == NULL && memchr(data, 0, size) == NULL) {
        return gonio_fail_byte(error, GONIO_E_INPUT, path, cr - data,
                               "its lines end with CR alone; expected LF or CRLF: save it so");
    }
    return GONIO_OK;
}

gonio_status gonio_text_open(const char *path, size_t limit, gonio_text *text, gonio_error *error) {
    char *data;
    size_t size;
    *text = (gonio_text){.path = path};
    gonio_status status = gonio_file_read(path, limit, &data, &size, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_text_check(path, data, size, error);
    if (status != GONIO_OK) {
        free(data);
        return status;
    }
    *text = gonio_text_begin(path, data, size);
    text->data = data;
    return GONIO_OK;
}

void gonio_text_free(gonio_text *text) {
    free(text->data);
    text->data = NULL;
}

// ---- lines ----

gonio_text gonio_text_begin(const char *path, char *data, size_t size) {
    const bool marked = size >= 3 && memcmp(data, "\xef\xbb\xbf", 3) == 0;
    return (gonio_text){.path = path, .next = data + (marked ? 3 : 0), .end = data + size};
}

static bool blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// Cut the blanks off both ends of [first, last), which has room for a 0 byte at last.
static char *trimmed(char *first, char *last) {
    while (first < last && blank(*first)) {
        first++;
    }
    while (last > first && blank(last[-1])) {
        last--;
    }
    *last = 0;
    return first;
}

// The same, of a text in which U+00A0, as spreadsheets and web pages write it, is a blank.
static char *unbroken(char *first, char *last) {
    for (char *wide = first; (wide = memchr(wide, 0xc2, (size_t)(last - wide))) != NULL; wide++) {
        if (wide + 1 < last && wide[1] == '\xa0') {
            wide[0] = wide[1] = ' ';
        }
    }
    return trimmed(first, last);
}

char *gonio_text_line(gonio_text *text) {
    if (text->next >= text->end) {
        return NULL;
    }
    char *first = text->next;
    char *last = memchr(first, '\n', (size_t)(text->end - first));
    if (last == NULL) {
        last = text->end;
    }
    text->next = last + 1;
    text->line++;
    // A zero byte would end the line for every string function: make it something that no field may hold.
    for (char *zero = first; (zero = memchr(zero, 0, (size_t)(last - zero))) != NULL;) {
        *zero = '?';
    }
    return unbroken(first, last);
}

char *gonio_text_trim(char *text) { return unbroken(text, text + strlen(text)); }

char *gonio_text_content(gonio_text *text) {
    char *line;
    do {
        line = gonio_text_line(text);
    } while (line != NULL && (line[0] == 0 || line[0] == '#'));
    return line;
}

char *gonio_text_commas(char *line) {
    if (line == NULL || strchr(line, ',') != NULL) {
        return line;
    }
    char *to = line;
    for (const char *from = line; *from != 0;) {
        const size_t blanks = strspn(from, " \t\r");
        *to++ = blanks > 0 ? ',' : *from;
        from += blanks > 0 ? blanks : 1;
    }
    *to = 0;
    return line;
}

char *gonio_text_row(gonio_text *text) { return gonio_text_commas(gonio_text_content(text)); }

char *gonio_text_setting(gonio_text *text, char **value, char **comment) {
    char *line;
    do {
        line = gonio_text_content(text);
    } while (line != NULL && line[0] == ';');
    *value = *comment = NULL;
    char *equals = line != NULL ? strchr(line, '=') : NULL;
    if (equals == NULL) {
        return line;
    }
    trimmed(line, equals);
    *value = equals + 1 + strspn(equals + 1, " \t");
    for (char *mark = *value; (mark = strpbrk(mark, ";#")) != NULL; mark++) {
        if (mark == *value || blank(mark[-1])) {
            *comment = mark + 1 + strspn(mark + 1, " \t");
            trimmed(*value, mark);
            break;
        }
    }
    return line;
}

bool gonio_text_is_header(char *const *fields, int n, const char *const *names) {
    int k = 0;
    while (k < n && names[k] != NULL && strcmp(fields[k], names[k]) == 0) {
        k++;
    }
    return k == n && names[k] == NULL;
}

int gonio_text_split(char *line, char separator, char **fields, int maximum) {
    int n = 0;
    char *first = line;
    for (;;) {
        if (separator == ' ') {
            while (blank(*first)) {
                first++;
            }
            if (*first == 0) {
                return n;
            }
        }
        char *last = first;
        while (*last != 0 && (separator == ' ' ? !blank(*last) : *last != separator)) {
            last++;
        }
        const bool is_end = *last == 0;
        char *field = trimmed(first, last);
        if (n < maximum) {
            fields[n] = field;
        }
        n++;
        if (is_end) {
            return n;
        }
        first = last + 1;
    }
}

gonio_status gonio_text_fail(const gonio_text *text, gonio_error *error, const char *format, ...) {
    char message[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    return gonio_fail_line(error, GONIO_E_INPUT, text->path, text->line > 0 ? text->line : -1, "%s", message);
}

// ---- numbers ----

// Only what a decimal number holds: strtod alone would take "0x1p3", "nan(3)" and "infinity" too.
static bool decimal_characters(const char *field) { return field[strspn(field, "0123456789+-.eE")] == 0; }

// How programs write that there is no value.
static bool names_nothing(const char *field) {
    static const char *const names[] = {"nan", "-nan", "na", "n/a", "null", "none", "#n/a", "-", "--", NULL};
    for (int k = 0; names[k] != NULL; k++) {
        if (strcasecmp(field, names[k]) == 0) {
            return true;
        }
    }
    return false;
}

gonio_status gonio_text_number(const gonio_text *text, const char *field, const char *what, double *value,
                               gonio_error *error) {
    char *end = NULL;
    if (names_nothing(field)) {
        return gonio_text_fail(
            text, error, "%s: expected a finite number, found '%.80s', which stands for a missing one", what, field);
    }
    if (field[0] == 0 || !decimal_characters(field)) {
        return gonio_text_fail(text, error, "%s: expected a finite number, found '%.80s'", what, field);
    }
    *value = gonio_number_parse(field, &end);
    if (end == field || *end != 0 || !isfinite(*value)) {
        return gonio_text_fail(text, error, "%s: expected a finite number, found '%.80s'", what, field);
    }
    return GONIO_OK;
}

gonio_status gonio_text_ratio(const gonio_text *text, char *field, const char *what, double *value,
                              gonio_error *error) {
    char *slash = strchr(field, '/');
    if (slash == NULL || names_nothing(field)) {
        return gonio_text_number(text, field, what, value, error);
    }
    double over;
    *slash = 0;
    gonio_status status = gonio_text_number(text, trimmed(field, slash), what, value, error);
    char *second = slash + 1;
    status = status == GONIO_OK ? gonio_text_number(text, trimmed(second, second + strlen(second)), what, &over, error)
                                : status;
    if (status == GONIO_OK && !(isfinite(*value / over))) {
        return gonio_text_fail(text, error, "%s: %g over %g is no number", what, *value, over);
    }
    *value = status == GONIO_OK ? *value / over : *value;
    return status;
}

bool gonio_text_declares_transmission(const gonio_text *text) {
    for (const char *at = text->next; at < text->end;) {
        const char *last = memchr(at, '\n', (size_t)(text->end - at));
        const size_t length = (size_t)((last != NULL ? last : text->end) - at);
        char line[160];
        snprintf(line, sizeof line, "%.*s", (int)(length < sizeof line ? length : sizeof line - 1), at);
        const char *key = line + strspn(line, "# \t"), *value = key + strcspn(key, "=:");
        if (line[strspn(line, " \t")] == '#' && strncasecmp(key, "halves", 6) == 0 &&
            key + 6 + strspn(key + 6, " \t") == value && strcasestr(value, "transmission") != NULL) {
            return true;
        }
        at += length + 1;
    }
    return false;
}

static const char *const pair_names[4] = {"theta_i", "phi_i", "theta_o", "phi_o"};

bool gonio_text_is_pair_header(char *const *fields, int n) {
    bool is = n >= 4;
    for (int k = 0; k < 4 && is; k++) {
        is = strcmp(fields[k], pair_names[k]) == 0;
    }
    return is;
}

#define PHI_MAX_DEG 36000.0

gonio_status gonio_text_pair(const gonio_text *text, char *const fields[4], gonio_pair *pair, gonio_error *error) {
    double angles[4];
    for (int k = 0; k < 4; k++) {
        double deg;
        const gonio_status status = gonio_text_number(text, fields[k], pair_names[k], &deg, error);
        if (status != GONIO_OK) {
            return status;
        }
        if (k % 2 == 0 && !(fabs(deg) <= (text->transmission ? 180 : 90))) {
            return gonio_text_fail(text, error,
                                   text->transmission
                                       ? "%s: expected 0 to 180 degrees, or -180 to 0 on the other side, found %s"
                                       : "%s: expected 0 to 90 degrees, or -90 to 0 on the other side, found %s",
                                   pair_names[k], fields[k]);
        }
        if (k % 2 == 1 && !(fabs(deg) <= PHI_MAX_DEG)) {
            return gonio_text_fail(text, error, "%s: expected -360 to 360 degrees and up to 100 turns, found %s",
                                   pair_names[k], fields[k]);
        }
        angles[k] = deg;
    }
    for (int k = 0; k < 4; k += 2) {
        double phi = fabs(angles[k + 1]) > 360 ? fmod(angles[k + 1], 360) : angles[k + 1];
        if (angles[k] < 0) {
            phi += phi > 0 ? -180 : 180;
        }
        angles[k] = gonio_radians(fabs(angles[k]));
        angles[k + 1] = gonio_radians(phi);
    }
    *pair = (gonio_pair){angles[0], angles[1], angles[2], angles[3]};
    return GONIO_OK;
}

// %g drops trailing zeros, so 15 digits give every shorter form too; 17 always suffice.
void gonio_text_append(char *text, size_t size, const char *format, ...) {
    const size_t used = strlen(text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text + used, size - used, format, arguments);
    va_end(arguments);
}

// The character at the head of a text and its bytes; 1 byte and no character (-1) where they are not UTF-8.
static int decode_utf8(const unsigned char *c, long *character) {
    static const long least[5] = {0, 0, 0x80, 0x800, 0x10000};
    const int n = *c < 0x80                 ? 1
                  : *c >= 0xc2 && *c < 0xe0 ? 2
                  : *c >= 0xe0 && *c < 0xf0 ? 3
                  : *c >= 0xf0 && *c < 0xf5 ? 4
                                            : 0;
    long value = n == 1 ? *c : *c & (0x7f >> n);
    int k = 1;
    while (k < n && (c[k] & 0xc0) == 0x80) { // a 0 byte ends it too
        value = value << 6 | (c[k++] & 0x3f);
    }
    const bool good = n > 0 && k == n && value >= least[n] && value <= 0x10ffff && (value < 0xd800 || value > 0xdfff);
    *character = good ? value : -1;
    return good ? n : 1;
}

static bool harmless(long c) {
    const bool control = c < 0x20 || (c >= 0x7f && c < 0xa0);
    const bool direction = c == 0x61c || (c >= 0x200b && c <= 0x200f) || (c >= 0x2028 && c <= 0x202e) ||
                           (c >= 0x2060 && c <= 0x206f) || c == 0xfeff;
    return !control && !direction;
}

bool gonio_text_is_printable(const char *text) {
    bool good = true;
    for (const unsigned char *c = (const unsigned char *)text; good && *c != 0;) {
        long character;
        c += decode_utf8(c, &character);
        good = harmless(character);
    }
    return good;
}

void gonio_text_printable(const char *text, char *out, size_t size) {
    size_t used = 0, whole = 0; // whole: characters that leave room for the dots
    for (const unsigned char *c = (const unsigned char *)text; *c != 0;) {
        char piece[24];
        long character;
        const int n = decode_utf8(c, &character);
        if (harmless(character)) {
            snprintf(piece, sizeof piece, "%.*s", n, (const char *)c);
        } else if (character == '\n' || character == '\t') {
            snprintf(piece, sizeof piece, "%s", character == '\n' ? "\\n" : "\\t");
        } else if (character < 0x80) {
            snprintf(piece, sizeof piece, "\\x%02x", (unsigned)*c);
        } else {
            snprintf(piece, sizeof piece, "\\u%04lx", (unsigned long)character);
        }
        const size_t length = strlen(piece);
        if (used + length >= size) {
            memcpy(out + whole, "...", 4);
            return;
        }
        memcpy(out + used, piece, length);
        used += length;
        whole = used + 4 <= size ? used : whole;
        c += n;
    }
    out[used] = 0;
}

void gonio_text_shortest(double value, char *buffer) {
    for (int digits = 15; digits <= 17; digits++) {
        gonio_number_format(buffer, 32, "%.*g", digits, value);
        char *end;
        if (gonio_number_parse(buffer, &end) == value) {
            return;
        }
    }
}

bool gonio_text_count(const char *text, size_t *value) {
    static const char suffixes[] = "kMG";
    char *end;
    double number = gonio_number_parse(text, &end);
    const char *suffix = *end != 0 ? strchr(suffixes, *end) : NULL;
    if (suffix != NULL) {
        number *= pow(1000, (double)(suffix - suffixes + 1));
        end++;
    }
    if (end == text || *end != 0 || !(number >= 0 && number <= 1e18) || number != floor(number)) {
        return false;
    }
    // Below 2^53 a double is the whole number itself.
    const bool digits = strspn(text, "0123456789") == strlen(text);
    *value = digits ? (size_t)strtoull(text, NULL, 10) : (size_t)number;
    return true;
}
