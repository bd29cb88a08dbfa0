// SPDX-License-Identifier: BSD-3-Clause
// A model of the RP2040 as firmware/board/pico uses it: registers that behave, and object, as the data sheet has it.
//
// What the data sheet forbids is told on stderr and counted (`wrong`), and the program goes on. Time is counted in
// cycles of 125 MHz; before the clocks run, the waits are right in kind but not in length.
#ifndef TESTS_BOARD_RP2040_H
#define TESTS_BOARD_RP2040_H

#include <stdbool.h>
#include <stdint.h>

enum { PIN_COUNT = 30, AXIS_COUNT = 4, CLOCK_MHZ = 125, TX_ROOM = 4096 };
enum { RP_FLASH = 0x10000000, RP_FLASH_SIZE = 0x200000, RP_SRAM = 0x20000000, RP_SRAM_SIZE = 0x42000 };
#define NEVER UINT64_MAX

struct rp2040 {
    uint64_t cycles;
    uint64_t next;      // when something happens by itself
    unsigned wrong;     // what the data sheet forbids
    bool want_reset;    // the watchdog has bitten, or was triggered
    uint32_t reason;    // WATCHDOG_REASON
    double crystal_mhz; // 0: it does not start
    double ring_mhz;
    bool sensor_open;
    uint32_t light, temperature; // at the converter, 12 bits

    uint32_t regs[0x70000 / 4]; // of the peripherals behind the bridge, by address
    uint32_t ssi[64];
    bool xip; // flash can be read as memory

    // pins
    uint32_t out, oe, levels;     // levels: what is outside, for inputs
    uint32_t ever_high;           // outputs that were, since the reset
    uint64_t risen[AXIS_COUNT];   // when the step output last rose
    int64_t position[AXIS_COUNT]; // of a motor there, by its direction output
    uint64_t shortest_pulse;      // cycles
    uint32_t phase[CLOCK_MHZ];    // rising edges, by cycles since the last whole tick
    uint64_t tick_origin;         // where ticks begin: SysTick's start

    // UART
    uint32_t divisor; // taken over by LCR_H; 1/64
    uint64_t tx_at, rx_at;
    bool tx_busy, tx_waits, rx_full;
    uint8_t tx_byte, tx_next, rx_byte;
    uint8_t sent[TX_ROOM]; // bytes that have left
    unsigned sent_count;
    const uint8_t *to_receive; // what the line has for it
    unsigned to_receive_count;

    uint64_t pwm_at;  // wrap of the step slice
    uint64_t adc_at;  // end of a conversion
    uint64_t bite_at; // of the watchdog
    uint64_t xosc_at, fc_at, pll_at[2];
};

void rp2040_reset(struct rp2040 *m, uint32_t reason);
uint32_t rp2040_read(struct rp2040 *m, uint32_t address);
void rp2040_write(struct rp2040 *m, uint32_t address, uint32_t value);
// Let happen what is due at m->cycles.
void rp2040_settle(struct rp2040 *m);
// Interrupt lines that are up, by number.
uint32_t rp2040_interrupts(const struct rp2040 *m);
// An input pin changes.
void rp2040_pin(struct rp2040 *m, unsigned pin, bool level);
// Nothing goes on that time would change.
bool rp2040_idle(const struct rp2040 *m);
void rp2040_object(struct rp2040 *m, const char *format, ...) __attribute__((format(printf, 2, 3)));

#endif
