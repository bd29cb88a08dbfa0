// SPDX-License-Identifier: BSD-3-Clause
// The serial line between the host and the controller: the system calls of libmodbus end here. RTU at 115200 baud, each
// byte at its time, and between the two ends whatever the seed has in store.
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdarg.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/select.h>
#include <sys/syscall.h>
#include <termios.h>
#include <unistd.h>

#include "tests/faults/line.h"
#include "tests/faults/world.h"

#define PORT "/sim/controller"

enum { CHARACTER_US = 87 };

static int line_fd = -1;

bool line_is(int fd) { return fd >= 0 && fd == line_fd; }

int line_open(const char *path) {
    if (strcmp(path, PORT) != 0) {
        return -2;
    }
    if (world_stands(FAULT_adapter_unplugged)) {
        errno = ENOENT;
        return -1;
    }
    w->line_broken = false;
    w->head = w->tail = w->held_n = 0;
    line_fd = (int)syscall(SYS_memfd_create, "line", MFD_CLOEXEC);
    return line_fd;
}

void line_close(int fd) {
    if (line_is(fd)) {
        line_fd = -1;
    }
}

// ---- to the host ----

static void put(int64_t at_us, uint8_t byte) {
    if (w->tail < SERIAL_MAX) {
        w->incoming[w->tail++] = (serial_byte){at_us, byte};
    }
}

static int64_t put_all(int64_t at_us, const uint8_t *bytes, int n) {
    for (int i = 0; i < n; i++) {
        put(at_us += CHARACTER_US, bytes[i]);
    }
    return at_us;
}

static uint16_t crc(const uint8_t *bytes, int n) {
    uint16_t c = 0xffff;
    for (int i = 0; i < n; i++) {
        c ^= bytes[i];
        for (int k = 0; k < 8; k++) {
            c = (uint16_t)(c & 1 ? c >> 1 ^ 0xa001 : c >> 1);
        }
    }
    return c;
}

static int64_t milliseconds(const fault *f, int least, int most) {
    return 1000 * (least + (int64_t)(f->parameter % (uint32_t)(most - least)));
}

static void keep(const uint8_t *reply, int n) {
    w->old_n = n <= OLD_MAX ? n : 0;
    memcpy(w->old, reply, (size_t)w->old_n);
}

// What the controller answered, on its way back.
static void send_back(const uint8_t *answer, int n) {
    uint8_t reply[OLD_MAX + MACHINE_SENT_MAX];
    memcpy(reply, w->held, (size_t)w->held_n);
    memcpy(reply + w->held_n, answer, (size_t)n);
    n += w->held_n;
    w->held_n = 0;
    if (n == 0) {
        return;
    }
    int64_t at_us = w->now_us;
    const fault *f;
    if ((f = world_strikes(FAULT_reply_dropped)) != NULL) {
        return;
    }
    if ((f = world_strikes(FAULT_replies_merged)) != NULL && n <= OLD_MAX) {
        memcpy(w->held, reply, (size_t)n);
        w->held_n = n;
        return;
    }
    if ((f = world_strikes(FAULT_busy_exception)) != NULL) {
        reply[1] |= 0x80;
        reply[2] = 6;
        const uint16_t c = crc(reply, 3);
        reply[3] = (uint8_t)c;
        reply[4] = (uint8_t)(c >> 8);
        n = 5;
    }
    if ((f = world_strikes(FAULT_reply_delayed)) != NULL) {
        at_us += milliseconds(f, 10, 700);
    }
    if ((f = world_strikes(FAULT_stale_reply)) != NULL && w->old_n > 0) {
        at_us = put_all(at_us, w->old, w->old_n);
        if (f->parameter & 1) { // instead of the true one, else before it
            return;
        }
        at_us += milliseconds(f, 0, 30);
    }
    if ((f = world_strikes(FAULT_reply_bit_flipped)) != NULL) {
        reply[world_random() % (uint32_t)n] ^= (uint8_t)(1u << world_random() % 8);
    }
    if ((f = world_strikes(FAULT_reply_cut)) != NULL) {
        n = (int)(world_random() % (uint32_t)n);
    }
    int first = n;
    if ((f = world_strikes(FAULT_reply_split)) != NULL) {
        first = (int)(world_random() % (uint32_t)n);
    }
    f = world_strikes(FAULT_line_noise);
    const bool before = f != NULL && f->parameter & 1;
    for (uint32_t i = 0; before && i < 1 + f->parameter / 2 % 9; i++) {
        put(at_us += CHARACTER_US, (uint8_t)world_random());
    }
    at_us = put_all(at_us, reply, first);
    if (first < n) {
        at_us += 1000 * (1 + world_random() % 90);
        at_us = put_all(at_us, reply + first, n - first);
    }
    for (uint32_t i = 0; f != NULL && !before && i < 1 + f->parameter / 2 % 9; i++) {
        put(at_us += CHARACTER_US, (uint8_t)world_random());
    }
    keep(reply, n);
}

