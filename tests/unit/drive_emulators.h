// SPDX-License-Identifier: BSD-3-Clause
// Stepper drives with Modbus registers, as their public manuals describe them, behind a TCP port of this machine or a
// pseudo terminal (RTU): Leadshine in PR mode, Oriental Motor AZ with direct data operation; and one slave with four
// axes, 16-bit registers, functions 4 and 6, such as none of these two has. Positions move in real time; faults can be
// asked for.
#ifndef GONIO_TESTS_DRIVE_EMULATORS_H
#define GONIO_TESTS_DRIVE_EMULATORS_H

#include <arpa/inet.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

typedef enum drives_kind { DRIVES_LEADSHINE, DRIVES_AZ, DRIVES_SHARED } drives_kind;

typedef struct one_drive {
    double from, to, began_s;
    bool homed, homing, halted;
    int64_t target, operation;
    uint32_t speed_seen;
} one_drive;

typedef struct drives {
    drives_kind kind;
    bool rtu;
    int listener, fd, port;
    char path[64]; // of the terminal
    pthread_t thread;
    pthread_mutex_t lock; // of all that follows
    one_drive axis[4];
    double speed;            // units a second
    uint32_t alarm;          // of axis 0; 0: none
    bool cause;              // of the alarm is still there
    bool limit;              // axis 0 is on its switch
    int mute, wrong, refuse; // so many answers are lost, of another request, or exceptions
    bool hang_up;            // at the next request
    double lost;             // axis 0 stands so far from its target
    double lag_s;            // a move begins so long after its command; until then all is as it was
    double lowest, highest;  // of all targets of axis 0
    int moves, stops, homings, resets;
    bool end;
} drives;

static inline double drives_now_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static inline double drives_at(const drives *d, int k) {
    const one_drive *a = &d->axis[k];
    const double way = a->to - a->from, gone = fmax(drives_now_s() - a->began_s, 0) * d->speed;
    return fabs(way) <= gone ? a->to : a->from + copysign(gone, way);
}

static inline bool drives_move(const drives *d, int k) {
    return drives_at(d, k) != d->axis[k].to && drives_now_s() >= d->axis[k].began_s;
}

static inline void drives_go(drives *d, int k, double to) {
    one_drive *a = &d->axis[k];
    a->from = drives_at(d, k);
    a->to = to;
    a->began_s = drives_now_s() + d->lag_s;
    a->halted = false;
}

static inline void drives_halt(drives *d, int k) {
    drives_go(d, k, drives_at(d, k));
    d->axis[k].halted = true;
    d->stops++;
}

static inline void drives_start(drives *d, int k) {
    if (k == 0 && d->alarm != 0) {
        return;
    }
    drives_go(d, k, (double)d->axis[k].target);
    d->lowest = k == 0 ? fmin(d->lowest, d->axis[k].to) : d->lowest;
    d->highest = k == 0 ? fmax(d->highest, d->axis[k].to) : d->highest;
    d->moves += k == 0;
}

static inline void drives_home(drives *d, int k) {
    drives_go(d, k, 0);
    d->axis[k].homed = true;
    d->homings += k == 0;
    d->lost = k == 0 ? 0 : d->lost;
}

static inline void drives_reset(drives *d, int k) {
    d->resets += k == 0;
    if (k == 0 && !d->cause) {
        d->alarm = 0;
    }
}

static inline int64_t drives_position(const drives *d, int k) {
    return llround(drives_at(d, k) + (k == 0 ? d->lost : 0));
}

static inline bool alarmed(const drives *d, int k) { return k == 0 && d->alarm != 0; }

// ---- registers: false where there is none ----

static inline uint16_t half(int64_t value, bool high) { return (uint16_t)((uint64_t)value >> (high ? 16 : 0)); }

static inline bool leadshine_read(const drives *d, int k, int address, uint16_t *word) {
    const bool moving = drives_move(d, k);
    switch (address) {
    case 0x1003:
        *word = (uint16_t)(alarmed(d, k) | 2 | moving << 2 | (!moving && !d->axis[k].halted) << 4 | !moving << 5 |
                           (d->axis[k].homed && !moving) << 6);
        return true;
    case 0x2203:
        *word = (uint16_t)(k == 0 ? d->alarm : 0);
        return true;
    case 0x1014:
    case 0x1015:
        *word = half(drives_position(d, k), address == 0x1014);
        return true;
    default:
        return false;
    }
}

