// SPDX-License-Identifier: BSD-3-Clause
// Ask a program that works.
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "host/control/internal.h"

enum { GONE_POLL_MS = 50 };

// A full queue is somebody who lives and has much to do: wait for a place in it.
static bool connected(int fd, const struct sockaddr_un *address) {
    const double until_s = gonio_clock_s() + CONTROL_PATIENCE_MS * 1e-3;
    while (connect(fd, (const struct sockaddr *)address, sizeof *address) != 0) {
        if ((errno != EAGAIN && errno != EINTR) || gonio_clock_s() >= until_s) {
            return false;
        }
        poll(NULL, 0, 10);
    }
    return gonio_control_mine(fd);
}

int gonio_control_connect(const char *name) {
    for (int k = 0; k < CONTROL_FOLDERS; k++) {
        const int folder = gonio_control_folder(k, false);
        const int fd = folder >= 0 ? socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0) : -1;
        struct sockaddr_un address;
        gonio_control_address(folder, name, &address);
        const bool there = fd >= 0 && connected(fd, &address);
        if (folder >= 0) {
            close(folder);
        }
        if (there) {
            return fd;
        }
        if (fd >= 0) {
            close(fd);
        }
    }
    return -1;
}

// A whole line within the time; false: there came none.
static bool receive(int fd, char answer[GONIO_CONTROL_ANSWER]) {
    const double until_s = gonio_clock_s() + CONTROL_PATIENCE_MS * 1e-3;
    size_t n = 0;
    for (;;) {
        const double left_s = until_s - gonio_clock_s();
        struct pollfd wait = {.fd = fd, .events = POLLIN};
        if (left_s <= 0 || n + 1 == GONIO_CONTROL_ANSWER) {
            return false;
        }
        if (poll(&wait, 1, 1 + (int)(left_s * 1e3)) <= 0) {
            continue; // the time is up, or a signal came
        }
        const ssize_t got = recv(fd, answer + n, GONIO_CONTROL_ANSWER - 1 - n, 0);
        if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) {
            return false;
        }
        n += got > 0 ? (size_t)got : 0;
        answer[n] = 0;
        char *end = strchr(answer, '\n');
        if (end != NULL) {
            *end = 0;
            return true;
        }
    }
}

gonio_status gonio_control_request(gonio_control_kind kind, const char *identity, const char *word,
                                   char answer[GONIO_CONTROL_ANSWER], gonio_error *error) {
    char name[CONTROL_NAME], line[CONTROL_WORD];
    const gonio_status status = gonio_control_name(kind, identity, name, error);
    if (status != GONIO_OK) {
        return status;
    }
    const int fd = gonio_control_connect(name);
    if (fd < 0) {
        return gonio_fail(error, GONIO_E_FAILED, "no program of yours on this machine is at work on it");
    }
    snprintf(line, sizeof line, "%s\n", word);
    const bool answered = send(fd, line, strlen(line), MSG_NOSIGNAL) == (ssize_t)strlen(line) && receive(fd, answer);
    close(fd);
    return answered ? GONIO_OK
                    : gonio_fail(error, GONIO_E_TIMEOUT, "the program that is at work on it does not answer");
}

bool gonio_control_wait_gone(gonio_control_kind kind, const char *identity, double timeout_s) {
    const double until_s = gonio_clock_s() + timeout_s;
    char name[CONTROL_NAME];
    int fd;
    while (gonio_control_name(kind, identity, name, NULL) == GONIO_OK && (fd = gonio_control_connect(name)) >= 0) {
        close(fd);
        if (gonio_clock_s() >= until_s) {
            return false;
        }
        poll(NULL, 0, GONE_POLL_MS);
    }
    return true;
}
