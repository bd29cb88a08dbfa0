// SPDX-License-Identifier: BSD-3-Clause
// Motion controllers of other makers, as their public manuals describe them, behind a TCP port of this machine:
// GRBL 1.1, Newport ESP300 and SMC100, Thorlabs Elliptec. Positions move in real time; faults can be asked for.
#ifndef GONIO_TESTS_LINE_EMULATORS_H
#define GONIO_TESTS_LINE_EMULATORS_H

#include <arpa/inet.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

typedef enum emulator_kind {
    EMULATOR_GRBL,
    EMULATOR_ESP,
    EMULATOR_SMC,
    EMULATOR_ELLIPTEC,
    EMULATOR_METER
} emulator_kind;

typedef struct emulator {
    emulator_kind kind;
    int listener, port;
    pthread_t thread;
    pthread_mutex_t lock;                  // of all that follows
    double from[4], to[4], began_s, speed; // units, units a second; all axes start together, each at its own pace
    bool homed, held, end;
    int error;              // the controller's last one
    int mute, garble;       // so many answers are lost, or damaged
    double lost;            // every move ends so far from its target
    double lag_s;           // a move begins so long after its command; until then all is as it was
    double lowest, highest; // of all places that axis 0 has been sent to
    int moves, stops, homings;
    const char *reading, *identity, *setup_error; // of a meter
    int questions;
    bool hang_up; // at the next question
    char line[256];
    size_t n;
    int client;
} emulator;

static inline double emulator_now_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static inline double emulator_at(const emulator *e, int k) {
    const double way = e->to[k] - e->from[k], gone = fmax(emulator_now_s() - e->began_s, 0) * e->speed;
    return fabs(way) <= gone ? e->to[k] : e->from[k] + copysign(gone, way);
}

static inline bool emulator_moves(const emulator *e) {
    for (int k = 0; k < 4 && emulator_now_s() >= e->began_s; k++) {
        if (emulator_at(e, k) != e->to[k]) {
            return !e->held;
        }
    }
    return false;
}

static inline void emulator_go(emulator *e, const double to[4]) {
    for (int k = 0; k < 4; k++) {
        e->from[k] = emulator_at(e, k);
        e->to[k] = to[k];
    }
    e->lowest = fmin(e->lowest, to[0]);
    e->highest = fmax(e->highest, to[0]);
    e->began_s = emulator_now_s() + e->lag_s;
    e->moves++;
}

static inline void emulator_halt(emulator *e) {
    double here[4];
    for (int k = 0; k < 4; k++) {
        here[k] = emulator_at(e, k);
    }
    memcpy(e->from, here, sizeof here);
    memcpy(e->to, here, sizeof here);
    e->stops++;
}

static inline void emulator_say(emulator *e, const char *text) {
    char out[300];
    int n = snprintf(out, sizeof out, "%s\r\n", text);
    if (e->mute > 0) {
        e->mute--;
        return;
    }
    if (e->garble > 0) {
        e->garble--;
        out[n / 2] = '#';
    }
    if (write(e->client, out, (size_t)n) != n) {
        e->n = 0;
    }
}

static inline void emulator_home(emulator *e) {
    emulator_go(e, (const double[4]){0});
    e->homed = true;
    e->homings++;
}

// ---- GRBL ----

static inline void grbl_status(emulator *e) {
    char text[200];
    const char *state = !e->homed ? "Alarm" : e->held ? "Hold:0" : emulator_moves(e) ? "Run" : "Idle";
    snprintf(text, sizeof text, "<%s|MPos:%.3f,%.3f,%.3f,%.3f|FS:0,0>", state, emulator_at(e, 0), emulator_at(e, 1),
             emulator_at(e, 2), emulator_at(e, 3));
    emulator_say(e, text);
}

