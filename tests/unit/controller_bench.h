// SPDX-License-Identifier: BSD-3-Clause
// A controller to talk to: the firmware's simulated machine in a process of its own, behind a pty (RTU) or TCP, in
// accelerated time, and between it and the driver a line that delays, drops, flips, splits, merges, repeats, adds noise
// and closes, by seed.
#ifndef GONIO_TESTS_CONTROLLER_BENCH_H
#define GONIO_TESTS_CONTROLLER_BENCH_H

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "firmware/board/posix/machine.h"

enum bench_fault {
    BENCH_NONE,
    BENCH_DELAY, // longer than the master waits
    BENCH_DROP,
    BENCH_FLIP,
    BENCH_SPLIT,
    BENCH_MERGE,  // held back and sent with the next
    BENCH_REPEAT, // an old one once more, later
    BENCH_NOISE,
    BENCH_CUT,
    BENCH_CLOSE,
    BENCH_FAULTS
};

// Shared with the processes.
typedef struct bench_shared {
    struct machine machine;
    volatile int permille;   // how often a frame is mangled
    volatile uint32_t kinds; // bits: which faults
    volatile int64_t hits[BENCH_FAULTS];
    volatile int64_t moves_past_limit, motions;
    volatile int frozen; // the machine answers nothing
    volatile int restart;
    volatile int plugged;
} bench_shared;

typedef struct bench {
    bench_shared *shared;
    pid_t machine_process, line_process;
    char port[128], folder[64];
} bench;

static int64_t bench_now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

// Read what comes until 2 ms of silence: a frame, or what a master takes for one. 0: closed, -1: nothing.
static int bench_read_frame(int fd, uint8_t *bytes, int size) {
    struct pollfd p = {.fd = fd, .events = POLLIN};
    int n = 0;
    while (n < size && poll(&p, 1, 2) > 0) {
        const ssize_t got = read(fd, bytes + n, (size_t)(size - n));
        if (got <= 0) {
            return n > 0 ? n : 0;
        }
        n += (int)got;
    }
    return n > 0 ? n : -1;
}

static void bench_write(int fd, const uint8_t *bytes, int n) {
    while (n > 0) {
        const ssize_t put = write(fd, bytes, (size_t)n);
        if (put <= 0) {
            return;
        }
        bytes += put;
        n -= (int)put;
    }
}

// ---- the machine ----

static void bench_answer(struct machine *m, uint32_t channel, int fd, uint8_t *bytes, int n) {
    if (channel == FW_CHANNEL_LINE) {
        m->sent_length = 0;
        gonio_machine_receive(m, bytes, (unsigned)n);
        bench_write(fd, m->sent, (int)m->sent_length);
        m->sent_length = 0;
        return;
    }
    // MBAP header: transaction, protocol 0, length, unit; several frames may have come together.
    for (int at = 0; at + 8 <= n;) {
        const int length = bytes[at + 4] << 8 | bytes[at + 5];
        if (length < 2 || at + 6 + length > n || bytes[at + 2] != 0 || bytes[at + 3] != 0) {
            return;
        }
        uint8_t reply[7 + FW_PDU_MAX];
        memcpy(reply, bytes + at, 7);
        const size_t size = gonio_fw_modbus_pdu(&m->core, channel, bytes + at + 7, (size_t)length - 1, reply + 7);
        reply[4] = (uint8_t)((size + 1) >> 8);
        reply[5] = (uint8_t)(size + 1);
        if (size > 0) {
            bench_write(fd, reply, (int)(7 + size));
        }
        at += 6 + length;
    }
}

static void bench_check_limits(bench_shared *s) {
    for (int k = 0; k < FW_AXES; k++) {
        const struct fw_registers *r = &s->machine.core.registers;
        if ((s->machine.core.known & 1 << k) && s->machine.core.state == FW_STATE_MOVING &&
            (r->position[k] < r->soft_min[k] || r->position[k] > r->soft_max[k])) {
            s->moves_past_limit++;
        }
    }
}

static void bench_count_motion(bench_shared *s, int *state) {
    s->motions += s->machine.core.state == FW_STATE_MOVING && *state != FW_STATE_MOVING;
    *state = s->machine.core.state;
}