static inline bool leadshine_write(drives *d, int k, int address, uint16_t word) {
    one_drive *a = &d->axis[k];
    switch (address) {
    case 0x6200: // path 0: 1 is absolute
        a->operation = word;
        return true;
    case 0x6201:
        a->target = (int32_t)((uint32_t)word << 16 | ((uint32_t)a->target & 0xffff));
        return true;
    case 0x6202:
        a->target = (int32_t)(((uint32_t)a->target & 0xffff0000u) | word);
        return true;
    case 0x6203:
        a->speed_seen = word;
        return true;
    case 0x6002:
        if (word == 0x10 && a->operation == 1) {
            drives_start(d, k);
        } else if (word == 0x20) {
            drives_home(d, k);
        } else if (word == 0x40) {
            drives_halt(d, k);
        }
        return true;
    case 0x1801:
        if (word == 0x1111) {
            drives_reset(d, k);
        }
        return true;
    default:
        return false;
    }
}

static inline bool az_read(const drives *d, int k, int address, uint16_t *word) {
    const bool moving = drives_move(d, k);
    switch (address) {
    case 0x007e:
        *word = 0;
        return true;
    case 0x007f:
        *word = (uint16_t)((!moving && !alarmed(d, k)) << 5 | alarmed(d, k) << 7 | moving << 13 |
                           (!moving && !d->axis[k].halted) << 14);
        return true;
    case 0x0080:
    case 0x0081:
        *word = half(k == 0 ? d->alarm : 0, address == 0x0080);
        return true;
    case 0x00cc:
    case 0x00cd:
        *word = half(drives_position(d, k), address == 0x00cc);
        return true;
    default:
        return false;
    }
}

// Its data are 32 bits each; the low word, which comes second, makes them count.
static inline bool az_write(drives *d, int k, int address, uint16_t word) {
    one_drive *a = &d->axis[k];
    static uint16_t high; // one client, one thread
    if (address < 0x0058 || address > 0x0079 || (address > 0x0067 && address < 0x0078)) {
        return false;
    }
    if (address % 2 == 0) {
        high = word;
        return true;
    }
    const uint32_t value = (uint32_t)high << 16 | word;
    switch (address) {
    case 0x005b:
        a->operation = value;
        return true;
    case 0x005d:
        a->target = (int32_t)value;
        return true;
    case 0x005f:
        a->speed_seen = value;
        return true;
    case 0x0067:
        if (value == 1 && a->operation == 1) {
            drives_start(d, k);
        }
        return true;
    case 0x0079:
        if ((value & 0x10) != 0) {
            drives_home(d, k);
        } else if ((value & 0x20) != 0) {
            drives_halt(d, k);
        } else if ((value & 0x80) != 0) {
            drives_reset(d, k);
        }
        return true;
    default:
        return true;
    }
}

// Four axes, 0x20 registers each; 0x0100, of all, is 1 while the motors' power is on.
static inline bool shared_read(const drives *d, int address, uint16_t *word) {
    const int k = address / 0x20, at = address % 0x20;
    if (address == 0x0100) {
        *word = 1;
        return true;
    }
    if (k > 3) {
        return false;
    }
    switch (at) {
    case 0: // 0 ready, 1 moving, 2 homing, 3 alarm, 4 limit switch, 5 not homed
        *word = alarmed(d, k) ? 3 : k == 0 && d->limit ? 4 : drives_move(d, k) ? 1 : d->axis[k].homed ? 0 : 5;
        return true;
    case 2:
        *word = (uint16_t)drives_position(d, k);
        return true;
    case 8:
        *word = (uint16_t)(k == 0 ? d->alarm : 0);
        return true;
    default:
        return false;
    }
}