static inline void grbl_line(emulator *e, const char *line) {
    if (strcmp(line, "$H") == 0) {
        emulator_home(e);
        emulator_say(e, "ok");
        return;
    }
    if (!e->homed) {
        emulator_say(e, "error:9"); // G-code locked out during alarm
        return;
    }
    double to[4];
    memcpy(to, e->to, sizeof to);
    for (const char *at = line; *at != 0; at++) {
        const char *axis = strchr("XYZA", *at);
        if (axis != NULL) {
            to[axis - "XYZA"] = strtod(at + 1, NULL) + e->lost;
        } else if (*at == 'F') {
            emulator_say(e, "error:20");
            return;
        }
    }
    emulator_go(e, to);
    emulator_say(e, "ok");
}

// Real-time characters are taken out of the stream wherever they stand.
static inline bool grbl_byte(emulator *e, char c) {
    if (c == '?') {
        grbl_status(e);
    } else if (c == '!') {
        emulator_halt(e);
        e->held = true;
    } else if (c == 0x18) {
        e->held = false;
        emulator_say(e, "Grbl 1.1h ['$' for help]");
    } else {
        return false;
    }
    return true;
}

// ---- Newport ----

static inline void newport_move(emulator *e, int axis, double value) {
    double to[4];
    memcpy(to, e->to, sizeof to);
    if (!e->homed && e->kind == EMULATOR_SMC) {
        e->error = 'H'; // not allowed in NOT REFERENCED
        return;
    }
    if (fabs(value) > 400) {
        e->error = e->kind == EMULATOR_SMC ? 'C' : 7; // parameter out of limits
        return;
    }
    to[axis] = value + e->lost;
    emulator_go(e, to);
}

static inline void newport_line(emulator *e, const char *line) {
    char text[100];
    char *end;
    const int axis = (int)strtol(line, &end, 10) - 1;
    if (end[0] == 'T' && end[1] == 'E' && e->kind == EMULATOR_ESP) {
        snprintf(text, sizeof text, "%d", e->error);
        e->error = 0;
    } else if (axis < 0 || axis > 3 || end[0] == 0 || end[1] == 0) {
        e->error = e->kind == EMULATOR_SMC ? 'A' : 6;
        return;
    } else if (strncmp(end, "PA", 2) == 0) {
        newport_move(e, axis, strtod(end + 2, NULL));
        return;
    } else if (strncmp(end, "OR", 2) == 0) {
        emulator_home(e);
        return;
    } else if (strncmp(end, "ST", 2) == 0) {
        emulator_halt(e);
        return;
    } else if (strncmp(end, "MO", 2) == 0) {
        return;
    } else if (strncmp(end, "MD?", 3) == 0) {
        snprintf(text, sizeof text, "%d", !emulator_moves(e));
    } else if (strncmp(end, "TP", 2) == 0) {
        snprintf(text, sizeof text, "%.*sTP%.5f", (int)(end - line), line, emulator_at(e, axis));
        if (e->kind == EMULATOR_ESP) {
            snprintf(text, sizeof text, "%.5f", emulator_at(e, axis));
        }
    } else if (strncmp(end, "TS", 2) == 0) {
        snprintf(text, sizeof text, "%dTS0000%s", axis + 1, emulator_moves(e) ? "28" : e->homed ? "33" : "0A");
    } else if (strncmp(end, "TE", 2) == 0) {
        snprintf(text, sizeof text, "%dTE%c", axis + 1, e->error != 0 ? e->error : '@');
        e->error = 0;
    } else {
        e->error = e->kind == EMULATOR_SMC ? 'A' : 6;
        return;
    }
    emulator_say(e, text);
}

// ---- Elliptec: commands of fixed lengths without an end ----

static inline void elliptec_position(emulator *e, int axis) {
    char text[40];
    snprintf(text, sizeof text, "%dPO%08X", axis, (unsigned)(int)lround(emulator_at(e, axis)));
    emulator_say(e, text);
}

