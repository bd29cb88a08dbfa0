// SPDX-License-Identifier: BSD-3-Clause
// An STM32F405 board with an 8 MHz crystal: 168 MHz Cortex-M4.
//
//     PC0-3 step   PC4-7 direction   PC8-11 motor on   PA6 lamp (PWM)   PA4 shutter   PA5 camera trigger
//     PB0-3 home switches   PB4-7 lower, PB8, 9, 12, 13 upper limit switches   PB14 emergency stop   PB15 door
//     PA9, PA10 USART 1   PA8 RS-485 driver on   PA0 photodiode   PA1 lamp temperature, 10 mV a degree
//
// Inputs have pull-ups and contacts open when active, so that a broken wire counts as active.
#include "firmware/board/cortex_m/step.h"
#include "firmware/board/stm32f405/stm32f405.h"
#include "firmware/contract/adc.h"
#include "firmware/contract/pin.h"
#include "firmware/contract/store.h"
#include "firmware/contract/tick.h"
#include "firmware/contract/uart.h"
#include "firmware/contract/watchdog.h"

enum { CLOCK_HZ = 168000000, BUS_HZ = 84000000, TICK_CYCLES = CLOCK_HZ / 1000000 };
enum { STEPS = 0x000F, DIRECTIONS = 0x00F0, MOTORS = 0x0F00, INPUTS = 0xF3FF, ESTOP = 1 << 14 };
enum { SHUTTER = 1 << 4, TRIGGER = 1 << 5, DRIVER = 1 << 8, PWM_PERIOD = 4200 }; // 20 kHz
static const struct step_timing timing = {.tick = TICK_CYCLES, .entry = 120, .near = 220, .leave = 36};
const uint16_t board_number = 3;
const uint32_t board_tick_cycles = TICK_CYCLES;

// ---- steps: TIM 2 counts half cycles once ----

INLINE void arm(uint32_t cycles) {
    TIM2_ARR = cycles / 2;
    TIM2_CNT = 0;
    TIM2_CR1 = 1 << 3 | 1 << 2 | 1; // one pulse; only an overflow interrupts
}

INLINE void put_steps(uint8_t edges) { GPIO_BSRR(GPIOC) = (edges & 15u) | (uint32_t)(edges >> 4u) << 16; }

static void step_interrupt(void) {
    TIM2_SR = 0;
    step_interrupt_with(timing, put_steps, arm);
}

void gonio_fw_board_step_arm(struct fw_core *core) { step_arm_with(core, timing, arm); }

void gonio_fw_board_halt_steps(struct fw_core *core) {
    (void)core;
    TIM2_CR1 = 0;
    GPIO_BSRR(GPIOC) = (uint32_t)STEPS << 16;
}

// ---- pins ----

// Set the bits of `mask` to those of `levels`, the others stay.
static void put(uint32_t base, uint32_t mask, uint32_t levels) {
    GPIO_BSRR(base) = (levels & mask) | (~levels & mask) << 16;
}

void gonio_fw_board_directions(struct fw_core *core, uint8_t levels) {
    (void)core;
    put(GPIOC, DIRECTIONS, (uint32_t)levels << 4);
}

void gonio_fw_board_motors(struct fw_core *core, uint8_t axes) {
    (void)core;
    put(GPIOC, MOTORS, (uint32_t)axes << 8);
}

uint16_t gonio_fw_board_inputs(struct fw_core *core) {
    (void)core;
    const uint32_t levels = GPIO_IDR(GPIOB) & INPUTS;
    return (uint16_t)((levels & 0x3FF) | levels >> 12 << 10);
}

static void input_interrupt(void) {
    const bool estop_changed = (EXTI_PR & ESTOP) != 0;
    EXTI_PR = INPUTS;
    cortex_m_inputs(estop_changed);
}

void gonio_fw_board_inputs_pend(struct fw_core *core) {
    (void)core;
    NVIC_ISPR(IRQ_EXTI15_10 / 32) = 1u << IRQ_EXTI15_10 % 32;
}

void gonio_fw_board_shutter(struct fw_core *core, bool open) {
    (void)core;
    put(GPIOA, SHUTTER, open ? SHUTTER : 0);
}

void gonio_fw_board_trigger(struct fw_core *core, bool high) {
    (void)core;
    put(GPIOA, TRIGGER, high ? TRIGGER : 0);
}

void gonio_fw_board_lamp(struct fw_core *core, uint16_t level) {
    (void)core;
    TIM3_CCR1 = (uint32_t)level * PWM_PERIOD / 10000;
}

// ---- line ----

void gonio_fw_board_uart_setup(struct fw_core *core, uint32_t baud) {
    (void)core;
    USART_BRR = (BUS_HZ + baud / 2) / baud;
    USART_CR1 = 1 << 13 | USART_RXNE | 1 << 3 | 1 << 2; // on, interrupt a byte, transmitter, receiver
    irq_enable(IRQ_USART1, PRIORITY_UART);
}

