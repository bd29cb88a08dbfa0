// SPDX-License-Identifier: BSD-3-Clause
// A board of the STM32F4 family on a model of its registers: what the reference manual (RM0090, RM0390) asks for and an
// emulator does not look at. Each access of the board's code goes through access_to, which first sees what the access
// before has written. A test defines BOARD_C, VOLTAGE (of PWR_CR), CLOCKED (8 MHz come as a clock, not from a crystal)
// and STRAPPED (a pin of port C chooses the line; 0: there is no choice), and includes this.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include <cmocka.h>

static volatile uint32_t *access_to(uint32_t address);
static jmp_buf out_of_it;
enum { REFUSED = 1, RESET, HUNG };
#define REG32(address) (*access_to((uint32_t)(address)))
#define REFUSE() longjmp(out_of_it, REFUSED)
#include "firmware/board/stm32f4/stm32f4.c"
#include BOARD_C

// ---- what the board takes from the Cortex-M ----

struct fw_core fw_core;
uint32_t link_stack_top;
void cortex_m_start(void) {}
void cortex_m_fault(void) {}
void cortex_m_wrap(void) {}
void cortex_m_produce(void) {}
enum fw_cause cortex_m_marked_cause(void) { return FW_CAUSE_WATCHDOG; }
void cortex_m_inputs(bool estop_changed) { (void)estop_changed; }
void cortex_m_reset(enum fw_cause cause, uint32_t address) {
    (void)address;
    longjmp(out_of_it, cause == FW_CAUSE_BROWN_OUT ? RESET : HUNG);
}
uint32_t gonio_fw_board_now(struct fw_core *core) { return core != NULL ? 0 : 1; }
void gonio_fw_board_lock(struct fw_core *core) { (void)core; }
void gonio_fw_board_unlock(struct fw_core *core) { (void)core; }
void gonio_fw_board_restart(struct fw_core *core) { (void)core; }
void gonio_fw_board_fault(struct fw_core *core) { (void)core; }

// ---- the registers ----

enum { CELLS = 512, A_RCC_CR = 0x40023800, A_RCC_PLLCFGR = 0x40023804, A_RCC_CFGR = 0x40023808, A_PWR_CR = 0x40007000 };
enum { A_PWR_CSR = 0x40007004, A_ACR = 0x40023C00, A_FLASH_CR = 0x40023C10, A_FLASH_SR = 0x40023C0C };
enum { A_TIM11_SR = 0x40014810 };
enum { A_TIM11_CCR1 = 0x40014834, A_KR = 0x40003000, A_PR = 0x40003004, A_RLR = 0x40003008, A_IWDG_SR = 0x4000300C };
enum { A_ADC_SR = 0x40012000, A_ADC_CR2 = 0x40012008, A_ADC_SMPR2 = 0x40012010, A_ADC_SQR3 = 0x40012034 };
enum {
    A_ADC_DR = 0x4001204C,
    A_ADC_CCR = 0x40012304,

    A_B_IDR = 0x40020410,
    A_B_PUPDR = 0x4002040C
};
enum { A_A_MODER = 0x40020000, A_A_PUPDR = 0x4002000C, A_EXTI_IMR = 0x40013C00, A_A_AFRL = 0x40020020 };
enum { A_C_IDR = 0x40020810, A_C_PUPDR = 0x4002080C };

#define A_VTOR 0xE000ED08u
#define A_ISER1 0xE000E104u

static struct {
    uint32_t address[CELLS], value[CELLS], count;
    uint32_t last, before; // the access before: its cell and what it held
    bool any;
    uint32_t accesses;
    double crystal_mhz, internal_mhz; // crystal 0: none
    double edge;                      // ticks of TIM 11 at its next capture
    uint32_t iwdg_busy, iwdg_lost;    // accesses until SR is clear; writes that came too soon
    bool iwdg_open;
    uint32_t adc_busy;
    uint32_t channel[2]; // what the pins of the ADC have
    bool sensor_open, pulled, strapped;
    uint32_t cache_flushes, wrong; // cache resets while they were off; what the manual forbids
} model;

static uint32_t *cell(uint32_t address) {
    for (uint32_t i = 0; i < model.count; i++)
        if (model.address[i] == address)
            return &model.value[i];
    assert_true(model.count < CELLS);
    model.address[model.count] = address;
    model.value[model.count] = 0;
    return &model.value[model.count++];
}

static bool pll_on(void) { return (*cell(A_RCC_CR) >> 24 & 1) != 0; }

