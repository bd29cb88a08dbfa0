// SPDX-License-Identifier: BSD-3-Clause
// What the STM32F4 boards share, all but what stm32f4.h asks of them: 168 MHz from 8 MHz, and the pins.
//
//     PC0-3 step   PC4-7 direction   PC8-11 motor on   PA6 lamp (PWM)   PA4 shutter   PA5 camera trigger
//     PB0, 1, 10, 3 home switches   PB4-7 lower, PB8, 9, 12, 13 upper limit switches   PB14 emergency stop   PB15 door
//     PA9, PA10 USART 1   PA8 RS-485 driver on   PA0 photodiode   PA1 lamp temperature, 10 mV a degree
//
// Sections are those of RM0090, the STM32F405's manual; RM0390, the STM32F446's, has the same registers. Inputs have
// pull-ups and contacts open when active, so that a broken wire counts as active. PB2 is BOOT1, which boards pull down:
// it stays free.
#include "firmware/board/stm32f4/stm32f4.h"

#include "firmware/board/cortex_m/step.h"
#include "firmware/contract/adc.h"
#include "firmware/contract/pin.h"
#include "firmware/contract/store.h"
#include "firmware/contract/tick.h"
#include "firmware/contract/uart.h"
#include "firmware/contract/watchdog.h"

enum { CLOCK_HZ = 168000000, TICK_CYCLES = CLOCK_HZ / 1000000 };
enum { STEPS = 0x000F, DIRECTIONS = 0x00F0, MOTORS = 0x0F00, INPUTS = 0xF7FB, HOME_2 = 1 << 10, ESTOP = 1 << 14 };
enum { SHUTTER = 1 << 4, TRIGGER = 1 << 5, DRIVER = 1 << 8, PWM_PERIOD = 4200 }; // 20 kHz
enum { BRAKE_0 = 1 << 7, BRAKE_1 = 1 << 11, BRAKE_2 = 1 << 12, BRAKE_3 = 1 << 15 };
enum { BRAKES = BRAKE_0 | BRAKE_1 | BRAKE_2 | BRAKE_3 };
static const struct step_timing timing = {.tick = TICK_CYCLES, .entry = 120, .near = 220, .leave = 36};
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

void gonio_fw_board_motors(struct fw_core *core, uint8_t levels) {
    (void)core;
    put(GPIOC, MOTORS, (uint32_t)levels << 8);
    put(GPIOA, BRAKES,
        ((levels & 1 << 4) != 0 ? BRAKE_0 : 0) | ((levels & 1 << 5) != 0 ? BRAKE_1 : 0) |
            ((levels & 1 << 6) != 0 ? BRAKE_2 : 0) | ((levels & 1 << 7) != 0 ? BRAKE_3 : 0));
}

