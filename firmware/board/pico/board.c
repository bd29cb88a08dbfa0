// SPDX-License-Identifier: BSD-3-Clause
// The Raspberry Pi Pico: RP2040, one of its two Cortex-M0+ at 125 MHz, from its 12 MHz crystal.
//
//     GP0, 1 UART 0 (transmit, receive)   GP2 RS-485 driver on   GP3-6 step   GP7-10 direction   GP11 motors on
//     GP12-15 home switches   GP16 emergency stop   GP17 door   GP18, 19 limit switches of light_theta and camera_theta
//     GP20 those of both phi axes   GP21 lamp (PWM)   GP22 shutter   GP28 camera trigger, or the brakes
//     GP26 photodiode   GP27 lamp temperature, 10 mV a degree
//
// There are 26 pins and no more. So GP11 switches all motors on while any axis is energised, GP28 opens all brakes
// while one is open (all motors hold then) where `brakes` says that there are any, and the limit switches at both ends
// of an axis, or of two, are contacts in series: one that opens counts as both ends of those axes, which then move
// neither way until it is closed again by hand. Inputs have pull-ups and contacts open when active, so that a broken
// wire counts as active.
#include "firmware/board/cortex_m/step.h"
#include "firmware/board/pico/rp2040.h"
#include "firmware/contract/adc.h"
#include "firmware/contract/pin.h"
#include "firmware/contract/store.h"
#include "firmware/contract/tick.h"
#include "firmware/contract/uart.h"
#include "firmware/contract/watchdog.h"

enum { CLOCK_HZ = 125000000, CRYSTAL_MHZ = 12, TICK_CYCLES = CLOCK_HZ / 1000000 };
enum { TRANSMIT, RECEIVE, DRIVER, STEP_0, DIRECTION_0 = 7, MOTORS = 11, HOME_0, ESTOP = 16, DOOR };
enum { LIMIT_LIGHT_THETA = 18, LIMIT_CAMERA_THETA, LIMIT_PHI, LAMP, SHUTTER, PHOTODIODE = 26, TEMPERATURE, TRIGGER };
enum { FIRST_INPUT = HOME_0, LAST_INPUT = LIMIT_PHI, STEPS = 15 << STEP_0, DIRECTIONS = 15 << DIRECTION_0 };
enum { OUTPUTS = 1 << DRIVER | STEPS | DIRECTIONS | 1 << MOTORS | 1 << SHUTTER | 1 << TRIGGER };
enum { LAMP_SLICE = 2, STEP_SLICE = 7, PWM_PERIOD = 6250, FAR = 0x8000 }; // the lamp is output B of its slice; 20 kHz
static const struct step_timing timing = {.tick = TICK_CYCLES, .entry = 150, .near = 250, .leave = 40};
const uint16_t board_number = FW_BOARD_pico;
const uint32_t board_tick_cycles = TICK_CYCLES;

// ---- steps: a PWM slice without pins counts cycles, 16 bits of them ----

// It stands, so that the top counts at once and not after a wrap (4.5.2.3). (One address and offsets to it: the
// compiler would load each register's own.)
INLINE void arm(uint32_t cycles) {
    volatile uint32_t *slice = &PWM_CSR(STEP_SLICE);
    __asm("" : "+r"(slice));
    slice[2] = 0;                                 // counter
    slice[4] = cycles < 0xFFFF ? cycles : 0xFFFF; // top
    slice[0] = 1;
}

INLINE void put_steps(uint8_t edges) {
    SIO_OUT_SET = (edges & 15u) << STEP_0;
    SIO_OUT_CLR = (edges >> 4u) << STEP_0;
}

static void step_interrupt(void) {
    PWM_CSR(STEP_SLICE) = 0;
    PWM_INTR = 1 << STEP_SLICE;
    const int32_t left = cycles_until(fw_core.step.due, TICK_CYCLES);
    if (left > FAR && fw_core.step.running) // the counter did not reach as far as the first event
        arm((uint32_t)(left - timing.entry));
    else
        step_interrupt_with(timing, put_steps, arm);
}

void gonio_fw_board_step_arm(struct fw_core *core) { step_arm_with(core, timing, arm); }