static void bench_run_machine(bench_shared *s, bool tcp, int fd, double speed) {
    int64_t last = bench_now_us();
    int state = s->machine.core.state;
    int client = tcp ? -1 : fd;
    uint32_t channel = FW_CHANNEL_LINE;
    for (;;) {
        if (client < 0) {
            struct pollfd p = {.fd = fd, .events = POLLIN};
            client = poll(&p, 1, 1) > 0 ? accept(fd, NULL, NULL) : -1;
            channel += client >= 0;
        }
        uint8_t bytes[1024];
        const int n = client >= 0 ? bench_read_frame(client, bytes, sizeof bytes) : -1;
        const int64_t now = bench_now_us();
        if (!s->frozen) {
            gonio_machine_run(&s->machine, (uint64_t)((double)(now - last) * speed));
        }
        last = now;
        bench_check_limits(s);
        bench_count_motion(s, &state);
        if (s->restart || s->machine.restart || s->machine.bitten || s->machine.fault) {
            s->restart = 0;
            gonio_machine_start(&s->machine, FW_CAUSE_POWER);
        }
        if (n > 0 && !s->frozen) {
            bench_answer(&s->machine, channel, client, bytes, n);
            bench_count_motion(s, &state); // where this process has to wait, the next step may be all of a move
        } else if (n == 0 && tcp) {
            close(client);
            client = -1;
            gonio_fw_modbus_hung_up(&s->machine.core, channel);
        } else if (n == 0) {
            usleep(1000);
        }
    }
}

// ---- the line ----

typedef struct bench_line {
    bench_shared *shared;
    uint32_t seed;
    uint8_t held[1024], old[1024];
    int held_n, old_n;
} bench_line;

static uint32_t bench_random(bench_line *l) {
    l->seed ^= l->seed << 13;
    l->seed ^= l->seed >> 17;
    l->seed ^= l->seed << 5;
    return l->seed;
}

static enum bench_fault bench_choose(bench_line *l) {
    const uint32_t kinds = l->shared->kinds;
    if ((int)(bench_random(l) % 1000) >= l->shared->permille || kinds == 0) {
        return BENCH_NONE;
    }
    for (;;) {
        const uint32_t kind = 1 + bench_random(l) % (BENCH_FAULTS - 1);
        if (kinds & 1u << kind) {
            return (enum bench_fault)kind;
        }
    }
}

// Pass one frame on; true: close the line.
static bool bench_pass(bench_line *l, int to, uint8_t *bytes, int n) {
    uint8_t all[2048];
    memcpy(all, l->held, (size_t)l->held_n);
    memcpy(all + l->held_n, bytes, (size_t)n);
    int size = l->held_n + n;
    l->held_n = 0;
    const enum bench_fault fault = bench_choose(l);
    l->shared->hits[fault]++;
    switch (fault) {
    case BENCH_DELAY:
        usleep(1000 * (20 + bench_random(l) % 60));
        break;
    case BENCH_DROP:
        return false;
    case BENCH_FLIP:
        all[bench_random(l) % (uint32_t)size] ^= (uint8_t)(1u << bench_random(l) % 8);
        break;
    case BENCH_SPLIT: {
        const int first = 1 + (int)(bench_random(l) % (uint32_t)size);
        bench_write(to, all, first);
        usleep(1000 * (1 + bench_random(l) % 12));
        bench_write(to, all + first, size - first);
        return false;
    }
    case BENCH_MERGE:
        if (size < 1000) {
            memcpy(l->held, all, (size_t)size);
            l->held_n = size;
            return false;
        }
        break;
    case BENCH_REPEAT:
        if (l->old_n > 0) {
            bench_write(to, l->old, l->old_n);
            usleep(4000);
        }
        break;
    case BENCH_NOISE:
        for (uint32_t i = 0; i < 1 + bench_random(l) % 6 && size < 2040; i++) {
            all[size++] = (uint8_t)bench_random(l);
        }
        break;
    case BENCH_CUT:
        size = 1 + (int)(bench_random(l) % (uint32_t)size);
        break;
    case BENCH_CLOSE:
        return true;
    default:
        break;
    }
    bench_write(to, all, size);
    l->old_n = n < (int)sizeof l->old ? n : 0;
    memcpy(l->old, bytes, (size_t)l->old_n);
    return false;
}

// Carry frames between two open ends until one closes, or is made to.
static void bench_carry(bench_line *there, bench_line *back, int driver, int machine) {
    for (;;) {
        uint8_t bytes[1024];
        struct pollfd p[2] = {{.fd = driver, .events = POLLIN}, {.fd = machine, .events = POLLIN}};
        if (!there->shared->plugged) {
            return;
        }
        if (poll(p, 2, 20) <= 0) {
            continue;
        }
        for (int side = 0; side < 2; side++) {
            if (p[side].revents == 0) {
                continue;
            }
            const int n = bench_read_frame(p[side].fd, bytes, sizeof bytes);
            if (n == 0 || (n < 0 && (p[side].revents & POLLHUP))) {
                if (side == 0 && isatty(p[0].fd)) {
                    usleep(2000); // nobody has opened the other end
                    continue;
                }
                return;
            }
            if (n > 0 && bench_pass(side == 0 ? there : back, p[1 - side].fd, bytes, n)) {
                return;
            }
        }
    }
}

