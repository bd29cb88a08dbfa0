// SPDX-License-Identifier: BSD-3-Clause
// The controller as a Linux process: the simulated machine behind a pseudo-terminal (Modbus RTU) or a TCP port (Modbus
// TCP), in real or accelerated time. Lines on standard input move its contacts:
//     hold CONTACT 0|1     release CONTACT     temperature MILLIDEGREES     position AXIS STEPS     quit
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "firmware/board/posix/machine.h"

enum { LINE_MAX_BYTES = 4096, MBAP = 7, TICK_MS = 1, RESTART_US = 1000, CLIENTS = 8 };

// A TCP connection. Each is a channel of its own (core/owner.h): any number may read, one of them holds the rig.
struct client {
    int fd; // -1: none
    uint32_t channel;
    uint8_t stream[LINE_MAX_BYTES];
    unsigned streamed;
};

struct host {
    struct machine machine;
    const char *link, *flash_path;
    double speed;
    int port;
    int line, listener; // file descriptors, -1: none
    struct client clients[CLIENTS];
    uint32_t channels;             // given so far
    uint8_t queue[LINE_MAX_BYTES]; // bytes on their way to the UART
    unsigned queued;
    struct fw_registers placed;                    // the parameters that the switches stand by
    uint32_t kept[FW_STORE_SLOTS][FW_STORE_WORDS]; // what the flash file holds
    char typed[256];
    unsigned typed_length;
    bool done;
};

static volatile sig_atomic_t interrupted;

static void on_signal(int number) {
    (void)number;
    interrupted = 1;
}

static void die(const char *what, const char *name) {
    fprintf(stderr, "gonio-controller: %s %s: %s\n", what, name, strerror(errno));
    exit(1);
}

static const char usage[] =
    "usage: gonio-controller [--pty LINK] [--tcp PORT] [--speed FACTOR] [--flash FILE] [--switch AXIS=FAULT] ...\n"
    "  --pty LINK       Modbus RTU on a pseudo-terminal; LINK becomes a symbolic link to it\n"
    "  --tcp PORT       Modbus TCP on 127.0.0.1; 0: any free port, printed\n"
    "  --speed FACTOR   simulated seconds a second (1)\n"
    "  --flash FILE     keep the parameters there (they are lost at the end)\n"
    "  --switch AXIS=missing|stuck|pressed|bouncing   a bad home switch\n";

// ---- flash file ----

static void load_flash(struct host *h) {
    FILE *file = h->flash_path != NULL ? fopen(h->flash_path, "rb") : NULL;
    if (file != NULL) {
        if (fread(h->machine.flash, sizeof h->machine.flash, 1, file) != 1)
            memset(h->machine.flash, 0xFF, sizeof h->machine.flash);
        fclose(file);
    }
    memcpy(h->kept, h->machine.flash, sizeof h->kept);
}

static void keep_flash(struct host *h) {
    if (h->flash_path == NULL || memcmp(h->kept, h->machine.flash, sizeof h->kept) == 0)
        return;
    FILE *file = fopen(h->flash_path, "wb");
    if (file == NULL || fwrite(h->machine.flash, sizeof h->machine.flash, 1, file) != 1 || fclose(file) != 0)
        die("cannot write", h->flash_path);
    memcpy(h->kept, h->machine.flash, sizeof h->kept);
}

// ---- line: bytes reach the UART a character time apart, whenever the kernel hands them over ----

static void open_line(struct host *h) {
    if (h->link == NULL)
        return;
    h->line = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (h->line < 0 || grantpt(h->line) != 0 || unlockpt(h->line) != 0)
        die("cannot open", "a pseudo-terminal");
    const char *name = ptsname(h->line);
    // Held open here, too, so that a host that closes it does not hang it up; raw, so that bytes stay what they are.
    const int other = open(name, O_RDWR | O_NOCTTY);
    struct termios settings;
    if (other < 0 || tcgetattr(other, &settings) != 0)
        die("cannot open", name);
    cfmakeraw(&settings);
    tcsetattr(other, TCSANOW, &settings);
    unlink(h->link);
    if (symlink(name, h->link) != 0)
        die("cannot link", h->link);
}