bool gonio_fw_board_uart_send(struct fw_core *core, uint8_t byte) {
    (void)core;
    if ((USART_SR & USART_TXE) == 0)
        return false;
    USART_DR = byte;
    return true;
}

bool gonio_fw_board_uart_sent(struct fw_core *core) {
    (void)core;
    return (USART_SR & USART_TC) != 0;
}

void gonio_fw_board_uart_drive(struct fw_core *core, bool on) {
    (void)core;
    put(GPIOA, DRIVER, on ? DRIVER : 0);
}

static void uart_interrupt(void) {
    while ((USART_SR & USART_RXNE) != 0)
        gonio_fw_modbus_receive(&fw_core, (uint8_t)USART_DR, gonio_fw_board_now(&fw_core));
}

// ---- watchdog: 32 kHz / 32 = about 1 kHz ----

void gonio_fw_board_watchdog_start(struct fw_core *core, uint32_t ms) {
    (void)core;
    IWDG_KR = IWDG_UNLOCK;
    IWDG_PR = 3;
    IWDG_RLR = ms;
    IWDG_KR = IWDG_START;
    IWDG_KR = IWDG_FEED;
}

void gonio_fw_board_watchdog_feed(struct fw_core *core) {
    (void)core;
    IWDG_KR = IWDG_FEED;
}

// ---- analogue: a conversion is started now and read the next time, so that nobody waits ----

static uint16_t convert(unsigned next) {
    static uint16_t reading[2];
    if ((ADC_SR & 2) != 0)
        reading[next ^ 1] = (uint16_t)(ADC_DR & 4095);
    ADC_SQR3 = next;
    ADC_CR2 = 1u << 30 | 1;
    return reading[next ^ 1];
}

uint16_t gonio_fw_board_photodiode(struct fw_core *core) {
    (void)core;
    const uint32_t raw = convert(1);
    return (uint16_t)(raw << 4 | raw >> 8);
}

int32_t gonio_fw_board_temperature(struct fw_core *core) {
    (void)core;
    const int32_t raw = convert(0), full_mv = 3300, full = 4095;
    if (raw == 0 || raw >= full - 12)
        return FW_NO_TEMPERATURE;
    return raw * (full_mv * 100) / full;
}

// ---- flash: the last two sectors; an erase takes up to 2 s, in which the processor stands ----

static const uint32_t store_address[FW_STORE_SLOTS] = {0x080C0000, 0x080E0000};
enum { STORE_SECTOR = 10, ERASE_MS = 4095 };
enum { CR_PROGRAM = 1, CR_ERASE = 2, CR_WORDS = 2 << 8, CR_START = 1 << 16, SR_BUSY = 1 << 16 };
#define CR_LOCK 0x80000000u

const uint32_t *gonio_fw_board_store_page(struct fw_core *core, unsigned slot) {
    (void)core;
    return (const uint32_t *)(uintptr_t)store_address[slot];
}

static void flash_begin(uint32_t mode) {
    FLASH_KEYR = 0x45670123;
    FLASH_KEYR = 0xCDEF89AB;
    FLASH_CR = mode | CR_WORDS;
}

static void flash_end(void) {
    while ((FLASH_SR & SR_BUSY) != 0) {
    }
    FLASH_CR = CR_LOCK;
}

bool gonio_fw_board_store_erase(struct fw_core *core, unsigned slot) {
    gonio_fw_board_watchdog_start(core, ERASE_MS);
    flash_begin(CR_ERASE | (STORE_SECTOR + slot) << 3);
    FLASH_CR |= CR_START;
    flash_end();
    gonio_fw_board_watchdog_start(core, FW_WATCHDOG_MS);
    const volatile uint32_t *page = gonio_fw_board_store_page(core, slot);
    for (unsigned i = 0; i < FW_STORE_WORDS; i++)
        if (page[i] != 0xFFFFFFFFu)
            return false;
    return true;
}

bool gonio_fw_board_store_program(struct fw_core *core, unsigned slot, unsigned index, uint32_t word) {
    (void)core;
    volatile uint32_t *at = (volatile uint32_t *)(uintptr_t)(store_address[slot] + 4 * index);
    flash_begin(CR_PROGRAM);
    *at = word;
    flash_end();
    return *at == word;
}

// ---- start ----

static bool wait_for(volatile uint32_t *at, uint32_t bit) {
    for (uint32_t i = 0; i < 100000; i++)
        if ((*at & bit) != 0)
            return true;
    return false;
}

// 168 MHz by the PLL from the crystal, or from the internal oscillator (1 % off) where the crystal does not start.
static void clock_start(void) {
    const uint32_t hse_on = 1u << 16, hse_ready = 1u << 17, pll_on = 1u << 24, pll_ready = 1u << 25;
    const uint32_t n_168 = 168u << 6, q_7 = 7u << 24, from_hse = 1u << 22;
    RCC_CR |= hse_on;
    const bool crystal = wait_for(&RCC_CR, hse_ready);
    RCC_PLLCFGR = q_7 | n_168 | (crystal ? from_hse | 4 : 8); // 2 MHz x 168 / 2
    FLASH_ACR = 1u << 10 | 1u << 9 | 1u << 8 | 5;             // caches, prefetch, 5 wait states (RM0090 table 10)
    RCC_CFGR = 5u << 10 | 4u << 13;                           // APB1 / 4, APB2 / 2
    RCC_CR |= pll_on;
    if (wait_for(&RCC_CR, pll_ready))
        RCC_CFGR |= 2;
}