void gonio_fw_board_halt_steps(struct fw_core *core) {
    (void)core;
    PWM_CSR(STEP_SLICE) = 0;
    SIO_OUT_CLR = STEPS;
}

// ---- pins ----

// Set the pins of `mask` to those of `levels`, the others stay.
static void put(uint32_t mask, uint32_t levels) {
    SIO_OUT_SET = levels & mask;
    SIO_OUT_CLR = ~levels & mask;
}

void gonio_fw_board_directions(struct fw_core *core, uint8_t levels) {
    (void)core;
    put(DIRECTIONS, (uint32_t)levels << DIRECTION_0);
}

// One output for all motors, and one for all brakes.
void gonio_fw_board_motors(struct fw_core *core, uint8_t levels) {
    const unsigned invert = core->registers.motors_invert[0] & 15u, brakes = core->registers.brakes[0] & 15u,
                   brakes_invert = core->registers.brakes_invert[0] & 15u;
    const bool on = (levels & 15u) != invert, low = (invert & 1) != 0;
    put(1 << MOTORS, on != low ? 1 << MOTORS : 0);
    if (brakes != 0) {
        const bool open = (((levels >> FW_AXES) ^ brakes_invert) & brakes) != 0;
        put(1 << TRIGGER, open != ((brakes_invert & brakes) != 0) ? 1 << TRIGGER : 0);
    }
}

uint16_t gonio_fw_board_inputs(struct fw_core *core) {
    (void)core;
    const uint32_t levels = SIO_IN, limits = (levels >> LIMIT_LIGHT_THETA & 1) |
                                             (levels >> LIMIT_CAMERA_THETA & 1) << 2 | (levels >> LIMIT_PHI & 1) << 1 |
                                             (levels >> LIMIT_PHI & 1) << 3;
    return (uint16_t)((levels >> HOME_0 & 15) | limits << FW_CONTACT_limit_min_0 | limits << FW_CONTACT_limit_max_0 |
                      (levels >> ESTOP & 3) << FW_CONTACT_estop);
}

static void input_interrupt(void) {
    const bool estop_changed = (IO_INTR(ESTOP / 8) >> 4 * (ESTOP % 8) & IO_EDGES) != 0;
    for (unsigned n = FIRST_INPUT / 8; n <= LAST_INPUT / 8; n++)
        IO_INTR(n) = 0xFFFFFFFF; // of other pins as well, which nobody asks for
    cortex_m_inputs(estop_changed);
}

void gonio_fw_board_inputs_pend(struct fw_core *core) {
    (void)core;
    NVIC_ISPR(0) = 1u << IRQ_IO_BANK0;
}

void gonio_fw_board_shutter(struct fw_core *core, bool open) {
    (void)core;
    put(1 << SHUTTER, open ? 1 << SHUTTER : 0);
}

void gonio_fw_board_trigger(struct fw_core *core, bool high) {
    if (core->registers.brakes[0] == 0)
        put(1 << TRIGGER, high ? 1 << TRIGGER : 0);
}

void gonio_fw_board_lamp(struct fw_core *core, uint16_t level) {
    (void)core;
    _Static_assert(8 * PWM_PERIOD == 5 * 10000,
                   "the lamp's drive in cycles; an emergency stop comes here, so without division");
    PWM_CC(LAMP_SLICE) = (level * 5u / 8) << 16;
}

// ---- line ----

void gonio_fw_board_uart_setup(struct fw_core *core, uint32_t baud) {
    (void)core;
    const uint32_t divisor = (CLOCK_HZ / 16 * 64 + baud / 2) / baud; // 6 fraction bits
    UART_CR = 0;
    UART_IBRD = divisor >> 6;
    UART_FBRD = divisor & 63;
    UART_LCR_H = 0x60; // takes the divisor over; 8 bits, no FIFO: each byte's time counts
    UART_IMSC = UART_RXI;
    UART_CR = 0x301;
    irq_enable(IRQ_UART0, PRIORITY_UART);
}

bool gonio_fw_board_uart_send(struct fw_core *core, uint8_t byte) {
    (void)core;
    if ((UART_FR & FR_TXFF) != 0)
        return false;
    UART_DR = byte;
    return true;
}

bool gonio_fw_board_uart_sent(struct fw_core *core) {
    (void)core;
    return (UART_FR & FR_BUSY) == 0;
}