static inline bool shared_write(drives *d, int address, uint16_t word) {
    const int k = address / 0x20, at = address % 0x20;
    if (k > 3 || (at != 4 && at != 6)) {
        return false;
    }
    if (at == 4) {
        d->axis[k].target = (int16_t)word;
    } else if (word == 1) {
        drives_start(d, k);
    } else if (word == 2) {
        drives_home(d, k);
    } else if (word == 3) {
        drives_halt(d, k);
    } else if (word == 4) {
        drives_reset(d, k);
    }
    return true;
}

static inline bool drives_read(const drives *d, int slave, int address, uint16_t *word) {
    return d->kind == DRIVES_LEADSHINE ? leadshine_read(d, slave - 1, address, word)
           : d->kind == DRIVES_AZ      ? az_read(d, slave - 1, address, word)
                                       : shared_read(d, address, word);
}

static inline bool drives_write(drives *d, int slave, int address, uint16_t word) {
    return d->kind == DRIVES_LEADSHINE ? leadshine_write(d, slave - 1, address, word)
           : d->kind == DRIVES_AZ      ? az_write(d, slave - 1, address, word)
                                       : shared_write(d, address, word);
}

// ---- protocol ----

static inline int drives_refuse(uint8_t *reply, int function, int code) {
    reply[0] = (uint8_t)(function | 0x80);
    reply[1] = (uint8_t)code;
    return 2;
}

// A request's PDU to its reply's; 0: nobody of that address is here.
static inline int drives_pdu(drives *d, int slave, const uint8_t *q, uint8_t *reply) {
    const int function = q[0], address = q[1] << 8 | q[2], n = q[3] << 8 | q[4];
    const bool shared = d->kind == DRIVES_SHARED;
    if (slave < 1 || slave > (shared ? 1 : 4)) {
        return 0;
    }
    if (d->refuse > 0) {
        d->refuse--;
        return drives_refuse(reply, function, 4);
    }
    if (function == (shared ? 4 : 3) && n > 0 && n < 100) {
        reply[0] = (uint8_t)function;
        reply[1] = (uint8_t)(2 * n);
        for (int i = 0; i < n; i++) {
            uint16_t word;
            if (!drives_read(d, slave, address + i, &word)) {
                return drives_refuse(reply, function, 2);
            }
            reply[2 + 2 * i] = (uint8_t)(word >> 8);
            reply[3 + 2 * i] = (uint8_t)word;
        }
        return 2 + 2 * n;
    }
    if (function == 6) {
        memcpy(reply, q, 5);
        return drives_write(d, slave, address, (uint16_t)n) ? 5 : drives_refuse(reply, function, 2);
    }
    if (function == 16 && !shared && n > 0 && n < 100) {
        for (int i = 0; i < n; i++) {
            if (!drives_write(d, slave, address + i, (uint16_t)(q[6 + 2 * i] << 8 | q[7 + 2 * i]))) {
                return drives_refuse(reply, function, 2);
            }
        }
        memcpy(reply, q, 5);
        return 5;
    }
    return drives_refuse(reply, function, 1);
}

static inline uint16_t drives_crc(const uint8_t *bytes, int n) {
    uint16_t c = 0xffff;
    for (int i = 0; i < n; i++) {
        c ^= bytes[i];
        for (int k = 0; k < 8; k++) {
            c = (uint16_t)(c & 1 ? c >> 1 ^ 0xa001 : c >> 1);
        }
    }
    return c;
}

// A frame that has arrived whole: bytes of it, 0: not yet.
static inline int drives_whole(const drives *d, const uint8_t *in, int n) {
    if (!d->rtu) {
        const int length = n >= 6 ? 6 + (in[4] << 8 | in[5]) : 0;
        return length > 0 && n >= length ? length : 0;
    }
    const int length = n < 7 ? 0 : in[1] == 16 ? 9 + in[6] : 8;
    return length > 0 && n >= length ? length : 0;
}

