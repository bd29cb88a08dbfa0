// SPDX-License-Identifier: BSD-3-Clause
// The lm3s6965evb: 50 MHz Cortex-M3.
//
//     PB0-3 step   PC4-7 direction   PE0-3 motor on   PF0 lamp (PWM)   PG0 shutter   PG1 camera trigger
//     PA2-5 home switches   PD0-3 lower, PD4-7 upper limit switches   PF2 emergency stop   PF3 door
//     PA0, PA1 UART 0   PA6 RS-485 driver on   ADC0 photodiode   ADC1 lamp temperature, 10 mV a degree
//
// Inputs have pull-ups and contacts open when active, so that a broken wire counts as active.
#include "firmware/board/cortex_m/step.h"
#include "firmware/board/lm3s6965evb/lm3s6965.h"
#include "firmware/board/lm3s6965evb/trace.h"
#include "firmware/contract/adc.h"
#include "firmware/contract/pin.h"
#include "firmware/contract/store.h"
#include "firmware/contract/tick.h"
#include "firmware/contract/uart.h"
#include "firmware/contract/watchdog.h"

enum { CLOCK_HZ = 50000000, TICK_CYCLES = CLOCK_HZ / 1000000 };
enum { STEPS = 0x0F, DIRECTIONS = 0xF0, MOTORS = 0x0F, HOMES = 0x3C, DRIVER = 0x40, STOPS = 0x0C, ESTOP = 0x04 };
enum { SHUTTER = 1, TRIGGER = 2, PWM_PERIOD = 2500 }; // 20 kHz
static const struct step_timing timing = {.tick = TICK_CYCLES, .entry = 100, .near = 124, .leave = 68};
const uint16_t board_number = FW_BOARD_lm3s6965evb;
const uint32_t board_tick_cycles = TICK_CYCLES;

// ---- steps ----

INLINE void arm(uint32_t cycles) {
    TIMER0_TAILR = cycles;
    TIMER0_CTL = 1;
}

INLINE void put(uint8_t edges) {
    const uint32_t up = edges & 15u, down = edges >> 4u;
    volatile uint32_t *port = (volatile uint32_t *)GPIOB;
    __asm("" : "+r"(port)); // in a register, with the mask as its index: the compiler would work the address out
    port[up | down] = up;
    trace_edges(edges);
}

static void step_interrupt(void) {
    TIMER0_ICR = 1;
    step_interrupt_with(timing, put, arm);
}

void gonio_fw_board_step_arm(struct fw_core *core) { step_arm_with(core, timing, arm); }

void gonio_fw_board_halt_steps(struct fw_core *core) {
    (void)core;
    TIMER0_CTL = 0;
    GPIO_DATA(GPIOB, STEPS) = 0;
}

// ---- pins ----

void gonio_fw_board_directions(struct fw_core *core, uint8_t levels) {
    (void)core;
    GPIO_DATA(GPIOC, DIRECTIONS) = (uint32_t)levels << 4;
}

void gonio_fw_board_motors(struct fw_core *core, uint8_t levels) {
    (void)core;
    GPIO_DATA(GPIOE, MOTORS) = levels;
}

uint16_t gonio_fw_board_inputs(struct fw_core *core) {
    (void)core;
    const uint32_t homes = GPIO_DATA(GPIOA, HOMES) >> 2, limits = GPIO_DATA(GPIOD, 0xFF),
                   stops = GPIO_DATA(GPIOF, STOPS) >> 2;
    return (uint16_t)(homes | limits << FW_CONTACT_limit_min_0 | stops << FW_CONTACT_estop);
}

void gonio_fw_board_inputs_pend(struct fw_core *core) {
    (void)core;
    NVIC_ISPR(0) = 1u << IRQ_GPIOA;
}

static void input_interrupt(void) {
    const bool estop_changed = (GPIO_MIS(GPIOF) & ESTOP) != 0;
    GPIO_ICR(GPIOA) = HOMES;
    GPIO_ICR(GPIOD) = 0xFF;
    GPIO_ICR(GPIOF) = STOPS;
    cortex_m_inputs(estop_changed);
}

void gonio_fw_board_shutter(struct fw_core *core, bool open) {
    (void)core;
    GPIO_DATA(GPIOG, SHUTTER) = open ? SHUTTER : 0;
}

void gonio_fw_board_trigger(struct fw_core *core, bool high) {
    (void)core;
    GPIO_DATA(GPIOG, TRIGGER) = high ? TRIGGER : 0;
}