void gonio_fw_board_uart_drive(struct fw_core *core, bool on) {
    (void)core;
    put(1 << DRIVER, on ? 1 << DRIVER : 0);
}

static void uart_interrupt(void) {
    while ((UART_FR & FR_RXFE) == 0)
        gonio_fw_modbus_receive(&fw_core, (uint8_t)UART_DR, gonio_fw_board_now(&fw_core));
}

// ---- watchdog: it counts down twice a microsecond (erratum RP2040-E1) ----

static uint32_t watchdog_load;

void gonio_fw_board_watchdog_start(struct fw_core *core, uint32_t ms) {
    (void)core;
    watchdog_load = 2000 * ms;
    WATCHDOG_CTRL = WATCHDOG_DEBUG_PAUSES;
    PSM_WDSEL = PSM_ALL_BUT_OSCILLATORS;
    WATCHDOG_SCRATCH4 = 0; // start from flash
    WATCHDOG_LOAD = watchdog_load;
    WATCHDOG_CTRL = WATCHDOG_DEBUG_PAUSES | WATCHDOG_ON;
}

void gonio_fw_board_watchdog_feed(struct fw_core *core) {
    (void)core;
    WATCHDOG_LOAD = watchdog_load;
}

// The processor's own reset request would leave the peripherals as they are.
void board_reset(void) {
    PSM_WDSEL = PSM_ALL_BUT_OSCILLATORS;
    WATCHDOG_SCRATCH4 = 0;
    WATCHDOG_CTRL = WATCHDOG_TRIGGER;
}

// ---- analogue: the temperature is converted from one millisecond to the next, the photodiode at once ----

// In between its pin is pulled down for a moment. A sensor drives it back to its voltage in no time; an open wire stays
// where it was pulled, and reads as broken.
static void start_conversion(unsigned pin) {
    PAD(TEMPERATURE) = PAD_OUTPUT_OFF | (pin == TEMPERATURE ? 0 : PAD_PULL_DOWN);
    ADC_CS = (pin - 26) << 12 | ADC_ON;
    ADC_CS = (pin - 26) << 12 | ADC_ON | ADC_START;
}

int32_t gonio_fw_board_temperature(struct fw_core *core) {
    (void)core;
    static bool begun;
    const int32_t full_mv = 3300, full = 4095, raw = (int32_t)(ADC_RESULT & 4095);
    const bool ended = begun && (ADC_CS & ADC_READY) != 0; // begun a millisecond ago
    begun = true;
    start_conversion(PHOTODIODE);
    // 1 degC and less is no lamp, and what is left of the pull on an open wire.
    return !ended || raw <= 12 || raw >= full - 12 ? FW_NO_TEMPERATURE : raw * (full_mv * 100) / full;
}

uint16_t gonio_fw_board_photodiode(struct fw_core *core) {
    (void)core;
    static uint32_t raw;
    uint32_t turns = 0; // 96 cycles of 48 MHz: 2 us
    while ((ADC_CS & ADC_READY) == 0 && turns < 200)
        turns++;
    if (turns < 200)
        raw = ADC_RESULT & 4095;
    start_conversion(TEMPERATURE);
    return (uint16_t)(raw << 4 | raw >> 8);
}

// ---- flash: two sectors behind the program, by the functions of the boot ROM (2.8.3). Nothing runs from flash, so
// interrupts go on; an erase takes up to 0.4 s (W25Q16JV) ----

enum { STORE = 48 * 1024, ERASE_MS = 2000 };
enum { SECTOR_ERASE = 0x20 };
#define ROM_HALF(address) (*(volatile uint16_t *)(uintptr_t)(address))
typedef void (*rom_function)(void);
typedef rom_function (*rom_lookup)(uintptr_t table, uint32_t code);
typedef void (*rom_erase)(uint32_t offset, uint32_t count, uint32_t block, uint8_t command);
typedef void (*rom_program)(uint32_t offset, const uint8_t *data, uint32_t count);

static rom_function rom(char first, char second) {
    const rom_lookup lookup = (rom_lookup)(uintptr_t)ROM_HALF(0x18);
    return lookup(ROM_HALF(0x14), (uint32_t)second << 8 | (uint32_t)first);
}