static void written_clock(uint32_t address, uint32_t value, uint32_t before) {
    uint32_t *cr = cell(A_RCC_CR);
    if (address == A_RCC_CR) {
        *cr = (value & ~0x02020002u) | (value & 1) << 1 | ((value >> 24 & 1) << 25);
        const bool ready = model.crystal_mhz > 0 && (value >> 18 & 1) == CLOCKED;
        *cr |= (value >> 16 & 1) != 0 && ready ? 1u << 17 : 0;
        model.wrong += ((value ^ before) >> 18 & 1) != 0 && (before >> 16 & 1) != 0; // HSEBYP while HSE is on (7.3.1)
        model.wrong +=
            (before >> 24 & 1) == 0 && pll_on() && (*cell(A_PWR_CR) & VOLTAGE) != VOLTAGE; // 168 MHz at scale 2
        model.wrong += (*cell(A_RCC_CFGR) & 12) == 8 && !pll_on();                         // the clock in use
    }
    if (address == A_RCC_CFGR) // the switch tells itself
        *cell(A_RCC_CFGR) = (value & ~12u) | (value & 3) << 2;
    model.wrong += address == A_RCC_PLLCFGR && pll_on();
    model.wrong += address == A_PWR_CR && ((value ^ before) & VOLTAGE) != 0 && pll_on(); // VOS
}

static void written_watchdog(uint32_t address, uint32_t value, uint32_t before) {
    if (address == A_KR) {
        model.iwdg_open = value == IWDG_UNLOCK;
        *cell(A_KR) = 0;
        model.iwdg_lost += value == IWDG_FEED && model.iwdg_busy > 0;
    }
    if (address == A_PR || address == A_RLR) {
        if (!model.iwdg_open || (*cell(A_IWDG_SR) >> (address == A_RLR) & 1) != 0) {
            model.iwdg_lost++;
            *cell(address) = before;
            return;
        }
        *cell(A_IWDG_SR) |= address == A_PR ? 1 : 2;
        model.iwdg_busy = 50;
    }
}

static void written_adc(uint32_t address, uint32_t value) {
    if (address == A_ADC_CR2 && (value >> 30 & 1) != 0) {
        *cell(A_ADC_CR2) = value & ~(1u << 30);
        model.wrong += model.adc_busy > 0; // one is under way
        model.adc_busy = 10;
    }
    if (address == A_A_MODER || address == A_A_PUPDR)
        model.pulled |= (*cell(A_A_MODER) >> 2 & 3) == 0 && (*cell(A_A_PUPDR) >> 2 & 3) == 2;
}

static void convert_channel(void) {
    const uint32_t channel = *cell(A_ADC_SQR3) & 31;
    model.wrong += channel == 1 && (*cell(A_A_MODER) >> 2 & 3) != 3; // not analogue
    uint32_t value = model.channel[channel];
    if (channel == 1 && model.sensor_open) // what the photodiode left on the wire, if nothing has pulled it down since
        value = model.pulled ? 2 : model.channel[0] / 3;
    if (channel == 1)
        model.pulled = false;
    *cell(A_ADC_DR) = value;
    *cell(A_ADC_SR) |= 2;
}

static void written_flash(uint32_t address, uint32_t value, uint32_t before) {
    static const uint32_t start[] = {0x08000000, 0x08004000, 0x08008000, 0x0800C000, 0x08010000, 0x08020000};
    static const uint32_t size[] = {0x4000, 0x4000, 0x4000, 0x4000, 0x10000, 0x20000};
    if (address == A_FLASH_CR && (value >> 16 & 1) != 0 && (value & 2) != 0) {
        const uint32_t sector = value >> 3 & 15;
        assert_true(sector < 6); // in every part, and mapped here
        memset((void *)(uintptr_t)start[sector], 0xFF, size[sector]);
        *cell(A_FLASH_CR) &= ~(1u << 16);
        model.cache_flushes = 0;
    }
    const uint32_t resets = value & ~before & 0x1800;
    if (address == A_ACR && resets != 0) {
        model.wrong += (value & 0x600) != 0; // they are reset while they are off alone (3.9.1)
        model.cache_flushes |= resets;
    }
}

static void settle(void) {
    if (!model.any)
        return;
    const uint32_t address = model.address[model.last], value = model.value[model.last];
    model.any = false;
    if (value == model.before) { // read
        if (address == line.usart + 4)
            *cell(line.usart) &= ~(uint32_t)(USART_RXNE | USART_ORE);
        if (address == A_TIM11_CCR1)
            *cell(A_TIM11_SR) = 0;
        if (address == A_ADC_DR)
            *cell(A_ADC_SR) = 0;
        return;
    }
    written_clock(address, value, model.before);
    written_watchdog(address, value, model.before);
    written_adc(address, value);
    written_flash(address, value, model.before);
}

