// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/lines_table.h"

#include <ctype.h>
#include <fnmatch.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/keys.h"
#include "base/number.h"
#include "host/drivers/table_file.h"

// ---- the tables that come with Gonio ----

static const gonio_table_text tables[] = {
    // GRBL 1.1 (its wiki: "Grbl v1.1 Interface", "Commands"): one line moves all axes; ? is a real-time command without
    // a
    // line's end. A hold ends in Hold:0, from where a reset loses no position.
    {"grbl", "end = \\n\n"
             "ack = ok\n"
             "error = error:*|ALARM:*\n"
             "ignore = Grbl*|[[]*\n"
             "home = $H\n"
             "home_timeout_s = 120\n"
             "move = G90 G0[ {axis}{value}]\n"
             "stop = !\\c\n"
             "stopped = <Hold:0*|<Idle*\n"
             "release = \\x18\\c\n"
             "state = ?\\c\n"
             "idle = <Idle*\n"
             "busy = <Run*|<Home*|<Jog*|<Hold*\n"
             "unhomed = <Alarm*\n"
             "position = ?\\c\n"
             "position_answer = *MPos:{values}\n"},
    // Newport ESP300/301 (user's manual, section 3): commands are not answered, TB? tells errors.
    {"esp", "end = \\r\n"
            "open = {axis}MO\n"
            "home = {axis}OR\n"
            "move = {axis}PA{value}\n"
            "stop = {axis}ST\n"
            "state = {axis}MD?\n"
            "idle = 1\n"
            "busy = 0\n"
            "position = {axis}TP?\n"
            "position_answer = {value}\n"
            "check = TE?\n"
            "check_good = 0\n"},
    // Newport SMC100 (command interface manual): four digits of errors, then the state; 32 to 35 READY, 28 MOVING, 1E
    // and
    // 1F HOMING, 0A to 11 NOT REFERENCED.
    {"smc100", "end = \\r\\n\n"
               "home = {axis}OR\n"
               "move = {axis}PA{value}\n"
               "stop = {axis}ST\n"
               "state = {axis}TS\n"
               "idle = {axis}TS00003[2-5]\n"
               "busy = {axis}TS000028|{axis}TS00001[EF]\n"
               "unhomed = {axis}TS00000[A-F]|{axis}TS00001[01]\n"
               "position = {axis}TP\n"
               "position_answer = {axis}TP{value}\n"
               "check = {axis}TE\n"
               "check_good = {axis}TE@\n"},
    // Thorlabs Elliptec (ELLx modules protocol manual): hexadecimal pulses; a move answers PO when it has arrived, or
    // GS with
    // a status: 00 sound, 09 busy.
    {"elliptec", "end = \n"
                 "ignore = {axis}PO*\n"
                 "error = {axis}GS0[1-8]|{axis}GS0[A-F]\n"
                 "home = {axis}ho0\n"
                 "move = {axis}ma{value}\n"
                 "state = {axis}gs\n"
                 "idle = {axis}GS00\n"
                 "busy = {axis}GS09\n"
                 "position = {axis}gp\n"
                 "position_answer = {axis}PO{value}\n"
                 "number = hex8\n"},
    {0},
};

GONIO_KEY_NAMES(numbers, "decimal", "integer", "hex8")
#define KEY(member)                                                                                                    \
    { GONIO_KEY(gonio_lines_table, member, TEXT), .section = "" }
static const gonio_key keys[] = {
    KEY(end),
    KEY(ack),
    KEY(error),
    KEY(ignore),
    KEY(open),
    KEY(home),
    KEY(move),
    KEY(stop),
    KEY(stopped),
    KEY(release),
    KEY(state),
    KEY(idle),
    KEY(busy),
    KEY(unhomed),
    KEY(position),
    KEY(position_answer),
    KEY(check),
    KEY(check_good),
    {GONIO_KEY(gonio_lines_table, home_timeout_s, REAL), .low = 0, .high = 3600, .section = ""},
    {GONIO_KEY(gonio_lines_table, number, CHOICE), .names = numbers, .section = ""},
    {0},
};

static const char *lacks(const void *given) {
    const gonio_lines_table *table = given;
    return table->home[0] != 0 && table->move[0] != 0 && table->state[0] != 0 && table->idle[0] != 0 &&
                   table->position[0] != 0 && strstr(table->position_answer, "{value") != NULL
               ? NULL
               : "home, move, state, idle, position and a position_answer with {value} or {values}";
}

gonio_status gonio_lines_table_read(const char *name, gonio_lines_table *table, gonio_error *error) {
    static const gonio_table_form form = {"table of commands", tables, keys, lacks};
    *table = (gonio_lines_table){0};
    return gonio_table_file_read(&form, name, table, error);
}

// ---- commands ----

typedef struct writer {
    char *to;
    size_t n;
    bool full;
} writer;

static void put(writer *w, const char *bytes, size_t n) {
    if (w->n + n > GONIO_LINES_COMMAND) {
        w->full = true;
        return;
    }
    memcpy(w->to + w->n, bytes, n);
    w->n += n;
}

static void put_value(writer *w, const gonio_lines_table *table, double value) {
    char text[40];
    int n;
    if (table->number == GONIO_LINES_DECIMAL) {
        n = gonio_number_format(text, sizeof text, "%.5f", value);
    } else if (table->number == GONIO_LINES_INTEGER) {
        n = snprintf(text, sizeof text, "%lld", llround(value));
    } else {
        n = snprintf(text, sizeof text, "%08X", (unsigned)(int32_t)llround(value));
    }
    put(w, text, (size_t)n);
}

static int hex_digit(char c) {
    return c >= '0' && c <= '9' ? c - '0' : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10 : -1;
}

