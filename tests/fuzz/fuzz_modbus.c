// SPDX-License-Identifier: BSD-3-Clause
// Any bytes on the line in answer to the Modbus master: the real controller core answers behind a line that the input
// tells how to spoil. Serial (a pseudo-terminal) and TCP, in a thread of its own, through libmodbus.
#include <arpa/inet.h>
#include <fcntl.h>
#include <modbus.h>
#include <poll.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include "firmware/board/posix/machine.h"
#include "host/drivers/lamp_modbus.h"
#include "host/drivers/stage_modbus.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
// The linker puts these in place of the waits of the real ones (--wrap): what they wait for comes at once here.
void __wrap_gonio_clock_sleep_ms(int ms);
void __wrap_gonio_modbus_drain(gonio_modbus *modbus, int quiet_ms);
void __real_gonio_modbus_drain(gonio_modbus *modbus, int quiet_ms);
int __wrap_modbus_set_byte_timeout(modbus_t *context, uint32_t s, uint32_t us);
int __real_modbus_set_byte_timeout(modbus_t *context, uint32_t s, uint32_t us);

void __wrap_gonio_clock_sleep_ms(int ms) { (void)ms; }
void __wrap_gonio_modbus_drain(gonio_modbus *modbus, int quiet_ms) {
    (void)quiet_ms;
    __real_gonio_modbus_drain(modbus, 1);
}
int __wrap_modbus_set_byte_timeout(modbus_t *context, uint32_t s, uint32_t us) {
    (void)us;
    return __real_modbus_set_byte_timeout(context, s, 1000);
}

enum { MBAP = 7, ROOM = 600 };

typedef struct line {
    struct machine machine;
    const uint8_t *input;
    size_t left;
    int fd;
    bool tcp;
    uint8_t last[ROOM];
    size_t last_n;
} line;

static uint8_t take(line *l) {
    if (l->left == 0) {
        return 0;
    }
    l->left--;
    return *l->input++;
}

// The reply to a request as the controller would give it, framed for the line; 0: none.
static size_t answer(line *l, const uint8_t *request, size_t n, uint8_t *reply) {
    const size_t before = l->tcp ? MBAP : 1, after = l->tcp ? 0 : 2;
    if (n < before + after + 1) {
        return 0;
    }
    const size_t m =
        gonio_fw_modbus_pdu(&l->machine.core, FW_CHANNEL_LINE, request + before, n - before - after, reply + before);
    if (m == 0) {
        return 0;
    }
    memcpy(reply, request, before);
    if (l->tcp) {
        reply[4] = (uint8_t)((m + 1) >> 8);
        reply[5] = (uint8_t)(m + 1);
        return MBAP + m;
    }
    const uint16_t crc = gonio_fw_modbus_crc(reply, m + 1);
    reply[m + 1] = (uint8_t)crc;
    reply[m + 2] = (uint8_t)(crc >> 8);
    return m + 3;
}

static void send_bytes(line *l, const uint8_t *bytes, size_t n) {
    const ssize_t sent = n == 0 ? 0 : l->tcp ? send(l->fd, bytes, n, MSG_NOSIGNAL) : write(l->fd, bytes, n);
    (void)sent;
}

// A checksum that fits, so that a spoilt frame passes as a sound one.
static void mend(const line *l, uint8_t *reply, size_t n) {
    if (!l->tcp && n > 3) {
        const uint16_t crc = gonio_fw_modbus_crc(reply, n - 2);
        reply[n - 2] = (uint8_t)crc;
        reply[n - 1] = (uint8_t)(crc >> 8);
    }
}

static size_t spoil(line *l, uint8_t *reply, size_t n, uint8_t how) {
    for (int k = take(l) % 8; k > 0 && n > 0; k--) {
        const uint8_t at = take(l);
        reply[at % n] ^= take(l);
    }
    if (how & 1) {
        mend(l, reply, n);
    }
    return n;
}

// Returns false where the line is cut.
static bool reply_once(line *l, const uint8_t *request, size_t n) {
    uint8_t reply[ROOM] = {0};
    gonio_machine_run(&l->machine, 20000);
    if (l->machine.restart || l->machine.fault || l->machine.bitten) {
        gonio_machine_start(&l->machine, FW_CAUSE_COMMAND);
    }
    size_t m = answer(l, request, n, reply);
    if (l->left == 0) {
        return false; // the input is over
    }
    const uint8_t how = take(l);
    switch (how >> 4) {
    default: // as it is
        break;
    case 8:
    case 9:
        m = spoil(l, reply, m, how);
        break;
    case 10: // the previous one first
        send_bytes(l, l->last, l->last_n);
        break;
    case 11: // noise first
    case 12: // nothing but noise
        for (size_t i = 0; i < how % 16u; i++) {
            const uint8_t noise = take(l);
            send_bytes(l, &noise, 1);
        }
        m = how >> 4 == 11 ? m : 0;
        break;
    case 13: // half of it
        m = m * (how & 15) / 16;
        break;
    case 14: // whole, of any length
        m = 2 + (size_t)take(l) * 2 % 300;
        for (size_t i = 0; i < m && l->left > 0; i++) {
            reply[i] = take(l);
        }
        mend(l, reply, m);
        break;
    case 15:
        return false;
    }
    send_bytes(l, reply, m);
    memcpy(l->last, reply, m);
    l->last_n = m;
    return true;
}

