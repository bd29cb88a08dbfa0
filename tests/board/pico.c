// SPDX-License-Identifier: BSD-3-Clause
// Runs an image for the Raspberry Pi Pico on the model of rp2040.c, its UART on a pseudo-terminal.
//
// usage: pico IMAGE.uf2 [NAME=VALUE ...]     crystal_mhz (12; 0: none), ring_mhz (6.5), sensor_open, aligned
// Prints "line PATH". Commands on stdin, each answered by a line: "pin N LEVEL" sets an input; "report" tells, as one
// line of JSON, what the outputs did; the end of stdin ends it.
//
// Emulated time nearly stands while the host thinks: where the line is silent and no axis steps, a tenth of it passes.
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "tests/board/cpu.h"

enum { BLOCK = 512, PAYLOAD = 256, LINE_ROOM = 512, SLICE_US = 200, REST_US = 500, REST_MS = 5, LINGER_US = 3000 };

// ---- the image ----

// UF2's blocks, as the ROM's USB drive takes them (2.8.5.1).
static bool load(const char *path, uint8_t *flash) {
    FILE *f = fopen(path, "rb");
    uint32_t block[BLOCK / 4];
    uint32_t count = 0, expected = 1;
    while (f != NULL && fread(block, BLOCK, 1, f) == 1) {
        const bool good = block[0] == 0x0A324655 && block[1] == 0x9E5D5157 && block[127] == 0x0AB16F30 &&
                          block[2] == 0x2000 && block[7] == 0xE48BFF56 && block[4] == PAYLOAD && block[5] == count &&
                          block[3] % PAYLOAD == 0 && block[3] >= RP_FLASH &&
                          block[3] - RP_FLASH <= RP_FLASH_SIZE - PAYLOAD;
        if (!good)
            break;
        memcpy(flash + (block[3] - RP_FLASH), block + 8, PAYLOAD);
        expected = block[6];
        count++;
    }
    if (f == NULL || fclose(f) != 0 || count != expected)
        return fprintf(stderr, "pico: %s: block %u of %u is no UF2 block of an RP2040\n", path, count, expected), false;
    return true;
}

// ---- the line ----

static int open_line(void) {
    const int fd = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (fd < 0 || grantpt(fd) != 0 || unlockpt(fd) != 0)
        return -1;
    struct termios raw;
    const int peer = open(ptsname(fd), O_RDWR | O_NOCTTY); // kept open: else the line is gone with its first user
    if (peer < 0 || tcgetattr(peer, &raw) != 0)
        return -1;
    cfmakeraw(&raw);
    tcsetattr(peer, TCSANOW, &raw);
    printf("line %s\n", ptsname(fd));
    fflush(stdout);
    return fd;
}

static void exchange(struct cpu *c, int fd) {
    static uint8_t received[LINE_ROOM];
    struct rp2040 *m = &c->chip;
    if (!m->tx_busy && m->sent_count > 0) {
        if (write(fd, m->sent, m->sent_count) < 0)
            perror("pico");
        m->sent_count = 0;
    }
    if (m->to_receive_count > 0)
        return;
    const ssize_t n = read(fd, received, sizeof received);
    if (n > 0) {
        m->to_receive = received;
        m->to_receive_count = (unsigned)n;
        m->rx_at = m->cycles;
        m->next = m->cycles;
    }
}

// ---- commands ----

static void report(struct rp2040 *m) {
    printf("{\"wrong\":%u,\"cycles\":%llu,\"out\":%u,\"oe\":%u,\"ever_high\":%u,\"shortest_pulse\":%llu,\"position\":[",
           m->wrong, (unsigned long long)m->cycles, m->out, m->oe, m->ever_high, (unsigned long long)m->shortest_pulse);
    for (unsigned i = 0; i < AXIS_COUNT; i++)
        printf("%s%lld", i > 0 ? "," : "", (long long)m->position[i]);
    printf("],\"phase\":[");
    for (unsigned i = 0; i < CLOCK_MHZ; i++)
        printf("%s%u", i > 0 ? "," : "", m->phase[i]);
    printf("],\"lamp\":%u}\n", m->regs[(0x50000 + 0x14 * 2 + 0xC) / 4] >> 16);
}

// False: no more commands.
static bool command(struct cpu *c) {
    char text[80];
    unsigned pin, level;
    if (fgets(text, sizeof text, stdin) == NULL)
        return false;
    if (sscanf(text, "pin %u %u", &pin, &level) == 2 && pin < PIN_COUNT) {
        rp2040_pin(&c->chip, pin, level != 0);
        printf("ok\n");
    } else if (strcmp(text, "report\n") == 0) {
        report(&c->chip);
    } else {
        printf("unknown command: %s", text);
    }
    fflush(stdout);
    return true;
}

static bool option(struct cpu *c, const char *text) {
    if (sscanf(text, "crystal_mhz=%lf", &c->chip.crystal_mhz) == 1 ||
        sscanf(text, "ring_mhz=%lf", &c->chip.ring_mhz) == 1)
        return true;
    if (strcmp(text, "sensor_open=1") == 0)
        return c->chip.sensor_open = true;
    return strcmp(text, "aligned=1") == 0 && (c->aligned = true);
}

// Until stdin ends. Exit status.
static int serve(struct cpu *c, int line) {
    struct pollfd fds[] = {{.fd = STDIN_FILENO, .events = POLLIN}, {.fd = line, .events = POLLIN}};
    uint64_t busy_at = 0;
    for (;;) {
        exchange(c, line);
        if (!rp2040_idle(&c->chip))
            busy_at = c->chip.cycles;
        const bool rests = c->chip.cycles - busy_at > (uint64_t)LINGER_US * CLOCK_MHZ;
        if (poll(fds, 2, rests ? REST_MS : 0) < 0 && errno != EINTR)
            return 1;
        if (fds[0].revents != 0 && !command(c))
            return 0;
        if ((fds[1].revents & POLLIN) != 0)
            exchange(c, line);
        if (!cpu_run(c, c->chip.cycles + (uint64_t)(rests ? REST_US : SLICE_US) * CLOCK_MHZ))
            return 1;
    }
}

int main(int argc, char **argv) {
    static struct cpu cpu;
    uint8_t *flash = malloc(RP_FLASH_SIZE);
    if (argc < 2 || flash == NULL) {
        fprintf(stderr, "usage: pico IMAGE.uf2 [crystal_mhz=MHZ] [ring_mhz=MHZ] [sensor_open=1] [aligned=1]\n");
        return 2;
    }
    memset(flash, 0xFF, RP_FLASH_SIZE);
    cpu.chip = (struct rp2040){.crystal_mhz = 12, .ring_mhz = 6.5, .light = 2000, .temperature = 310};
    for (int i = 2; i < argc; i++)
        if (!option(&cpu, argv[i]))
            return fprintf(stderr, "pico: %s\n", argv[i]), 2;
    const int line = open_line();
    if (line < 0 || !load(argv[1], flash) || !cpu_open(&cpu, flash) || !cpu_boot(&cpu, 0))
        return 1;
    const int status = serve(&cpu, line);
    cpu_close(&cpu);
    free(flash);
    return status;
}