static void time_passes(void) {
    if (model.iwdg_busy > 0 && --model.iwdg_busy == 0)
        *cell(A_IWDG_SR) = 0;
    if (model.adc_busy > 0 && --model.adc_busy == 0)
        convert_channel();
    *cell(A_C_IDR) = model.strapped ? 0 : (*cell(A_C_PUPDR) >> 2 * STRAPPED & 3) == 1 ? 1u << STRAPPED : 0;
    const uint32_t divider = *cell(A_RCC_CFGR) >> 16 & 31;
    if (model.accesses % 7 == 0 && model.crystal_mhz > 0 && divider > 1 && *cell(A_TIM11_SR) == 0) {
        model.edge += 8 * divider * model.internal_mhz / model.crystal_mhz;
        *cell(A_TIM11_CCR1) = (uint32_t)model.edge & 0xFFFF;
        *cell(A_TIM11_SR) = 2;
    }
}

static volatile uint32_t *access_to(uint32_t address) {
    settle();
    time_passes();
    if (++model.accesses > 3000000)
        longjmp(out_of_it, HUNG);
    uint32_t *at = cell(address & ~3u);
    model.last = (uint32_t)(at - model.value);
    model.before = *at;
    model.any = true;
    return at;
}

// As a reset leaves them, but for what a boot loader has done.
static void power_up(double crystal_mhz, double internal_mhz) {
    static void *flash;
    memset(&model, 0, sizeof model);
    model.crystal_mhz = crystal_mhz;
    model.internal_mhz = internal_mhz;
    model.edge = 65000; // it wraps
    *cell(A_RCC_CR) = 0x83;
    *cell(A_PWR_CR) = VOLTAGE;
    *cell(A_A_PUPDR) = 0x64000000;
    if (flash == NULL)
        flash = mmap((void *)(uintptr_t)0x08000000, 0x40000, PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED_NOREPLACE, -1, 0);
    assert_true(flash == (void *)(uintptr_t)0x08000000);
}

// 0: it ran to its end.
static int run(void (*what)(void)) {
    const int end = setjmp(out_of_it);
    if (end == 0) {
        what();
        settle();
    }
    return end;
}

// ---- the points ----

static void the_clock_is_right(void **state) {
    (void)state;
    for (int loader = 0; loader < 2;
         loader++) { // fresh, and as a boot loader leaves it: PLL in use, scale 2, its vectors
        power_up(8, 16);
        if (loader != 0) {
            *cell(A_RCC_CR) = 0x03030083 | (CLOCKED ? 0 : 1 << 18);
            *cell(A_RCC_CFGR) = 0x140A;
            *cell(A_PWR_CR) = 0;
            *cell(A_VTOR) = 0x1FFF0000;
        }
        assert_int_equal(run(board_start), 0);
        assert_int_equal(model.wrong, 0);
        assert_int_equal(*cell(A_VTOR), 0x08000000);
        assert_int_equal(*cell(A_RCC_CFGR), 4u << 13 | 5 << 10 | 10);
        assert_int_equal(*cell(A_RCC_PLLCFGR), 7u << 24 | 1u << 22 | 168 << 6 | 4);
        assert_int_equal(*cell(A_RCC_CR) >> 18 & 1, CLOCKED);
        assert_int_equal(*cell(A_PWR_CR), VOLTAGE | 7 << 5 | 1 << 4); // scale 1, and the supply is watched
        assert_true((*cell(A_ACR) & 7) == 5);
    }
}

static void another_crystal_is_refused(void **state) {
    (void)state;
    static const double mhz[] = {4, 6, 7.3728, 10, 12, 14.7456, 16, 20, 24, 25, 26};
    for (size_t i = 0; i < sizeof mhz / sizeof *mhz; i++) {
        power_up(mhz[i], 16);
        assert_int_equal(run(board_start), REFUSED);
        assert_true((*cell(0x40020800) & 0x555555) == 0x555555 && *cell(A_RCC_PLLCFGR) == 0); // outputs stand, low
    }
    for (double internal = 15.4; internal <= 16.6; internal += 0.1) { // as far off as it may be
        power_up(8, internal);
        assert_int_equal(run(board_start), 0);
    }
    power_up(0, 16); // none: on the internal oscillator
    assert_int_equal(run(board_start), 0);
    assert_int_equal(*cell(A_RCC_PLLCFGR), 7u << 24 | 168 << 6 | 8);
}