// One element of a template: a byte, an escape, {axis} or {value}. *no_end: \c stood there.
static const char *element(writer *w, const gonio_lines_table *table, const char *at, const char *axis, double value,
                           bool *no_end) {
    if (strncmp(at, "{axis}", 6) == 0) {
        put(w, axis, strlen(axis));
        return at + 6;
    }
    if (strncmp(at, "{value}", 7) == 0) {
        put_value(w, table, value);
        return at + 7;
    }
    if (at[0] == '\\' && at[1] != 0) {
        if (at[1] == 'x' && hex_digit(at[2]) >= 0 && hex_digit(at[3]) >= 0) {
            put(w, &(const char){(char)(hex_digit(at[2]) * 16 + hex_digit(at[3]))}, 1);
            return at + 4;
        }
        *no_end = *no_end || at[1] == 'c';
        if (at[1] != 'c') {
            put(w, at[1] == 'n' ? "\n" : at[1] == 'r' ? "\r" : at + 1, 1);
        }
        return at + 2;
    }
    put(w, at, 1);
    return at + 1;
}

gonio_status gonio_lines_command(const gonio_lines_table *table, const char *template, const gonio_lines_axes *axes,
                                 int axis, char command[GONIO_LINES_COMMAND], size_t *n, gonio_error *error) {
    writer w = {.to = command};
    bool no_end = false, ignored = false;
    const char *name = axis < axes->n ? axes->names[axis] : "";
    const double value = axis < axes->n ? axes->values[axis] : 0;
    for (const char *at = template; *at != 0;) {
        const char *close = *at == '[' ? strchr(at, ']') : NULL;
        if (close == NULL) {
            at = element(&w, table, at, name, value, &no_end);
            continue;
        }
        for (int k = 0; k < axes->n; k++) {
            for (const char *in = at + 1; in < close;) {
                in = element(&w, table, in, axes->names[k], axes->values[k], &no_end);
            }
        }
        at = close + 1;
    }
    for (const char *at = no_end ? "" : table->end; *at != 0;) {
        at = element(&w, table, at, "", 0, &ignored);
    }
    *n = w.n;
    return w.full ? gonio_fail(error, GONIO_E_INPUT, "the command '%.60s' is longer than %d bytes", template,
                               GONIO_LINES_COMMAND)
                  : GONIO_OK;
}

bool gonio_lines_each(const char *template) {
    int depth = 0;
    for (const char *at = template; *at != 0; at++) {
        depth += *at == '[' ? 1 : *at == ']' ? -1 : 0;
        if (depth == 0 && strncmp(at, "{axis}", 6) == 0) {
            return true;
        }
    }
    return false;
}

// Cut at a separator, blanks around taken away.
static bool part_of(const char *text, const char *separator, int k, char part[GONIO_LINES_TEXT]) {
    const char *begin = text, *end = strstr(text, separator);
    for (; k > 0 && end != NULL; k--) {
        begin = end + strlen(separator);
        end = strstr(begin, separator);
    }
    if (k > 0) {
        return false;
    }
    const char *last = end != NULL ? end : begin + strlen(begin);
    while (begin < last && *begin == ' ') {
        begin++;
    }
    while (last > begin && last[-1] == ' ') {
        last--;
    }
    snprintf(part, GONIO_LINES_TEXT, "%.*s", (int)(last - begin), begin);
    return part[0] != 0;
}

bool gonio_lines_part(const char *template, int k, char part[GONIO_LINES_TEXT]) {
    return part_of(template, "&&", k, part);
}

// ---- answers ----

static void with_axis(const char *pattern, const char *axis, char out[2 * GONIO_LINES_TEXT]) {
    size_t n = 0;
    for (const char *at = pattern; *at != 0 && n + 40 < 2 * GONIO_LINES_TEXT;) {
        if (strncmp(at, "{axis}", 6) == 0) {
            n += (size_t)snprintf(out + n, 40, "%.32s", axis != NULL ? axis : "");
            at += 6;
        } else {
            out[n++] = *at++;
        }
    }
    out[n] = 0;
}

bool gonio_lines_match(const char *patterns, const char *axis, const char *answer) {
    char one[GONIO_LINES_TEXT], whole[2 * GONIO_LINES_TEXT];
    for (int k = 0; part_of(patterns, "|", k, one); k++) {
        with_axis(one, axis, whole);
        if (fnmatch(whole, answer, FNM_NOESCAPE) == 0) {
            return true;
        }
    }
    return false;
}

static bool parse(const gonio_lines_table *table, const char *text, double *value) {
    char *end;
    if (table->number == GONIO_LINES_HEX8) {
        const unsigned long raw = strtoul(text, &end, 16);
        *value = (double)(int32_t)(uint32_t)raw;
        return end == text + 8;
    }
    *value = gonio_number_parse(text, &end);
    return end != text && isfinite(*value);
}

bool gonio_lines_number_in(const gonio_lines_table *table, const char *pattern, const char *axis, int place,
                           const char *answer, double *value) {
    char whole[2 * GONIO_LINES_TEXT];
    with_axis(pattern, axis, whole);
    char *mark = strstr(whole, "{value");
    if (mark == NULL) {
        return false;
    }
    const bool list = strncmp(mark, "{values}", 8) == 0;
    *mark = 0;
    const char *at;
    if (whole[0] == '*') {
        at = strstr(answer, whole + 1);
        at = at != NULL ? at + strlen(whole + 1) : NULL;
    } else {
        at = strncmp(answer, whole, strlen(whole)) == 0 ? answer + strlen(whole) : NULL;
    }
    for (int k = 0; at != NULL && list && k < place; k++) {
        at += strspn(at, "+-0123456789.eE");
        at = *at == ',' ? at + 1 : NULL;
    }
    return at != NULL && parse(table, at, value);
}