static void bench_raw(int fd) {
    struct termios t;
    tcgetattr(fd, &t);
    cfmakeraw(&t);
    tcsetattr(fd, TCSANOW, &t);
}

static int bench_pty(char *path, size_t size) {
    const int master = posix_openpt(O_RDWR | O_NOCTTY);
    grantpt(master);
    unlockpt(master);
    ptsname_r(master, path, size);
    bench_raw(master);
    return master;
}

static int bench_listen(int *port) {
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    const int yes = 1;
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons((uint16_t)*port)};
    socklen_t size = sizeof address;
    if (bind(fd, (struct sockaddr *)&address, size) != 0 || listen(fd, 4) != 0) {
        return -1;
    }
    getsockname(fd, (struct sockaddr *)&address, &size);
    *port = ntohs(address.sin_port);
    return fd;
}

static int bench_connect(int port) {
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    const struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons((uint16_t)port)};
    return connect(fd, (const struct sockaddr *)&address, sizeof address) == 0 ? fd : -1;
}

// The line as a process: its driver's end is a pty behind a name that stays, or a TCP port.
static void bench_run_line(bench *b, bool tcp, int listener, int machine_end, int machine_port, uint32_t seed) {
    bench_line there = {.shared = b->shared, .seed = seed * 2 + 1}, back = {.shared = b->shared, .seed = seed * 2 + 77};
    for (;;) {
        while (!b->shared->plugged) {
            usleep(2000);
        }
        int driver, machine = machine_end;
        char path[64], next[160];
        if (tcp) {
            driver = accept(listener, NULL, NULL);
            machine = bench_connect(machine_port);
        } else {
            driver = bench_pty(path, sizeof path);
            snprintf(next, sizeof next, "%s.new", b->port);
            unlink(next);
            if (symlink(path, next) != 0 || rename(next, b->port) != 0) {
                _exit(1);
            }
        }
        there.held_n = back.held_n = 0;
        bench_carry(&there, &back, driver, machine);
        if (!tcp) {
            unlink(b->port);
        } else {
            close(machine);
        }
        close(driver);
        usleep(20000);
    }
}

static pid_t bench_fork(void) {
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        signal(SIGPIPE, SIG_IGN);
    }
    return child;
}

// Start a controller and a line to it. speed: simulated seconds a second.
static void bench_start(bench *b, bool tcp, double speed, uint32_t seed) {
    *b = (bench){.shared = mmap(NULL, sizeof *b->shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)};
    gonio_machine_new(&b->shared->machine);
    gonio_machine_start(&b->shared->machine, FW_CAUSE_POWER);
    b->shared->machine.core.registers.lamp_warm_up[0] = 200;
    gonio_fw_core_parameters_changed(&b->shared->machine.core);
    b->shared->plugged = 1;
    strcpy(b->folder, "/tmp/gonio-bench-XXXXXX");
    if (mkdtemp(b->folder) == NULL) {
        abort();
    }
    int machine_port = 0, port = 0, machine_end = -1, listener = -1, machine_fd;
    char path[64];
    if (tcp) {
        machine_fd = bench_listen(&machine_port);
        listener = bench_listen(&port);
        snprintf(b->port, sizeof b->port, "tcp:127.0.0.1:%d", port);
    } else {
        machine_fd = bench_pty(path, sizeof path);
        machine_end = open(path, O_RDWR | O_NOCTTY);
        bench_raw(machine_end);
        snprintf(b->port, sizeof b->port, "%s/controller", b->folder);
    }
    b->machine_process = bench_fork();
    if (b->machine_process == 0) {
        bench_run_machine(b->shared, tcp, machine_fd, speed);
        _exit(0);
    }
    b->line_process = bench_fork();
    if (b->line_process == 0) {
        bench_run_line(b, tcp, listener, machine_end, machine_port, seed);
        _exit(0);
    }
    close(machine_fd);
    close(tcp ? listener : machine_end);
    for (int i = 0; i < 500 && !tcp && access(b->port, F_OK) != 0; i++) {
        usleep(2000);
    }
}

static void bench_stop(bench *b) {
    kill(b->line_process, SIGKILL);
    kill(b->machine_process, SIGKILL);
    waitpid(b->line_process, NULL, 0);
    waitpid(b->machine_process, NULL, 0);
    unlink(b->port);
    rmdir(b->folder);
    munmap(b->shared, sizeof *b->shared);
}

#endif