// ---- encoders on the same line ----

enum { ENCODER_SLAVE = 11, ENCODER_REGISTER = 2 };

// The reply to a whole request of one word; 0 bytes: nobody answers.
static int encoder_reply(const uint8_t *request, int n, uint8_t reply[7]) {
    const int axis = request[0] - ENCODER_SLAVE;
    const uint16_t sum = n == 8 ? crc(request, 6) : 0;
    const bool sound = n == 8 && request[6] == (uint8_t)sum && request[7] == (uint8_t)(sum >> 8) && request[1] == 3 &&
                       request[2] == 0 && request[3] == ENCODER_REGISTER && request[4] == 0 && request[5] == 1;
    if (!w->encoders || !sound || axis < 0 || axis >= FW_AXES || world_stands(FAULT_encoder_silent)) {
        return 0;
    }
    const uint16_t counts = (uint16_t)(world_encoder(axis) + 20000 * axis); // a step each, from anywhere on
    memcpy(reply, (const uint8_t[]){request[0], 3, 2, (uint8_t)(counts >> 8), (uint8_t)counts}, 5);
    const uint16_t c = crc(reply, 5);
    reply[5] = (uint8_t)c;
    reply[6] = (uint8_t)(c >> 8);
    return 7;
}

// ---- to the controller ----

static void deliver(const uint8_t *bytes, int n) {
    struct machine *m = &w->machine;
    if (w->controller_off || world_stands(FAULT_line_dead)) {
        world_pass((int64_t)n * CHARACTER_US);
        return;
    }
    m->sent_length = 0;
    for (int i = 0; i < n; i++) {
        world_pass(CHARACTER_US);
        if (!w->controller_off) {
            gonio_fw_modbus_receive(&m->core, bytes[i], (uint32_t)m->now_us);
        }
    }
    world_pass(4 * CHARACTER_US + 2000);
    for (int i = 0; i < 100 && m->core.modbus.sending && !w->controller_off; i++) { // a line that takes its time
        world_pass(500);
    }
    uint8_t reply[MACHINE_SENT_MAX];
    const int sent = (int)m->sent_length;
    memcpy(reply, m->sent, (size_t)sent);
    m->sent_length = 0;
    uint8_t other[7];
    const int encoder = encoder_reply(bytes, n, other);
    if (!world_stands(FAULT_line_dead)) {
        send_back(encoder > 0 ? other : reply, encoder > 0 ? encoder : sent);
    }
}