static void an_overrun_ends(void **state) {
    (void)state;
    for (uint32_t flags = 0; flags < 4; flags++) {
        power_up(8, 16);
        assert_int_equal(run(board_start), 0);
        *cell(line.usart) = ((flags & 1) != 0 ? USART_RXNE : 0u) | ((flags & 2) != 0 ? USART_ORE : 0u);
        *cell(line.usart + 4) = 0x55;
        assert_int_equal(run(uart_interrupt), 0);
        assert_int_equal(*cell(line.usart), 0); // else it interrupts for ever
    }
}

static void every_rate_fits_its_register(void **state) {
    (void)state;
    static const uint32_t rates[] = {2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600, 1000000};
    for (size_t i = 0; i < 2 * sizeof rates / sizeof *rates; i++) {
        power_up(8, 16);
        model.strapped = i % 2 != 0;
        assert_int_equal(run(board_start), 0);
        gonio_fw_board_uart_setup(NULL, rates[i / 2]);
        settle();
        const uint32_t brr = *cell(line.usart + 8), bus = line.usart == USART1 ? 84000000 : 42000000;
        const double rate = (double)bus / (brr & 0xFFFF);
        assert_true(brr <= 0xFFFF && rate > 0.99 * rates[i / 2] && rate < 1.01 * rates[i / 2]);
        assert_int_equal(*cell(A_ISER1), 1u << (line.usart == USART1 ? 5 : 6)); // its interrupt alone
    }
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    if (strcmp(#name, "baud") == 0)                                                                                    \
        assert_true((int64_t)(minimum) == rates[0] && (int64_t)(maximum) == 1000000);
#include "firmware/regmap.def"
}

// USART 1 is on PA9 and PA10; with a strap that is open, USART 2 on PA2 and PA3.
static void the_strap_chooses_the_line(void **state) {
    (void)state;
    for (int strapped = 0; strapped < 2; strapped++) {
        power_up(8, 16);
        model.strapped = strapped != 0;
        assert_int_equal(run(board_start), 0);
        const bool second = STRAPPED != 0 && strapped == 0;
        assert_int_equal(line.usart, second ? USART2 : USART1);
        assert_int_equal(*cell(A_A_MODER) >> 4 & 15, second ? 10 : 0);
        assert_int_equal(*cell(A_A_AFRL) >> 8 & 255, second ? 0x77 : 0);
        assert_int_equal(*cell(A_A_MODER) >> 18 & 15, 10);
    }
}

// Each axis has a motor enable on port C and a brake of its own on port A, all of them outputs that begin low.
static void every_axis_has_a_brake(void **state) {
    (void)state;
    static const unsigned pins[4] = {7, 11, 12, 15};
    const uint32_t set_a = 0x40020018, set_c = 0x40020818, all = 1u << 7 | 1u << 11 | 1u << 12 | 1u << 15;
    power_up(8, 16);
    assert_int_equal(run(board_start), 0);
    for (int axis = 0; axis < 4; axis++) {
        assert_int_equal(*cell(A_A_MODER) >> 2 * pins[axis] & 3, 1);
        gonio_fw_board_motors(NULL, (uint8_t)(1 << (4 + axis)));
        assert_int_equal(*cell(set_a), 1u << pins[axis] | (all & ~(1u << pins[axis])) << 16);
        assert_int_equal(*cell(set_c), 0xF00u << 16);
        gonio_fw_board_motors(NULL, (uint8_t)(1 << axis));
        assert_int_equal(*cell(set_a), all << 16);
        assert_int_equal(*cell(set_c), 0x100u << axis | (0xF00u & ~(0x100u << axis)) << 16);
    }
}

static void set_watchdog(void) { gonio_fw_board_watchdog_start(NULL, FW_WATCHDOG_MS); }

static void the_watchdog_takes_what_it_is_told(void **state) {
    (void)state;
    power_up(8, 16);
    for (int i = 0; i < 3; i++) { // at start, and around an erase in close succession
        *cell(A_RLR) = 7;
        assert_int_equal(run(set_watchdog), 0);
        assert_true(*cell(A_RLR) == FW_WATCHDOG_MS && *cell(A_PR) == 3);
    }
    assert_int_equal(model.iwdg_lost, 0);
}

static void an_erase_empties_the_caches(void **state) {
    (void)state;
    for (unsigned slot = 0; slot < FW_STORE_SLOTS; slot++) {
        power_up(8, 16);
        assert_int_equal(run(board_start), 0);
        memset((void *)(uintptr_t)0x08000000, 0x5A, 0x40000);
        assert_true(gonio_fw_board_store_erase(NULL, slot));
        settle();
        assert_int_equal(model.cache_flushes, 0x1800);
        assert_true((*cell(A_ACR) & 0x600) == 0x600 && model.wrong == 0);
        for (uint32_t at = 0x08000000; at < 0x0800C000; at += 4) // the program stands
            assert_true(*(const uint32_t *)(uintptr_t)at == 0x5A5A5A5A);
        assert_true(gonio_fw_board_store_program(NULL, slot, 3, 0x1234));
        assert_int_equal(gonio_fw_board_store_page(NULL, slot)[3], 0x1234);
    }
}

static void read_once(uint32_t *light, int32_t *temperature) {
    *temperature = gonio_fw_board_temperature(NULL);
    *light = gonio_fw_board_photodiode(NULL);
    for (int i = 0; i < 60; i++) // a millisecond
        (void)IWDG_SR;
}

static void the_converter_is_slow_enough_and_sees_an_open_wire(void **state) {
    (void)state;
    for (int open = 0; open < 2; open++) {
        power_up(8, 16);
        assert_int_equal(run(board_start), 0);
        const double clock_mhz = 84.0 / (2 * (1 + (*cell(A_ADC_CCR) >> 16 & 3)));
        assert_true(clock_mhz <= 36);
        assert_true((*cell(A_ADC_SMPR2) & 7) >= 4 && (*cell(A_ADC_SMPR2) >> 3 & 7) == 7);
        model.channel[0] = 4000;
        model.channel[1] = 310;
        model.sensor_open = open != 0;
        uint32_t light = 0;
        int32_t temperature = 0;
        for (int i = 0; i < 3; i++)
            read_once(&light, &temperature);
        assert_int_equal(light, 4000 << 4 | 4000 >> 8);
        assert_int_equal(temperature, open != 0 ? FW_NO_TEMPERATURE : 310 * 330000 / 4095);
        assert_int_equal(model.wrong, 0);
        assert_int_equal(*cell(A_A_PUPDR) & 0xFC000000, 0x64000000); // the debugger's
    }
}

static void a_low_supply_is_seen_at_start(void **state) {
    (void)state;
    power_up(8, 16);
    assert_int_equal(run(board_start), 0);
    assert_int_equal(run(board_inputs_start), 0);
    assert_true((*cell(A_EXTI_IMR) >> 16 & 1) != 0);
    *cell(A_PWR_CSR) = 1 << 2;
    assert_int_equal(run(board_inputs_start), RESET);
}

// Each contact on its own pin, with its pull-up and its interrupt; none on PB2, which is BOOT1.
static void contacts_stand_clear_of_boot1(void **state) {
    (void)state;
    power_up(8, 16);
    assert_int_equal(run(board_start), 0);
    assert_int_equal(run(board_inputs_start), 0);
    unsigned seen = 0;
    for (unsigned pin = 0; pin < 16; pin++) {
        *cell(A_B_IDR) = 1u << pin;
        const uint16_t inputs = gonio_fw_board_inputs(NULL);
        const bool used = inputs != 0;
        assert_true((inputs & (inputs - 1)) == 0 && (seen & inputs) == 0);
        assert_int_equal(used, pin != 2 && pin != 11);
        assert_int_equal(*cell(A_B_PUPDR) >> 2 * pin & 3, used);
        assert_int_equal(*cell(A_EXTI_IMR) >> pin & 1, used);
        seen |= inputs;
    }
    assert_int_equal(seen, (1 << FW_CONTACTS) - 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_clock_is_right),
        cmocka_unit_test(another_crystal_is_refused),
        cmocka_unit_test(an_overrun_ends),
        cmocka_unit_test(every_rate_fits_its_register),
        cmocka_unit_test(the_strap_chooses_the_line),
        cmocka_unit_test(every_axis_has_a_brake),
        cmocka_unit_test(the_watchdog_takes_what_it_is_told),
        cmocka_unit_test(an_erase_empties_the_caches),
        cmocka_unit_test(the_converter_is_slow_enough_and_sees_an_open_wire),
        cmocka_unit_test(a_low_supply_is_seen_at_start),
        cmocka_unit_test(contacts_stand_clear_of_boot1),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