void gonio_fw_board_lamp(struct fw_core *core, uint16_t level) {
    (void)core;
    // Counting down from LOAD, high from CMPA on; 0 takes the output away altogether.
    PWM0_CMPA = level >= 10000 ? PWM_PERIOD - 1 : (uint32_t)level * PWM_PERIOD / 10000;
    PWM_ENABLE = level > 0;
}

// ---- line ----

void gonio_fw_board_uart_setup(struct fw_core *core, uint32_t baud) {
    (void)core;
    const uint32_t divisor = (CLOCK_HZ / 16 * 64 + baud / 2) / baud; // 6 fraction bits
    UART0_CTL = 0;
    UART0_IBRD = divisor >> 6;
    UART0_FBRD = divisor & 63;
    UART0_LCRH = 0x60; // 8 bits, no FIFO: each byte's time counts
    UART0_IM = UART_RX;
    UART0_CTL = 0x301;
    irq_enable(IRQ_UART0, PRIORITY_UART);
}

bool gonio_fw_board_uart_send(struct fw_core *core, uint8_t byte) {
    (void)core;
    if ((UART0_FR & UART_FR_TXFF) != 0)
        return false;
    UART0_DR = byte;
    return true;
}

bool gonio_fw_board_uart_sent(struct fw_core *core) {
    (void)core;
    return (UART0_FR & UART_FR_BUSY) == 0;
}

void gonio_fw_board_uart_drive(struct fw_core *core, bool on) {
    (void)core;
    GPIO_DATA(GPIOA, DRIVER) = on ? DRIVER : 0;
}

static void uart_interrupt(void) {
    UART0_ICR = UART_RX;
    while ((UART0_FR & UART_FR_RXFE) == 0)
        gonio_fw_modbus_receive(&fw_core, (uint8_t)UART0_DR, gonio_fw_board_now(&fw_core));
}

// ---- watchdog: its first time-out asks for an interrupt nobody serves, its second resets ----

void gonio_fw_board_watchdog_start(struct fw_core *core, uint32_t ms) {
    (void)core;
    WDT_LOCK = WDT_UNLOCK;
    WDT_LOAD = CLOCK_HZ / 1000 * ms / 2;
    WDT_CTL = 3;
}

void gonio_fw_board_watchdog_feed(struct fw_core *core) {
    (void)core;
    WDT_ICR = 1; // clears the first time-out and reloads
}

// ---- analogue: a conversion is started now and read the next time, so that nobody waits ----

static uint16_t convert(unsigned next) {
    static uint16_t reading[2];
    while ((ADC_SSFSTAT3 & ADC_EMPTY) == 0)
        reading[next ^ 1] = (uint16_t)(ADC_SSFIFO3 & 1023);
    ADC_ACTSS = 0;
    ADC_SSMUX3 = next;
    ADC_ACTSS = ADC_SEQUENCER_3;
    ADC_PSSI = ADC_SEQUENCER_3;
    return reading[next ^ 1];
}

uint16_t gonio_fw_board_photodiode(struct fw_core *core) {
    (void)core;
    const uint32_t raw = convert(1);
    return (uint16_t)(raw << 6 | raw >> 4);
}

int32_t gonio_fw_board_temperature(struct fw_core *core) {
    (void)core;
    const int32_t raw = convert(0), full_mv = 3000, full = 1023;
    if (raw == 0 || raw >= full - 3)
        return FW_NO_TEMPERATURE;
    return raw * (full_mv * 100) / full;
}

// ---- flash ----

#define STORE ((const uint32_t *)0x0003F800)

const uint32_t *gonio_fw_board_store_page(struct fw_core *core, unsigned slot) {
    (void)core;
    return STORE + slot * FW_STORE_WORDS;
}

static bool flash(const uint32_t *at, uint32_t word, uint32_t operation) {
    FLASH_FMA = (uint32_t)(uintptr_t)at;
    FLASH_FMD = word;
    FLASH_FMC = FMC_KEY | operation;
    while ((FLASH_FMC & operation) != 0) {
    }
    return true;
}

bool gonio_fw_board_store_erase(struct fw_core *core, unsigned slot) {
    const uint32_t *page = gonio_fw_board_store_page(core, slot);
    flash(page, 0, FMC_ERASE);
    return cortex_m_erased(page);
}

bool gonio_fw_board_store_program(struct fw_core *core, unsigned slot, unsigned index, uint32_t word) {
    const uint32_t *at = gonio_fw_board_store_page(core, slot) + index;
    flash(at, word, FMC_WRITE);
    return *(const volatile uint32_t *)at == word;
}

// ---- start ----

