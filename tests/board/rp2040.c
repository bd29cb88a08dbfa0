// SPDX-License-Identifier: BSD-3-Clause
// Sections are those of the RP2040 Datasheet.
#include "tests/board/rp2040.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { PSM = 0x40010000, RESETS = 0x4000C000, RESETS_DONE = 0x4000C008, CHIP = 0x40064008, CLOCKS = 0x40008000 };
enum { REF_CTRL = CLOCKS + 0x30, SYS_CTRL = CLOCKS + 0x3C, PERI_CTRL = CLOCKS + 0x48, ADC_CTRL = CLOCKS + 0x60 };
enum { FC_KHZ = CLOCKS + 0x80, FC_SRC = CLOCKS + 0x94, FC_STATUS = CLOCKS + 0x98, FC_RESULT = CLOCKS + 0x9C };
enum { XOSC = 0x40024000, PLL = 0x40028000, PLL_STRIDE = 0x4000, IO = 0x40014000, PADS = 0x4001C000 };
enum { UART = 0x40034000, ADC = 0x4004C000, PWM = 0x40050000, WATCHDOG = 0x40058000, SIO = (int)0xD0000000 };
enum { SSI = 0x18000000, STEP_SLICE = 7, FIRST_STEP = 3, FIRST_DIRECTION = 7, SENSOR = 27 };
// Of each peripheral, its bit in RESETS; none: it has none.
static const struct {
    uint32_t base, bit;
} resets[] = {{ADC, 0}, {IO, 5}, {PADS, 8}, {PLL, 12}, {PLL + PLL_STRIDE, 13}, {PWM, 14}, {UART, 22}};
enum { NEEDS_PERI = 1 << 22, NEEDS_ADC = 1 << 0, RESET_DEFAULT = 0x01FFFFFF & ~(1 << 6 | 1 << 9 | 1 << 18) };

static uint32_t *reg(const struct rp2040 *m, uint32_t address) {
    return (uint32_t *)&m->regs[(address - 0x40000000) / 4];
}