static void read_line(struct host *h) {
    const ssize_t n = read(h->line, h->queue + h->queued, sizeof h->queue - h->queued);
    if (n > 0)
        h->queued += (unsigned)n;
}

static void write_line(struct host *h) {
    struct machine *m = &h->machine;
    if (m->sent_length == 0)
        return;
    if (h->line >= 0 && write(h->line, m->sent, m->sent_length) < 0 && errno != EAGAIN)
        die("cannot write", "the pseudo-terminal");
    m->sent_length = 0;
}

// ---- Modbus TCP (Messaging on TCP/IP Implementation Guide V1.0b, section 3.1.3) ----

static void open_port(struct host *h) {
    if (h->port < 0)
        return;
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)h->port)};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const int one = 1;
    socklen_t length = sizeof address;
    h->listener = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0);
    setsockopt(h->listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (bind(h->listener, (struct sockaddr *)&address, sizeof address) != 0 || listen(h->listener, 4) != 0 ||
        getsockname(h->listener, (struct sockaddr *)&address, &length) != 0)
        die("cannot listen on", "the TCP port");
    printf("port %d\n", ntohs(address.sin_port));
}

static void drop_client(struct host *h, struct client *c) {
    if (c->fd < 0)
        return;
    close(c->fd);
    gonio_fw_modbus_hung_up(&h->machine.core, c->channel);
    *c = (struct client){.fd = -1};
}

// A free place, or that of the oldest connection that does not hold the rig: hosts that died may never have closed.
static struct client *place_for_client(struct host *h) {
    struct client *oldest = NULL;
    for (struct client *c = h->clients; c < h->clients + CLIENTS; c++) {
        if (c->fd < 0)
            return c;
        const bool holds = h->machine.core.owner.number != 0 && h->machine.core.owner.channel == c->channel;
        if (!holds && (oldest == NULL || c->channel < oldest->channel))
            oldest = c;
    }
    if (oldest == NULL) // there are more places than the one that can hold it
        oldest = h->clients;
    drop_client(h, oldest);
    return oldest;
}

static void accept_client(struct host *h) {
    const int one = 1, fd = accept(h->listener, NULL, NULL);
    if (fd < 0)
        return;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    struct client *c = place_for_client(h);
    c->fd = fd;
    c->channel = ++h->channels;
}

static void serve_request(struct host *h, struct client *c, const uint8_t *request, unsigned length) {
    uint8_t reply[MBAP + FW_PDU_MAX];
    const size_t n = gonio_fw_modbus_pdu(&h->machine.core, c->channel, request + MBAP, length - MBAP, reply + MBAP);
    if (n == 0)
        return;
    memcpy(reply, request, MBAP);
    reply[4] = (uint8_t)((n + 1) >> 8);
    reply[5] = (uint8_t)(n + 1);
    if (send(c->fd, reply, MBAP + n, MSG_NOSIGNAL) < 0)
        drop_client(h, c);
}

static void read_client(struct host *h, struct client *c) {
    const ssize_t n = read(c->fd, c->stream + c->streamed, sizeof c->stream - c->streamed);
    if (n <= 0) {
        drop_client(h, c);
        return;
    }
    c->streamed += (unsigned)n;
    while (c->fd >= 0 && c->streamed >= MBAP) {
        const unsigned length = 6 + ((unsigned)c->stream[4] << 8 | c->stream[5]);
        if (c->stream[2] != 0 || c->stream[3] != 0 || length <= MBAP || length > MBAP + FW_PDU_MAX) {
            drop_client(h, c); // no Modbus: there is no way to find the next request
            return;
        }
        if (c->streamed < length)
            return;
        serve_request(h, c, c->stream, length);
        c->streamed -= length < c->streamed ? length : c->streamed;
        memmove(c->stream, c->stream + length, c->streamed);
    }
}