static void pins_start(void) {
    GPIO_BSRR(GPIOC) = (uint32_t)(STEPS | DIRECTIONS | MOTORS) << 16;
    GPIO_MODER(GPIOC) = 0x00555555;
    GPIO_BSRR(GPIOA) = (uint32_t)(SHUTTER | TRIGGER | DRIVER) << 16;
    // PA0, 1 analogue; 4, 5, 8 outputs; 6 TIM 3; 9, 10 USART 1; 13, 14 stay the debugger's
    GPIO_MODER(GPIOA) = 2u << 28 | 2u << 26 | 2u << 20 | 2u << 18 | 1u << 16 | 2u << 12 | 1u << 10 | 1u << 8 | 15;
    GPIO_AFRL(GPIOA) = 2u << 24;
    GPIO_AFRH(GPIOA) = 7u << 4 | 7u << 8;
    GPIO_MODER(GPIOB) = 0;
    GPIO_PUPDR(GPIOB) = 0x55055555;
}

void board_inputs_start(void) {
    for (unsigned i = 0; i < 4; i++)
        SYSCFG_EXTICR(i) = 0x1111; // port B
    EXTI_RTSR = INPUTS | 1u << 16; // and the supply
    EXTI_FTSR = INPUTS;
    EXTI_PR = INPUTS;
    EXTI_IMR = INPUTS | 1u << 16;
    for (unsigned irq = IRQ_EXTI0; irq < IRQ_EXTI0 + 5; irq++)
        irq_enable(irq, PRIORITY_INPUTS);
    irq_enable(IRQ_EXTI9_5, PRIORITY_INPUTS);
    irq_enable(IRQ_EXTI15_10, PRIORITY_INPUTS);
}

// The supply falls below 2.9 V (RM0090 5.2.3): safe while there is still some, then anew.
static void supply_interrupt(void) {
    gonio_fw_interlock_fault(&fw_core);
    cortex_m_reset(FW_CAUSE_BROWN_OUT, 0);
}

static void peripherals_start(void) {
    RCC_AHB1ENR |= 7;                            // GPIO A to C
    RCC_APB1ENR |= 1u << 28 | 1u << 1 | 1u << 0; // PWR, TIM 3, TIM 2
    RCC_APB2ENR |= 1u << 14 | 1u << 8 | 1u << 4; // SYSCFG, ADC 1, USART 1
    (void)RCC_APB2ENR;
    pins_start();
    TIM3_ARR = PWM_PERIOD - 1;
    TIM3_CCMR1 = 6 << 4 | 1 << 3; // PWM mode 1, preloaded
    TIM3_CCER = 1;
    TIM3_CR1 = 1;
    ADC_CR2 = 1;
    TIM2_DIER = 1;
    irq_enable(IRQ_TIM2, PRIORITY_STEP);
    PWR_CR = 7u << 5 | 1u << 4;
    irq_enable(IRQ_PVD, PRIORITY_INPUTS);
}

enum fw_cause board_cause(void) {
    const uint32_t csr = RCC_CSR;
    const enum fw_cause marked = cortex_m_marked_cause();
    RCC_CSR = CSR_CLEAR;
    if ((csr & CSR_POR) != 0)
        return FW_CAUSE_POWER;
    if ((csr & CSR_BOR) != 0)
        return FW_CAUSE_BROWN_OUT;
    if ((csr & CSR_IWDG) != 0)
        return FW_CAUSE_WATCHDOG;
    // Every reset pulls the pin; alone it is the pin itself, unless a mark tells more.
    if (csr >> 25 == CSR_PIN >> 25 && marked == FW_CAUSE_WATCHDOG)
        return FW_CAUSE_PIN;
    return marked;
}

void board_start(void) {
    clock_start();
    peripherals_start();
}

void board_turn(void) {}

__attribute__((section(".vectors"), used)) static const vector vectors[16 + IRQS] = {
    CORTEX_M_VECTORS,
    [16 + IRQ_PVD] = supply_interrupt,
    [16 + IRQ_EXTI0] = input_interrupt,
    [16 + IRQ_EXTI0 + 1] = input_interrupt,
    [16 + IRQ_EXTI0 + 2] = input_interrupt,
    [16 + IRQ_EXTI0 + 3] = input_interrupt,
    [16 + IRQ_EXTI0 + 4] = input_interrupt,
    [16 + IRQ_EXTI9_5] = input_interrupt,
    [16 + IRQ_EXTI15_10] = input_interrupt,
    [16 + IRQ_TIM2] = step_interrupt,
    [16 + IRQ_USART1] = uart_interrupt,
};