void rp2040_object(struct rp2040 *m, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fputs("pico: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    m->wrong++;
}

static void plan(struct rp2040 *m) {
    const uint64_t at[] = {m->tx_busy ? m->tx_at : NEVER,
                           m->rx_full || m->to_receive_count == 0 ? NEVER : m->rx_at,
                           m->pwm_at,
                           m->adc_at,
                           m->bite_at,
                           m->xosc_at,
                           m->fc_at,
                           m->pll_at[0],
                           m->pll_at[1]};
    m->next = NEVER;
    for (unsigned i = 0; i < sizeof at / sizeof *at; i++)
        m->next = at[i] < m->next ? at[i] : m->next;
}

void rp2040_reset(struct rp2040 *m, uint32_t reason) {
    memset(m->regs, 0, sizeof m->regs);
    memset(m->ssi, 0, sizeof m->ssi);
    *reg(m, RESETS) = RESET_DEFAULT;
    *reg(m, CHIP) = 1 << 8; // power
    *reg(m, WATCHDOG + 8) = m->reason = reason;
    *reg(m, CLOCKS + 0x38) = 1;
    *reg(m, CLOCKS + 0x44) = 1;
    for (unsigned i = 0; i < 2; i++)
        *reg(m, PLL + i * PLL_STRIDE + 4) = 0x2D;
    for (unsigned pin = 0; pin < PIN_COUNT; pin++) {
        *reg(m, IO + 4 + 8 * pin) = 31;
        *reg(m, PADS + 4 + 4 * pin) = 0x56;
    }
    for (unsigned slice = 0; slice < 8; slice++)
        *reg(m, PWM + 0x14 * slice + 0x10) = 0xFFFF;
    m->out = m->oe = m->ever_high = 0;
    m->xip = m->want_reset = m->tx_busy = m->tx_waits = m->rx_full = false;
    m->divisor = 0;
    m->shortest_pulse = NEVER;
    m->pwm_at = m->adc_at = m->bite_at = m->xosc_at = m->fc_at = m->pll_at[0] = m->pll_at[1] = NEVER;
    plan(m);
}

static double system_mhz(const struct rp2040 *m) {
    const uint32_t sys = *reg(m, SYS_CTRL);
    if ((sys & 1) == 0)
        return (*reg(m, REF_CTRL) & 3) == 2 ? m->crystal_mhz : m->ring_mhz;
    const uint32_t prim = *reg(m, PLL + 12);
    return m->crystal_mhz * *reg(m, PLL + 8) / (double)((prim >> 16 & 7) * (prim >> 12 & 7));
}

// ---- resets and clocks ----

static bool clocked(const struct rp2040 *m, uint32_t bit) {
    if ((1u << bit & NEEDS_PERI) != 0)
        return (*reg(m, PERI_CTRL) >> 11 & 1) != 0;
    if ((1u << bit & NEEDS_ADC) != 0)
        return (*reg(m, ADC_CTRL) >> 11 & 1) != 0;
    return true;
}

// In reset, or without its clock, a peripheral answers nothing good (2.14.1).
static void look_at_reset(struct rp2040 *m, uint32_t address) {
    for (unsigned i = 0; i < sizeof resets / sizeof *resets; i++)
        if ((address & ~0xFFFu) == resets[i].base &&
            ((*reg(m, RESETS) >> resets[i].bit & 1) != 0 || !clocked(m, resets[i].bit)))
            rp2040_object(m, "access to 0x%08X, which is in reset or has no clock", address);
}

static uint32_t resets_done(const struct rp2040 *m) {
    uint32_t done = ~*reg(m, RESETS) & 0x01FFFFFF;
    for (unsigned i = 0; i < sizeof resets / sizeof *resets; i++)
        if (!clocked(m, resets[i].bit))
            done &= ~(1u << resets[i].bit);
    return done;
}

static void write_pll(struct rp2040 *m, unsigned which, uint32_t offset, uint32_t before) {
    const uint32_t base = PLL + which * PLL_STRIDE, power = *reg(m, base + 4);
    const double vco = m->crystal_mhz * *reg(m, base + 8);
    if ((offset == 0 || offset == 8) && (power & 0x21) == 0 && *reg(m, base + offset) != before)
        rp2040_object(m, "PLL %u is changed while it runs", which);
    if (offset != 4)
        return;
    if ((before & 0x21) != 0 && (power & 0x21) == 0) {
        if (vco < 750 || vco > 1600)
            rp2040_object(m, "PLL %u: %g MHz, expected 750 to 1600 (2.18.2)", which, vco);
        m->pll_at[which] = m->cycles + 5000;
    }
    if ((before & 8) != 0 && (power & 8) == 0 && (*reg(m, base) >> 31) == 0)
        rp2040_object(m, "PLL %u is let out before it has locked", which);
}

static void write_clock(struct rp2040 *m, uint32_t address, uint32_t before) {
    const uint32_t value = *reg(m, address);
    if (address == REF_CTRL) {
        if ((value & 3) == 2 && (*reg(m, XOSC + 4) >> 31) == 0)
            rp2040_object(m, "clk_ref from a crystal that is not stable");
        *reg(m, CLOCKS + 0x38) = 1u << (value & 3);
    }
    if (address == SYS_CTRL) {
        if ((before & 1) != 0 && (value & 1) != 0 && before != value)
            rp2040_object(m, "the auxiliary source is changed in use (2.15.3.2)");
        if ((value & 1) != 0 && ((*reg(m, PLL) >> 31) == 0 || (*reg(m, PLL + 4) & 0x29) != 0 || (value >> 5 & 7) != 0))
            rp2040_object(m, "clk_sys from a PLL that is not ready");
        else if (system_mhz(m) > 133)
            rp2040_object(m, "clk_sys of %g MHz", system_mhz(m));
        *reg(m, CLOCKS + 0x44) = 1u << (value & 1);
    }
    if (address == FC_SRC) {
        if (value != 3 || *reg(m, FC_KHZ) == 0 || (*reg(m, REF_CTRL) & 3) != 2)
            rp2040_object(m, "the frequency counter is not asked about the ring oscillator, against the crystal");
        *reg(m, FC_STATUS) = 0;
        m->fc_at = m->cycles + 20000;
    }
}

// ---- pins ----

static void step_edges(struct rp2040 *m, uint32_t before) {
    for (unsigned axis = 0; axis < AXIS_COUNT; axis++) {
        const uint32_t pin = 1u << (FIRST_STEP + axis);
        if ((~before & m->out & pin) != 0) {
            m->position[axis] += (m->out >> (FIRST_DIRECTION + axis) & 1) != 0 ? 1 : -1;
            m->risen[axis] = m->cycles;
            m->phase[(m->cycles - m->tick_origin) % CLOCK_MHZ]++;
        }
        if ((before & ~m->out & pin) != 0 && m->cycles - m->risen[axis] < m->shortest_pulse)
            m->shortest_pulse = m->cycles - m->risen[axis];
    }
}

static void write_sio(struct rp2040 *m, uint32_t offset, uint32_t value) {
    const uint32_t before = m->out;
    switch (offset) {
    case 0x14:
        m->out |= value;
        break;
    case 0x18:
        m->out &= ~value;
        break;
    case 0x20:
        m->oe = value;
        break;
    default:
        rp2040_object(m, "SIO register 0x%X", offset);
    }
    for (unsigned pin = 0; pin < PIN_COUNT; pin++)
        if (((m->out & m->oe) >> pin & 1) != 0 && (*reg(m, IO + 4 + 8 * pin) & 31) != 5)
            rp2040_object(m, "GP%u is driven, and is not the processor's", pin);
    m->ever_high |= m->out & m->oe;
    step_edges(m, before);
}

// What an input reads: outside, if its pad lets it in; and not driven by itself.
static uint32_t read_pins(const struct rp2040 *m) {
    uint32_t in = 0;
    for (unsigned pin = 0; pin < PIN_COUNT; pin++)
        if ((*reg(m, PADS + 4 + 4 * pin) >> 6 & 1) != 0)
            in |= 1u << pin;
    return in & ((m->levels & ~m->oe) | (m->out & m->oe));
}

void rp2040_pin(struct rp2040 *m, unsigned pin, bool level) {
    const uint32_t before = read_pins(m);
    m->levels = (m->levels & ~(1u << pin)) | (uint32_t)level << pin;
    const uint32_t changed = before ^ read_pins(m);
    if (changed != 0)
        *reg(m, IO + 0xF0 + pin / 8 * 4) |= (level ? 8u : 4u) << 4 * (pin % 8);
}

// ---- UART ----

static uint64_t byte_cycles(const struct rp2040 *m) {
    return m->divisor == 0 ? 10000 : (uint64_t)10 * 16 * m->divisor / 64;
}

static void write_uart(struct rp2040 *m, uint32_t offset, uint32_t value) {
    if (offset == 0x2C) { // 4.2.7.1: it takes the divisor over
        m->divisor = *reg(m, UART + 0x24) << 6 | *reg(m, UART + 0x28);
        if ((*reg(m, UART + 0x30) & 1) != 0)
            rp2040_object(m, "the UART is set up while it is on");
        if (value != 0x60)
            rp2040_object(m, "the UART's format is 0x%X, expected 8N1 without FIFO", value);
    }
    if (offset != 0)
        return;
    if ((*reg(m, UART + 0x30) & 0x101) != 0x101)
        rp2040_object(m, "a byte for a UART that is off");
    if (m->tx_waits)
        rp2040_object(m, "a byte for a UART that is full");
    if (m->tx_busy) {
        m->tx_waits = true;
        m->tx_next = (uint8_t)value;
        return;
    }
    if ((m->out >> 2 & 1) == 0)
        rp2040_object(m, "a byte while the RS-485 driver is off");
    m->tx_busy = true;
    m->tx_byte = (uint8_t)value;
    m->tx_at = m->cycles + byte_cycles(m);
}

static uint32_t read_uart(struct rp2040 *m, uint32_t offset) {
    if (offset == 0x18)
        return (m->tx_busy ? 8u : 0) | (m->rx_full ? 0 : 16u) | (m->tx_waits ? 32u : 0);
    if (offset == 0) {
        m->rx_full = false;
        return m->rx_byte;
    }
    return *reg(m, UART + offset);
}

static void settle_uart(struct rp2040 *m) {
    if (m->tx_busy && m->cycles >= m->tx_at) {
        if ((m->out >> 2 & 1) == 0)
            rp2040_object(m, "the RS-485 driver was switched off within a byte");
        if (m->sent_count < TX_ROOM)
            m->sent[m->sent_count++] = m->tx_byte;
        m->tx_busy = m->tx_waits;
        m->tx_byte = m->tx_next;
        m->tx_waits = false;
        m->tx_at += byte_cycles(m);
    }
    if (m->to_receive_count > 0 && m->cycles >= m->rx_at && (*reg(m, UART + 0x30) & 0x201) == 0x201) {
        if (m->rx_full)
            rp2040_object(m, "a byte was received over another");
        m->rx_byte = *m->to_receive++;
        m->to_receive_count--;
        m->rx_full = true;
        m->rx_at = m->cycles + byte_cycles(m);
    }
}

// ---- PWM, ADC, watchdog ----

static void write_pwm(struct rp2040 *m, uint32_t offset) {
    if (offset / 0x14 != STEP_SLICE || offset >= 0xA0)
        return;
    const uint32_t base = PWM + 0x14 * STEP_SLICE;
    if (offset % 0x14 != 0 && (*reg(m, base) & 1) != 0)
        rp2040_object(m, "the step slice is set while it runs: it would count after the next wrap (4.5.2.3)");
    m->pwm_at = NEVER;
    if ((*reg(m, base) & 1) != 0)
        m->pwm_at = m->cycles + *reg(m, base + 0x10) + 1 - *reg(m, base + 8);
}

static void write_adc(struct rp2040 *m, uint32_t value, uint32_t before) {
    if ((value & 4) == 0)
        return;
    *reg(m, ADC) = value & ~4u;
    if ((before & 1) == 0 || m->adc_at != NEVER)
        rp2040_object(m, "a conversion is begun while the converter is off or at another one");
    if ((*reg(m, PADS + 4 + 4 * (26 + (value >> 12 & 7))) & 0x80) == 0)
        rp2040_object(m, "a converted pin could be driven");
    m->adc_at = m->cycles + 2 * CLOCK_MHZ;
}

static void settle_adc(struct rp2040 *m) {
    m->adc_at = NEVER;
    uint32_t value = m->light;
    if ((*reg(m, ADC) >> 12 & 7) == SENSOR - 26) {
        if ((*reg(m, PADS + 4 + 4 * SENSOR) & 0xC) != 0)
            rp2040_object(m, "the sensor is converted while its pin is pulled");
        value = m->sensor_open ? 2 : m->temperature;
    } else if (m->sensor_open && (*reg(m, PADS + 4 + 4 * SENSOR) & 4) == 0) {
        rp2040_object(m, "the sensor's pin is not pulled down in between");
    }
    *reg(m, ADC + 4) = value;
}

static void write_watchdog(struct rp2040 *m, uint32_t offset, uint32_t value) {
    if (offset == 0 && (value >> 31) != 0) {
        m->want_reset = true;
        m->reason = 2;
    }
    if ((offset == 0 && value >> 31 != 0) || (offset == 0 && (value >> 30 & 1) != 0)) {
        if (*reg(m, PSM + 8) != 0x1FFFC || *reg(m, WATCHDOG + 0x1C) != 0)
            rp2040_object(m, "the watchdog would not reset all and start from flash");
    }
    if (offset == 4 && value > 0xFFFFFF)
        rp2040_object(m, "the watchdog has 24 bits");
    m->bite_at = NEVER;
    if ((*reg(m, WATCHDOG) >> 30 & 1) != 0) {
        if ((*reg(m, WATCHDOG + 0x2C) & 0x3FF) != (0x200 | 12))
            rp2040_object(m, "the watchdog has no tick of 1 us");
        m->bite_at = m->cycles + (uint64_t)*reg(m, WATCHDOG + 4) * CLOCK_MHZ / 2; // erratum RP2040-E1
    }
}

// ---- flash as memory ----

static void write_ssi(struct rp2040 *m, uint32_t offset, uint32_t value) {
    if (offset != 8 && (m->ssi[2] & 1) != 0)
        rp2040_object(m, "the SSI is set up while it is on (4.10.13)");
    m->ssi[offset / 4] = value;
    if (offset != 8 || value != 1)
        return;
    // Command 03h, 24 bits of address, one frame of 32 bits, each on one line; at an even divider.
    m->xip = m->ssi[0] == (31u << 16 | 3u << 8) && m->ssi[1] == 0 &&
             m->ssi[0xF4 / 4] == (3u << 24 | 2u << 8 | 6u << 2) && m->ssi[5] >= 4 && m->ssi[5] % 2 == 0;
    if (!m->xip)
        rp2040_object(m, "the SSI would not read a flash by 03h");
}

// ---- all ----

uint32_t rp2040_read(struct rp2040 *m, uint32_t address) {
    rp2040_settle(m);
    if (address >> 28 == 0xD)
        return (address & 0xFFF) == 4 ? read_pins(m) : 0;
    if (address >> 24 == 0x18)
        return m->ssi[(address & 0xFF) / 4];
    look_at_reset(m, address);
    if (address == RESETS_DONE)
        return resets_done(m);
    if (address == ADC)
        return *reg(m, ADC) | (m->adc_at == NEVER ? 1u << 8 : 0);
    if ((address & ~0xFFFu) == UART) {
        const uint32_t value = read_uart(m, address & 0xFFF);
        plan(m);
        return value;
    }
    return *reg(m, address);
}

// Registers whose ones clear.
static bool cleared_by_ones(uint32_t address) {
    return address == PWM + 0xA4 || (address >= IO + 0xF0 && address < IO + 0x100);
}

static void written(struct rp2040 *m, uint32_t address, uint32_t before) {
    const uint32_t base = address & ~0xFFFu, offset = address & 0xFFF, value = *reg(m, address);
    if (base == CLOCKS)
        write_clock(m, address, before);
    else if (base == PLL || base == PLL + PLL_STRIDE)
        write_pll(m, base != PLL, offset, before);
    else if (base == UART)
        write_uart(m, offset, value);
    else if (base == PWM)
        write_pwm(m, offset);
    else if (address == ADC)
        write_adc(m, value, before);
    else if (base == WATCHDOG)
        write_watchdog(m, offset, value);
    else if (address == XOSC && (value & 0xFFFFFF) == 0xFABAA0 && m->crystal_mhz > 0)
        m->xosc_at = m->cycles + 20000;
}

void rp2040_write(struct rp2040 *m, uint32_t address, uint32_t value) {
    rp2040_settle(m);
    if (address >> 28 == 0xD) {
        write_sio(m, address & 0xFFF, value);
        return;
    }
    if (address >> 24 == 0x18) {
        write_ssi(m, address & 0xFF, value);
        return;
    }
    const uint32_t plain = address & ~0x3000u, before = *reg(m, plain);
    look_at_reset(m, plain);
    const uint32_t results[] = {value, before ^ value, before | value, before & ~value};
    *reg(m, plain) = cleared_by_ones(plain) ? before & ~value : results[address >> 12 & 3];
    written(m, plain, before);
    plan(m);
}

void rp2040_settle(struct rp2040 *m) {
    if (m->cycles < m->next)
        return;
    settle_uart(m);
    if (m->cycles >= m->pwm_at) {
        *reg(m, PWM + 0xA4) |= 1u << STEP_SLICE;
        m->pwm_at += *reg(m, PWM + 0x14 * STEP_SLICE + 0x10) + 1;
    }
    if (m->cycles >= m->adc_at)
        settle_adc(m);
    if (m->cycles >= m->bite_at) {
        m->bite_at = NEVER;
        m->want_reset = true;
        m->reason = 1;
    }
    if (m->cycles >= m->xosc_at) {
        m->xosc_at = NEVER;
        *reg(m, XOSC + 4) |= 1u << 31;
    }
    if (m->cycles >= m->fc_at) {
        m->fc_at = NEVER;
        *reg(m, FC_STATUS) = 1 << 4;
        *reg(m, FC_RESULT) = (uint32_t)(m->ring_mhz * *reg(m, FC_KHZ) / m->crystal_mhz * 32);
    }
    for (unsigned i = 0; i < 2; i++)
        if (m->cycles >= m->pll_at[i]) {
            m->pll_at[i] = NEVER;
            *reg(m, PLL + i * PLL_STRIDE) |= 1u << 31;
        }
    plan(m);
}

uint32_t rp2040_interrupts(const struct rp2040 *m) {
    uint32_t lines = (*reg(m, PWM + 0xA4) & *reg(m, PWM + 0xA8)) != 0 ? 1u << 4 : 0;
    for (unsigned n = 0; n < 4; n++)
        lines |= (*reg(m, IO + 0xF0 + 4 * n) & *reg(m, IO + 0x100 + 4 * n)) != 0 ? 1u << 13 : 0;
    lines |= m->rx_full && (*reg(m, UART + 0x38) >> 4 & 1) != 0 ? 1u << 20 : 0;
    return lines;
}

bool rp2040_idle(const struct rp2040 *m) {
    return m->pwm_at == NEVER && !m->tx_busy && !m->rx_full && m->to_receive_count == 0;
}