static ssize_t line_write(const uint8_t *bytes, int n) {
    uint8_t request[OLD_MAX];
    w->counts[EXCHANGES]++;
    if (w->line_broken || n > OLD_MAX) {
        errno = EIO;
        return -1;
    }
    memcpy(request, bytes, (size_t)n);
    if (world_strikes(FAULT_line_closed) != NULL) {
        w->line_broken = true;
        errno = EIO;
        return -1;
    }
    if (world_strikes(FAULT_request_dropped) != NULL) {
        world_pass((int64_t)n * CHARACTER_US);
        return n;
    }
    if (world_strikes(FAULT_request_bit_flipped) != NULL) {
        request[world_random() % (uint32_t)n] ^= (uint8_t)(1u << world_random() % 8);
    }
    if (world_strikes(FAULT_request_split) != NULL) {
        const int first = 1 + (int)(world_random() % (uint32_t)n);
        deliver(request, first);
        world_pass(1000 * (1 + world_random() % 20));
        deliver(request + first, n - first);
        return n;
    }
    deliver(request, n);
    return n;
}

static ssize_t line_read(uint8_t *bytes, size_t size) {
    if (w->line_broken) {
        return 0;
    }
    size_t n = 0;
    while (n < size && w->head < w->tail && w->incoming[w->head].at_us <= w->now_us) {
        bytes[n++] = w->incoming[w->head++].byte;
    }
    if (w->head == w->tail) {
        w->head = w->tail = 0;
    }
    if (n == 0) {
        errno = EAGAIN;
        return -1;
    }
    return (ssize_t)n;
}

// Wait until something can be read; false: not within timeout_us.
static bool line_wait(int64_t timeout_us) {
    const int64_t until = w->now_us + timeout_us;
    while (!w->line_broken && !(w->head < w->tail && w->incoming[w->head].at_us <= w->now_us)) {
        if (w->now_us >= until) {
            return false;
        }
        const bool comes = w->head < w->tail && w->incoming[w->head].at_us < until;
        const int64_t step = (comes ? w->incoming[w->head].at_us : until) - w->now_us;
        world_pass(step < 1000 ? step : 1000);
    }
    return true;
}

// ---- the system calls ----

ssize_t line_or_write(int fd, const void *bytes, size_t n) {
    (void)fd;
    return line_write(bytes, (int)n);
}

ssize_t read(int fd, void *bytes, size_t size) {
    return line_is(fd) ? line_read(bytes, size) : (ssize_t)syscall(SYS_read, fd, bytes, size);
}

int select(int n, fd_set *readable, fd_set *writable, fd_set *exceptional, struct timeval *timeout) {
    if (line_fd >= 0 && readable != NULL && FD_ISSET(line_fd, readable)) {
        const bool ready = line_wait(timeout->tv_sec * 1000000 + timeout->tv_usec);
        FD_ZERO(readable);
        if (ready) {
            FD_SET(line_fd, readable);
        }
        return ready;
    }
    return (int)syscall(SYS_select, n, readable, writable, exceptional, timeout);
}

int poll(struct pollfd *fds, nfds_t n, int timeout_ms) {
    struct pollfd *volatile given = fds; // poll is declared to write only, and reads which descriptor it is asked for
    if (n == 1 && line_is(given->fd)) {
        const bool ready = line_wait(1000 * (int64_t)timeout_ms);
        given->revents = ready ? POLLIN : 0;
        return ready;
    }
    return (int)syscall(SYS_poll, fds, n, timeout_ms);
}

int tcgetattr(int fd, struct termios *settings) {
    memset(settings, 0, sizeof *settings);
    return line_is(fd) ? 0 : -1;
}

int tcsetattr(int fd, int when, const struct termios *settings) {
    (void)when;
    (void)settings;
    return line_is(fd) ? 0 : -1;
}

int tcflush(int fd, int queue) {
    (void)queue;
    if (!line_is(fd) || w->line_broken) {
        errno = EIO;
        return -1;
    }
    // What has arrived goes; what is still on its way does not.
    while (w->head < w->tail && w->incoming[w->head].at_us <= w->now_us) {
        w->head++;
    }
    if (w->head == w->tail) {
        w->head = w->tail = 0;
    }
    return 0;
}