static inline void drives_answer(drives *d, uint8_t *in, int n) {
    uint8_t out[300];
    const int head = d->rtu ? 1 : 7;
    if (d->rtu && drives_crc(in, n) != 0) {
        return;
    }
    int length = drives_pdu(d, in[head - 1], in + head, out + head);
    if (d->hang_up) {
        d->hang_up = false;
        close(d->fd);
        d->fd = -1;
        return;
    }
    if (length == 0 || d->mute > 0) {
        d->mute -= d->mute > 0;
        return;
    }
    memcpy(out, in, (size_t)head);
    const bool wrong = d->wrong > 0;
    d->wrong -= wrong;
    length += head;
    if (d->rtu) {
        const uint16_t c = (uint16_t)(drives_crc(out, length) ^ (wrong ? 0x5a : 0));
        out[length++] = (uint8_t)c;
        out[length++] = (uint8_t)(c >> 8);
    } else {
        out[1] = (uint8_t)(out[1] ^ (wrong ? 0x5a : 0)); // of another request
        out[4] = (uint8_t)((length - 6) >> 8);
        out[5] = (uint8_t)(length - 6);
    }
    if (write(d->fd, out, (size_t)length) != length) {
        abort();
    }
}

static inline void *drives_run(void *argument) {
    drives *d = argument;
    uint8_t in[600];
    int n = 0;
    for (bool end = false; !end;) {
        struct pollfd on = {.fd = d->fd >= 0 ? d->fd : d->listener, .events = POLLIN};
        const int ready = poll(&on, 1, 10);
        pthread_mutex_lock(&d->lock);
        end = d->end;
        if (ready > 0 && d->fd < 0) {
            d->fd = accept(d->listener, NULL, NULL);
            n = 0;
        } else if (ready > 0) {
            const ssize_t got = read(d->fd, in + n, sizeof in - (size_t)n);
            if (got <= 0 && !d->rtu) {
                close(d->fd);
                d->fd = -1;
            }
            n += got > 0 ? (int)got : 0;
            for (int length; d->fd >= 0 && (length = drives_whole(d, in, n)) > 0;) {
                drives_answer(d, in, length);
                memmove(in, in + length, (size_t)(n - length));
                n -= length;
            }
        }
        pthread_mutex_unlock(&d->lock);
        if (ready > 0 && d->rtu && (on.revents & POLLHUP) != 0) {
            usleep(5000); // nobody has the terminal open
        }
    }
    return NULL;
}

static inline void drives_listen(drives *d) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    d->listener = socket(AF_INET, SOCK_STREAM, 0);
    if (bind(d->listener, (struct sockaddr *)&address, size) != 0 || listen(d->listener, 1) != 0 ||
        getsockname(d->listener, (struct sockaddr *)&address, &size) != 0) {
        abort();
    }
    d->port = ntohs(address.sin_port);
    snprintf(d->path, sizeof d->path, "tcp:127.0.0.1:%d", d->port);
}

static inline void drives_terminal(drives *d) {
    d->fd = posix_openpt(O_RDWR | O_NOCTTY);
    if (d->fd < 0 || grantpt(d->fd) != 0 || unlockpt(d->fd) != 0 || ptsname_r(d->fd, d->path, sizeof d->path) != 0) {
        abort();
    }
    struct termios raw;
    tcgetattr(d->fd, &raw);
    cfmakeraw(&raw);
    tcsetattr(d->fd, TCSANOW, &raw);
}

static inline drives *drives_start_up(drives_kind kind, bool rtu, double speed) {
    drives *d = calloc(1, sizeof *d);
    *d = (drives){.kind = kind, .rtu = rtu, .speed = speed, .fd = -1, .listener = -1};
    if (rtu) {
        drives_terminal(d);
    } else {
        drives_listen(d);
    }
    pthread_mutex_init(&d->lock, NULL);
    pthread_create(&d->thread, NULL, drives_run, d);
    return d;
}

static inline void drives_shut_down(drives *d) {
    pthread_mutex_lock(&d->lock);
    d->end = true;
    pthread_mutex_unlock(&d->lock);
    pthread_join(d->thread, NULL);
    if (d->listener >= 0) {
        close(d->listener);
    }
    if (d->fd >= 0) {
        close(d->fd);
    }
    pthread_mutex_destroy(&d->lock);
    free(d);
}

#endif
