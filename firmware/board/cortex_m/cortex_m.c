// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/board/cortex_m/cortex_m.h"

#include <stddef.h>

#include "firmware/contract/pin.h"

struct fw_core fw_core;

// ---- start-up ----

extern uint32_t link_data_load, link_data_start, link_data_end, link_bss_start, link_bss_end;

void cortex_m_start(void) {
    const uint32_t *from = &link_data_load;
    for (uint32_t *to = &link_data_start; to < &link_data_end;)
        *to++ = *from++;
    for (uint32_t *to = &link_bss_start; to < &link_bss_end;)
        *to++ = 0;
    main();
    for (;;) {
    }
}

int main(void) {
    const enum fw_cause cause = board_cause();
    const uint32_t address = cortex_m_marked_address();
    cortex_m_mark(FW_CAUSE_WATCHDOG, address); // should this run end without a word, it was the watchdog
    board_start();
    cortex_m_time_start(board_tick_cycles);
    gonio_fw_core_init(&fw_core, board_number, cause);
    fw_core.registers.fault_address[0] = address;
    board_inputs_start();
    for (;;) {
        gonio_fw_core_poll(&fw_core);
        board_turn();
    }
}

// What the compiler may call; it must not turn their loops into calls of themselves.
#define PLAIN __attribute__((optimize("no-tree-loop-distribute-patterns")))
void *memset(void *to, int byte, size_t length);
void *memcpy(void *restrict to, const void *restrict from, size_t length);

PLAIN void *memset(void *to, int byte, size_t length) {
    for (uint8_t *p = to; length > 0; length--)
        *p++ = (uint8_t)byte;
    return to;
}

PLAIN void *memcpy(void *restrict to, const void *restrict from, size_t length) {
    const uint8_t *source = from;
    for (uint8_t *p = to; length > 0; length--)
        *p++ = *source++;
    return to;
}

// ---- mark ----

#define MARK 0x4D41524Bu
static struct {
    uint32_t mark, check, cause, address; // check: mark ^ cause ^ address
} mark __attribute__((section(".noinit")));

enum fw_cause cortex_m_marked_cause(void) {
    if (mark.mark != MARK || mark.check != (MARK ^ mark.cause ^ mark.address) || mark.cause > FW_CAUSE_PIN)
        return FW_CAUSE_POWER;
    return (enum fw_cause)mark.cause;
}

uint32_t cortex_m_marked_address(void) { return cortex_m_marked_cause() == FW_CAUSE_POWER ? 0 : mark.address; }

void cortex_m_mark(enum fw_cause cause, uint32_t address) {
    mark.mark = MARK;
    mark.cause = (uint32_t)cause;
    mark.address = address;
    mark.check = MARK ^ mark.cause ^ mark.address;
}

void cortex_m_reset(enum fw_cause cause, uint32_t address) {
    cortex_m_mark(cause, address);
    __asm volatile("dsb" ::: "memory");
    board_reset();
    for (;;) {
    }
}

// ---- faults: safe first, then tell, then start anew ----

// frame: what the processor pushed; the seventh word is the program counter (B1.5.6).
__attribute__((used)) static void faulted(const uint32_t *frame) {
    gonio_fw_interlock_fault(&fw_core);
    cortex_m_reset(FW_CAUSE_FAULT, frame[6]);
}

__attribute__((naked)) void cortex_m_fault(void) {
    __asm volatile("mrs r0, msp\n"
                   "bl %c0" ::"i"(faulted)); // a plain branch does not reach that far in ARMv6-M
}

// ---- time ----

#define WRAP_CYCLES (1u << 24)

static volatile uint32_t wrap_tick; // tick during which the counter last wrapped
static uint32_t wrap_cycles;        // cycles of that tick that were over by then
static uint32_t tick_cycles;
static uint32_t wrap_ticks, wrap_rest; // of a wrap: whole ticks, and cycles beyond them

void cortex_m_time_start(uint32_t cycles) {
    tick_cycles = cycles;
    wrap_ticks = WRAP_CYCLES / cycles;
    wrap_rest = WRAP_CYCLES % cycles;
    SYST_RVR = WRAP_CYCLES - 1;
    SYST_CVR = 0;
    SYST_CSR = 7; // processor clock, interrupt, on
    SCB_SHPR3 = (uint32_t)PRIORITY_INPUTS << 24 | PRIORITY_PRODUCER << 16;
}

// Nothing preempts it, and an edge may be due: no division, which takes a Cortex-M0+ hundreds of cycles.
void cortex_m_wrap(void) {
    const uint32_t cycles = wrap_cycles + wrap_rest, over = cycles >= tick_cycles;
    wrap_cycles = over != 0 ? cycles - tick_cycles : cycles;
    wrap_tick += wrap_ticks + over;
}

uint32_t gonio_fw_board_now(struct fw_core *core) {
    (void)core;
    for (;;) {
        const uint32_t tick = wrap_tick, cycles = wrap_cycles;
        uint32_t passed = (0u - SYST_CVR) % WRAP_CYCLES;
        if ((SCB_ICSR & ICSR_PENDSTSET) != 0) // wrapped, but the interrupt has to wait for us
            passed = (0u - SYST_CVR) % WRAP_CYCLES + WRAP_CYCLES;
        if (wrap_tick == tick)
            return tick + (cycles + passed) / tick_cycles;
    }
}

// ---- contacts ----

void cortex_m_inputs(bool estop_changed) {
    const uint16_t inputs = gonio_fw_board_inputs(&fw_core);
    if (estop_changed) // pressed and let go since: it has been both ways
        gonio_fw_interlock_input(&fw_core, inputs ^ 1u << FW_CONTACT_estop);
    gonio_fw_interlock_input(&fw_core, inputs);
}

// ---- producer ----

// Held back by a word, since ARMv6-M masks all interrupts or none: a producer that comes while the main loop holds the
// word leaves a note and goes, and is pended again when the word is let go.
static volatile bool held, wanted;

void cortex_m_produce(void) {
    wanted = held;
    if (!held)
        gonio_fw_stepgen_produce(&fw_core.step);
}

void gonio_fw_board_lock(struct fw_core *core) {
    (void)core;
    held = true;
    __asm volatile("" ::: "memory");
}

void gonio_fw_board_unlock(struct fw_core *core) {
    (void)core;
    __asm volatile("" ::: "memory");
    held = false;
    if (wanted)
        SCB_ICSR = ICSR_PENDSVSET;
}

void gonio_fw_board_restart(struct fw_core *core) {
    (void)core;
    cortex_m_reset(FW_CAUSE_COMMAND, 0);
}

void gonio_fw_board_fault(struct fw_core *core) {
    (void)core;
    __asm volatile("udf #0");
}