static inline bool elliptec_command(emulator *e) {
    const int axis = e->line[0] - '0';
    const size_t length = e->n < 3                             ? 99
                          : strncmp(e->line + 1, "ma", 2) == 0 ? 11
                          : strncmp(e->line + 1, "ho", 2) == 0 ? 4
                                                               : 3;
    if (e->n < length || axis < 0 || axis > 3) {
        return false;
    }
    char text[40];
    if (length == 11) {
        double to[4];
        memcpy(to, e->to, sizeof to);
        to[axis] = (double)(int)(unsigned)strtoul(e->line + 3, NULL, 16) + e->lost;
        emulator_go(e, to);
    } else if (length == 4) {
        emulator_home(e);
    } else if (strncmp(e->line + 1, "gp", 2) == 0) {
        elliptec_position(e, axis);
    } else {
        snprintf(text, sizeof text, "%dGS%s", axis, emulator_moves(e) ? "09" : e->error != 0 ? "02" : "00");
        e->error = 0;
        if (!emulator_moves(e) && e->stops == 0 && e->moves > 0) {
            e->stops = 1; // what a finished move says by itself comes before the answer, once
            elliptec_position(e, axis);
        }
        emulator_say(e, text);
    }
    e->n = 0;
    return true;
}

// ---- SCPI ----

static inline void meter_line(emulator *e, const char *line) {
    if (strchr(line, '?') == NULL) {
        return;
    }
    if (e->hang_up) {
        e->hang_up = false;
        close(e->client);
        e->client = -1;
        return;
    }
    if (strcmp(line, "*IDN?") == 0) {
        emulator_say(e, e->identity);
    } else if (strcmp(line, "SYST:ERR?") == 0) {
        if (e->setup_error != NULL) {
            emulator_say(e, e->setup_error);
        }
    } else {
        e->questions++;
        emulator_say(e, e->reading);
    }
}

static inline void emulator_byte(emulator *e, char c) {
    if (e->kind == EMULATOR_GRBL && grbl_byte(e, c)) {
        return;
    }
    if (e->kind == EMULATOR_ELLIPTEC) {
        e->line[e->n++] = c;
        e->line[e->n] = 0;
        e->n = e->n > 200 ? 0 : e->n;
        elliptec_command(e);
    } else if (c == '\n' || c == '\r') {
        e->line[e->n] = 0;
        if (e->n > 0) {
            (e->kind == EMULATOR_GRBL ? grbl_line : e->kind == EMULATOR_METER ? meter_line : newport_line)(e, e->line);
        }
        e->n = 0;
    } else if (e->n < sizeof e->line - 1) {
        e->line[e->n++] = c;
    }
}

static inline void *emulator_run(void *context) {
    emulator *e = context;
    for (bool end = false; !end;) {
        struct pollfd at[2] = {{.fd = e->listener, .events = POLLIN}, {.fd = e->client, .events = POLLIN}};
        poll(at, 2, 20);
        pthread_mutex_lock(&e->lock);
        if (at[0].revents != 0) {
            if (e->client >= 0) {
                close(e->client);
            }
            e->client = accept(e->listener, NULL, NULL);
        } else if (at[1].revents != 0) {
            char bytes[256];
            const ssize_t n = read(e->client, bytes, sizeof bytes);
            for (ssize_t k = 0; k < n && e->client >= 0; k++) {
                emulator_byte(e, bytes[k]);
            }
            if (n <= 0 && e->client >= 0) {
                close(e->client);
                e->client = -1;
            }
        }
        end = e->end;
        pthread_mutex_unlock(&e->lock);
    }
    return NULL;
}

static inline emulator *emulator_start(emulator_kind kind, double speed) {
    emulator *e = calloc(1, sizeof *e);
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    *e = (emulator){.kind = kind, .speed = speed, .client = -1, .listener = socket(AF_INET, SOCK_STREAM, 0)};
    if (bind(e->listener, (struct sockaddr *)&address, size) != 0 || listen(e->listener, 1) != 0 ||
        getsockname(e->listener, (struct sockaddr *)&address, &size) != 0) {
        abort();
    }
    e->port = ntohs(address.sin_port);
    pthread_mutex_init(&e->lock, NULL);
    pthread_create(&e->thread, NULL, emulator_run, e);
    return e;
}

static inline void emulator_stop(emulator *e) {
    pthread_mutex_lock(&e->lock);
    e->end = true;
    pthread_mutex_unlock(&e->lock);
    pthread_join(e->thread, NULL);
    close(e->listener);
    if (e->client >= 0) {
        close(e->client);
    }
    pthread_mutex_destroy(&e->lock);
    free(e);
}

#endif