static void flash_begin(void) {
    rom('I', 'F')(); // pins to the flash
    rom('E', 'X')(); // out of reading as memory
}

static void flash_end(void) {
    rom('F', 'C')(); // empty the cache
    rom('C', 'X')(); // back, by command 03h
}

const uint32_t *gonio_fw_board_store_page(struct fw_core *core, unsigned slot) {
    (void)core;
    return (const uint32_t *)(uintptr_t)(FLASH_BASE + STORE + slot * FLASH_SECTOR);
}

bool gonio_fw_board_store_erase(struct fw_core *core, unsigned slot) {
    gonio_fw_board_watchdog_start(core, ERASE_MS);
    flash_begin();
    ((rom_erase)rom('R', 'E'))(STORE + slot * FLASH_SECTOR, FLASH_SECTOR, FLASH_SECTOR, SECTOR_ERASE);
    flash_end();
    gonio_fw_board_watchdog_start(core, FW_WATCHDOG_MS);
    return cortex_m_erased(gonio_fw_board_store_page(core, slot));
}

// A page is programmed at a time: ones leave what is there.
bool gonio_fw_board_store_program(struct fw_core *core, unsigned slot, unsigned index, uint32_t word) {
    union {
        uint32_t words[FLASH_PAGE / 4];
        uint8_t bytes[FLASH_PAGE];
    } page;
    for (unsigned i = 0; i < FLASH_PAGE / 4; i++)
        page.words[i] = 0xFFFFFFFFu;
    page.words[index % (FLASH_PAGE / 4)] = word;
    gonio_fw_board_watchdog_feed(core);
    flash_begin();
    ((rom_program)rom('R', 'P'))(STORE + slot * FLASH_SECTOR + 4 * index / FLASH_PAGE * FLASH_PAGE, page.bytes,
                                 FLASH_PAGE);
    flash_end();
    return ((const volatile uint32_t *)gonio_fw_board_store_page(core, slot))[index] == word;
}

// ---- start ----

// Whether all of these bits come; bounded: a second at the most.
static bool come(const volatile uint32_t *reg, uint32_t bits) {
    for (uint32_t i = 0; i < 200000; i++)
        if ((*reg & bits) == bits)
            return true;
    return false;
}

// As after a reset, whoever ran before: the internal oscillator drives all, and the peripherals but for those of the
// flash are reset.
static void clock_reset(void) {
    CLK_REF_CTRL = REF_ROSC;
    come(&CLK_REF_SELECTED, 1 << REF_ROSC);
    CLK_SYS_CTRL = SYS_REF;
    come(&CLK_SYS_SELECTED, 1 << SYS_REF);
    SET_BITS(RESETS_RESET) = RESET_ALL & ~(RESET_IO_QSPI | RESET_PADS_QSPI | RESET_SYSCFG);
}

static bool release(uint32_t resets) {
    CLEAR_BITS(RESETS_RESET) = resets;
    return come(&RESETS_DONE, resets);
}

// Whether the crystal may be one of 12 MHz: measured with it, the internal oscillator has its 1 to 12 MHz (2.15.2.1.1),
// and a tenth more. That finds a crystal of less than half of it, but not one of twice as much; which is rare, since
// the boot ROM speaks USB with nothing but 12 MHz.
static bool crystal_fits(void) {
    FC0_REF_KHZ = CRYSTAL_MHZ * 1000;
    FC0_INTERVAL = 10; // 1 ms
    FC0_MIN_KHZ = 0;
    FC0_MAX_KHZ = 0x1FFFFFF;
    FC0_SRC = FC0_ROSC; // which begins
    const bool done = come(&FC0_STATUS, FC0_DONE);
    const uint32_t khz = FC0_RESULT >> 5;
    return done && khz >= 900 && khz <= 13200;
}

// From the crystal times `times` by the two dividers; the reference comes undivided.
static bool pll_start(uint32_t base, uint32_t times, uint32_t first, uint32_t second) {
    PLL_CS(base) = 1;
    PLL_FBDIV(base) = times;
    CLEAR_BITS(base + 4) = PLL_PD | PLL_VCOPD;
    if (!come(&PLL_CS(base), PLL_LOCK))
        return false;
    PLL_PRIM(base) = first << 16 | second << 12;
    CLEAR_BITS(base + 4) = PLL_POSTDIVPD;
    return true;
}