// 50 MHz from the 8 MHz crystal by the PLL (data sheet, "Initialization and Configuration" of System Control).
static void clock_start(void) {
    enum { PLL_LOCKED = 1 << 6 };
    const uint32_t bypass = 1u << 11, divide = 1u << 22, power_down = 1u << 13;
    uint32_t rcc = (SYSCTL_RCC | bypass) & ~divide;
    SYSCTL_RCC = rcc;
    rcc = (rcc & ~(0xFu << 6 | 3u << 4 | power_down | 1u)) | 0xEu << 6;
    SYSCTL_RCC = rcc;
    rcc = (rcc & ~(0xFu << 23)) | 3u << 23 | divide;
    SYSCTL_RCC = rcc;
    while ((SYSCTL_RIS & PLL_LOCKED) == 0) {
    }
    SYSCTL_RCC = rcc & ~bypass;
    SYSCTL_USECRL = CLOCK_HZ / 1000000 - 1;
    SYSCTL_PBORCTL = 2; // a brown-out resets
}

static void output(uint32_t base, uint32_t pins) {
    GPIO_DATA(base, pins) = 0;
    GPIO_DIR(base) |= pins;
    GPIO_DEN(base) |= pins;
}

static void input(uint32_t base, uint32_t pins, unsigned irq) {
    GPIO_PUR(base) |= pins;
    GPIO_DEN(base) |= pins;
    GPIO_IBE(base) |= pins;
    GPIO_ICR(base) = pins;
    GPIO_IM(base) |= pins;
    irq_enable(irq, PRIORITY_INPUTS);
}

static void peripherals_start(void) {
    SYSCTL_RCGC0 |= 1u << 20 | 1u << 16 | 1u << 3; // PWM, ADC, watchdog
    SYSCTL_RCGC1 |= 1u << 16 | 1u << 0;            // timer 0, UART 0
    SYSCTL_RCGC2 |= 0x7F;                          // GPIO A to G
    (void)SYSCTL_RCGC2;                            // the clocks need a few cycles
    (void)SYSCTL_RCGC2;
    output(GPIOB, STEPS);
    output(GPIOC, DIRECTIONS);
    output(GPIOE, MOTORS);
    output(GPIOG, SHUTTER | TRIGGER);
    output(GPIOA, DRIVER);
    GPIO_AFSEL(GPIOA) |= 3;
    GPIO_DEN(GPIOA) |= 3;
    GPIO_AFSEL(GPIOF) |= 1;
    GPIO_DEN(GPIOF) |= 1;
    PWM0_LOAD = PWM_PERIOD - 1;
    PWM0_GENA = 0xC8; // low at LOAD, high at CMPA down
    PWM0_CTL = 1;
    ADC_EMUX = 0;
    ADC_SSCTL3 = ADC_LAST;
    TIMER0_CFG = 0;  // 32 bits
    TIMER0_TAMR = 1; // one shot
    TIMER0_IMR = 1;
    irq_enable(IRQ_TIMER0A, PRIORITY_STEP);
}

void board_inputs_start(void) {
    input(GPIOA, HOMES, IRQ_GPIOA);
    input(GPIOD, 0xFF, IRQ_GPIOD);
    input(GPIOF, STOPS, IRQ_GPIOF);
}

// The register tells most causes; where it is silent (an emulator), or a fault ended in a software reset, the mark
// does.
enum fw_cause board_cause(void) {
    const uint32_t resc = SYSCTL_RESC;
    const enum fw_cause marked = cortex_m_marked_cause();
    SYSCTL_RESC = 0;
    if ((resc & RESC_POR) != 0)
        return FW_CAUSE_POWER;
    if ((resc & RESC_BOR) != 0)
        return FW_CAUSE_BROWN_OUT;
    if ((resc & RESC_WDT) != 0)
        return FW_CAUSE_WATCHDOG;
    if ((resc & RESC_EXT) != 0)
        return FW_CAUSE_PIN;
    return marked;
}

void board_start(void) {
    clock_start();
    peripherals_start();
}

void board_turn(void) { trace_poll(); }

void board_reset(void) { SCB_AIRCR = AIRCR_RESET; }

__attribute__((section(".vectors"), used)) static const vector vectors[16 + IRQS] = {
    CORTEX_M_VECTORS,
    [16 + IRQ_GPIOA] = input_interrupt,
    [16 + IRQ_GPIOD] = input_interrupt,
    [16 + IRQ_GPIOF] = input_interrupt,
    [16 + IRQ_UART0] = uart_interrupt,
    [16 + IRQ_TIMER0A] = step_interrupt,
};
