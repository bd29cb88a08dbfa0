// SPDX-License-Identifier: BSD-3-Clause
#include "host/transport/line.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include "host/transport/clock.h"

struct gonio_line {
    gonio_line_config config;
    int fd; // -1: closed, or a tape is replayed
    gonio_tape *tape;
    bool replays;
    char buffer[GONIO_LINE_MAX]; // what has arrived and is no whole line yet
    size_t n;
};

// ---- opening ----

static gonio_status fail(const gonio_line *line, gonio_status status, int number, const char *what,
                         gonio_error *error) {
    return gonio_fail(error, status, "port %.200s %s: %s", line->config.port, what,
                      number != 0 ? strerror(number) : "no more");
}

static speed_t speed_of(int baud) {
    static const struct {
        int baud;
        speed_t speed;
    } speeds[] = {{1200, B1200},   {2400, B2400},   {4800, B4800},     {9600, B9600},     {19200, B19200},
                  {38400, B38400}, {57600, B57600}, {115200, B115200}, {230400, B230400}, {921600, B921600}};
    for (size_t k = 0; k < sizeof speeds / sizeof *speeds; k++) {
        if (speeds[k].baud == baud) {
            return speeds[k].speed;
        }
    }
    return B0;
}

static gonio_status open_serial(gonio_line *line, gonio_error *error) {
    const speed_t speed = speed_of(line->config.baud);
    if (speed == B0) {
        return gonio_fail(error, GONIO_E_INPUT, "port %.200s: %d baud; expected 1200 ... 115200, 230400 or 921600",
                          line->config.port, line->config.baud);
    }
    line->fd = open(line->config.port, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    struct termios mode;
    if (line->fd < 0 || tcgetattr(line->fd, &mode) != 0) {
        return fail(line, GONIO_E_DEVICE, errno, "cannot be opened", error);
    }
    if (flock(line->fd, LOCK_EX | LOCK_NB) != 0 || ioctl(line->fd, TIOCEXCL) != 0) {
        return gonio_fail(error, GONIO_E_DEVICE, "port %.200s: another program drives this rig", line->config.port);
    }
    cfmakeraw(&mode);
    mode.c_cflag &= ~(tcflag_t)(PARENB | PARODD | CSTOPB | CRTSCTS);
    mode.c_cflag |=
        CLOCAL | CREAD | (line->config.parity != 0 ? PARENB : 0u) | (line->config.parity == 2 ? PARODD : 0u);
    mode.c_cc[VMIN] = 0;
    mode.c_cc[VTIME] = 0;
    if (cfsetspeed(&mode, speed) != 0 || tcsetattr(line->fd, TCSANOW, &mode) != 0) {
        return fail(line, GONIO_E_DEVICE, errno, "cannot be set up", error);
    }
    tcflush(line->fd, TCIOFLUSH);
    return GONIO_OK;
}

static bool connected(int fd, const struct addrinfo *address, int timeout_ms) {
    if (connect(fd, address->ai_addr, address->ai_addrlen) == 0) {
        return true;
    }
    struct pollfd ready = {.fd = fd, .events = POLLOUT};
    int code = 0;
    socklen_t size = sizeof code;
    if (errno != EINPROGRESS || poll(&ready, 1, timeout_ms) <= 0) {
        errno = errno == EINPROGRESS ? ETIMEDOUT : errno;
        return false;
    }
    getsockopt(fd, SOL_SOCKET, SO_ERROR, &code, &size);
    errno = code;
    return code == 0;
}

// tcp:HOST:PORT; a host of colons stands in brackets.
static gonio_status open_tcp(gonio_line *line, gonio_error *error) {
    char host[256];
    snprintf(host, sizeof host, "%s", line->config.port + 4);
    char *port = strrchr(host, ':');
    if (port == NULL || port[1] == 0 || port == host) {
        return gonio_fail(error, GONIO_E_INPUT, "port '%.200s': expected tcp:HOST:PORT", line->config.port);
    }
    *port++ = 0;
    char *name = host;
    if (name[0] == '[' && port[-2] == ']') {
        port[-2] = 0;
        name++;
    }
    struct addrinfo *list = NULL;
    const struct addrinfo hints = {.ai_socktype = SOCK_STREAM};
    const int code = getaddrinfo(name, port, &hints, &list);
    if (code != 0) {
        return gonio_fail(error, GONIO_E_DEVICE, "port %.200s: %s", line->config.port, gai_strerror(code));
    }
    errno = ECONNREFUSED;
    for (const struct addrinfo *a = list; a != NULL && line->fd < 0; a = a->ai_next) {
        line->fd = socket(a->ai_family, a->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, a->ai_protocol);
        if (line->fd >= 0 && !connected(line->fd, a, line->config.timeout_ms)) {
            const int why = errno;
            close(line->fd);
            line->fd = -1;
            errno = why;
        }
    }
    const int why = errno;
    freeaddrinfo(list);
    return line->fd >= 0 ? GONIO_OK : fail(line, GONIO_E_DEVICE, why, "cannot be opened", error);
}

static void shut(gonio_line *line) {
    if (line->fd >= 0) {
        close(line->fd);
    }
    line->fd = -1;
    line->n = 0;
}

static gonio_status open_port(gonio_line *line, gonio_error *error) {
    const gonio_status status =
        strncmp(line->config.port, "tcp:", 4) == 0 ? open_tcp(line, error) : open_serial(line, error);
    if (status != GONIO_OK) {
        shut(line);
    }
    return status;
}

gonio_status gonio_line_open(const gonio_line_config *config, const char *record, const char *replay, gonio_line **out,
                             gonio_error *error) {
    if (config->port[0] == 0 && replay[0] == 0) {
        return gonio_fail(error, GONIO_E_INPUT, "no port given; expected a serial device or tcp:HOST:PORT");
    }
    gonio_line *line = calloc(1, sizeof *line);
    if (line == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a port");
    }
    line->config = *config;
    line->fd = -1;
    line->replays = replay[0] != 0;
    gonio_status status = gonio_tape_choose(record, replay, &line->tape, error);
    status = status == GONIO_OK && !line->replays ? open_port(line, error) : status;
    if (status != GONIO_OK) {
        gonio_line_close(line);
        return status;
    }
    *out = line;
    return GONIO_OK;
}

void gonio_line_close(gonio_line *line) {
    if (line != NULL) {
        shut(line);
        gonio_tape_close(line->tape);
        free(line);
    }
}

gonio_status gonio_line_reopen(gonio_line *line, gonio_error *error) {
    if (line->replays) {
        return GONIO_OK;
    }
    shut(line);
    return open_port(line, error);
}

// ---- bytes ----

static gonio_status send_all(gonio_line *line, const char *bytes, size_t n, gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_ms(line->config.timeout_ms);
    while (n > 0) {
        const ssize_t sent = line->fd >= 0 ? write(line->fd, bytes, n) : -1;
        if (sent > 0) {
            bytes += sent;
            n -= (size_t)sent;
            continue;
        }
        if (line->fd < 0 || (errno != EAGAIN && errno != EINTR)) {
            return fail(line, GONIO_E_DEVICE, line->fd < 0 ? ENOTCONN : errno, "takes nothing", error);
        }
        struct pollfd ready = {.fd = line->fd, .events = POLLOUT};
        if (gonio_deadline_left_ms(deadline) == 0) {
            return fail(line, GONIO_E_TIMEOUT, ETIMEDOUT, "takes nothing", error);
        }
        poll(&ready, 1, gonio_deadline_left_ms(deadline));
    }
    return GONIO_OK;
}

gonio_status gonio_line_send(gonio_line *line, const char *bytes, size_t n, gonio_error *error) {
    long long code = 0;
    size_t m;
    if (line->replays) {
        const gonio_status status = gonio_tape_get(line->tape, "line-send", bytes, n, &code, NULL, 0, &m, error);
        return status != GONIO_OK || code == 0 ? status
                                               : gonio_fail(error, GONIO_E_DEVICE, "the port took nothing on the tape");
    }
    const gonio_status status = send_all(line, bytes, n, error);
    if (line->tape != NULL) {
        gonio_tape_put(line->tape, "line-send", bytes, n, status, NULL, 0);
    }
    return status;
}

// A whole line out of the buffer; false where there is none.
static bool take_line(gonio_line *line, char answer[GONIO_LINE_MAX]) {
    size_t end = 0;
    while (end < line->n && line->buffer[end] != '\n' && line->buffer[end] != '\r') {
        end++;
    }
    if (end == line->n) {
        return false;
    }
    size_t first = 0, last = end;
    while (first < last && (line->buffer[first] == ' ' || line->buffer[first] == 0)) {
        first++;
    }
    while (last > first && line->buffer[last - 1] == ' ') {
        last--;
    }
    memcpy(answer, line->buffer + first, last - first);
    answer[last - first] = 0;
    line->n -= end + 1;
    memmove(line->buffer, line->buffer + end + 1, line->n);
    return true;
}

static gonio_status more(gonio_line *line, gonio_deadline deadline, gonio_error *error) {
    if (line->fd < 0) {
        return fail(line, GONIO_E_DEVICE, ENOTCONN, "is closed", error);
    }
    if (line->n == sizeof line->buffer) {
        line->n = 0;
        return gonio_fail(error, GONIO_E_DEVICE, "port %.200s: an answer of more than %d bytes without an end",
                          line->config.port, GONIO_LINE_MAX);
    }
    struct pollfd ready = {.fd = line->fd, .events = POLLIN};
    if (poll(&ready, 1, gonio_deadline_left_ms(deadline)) <= 0) {
        return gonio_deadline_left_ms(deadline) > 0 ? GONIO_OK
                                                    : fail(line, GONIO_E_TIMEOUT, ETIMEDOUT, "does not answer", error);
    }
    const ssize_t got = read(line->fd, line->buffer + line->n, sizeof line->buffer - line->n);
    if (got > 0) {
        line->n += (size_t)got;
        return GONIO_OK;
    }
    return got < 0 && (errno == EAGAIN || errno == EINTR)
               ? GONIO_OK
               : fail(line, GONIO_E_DEVICE, got < 0 ? errno : 0, "is gone", error);
}

static gonio_status receive(gonio_line *line, int timeout_ms, char answer[GONIO_LINE_MAX], gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_ms(timeout_ms < 0 ? line->config.timeout_ms : timeout_ms);
    gonio_status status = GONIO_OK;
    answer[0] = 0;
    while (status == GONIO_OK && answer[0] == 0) {
        if (!take_line(line, answer)) {
            status = more(line, deadline, error);
        }
    }
    return status;
}

gonio_status gonio_line_receive(gonio_line *line, int timeout_ms, char answer[GONIO_LINE_MAX], gonio_error *error) {
    long long code = 0;
    size_t n = 0;
    if (line->replays) {
        const gonio_status status =
            gonio_tape_get(line->tape, "line-receive", NULL, 0, &code, answer, GONIO_LINE_MAX - 1, &n, error);
        answer[status == GONIO_OK ? n : 0] = 0;
        return status != GONIO_OK || code == 0 ? status
                                               : gonio_fail(error, (gonio_status)code, "no answer on the tape either");
    }
    const gonio_status status = receive(line, timeout_ms, answer, error);
    if (line->tape != NULL) {
        gonio_tape_put(line->tape, "line-receive", NULL, 0, status, answer, status == GONIO_OK ? strlen(answer) : 0);
    }
    return status;
}

void gonio_line_drain(gonio_line *line) {
    char rest[256];
    line->n = 0;
    while (line->fd >= 0 && read(line->fd, rest, sizeof rest) > 0) {
    }
}