// 125 MHz from the crystal, and 48 MHz for the converter. False: it does not start, or is another one; the internal
// oscillator is too far off for a line's rate.
static bool clock_start(void) {
    XOSC_STARTUP = 512; // times 256 cycles: 11 ms
    XOSC_CTRL = XOSC_ON | XOSC_1_TO_15_MHZ;
    if (!come(&XOSC_STATUS, XOSC_STABLE))
        return false;
    CLK_REF_CTRL = REF_XOSC;
    if (!come(&CLK_REF_SELECTED, 1 << REF_XOSC) || !crystal_fits())
        return false;
    if (!release(RESET_PLL_SYS | RESET_PLL_USB) || !pll_start(PLL_SYS, 125, 6, 2) || !pll_start(PLL_USB, 100, 5, 5))
        return false;
    CLK_SYS_CTRL = SYS_AUX;
    CLK_PERI_CTRL = CLK_ON;
    CLK_ADC_CTRL = CLK_ON;
    WATCHDOG_TICK = TICK_ON | CRYSTAL_MHZ;
    return come(&CLK_SYS_SELECTED, 1 << SYS_AUX);
}

static void pins_start(void) {
    release(RESET_IO_BANK0 | RESET_PADS_BANK0);
    SIO_OUT_CLR = OUTPUTS;
    SIO_OE = OUTPUTS;
    for (unsigned pin = TRANSMIT; pin <= TRIGGER; pin++) {
        const bool line = pin <= RECEIVE;
        if (pin == LAMP)
            GPIO_CTRL(pin) = FUNCTION_PWM;
        else if (line || (OUTPUTS >> pin & 1) != 0 || (pin >= FIRST_INPUT && pin <= LAST_INPUT))
            GPIO_CTRL(pin) = line ? FUNCTION_UART : FUNCTION_SIO;
        if (pin == RECEIVE || (pin >= FIRST_INPUT && pin <= LAST_INPUT))
            PAD(pin) = PAD_INPUT | PAD_SCHMITT | PAD_PULL_UP;
    }
    PAD(PHOTODIODE) = PAD_OUTPUT_OFF;
    PAD(TEMPERATURE) = PAD_OUTPUT_OFF;
}

static void peripherals_start(void) {
    release(RESET_PWM | RESET_UART0 | RESET_ADC);
    PWM_TOP(LAMP_SLICE) = PWM_PERIOD - 1;
    PWM_CSR(LAMP_SLICE) = 1;
    ADC_CS = ADC_ON;
    PWM_INTE = 1 << STEP_SLICE;
    irq_enable(IRQ_PWM, PRIORITY_STEP);
}

void board_inputs_start(void) {
    for (unsigned pin = FIRST_INPUT; pin <= LAST_INPUT; pin++) {
        IO_INTR(pin / 8) = (uint32_t)IO_EDGES << 4 * (pin % 8);
        IO_INTE(pin / 8) |= (uint32_t)IO_EDGES << 4 * (pin % 8);
    }
    irq_enable(IRQ_IO_BANK0, PRIORITY_INPUTS);
}

// A supply that fell is told as power: the chip does not tell them apart.
enum fw_cause board_cause(void) {
    const uint32_t reason = WATCHDOG_REASON;
    if ((reason & REASON_TIMER) != 0)
        return FW_CAUSE_WATCHDOG;
    if ((reason & REASON_FORCE) != 0)
        return cortex_m_marked_cause();
    return (CHIP_RESET & CHIP_HAD_RUN) != 0 ? FW_CAUSE_PIN : FW_CAUSE_POWER;
}

void board_start(void) {
    clock_reset();
    pins_start(); // all off first
    while (!clock_start())
        for (;;) // everything stays off, and nobody answers
            __asm volatile("wfi");
    peripherals_start();
}

void board_turn(void) {}

__attribute__((section(".vectors"), used)) static const vector vectors[16 + IRQS] = {
    CORTEX_M_VECTORS,
    [16 + IRQ_PWM] = step_interrupt,
    [16 + IRQ_IO_BANK0] = input_interrupt,
    [16 + IRQ_UART0] = uart_interrupt,
};