uint16_t gonio_fw_board_inputs(struct fw_core *core) {
    (void)core;
    const uint32_t levels = GPIO_IDR(GPIOB) & INPUTS;
    return (uint16_t)((levels & 0x3FB) | (levels & HOME_2) >> 8 | levels >> 12 << 10);
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

static struct stm32f4_line line;

void gonio_fw_board_uart_setup(struct fw_core *core, uint32_t baud) {
    (void)core;
    USART_BRR(line.usart) = (line.bus_hz + baud / 2) / baud;
    USART_CR1(line.usart) = 1 << 13 | USART_RXNE | 1 << 3 | 1 << 2; // on, interrupt a byte, transmitter, receiver
    irq_enable(line.irq, PRIORITY_UART);
}

bool gonio_fw_board_uart_send(struct fw_core *core, uint8_t byte) {
    (void)core;
    if ((USART_SR(line.usart) & USART_TXE) == 0)
        return false;
    USART_DR(line.usart) = byte;
    return true;
}

bool gonio_fw_board_uart_sent(struct fw_core *core) {
    (void)core;
    return (USART_SR(line.usart) & USART_TC) != 0;
}

void gonio_fw_board_uart_drive(struct fw_core *core, bool on) {
    (void)core;
    put(GPIOA, DRIVER, on ? DRIVER : 0);
}

// An overrun interrupts as well, and only reading the data after the status ends it (RM0090 30.3.3); its data is good.
static void uart_interrupt(void) {
    while ((USART_SR(line.usart) & (USART_RXNE | USART_ORE)) != 0)
        gonio_fw_modbus_receive(&fw_core, (uint8_t)USART_DR(line.usart), gonio_fw_board_now(&fw_core));
}

// ---- watchdog: 32 kHz / 32 = about 1 kHz ----

// Five cycles of 32 kHz; bounded, should that oscillator be dead.
static void watchdog_settled(void) {
    for (uint32_t i = 0; i < 100000 && (IWDG_SR & 3) != 0; i++) {
    }
}

void gonio_fw_board_watchdog_start(struct fw_core *core, uint32_t ms) {
    (void)core;
    IWDG_KR = IWDG_START; // and with it the oscillator by which the registers are taken over
    IWDG_KR = IWDG_UNLOCK;
    IWDG_PR = 3;
    IWDG_RLR = ms;
    watchdog_settled(); // a feed before that reloads the old value, the next write is lost (21.4.4)
    IWDG_KR = IWDG_FEED;
}

void gonio_fw_board_watchdog_feed(struct fw_core *core) {
    (void)core;
    IWDG_KR = IWDG_FEED;
}

// ---- analogue: the temperature is converted from one millisecond to the next, the photodiode at once ----

enum { PHOTODIODE, TEMPERATURE, ADC_EOC = 2, ADC_ON = 1, ADC_START = 1 << 30 };

// Channel 1's pin: analogue, or for a moment pulled down (in analogue mode there is no pull, 8.3.12). A sensor drives
// it back to its voltage in no time; an open wire stays where it was pulled, and reads as broken.
static void pull_sensor_down(bool on) {
    GPIO_PUPDR(GPIOA) = (GPIO_PUPDR(GPIOA) & ~(3u << 2)) | (on ? 2u << 2 : 0);
    GPIO_MODER(GPIOA) = (GPIO_MODER(GPIOA) & ~(3u << 2)) | (on ? 0 : 3u << 2);
}

static void start_conversion(unsigned channel) {
    ADC_SR = 0;
    ADC_SQR3 = channel;
    ADC_CR2 = ADC_START | ADC_ON;
}

int32_t gonio_fw_board_temperature(struct fw_core *core) {
    (void)core;
    static uint32_t raw;
    const int32_t full_mv = 3300, full = 4095;
    const bool ended = (ADC_SR & ADC_EOC) != 0; // begun a millisecond ago
    if (ended)
        raw = ADC_DR & 4095;
    pull_sensor_down(true);
    start_conversion(PHOTODIODE);
    // 0.3 degC and less is no lamp, and what is left of the pull on an open wire.
    return !ended || raw <= 4 || raw >= (uint32_t)full - 12 ? FW_NO_TEMPERATURE : (int32_t)raw * (full_mv * 100) / full;
}

uint16_t gonio_fw_board_photodiode(struct fw_core *core) {
    (void)core;
    static uint32_t raw;
    uint32_t turns = 0; // 96 cycles of 21 MHz: 5 us
    while ((ADC_SR & ADC_EOC) == 0 && turns < 200)
        turns++;
    if (turns < 200)
        raw = ADC_DR & 4095;
    pull_sensor_down(false);
    start_conversion(TEMPERATURE);
    return (uint16_t)(raw << 4 | raw >> 8);
}

// ---- flash: sectors 3 (16 KiB) and 4 (64 KiB), behind the program, which parts of 512 KiB have as well; an erase
// takes up to 2 s, in which the processor stands ----

static const uint32_t store_address[FW_STORE_SLOTS] = {0x0800C000, 0x08010000};
enum { STORE_SECTOR = 3, ERASE_MS = 4095 };
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
    // The caches may still hold what was erased; they are emptied while they are off (3.9.1).
    FLASH_ACR &= ~(uint32_t)ACR_CACHES;
    FLASH_ACR |= ACR_RESET_CACHES;
    FLASH_ACR &= ~(uint32_t)ACR_RESET_CACHES;
    FLASH_ACR |= ACR_CACHES;
    gonio_fw_board_watchdog_start(core, FW_WATCHDOG_MS);
    return cortex_m_erased(gonio_fw_board_store_page(core, slot));
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

enum { FLASH_START = 0x08000000 };
enum { HSI_ON = 1 << 0, HSI_READY = 1 << 1, HSE_READY = 1 << 17, PLL_ON = 1 << 24, PLL_READY = 1 << 25 };

// Whether a bit of a register comes; bounded.
#define WAIT_FOR(name, reg, bit)                                                                                       \
    static bool name(void) {                                                                                           \
        for (uint32_t i = 0; i < 100000; i++)                                                                          \
            if (((reg) & (uint32_t)(bit)) != 0)                                                                        \
                return true;                                                                                           \
        return false;                                                                                                  \
    }
WAIT_FOR(internal_ready, RCC_CR, HSI_READY)
WAIT_FOR(crystal_ready, RCC_CR, HSE_READY)
WAIT_FOR(pll_ready, RCC_CR, PLL_READY)
WAIT_FOR(edge_captured, TIM11_SR, 1 << 1)

// As after a reset, whoever ran before (7.3): a boot loader leaves its clock and its vectors.
static void clock_reset(void) {
    RCC_CR |= HSI_ON;
    internal_ready();
    RCC_CFGR = 0;
    for (uint32_t i = 0; i < 100000 && (RCC_CFGR & 12) != 0; i++) { // the internal oscillator drives
    }
    RCC_CR &= 0xFF | HSE_BYPASS; // crystal, PLL and clock security off, the oscillator's trim stays
    RCC_CR &= 0xFF;              // and then the bypass, which cannot be written before (7.3.1)
    RCC_CIR = 0;
    SCB_VTOR = FLASH_START;
}

// TIM 11 captures each eighth edge of HSE_RTC, which is the crystal over RTCPRE.
enum { RTCPRE = 31, EDGES = 8, CAPTURES = 4, HSI_MHZ = 16, CRYSTAL_MHZ = 8 };

// Ticks of the internal oscillator in four such captures, 1984 at 8 MHz; 0: there are no edges.
static uint32_t crystal_ticks(void) {
    enum { REMAP_HSE_RTC = 2, EACH_EIGHTH = 3 << 2, DIRECT = 1 };
    RCC_CFGR = (uint32_t)RTCPRE << 16;
    TIM11_OR = REMAP_HSE_RTC;
    TIM11_CCMR1 = EACH_EIGHTH | DIRECT;
    TIM11_CCER = 1;
    TIM11_CR1 = 1;
    uint32_t first = 0, at = 0;
    for (unsigned i = 0; i <= CAPTURES; i++) {
        if (!edge_captured())
            return 0;
        at = TIM11_CCR1; // reading it clears the flag
        first = i == 0 ? at : first;
    }
    TIM11_CR1 = 0;
    return (at - first) & 0xFFFF;
}

// Whether the crystal is one of 8 MHz: the internal oscillator is within 4 % from -10 to 85 degC (data sheet), so 6 %
// are let pass; the next usual crystals are 7.37 and 10 MHz.
static bool crystal_fits(void) {
    const uint32_t expected = HSI_MHZ * RTCPRE * EDGES * CAPTURES / CRYSTAL_MHZ, ticks = crystal_ticks();
    return 100 * ticks >= 94 * expected && 100 * ticks <= 106 * expected;
}

// 168 MHz by the PLL from the crystal, or from the internal oscillator (1 % off) where the crystal does not start.
// False: the crystal is another one.
static bool clock_start(void) {
    const uint32_t n_168 = 168u << 6, q_7 = 7u << 24, from_hse = 1u << 22;
    clock_reset();
    PWR_CR |= stm32f4_voltage; // above 144 MHz (5.4.1); taken while the PLL is off
    RCC_CR |= stm32f4_crystal & HSE_BYPASS;
    RCC_CR |= stm32f4_crystal;
    const bool crystal = crystal_ready();
    if (crystal && !crystal_fits())
        return false;
    RCC_PLLCFGR = q_7 | n_168 | (crystal ? from_hse | 4 : 8); // 2 MHz x 168 / 2
    FLASH_ACR = ACR_CACHES | 1u << 8 | 5;                     // caches, prefetch, 5 wait states (RM0090 table 10)
    RCC_CFGR = 5u << 10 | 4u << 13;                           // APB1 / 4, APB2 / 2
    RCC_CR |= PLL_ON;
    if (pll_ready())
        RCC_CFGR |= 2;
    return true;
}

// Another crystal: everything stays off, and nobody answers. A test comes back from it.
#ifndef REFUSE
#define REFUSE() __asm volatile("wfi")
#endif
static void refuse(void) {
    for (;;)
        REFUSE();
}

static void pins_start(void) {
    GPIO_BSRR(GPIOC) = (uint32_t)(STEPS | DIRECTIONS | MOTORS) << 16;
    GPIO_MODER(GPIOC) = 0x00555555;
    GPIO_BSRR(GPIOA) = (uint32_t)(SHUTTER | TRIGGER | DRIVER | BRAKES) << 16;
    // PA0, 1 analogue; 4, 5, 7, 8, 11, 12, 15 outputs; 6 TIM 3; 9, 10 USART 1; 13, 14 stay the debugger's
    GPIO_MODER(GPIOA) = 1u << 30 | 1u << 24 | 1u << 22 | 1u << 14 | 2u << 28 | 2u << 26 | 2u << 20 | 2u << 18 |
                        1u << 16 | 2u << 12 | 1u << 10 | 1u << 8 | 15;
    GPIO_AFRL(GPIOA) = 2u << 24;
    GPIO_AFRH(GPIOA) = 7u << 4 | 7u << 8;
    GPIO_MODER(GPIOB) = 0;
    GPIO_PUPDR(GPIOB) = 0x55155545; // all but PB2 and PB11
}

// The supply falls below 2.9 V (RM0090 5.2.3): safe while there is still some, then anew.
static void supply_interrupt(void) {
    gonio_fw_interlock_fault(&fw_core);
    cortex_m_reset(FW_CAUSE_BROWN_OUT, 0);
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
    if ((PWR_CSR & PWR_PVDO) != 0) // low already: no edge will tell
        supply_interrupt();
}

static void peripherals_start(void) {
    RCC_APB1ENR |= 1u << 17 | 1u << 1 | 1u << 0; // USART 2, TIM 3, TIM 2
    RCC_APB2ENR |= 1u << 14 | 1u << 8 | 1u << 4; // SYSCFG, ADC 1, USART 1
    (void)RCC_APB2ENR;
    line = stm32f4_line();
    TIM3_ARR = PWM_PERIOD - 1;
    TIM3_CCMR1 = 6 << 4 | 1 << 3; // PWM mode 1, preloaded
    TIM3_CCER = 1;
    TIM3_CR1 = 1;
    ADC_CCR = 1u << 16;       // 84 MHz / 4; 36 MHz are the most (data sheet)
    ADC_SMPR2 = 7u << 3 | 4u; // 480 cycles for the sensor, 84 for the photodiode
    ADC_CR2 = ADC_ON;
    TIM2_DIER = 1;
    irq_enable(IRQ_TIM2, PRIORITY_STEP);
    PWR_CR |= PWR_PLS_2V9 | PWR_PVDE;
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
    RCC_AHB1ENR |= 7;        // GPIO A to C
    RCC_APB1ENR |= 1u << 28; // PWR
    RCC_APB2ENR |= 1u << 18; // TIM 11
    (void)RCC_APB2ENR;       // the clocks need a few cycles
    pins_start();            // all off first
    if (!clock_start())
        refuse(); // no time and no line rate would be right
    peripherals_start();
}

void board_turn(void) {}

void board_reset(void) { SCB_AIRCR = AIRCR_RESET; }

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
    [16 + IRQ_USART2] = uart_interrupt,
};