static void *serve(void *opaque) {
    line *l = opaque;
    uint8_t request[ROOM];
    ssize_t n;
    while ((n = read(l->fd, request, sizeof request)) > 0 && reply_once(l, request, (size_t)n)) {
    }
    shutdown(l->fd, SHUT_RDWR);
    if (!l->tcp) {
        close(l->fd); // hangs the other side up
        l->fd = -1;
    }
    return NULL;
}

static int listener = -1;

static void *accept_and_serve(void *opaque) {
    line *l = opaque;
    l->fd = accept(listener, NULL, NULL);
    return l->fd >= 0 ? serve(l) : NULL;
}

static void listen_once(char *port, size_t size) {
    static struct sockaddr_in address;
    socklen_t length = sizeof address;
    if (listener < 0) {
        address = (struct sockaddr_in){.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
        listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (bind(listener, (struct sockaddr *)&address, length) != 0 || listen(listener, 8) != 0 ||
            getsockname(listener, (struct sockaddr *)&address, &length) != 0) {
            abort();
        }
    }
    snprintf(port, size, "tcp:127.0.0.1:%d", ntohs(address.sin_port));
}

static void open_pty(line *l, char *port, size_t size) {
    l->fd = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    struct termios raw;
    if (l->fd < 0 || grantpt(l->fd) != 0 || unlockpt(l->fd) != 0 || ptsname_r(l->fd, port, size) != 0 ||
        tcgetattr(l->fd, &raw) != 0) {
        abort();
    }
    cfmakeraw(&raw);
    tcsetattr(l->fd, TCSANOW, &raw);
}

static void drive(const char *port) {
    gonio_controller_config config;
    gonio_controller_defaults(&config);
    strcpy(config.modbus.port, port);
    config.modbus.timeout_ms = 3;
    config.replug_s = 0;
    config.retries = 2;
    config.deadman_s = 0;
    gonio_controller *c;
    gonio_error error = {0};
    if (gonio_controller_open(&config, &c, &error) != GONIO_OK) {
        if (error.message[0] == 0) {
            abort();
        }
        return;
    }
    gonio_stage_modbus_config stage_config;
    gonio_stage_modbus_defaults(&stage_config);
    stage_config.axes[0].steps_per_deg = 100;
    void *stage, *lamp;
    const gonio_stamp stamp = {0};
    double rad[GONIO_AXES] = {0.1, 0.2, 0.3, 0.4}, waited;
    if (gonio_stage_modbus_open(&stage_config, c, &stage, NULL) == GONIO_OK) {
        gonio_stage_modbus.home(stage, 0.05, NULL);
        gonio_stage_modbus.move(stage, rad, 1, &stamp, 0.05, NULL);
        gonio_stage_modbus.position(stage, rad, NULL);
        gonio_stage_modbus.stop(stage, NULL);
        gonio_stage_modbus.close(stage);
    }
    if (gonio_lamp_modbus_open(c, 0, &lamp, NULL) == GONIO_OK) {
        gonio_lamp_modbus.set_level(lamp, 0.5, NULL);
        gonio_lamp_modbus.set_shutter(lamp, true, NULL);
        gonio_lamp_modbus.wait_ready(lamp, &stamp, 0.01, &waited, NULL);
        gonio_lamp_modbus.close(lamp);
    }
    gonio_controller_release(c);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size < 2) {
        return 0;
    }
    static line l;
    l.input = data + 1;
    l.left = size - 1;
    l.tcp = data[0] & 1;
    l.fd = -1;
    l.last_n = 0;
    gonio_machine_new(&l.machine);
    gonio_machine_start(&l.machine, FW_CAUSE_POWER);
    char port[64];
    pthread_t thread;
    if (l.tcp) {
        listen_once(port, sizeof port);
    } else {
        open_pty(&l, port, sizeof port);
    }
    if (pthread_create(&thread, NULL, l.tcp ? accept_and_serve : serve, &l) != 0) {
        abort();
    }
    drive(port);
    pthread_join(thread, NULL);
    if (l.fd >= 0) {
        close(l.fd);
    }
    return 0;
}