// ---- standard input ----

static int contact_named(const char *name) {
#define CONTACT(address, contact, text)                                                                                \
    if (strcmp(name, #contact) == 0)                                                                                   \
        return address;
#include "firmware/regmap.def"
    return -1;
}

static void obey(struct host *h, const char *line) {
    struct machine *m = &h->machine;
    char word[16] = "", name[32] = "";
    long long value = 0;
    const int words = sscanf(line, "%15s %31s %lld", word, name, &value);
    const int contact = contact_named(name);
    if (words == 3 && strcmp(word, "hold") == 0 && contact >= 0)
        gonio_machine_hold(m, (enum fw_contact)contact, value != 0);
    else if (words == 2 && strcmp(word, "release") == 0 && contact >= 0)
        gonio_machine_release(m, (enum fw_contact)contact);
    else if (words == 2 && strcmp(word, "temperature") == 0)
        m->temperature = (int32_t)strtol(name, NULL, 10);
    else if (words == 3 && strcmp(word, "position") == 0 && name[0] >= '0' && name[0] < '0' + FW_AXES)
        m->axis[name[0] - '0'].steps = value;
    else if (words == 1 && strcmp(word, "quit") == 0)
        h->done = true;
    else
        fprintf(stderr, "gonio-controller: not understood: %s\n", line);
}

// Returns false at the end of the input: the process then goes on without.
static bool read_commands(struct host *h) {
    const ssize_t n = read(STDIN_FILENO, h->typed + h->typed_length, sizeof h->typed - 1 - h->typed_length);
    if (n <= 0)
        return false;
    h->typed_length += (unsigned)n;
    h->typed[h->typed_length] = '\0';
    for (char *end; (end = strchr(h->typed, '\n')) != NULL;) {
        *end = '\0';
        obey(h, h->typed);
        h->typed_length -= (unsigned)(end + 1 - h->typed);
        memmove(h->typed, end + 1, h->typed_length + 1);
    }
    if (h->typed_length == sizeof h->typed - 1)
        h->typed_length = 0; // a line that long is none of ours
    return true;
}

// ---- time ----

static double seconds_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// Without parameters of its own the controller is set up for the machine it stands in: switches that are active below
// 0, so that they tell the side, and homing that ends at 0.
static void start(struct host *h, enum fw_cause cause) {
    struct fw_registers *r = &h->machine.core.registers;
    gonio_machine_start(&h->machine, cause);
    if (r->store_slot[0] != 0)
        return;
    r->home_pressed[0] = 1;
    for (unsigned i = 0; i < FW_AXES; i++)
        r->home_position[i] = -(int64_t)r->home_backoff[i];
    gonio_fw_core_parameters_changed(&h->machine.core);
}

static void start_anew(struct host *h) {
    struct machine *m = &h->machine;
    const enum fw_cause cause = m->bitten ? FW_CAUSE_WATCHDOG : m->fault ? FW_CAUSE_FAULT : FW_CAUSE_COMMAND;
    fprintf(stderr, "gonio-controller: starts anew\n");
    keep_flash(h);
    m->now_us += RESTART_US;
    start(h, cause);
}

// The switches follow the parameters, as a mechanic would set them: whatever the scale of an axis, it homes and moves.
static void place_switches(struct host *h) {
    const struct fw_registers *r = &h->machine.core.registers;
    struct fw_registers *p = &h->placed;
    if (memcmp(p->home_position, r->home_position, sizeof p->home_position) == 0 &&
        memcmp(p->home_up, r->home_up, sizeof p->home_up) == 0 &&
        memcmp(p->soft_min, r->soft_min, sizeof p->soft_min) == 0 &&
        memcmp(p->soft_max, r->soft_max, sizeof p->soft_max) == 0 &&
        memcmp(p->speed_max, r->speed_max, sizeof p->speed_max) == 0 &&
        memcmp(p->acceleration, r->acceleration, sizeof p->acceleration) == 0 &&
        memcmp(p->jerk, r->jerk, sizeof p->jerk) == 0)
        return;
    *p = *r;
    gonio_machine_place(&h->machine);
}

static void run_until(struct host *h, uint64_t us) {
    struct machine *m = &h->machine;
    while (m->now_us < us || h->queued > 0) {
        uint64_t slice = us > m->now_us ? us - m->now_us : 0;
        if (h->queued > 0 || slice > m->core.modbus.character)
            slice = m->core.modbus.character;
        place_switches(h);
        gonio_machine_run(m, slice);
        if (m->bitten || m->fault || m->restart)
            start_anew(h);
        if (h->queued > 0) {
            gonio_fw_modbus_receive(&m->core, h->queue[0], (uint32_t)m->now_us);
            memmove(h->queue, h->queue + 1, --h->queued);
        }
        write_line(h);
    }
}

static void run(struct host *h) {
    const double start = seconds_now();
    bool commands = true;
    while (!h->done && !interrupted) {
        enum { FIRST = 3 };
        struct pollfd fds[FIRST + CLIENTS] = {
            {commands ? STDIN_FILENO : -1, POLLIN, 0}, {h->line, POLLIN, 0}, {h->listener, POLLIN, 0}};
        for (unsigned i = 0; i < CLIENTS; i++)
            fds[FIRST + i] = (struct pollfd){h->clients[i].fd, POLLIN, 0};
        poll(fds, FIRST + CLIENTS, TICK_MS);
        if (fds[0].revents != 0)
            commands = read_commands(h);
        if ((fds[1].revents & POLLIN) != 0)
            read_line(h);
        run_until(h, (uint64_t)((seconds_now() - start) * h->speed * 1e6));
        for (unsigned i = 0; i < CLIENTS; i++)
            if (fds[FIRST + i].revents != 0)
                read_client(h, &h->clients[i]);
        if (fds[2].revents != 0)
            accept_client(h);
        keep_flash(h);
    }
}

static void set_switch(struct host *h, const char *text) {
    static const char *const names[] = {"good", "missing", "stuck", "pressed", "bouncing"};
    for (unsigned i = 0; i < sizeof names / sizeof names[0]; i++)
        if (text[0] >= '0' && text[0] < '0' + FW_AXES && text[1] == '=' && strcmp(text + 2, names[i]) == 0) {
            h->machine.axis[text[0] - '0'].home_switch = (enum machine_switch)i;
            h->machine.axis[text[0] - '0'].bounce_us = 20000;
            return;
        }
    fprintf(stderr, "gonio-controller: no such switch fault: %s\n%s", text, usage);
    exit(2);
}

static void parse(struct host *h, int argc, char **argv) {
    for (int i = 1; i < argc; i += 2) {
        const char *option = argv[i], *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (value != NULL && strcmp(option, "--pty") == 0)
            h->link = value;
        else if (value != NULL && strcmp(option, "--tcp") == 0)
            h->port = atoi(value);
        else if (value != NULL && strcmp(option, "--speed") == 0 && atof(value) > 0.0)
            h->speed = atof(value);
        else if (value != NULL && strcmp(option, "--flash") == 0)
            h->flash_path = value;
        else if (value != NULL && strcmp(option, "--switch") == 0)
            set_switch(h, value);
        else {
            const bool help = strcmp(option, "--help") == 0;
            fputs(usage, help ? stdout : stderr);
            exit(help ? 0 : 2);
        }
    }
}

int main(int argc, char **argv) {
    static struct host host = {.speed = 1.0, .port = -1, .line = -1, .listener = -1};
    for (unsigned i = 0; i < CLIENTS; i++)
        host.clients[i].fd = -1;
    gonio_machine_new(&host.machine);
    parse(&host, argc, argv);
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    load_flash(&host);
    open_line(&host);
    open_port(&host);
    start(&host, FW_CAUSE_POWER);
    puts("ready");
    fflush(stdout);
    run(&host);
    if (host.link != NULL)
        unlink(host.link);
    return 0;
}
