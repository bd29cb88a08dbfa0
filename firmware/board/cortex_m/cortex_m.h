// SPDX-License-Identifier: BSD-3-Clause
// What the Cortex-M boards share: core peripherals, start-up, time, mark. What is here is in ARMv6-M and ARMv7-M alike
// (their Architecture Reference Manuals, B3).
#ifndef FW_CORTEX_M_H
#define FW_CORTEX_M_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware/board/boards.h"
#include "firmware/contract/store.h"
#include "firmware/contract/tick.h"
#include "firmware/contract/watchdog.h"
#include "firmware/core/core.h"

#ifndef REG32 // a test has registers of its own
#define REG32(address) (*(volatile uint32_t *)(uintptr_t)(address))
#endif

#define SYST_CSR REG32(0xE000E010)
#define SYST_RVR REG32(0xE000E014)
#define SYST_CVR REG32(0xE000E018)
#define NVIC_ISER(n) REG32(0xE000E100 + 4 * (n))
#define NVIC_ISPR(n) REG32(0xE000E200 + 4 * (n))
#define NVIC_IPR(irq) REG32(0xE000E400 + ((irq) & ~3u)) // four interrupts a word, and no access but by words in ARMv6-M
#define SCB_ICSR REG32(0xE000ED04)
#define SCB_VTOR REG32(0xE000ED08)
#define SCB_AIRCR REG32(0xE000ED0C)
#define SCB_SHPR3 REG32(0xE000ED20) // priorities of SysTick in the highest byte, of PendSV in the next

enum { ICSR_PENDSTSET = 1 << 26, ICSR_PENDSVSET = 1 << 28 };
#define AIRCR_RESET 0x05FA0004u

// Priorities (contract/tick.h): ARMv6-M has these four.
enum { PRIORITY_INPUTS = 0x00, PRIORITY_STEP = 0x40, PRIORITY_UART = 0x80, PRIORITY_PRODUCER = 0xC0 };

static inline void irq_enable(unsigned irq, uint8_t priority) {
    const unsigned shift = 8 * (irq % 4);
    NVIC_IPR(irq) = (NVIC_IPR(irq) & ~(0xFFu << shift)) | (uint32_t)priority << shift;
    NVIC_ISER(irq / 32) = 1u << irq % 32;
}

// The one controller of a board.
extern struct fw_core fw_core;

// Is a page of the store all ones? Read anew, whatever was read of it before.
static inline bool cortex_m_erased(const volatile uint32_t *page) {
    for (unsigned i = 0; i < FW_STORE_WORDS; i++)
        if (page[i] != 0xFFFFFFFFu)
            return false;
    return true;
}

// ---- time: SysTick counts processor cycles down through all its 24 bits ----

// cycles: a tick. Starts SysTick.
void cortex_m_time_start(uint32_t cycles);
// Cycles until tick `due`, which is less than 2^23 cycles away; negative: it has passed. Any. Tick t begins when the
// count of cycles is t times the cycles of a tick, modulo 2^24 as well.
static inline int32_t cycles_until(uint32_t due, uint32_t cycles_per_tick) {
    return (int32_t)((SYST_CVR + due * cycles_per_tick) << 8) >> 8;
}

// ---- mark: words that start-up does not clear; they tell why it starts where the reset register cannot ----

// Why this start, from the mark that the run before left: WATCHDOG unless it said otherwise; POWER without a mark.
enum fw_cause cortex_m_marked_cause(void);
// Leave a mark; the next start reports it. address: of a fault.
void cortex_m_mark(enum fw_cause cause, uint32_t address);
// The address in the mark; 0: none.
uint32_t cortex_m_marked_address(void);
// Mark and reset, as board_reset has it.
_Noreturn void cortex_m_reset(enum fw_cause cause, uint32_t address);

// ---- each board has ----
extern const uint16_t board_number;      // value of register board
extern const uint32_t board_tick_cycles; // cycles of a tick
enum fw_cause board_cause(void);         // why it starts, from the reset register or the mark
void board_start(void);                  // clock and peripherals, all outputs off
void board_inputs_start(void);           // let contacts interrupt
void board_turn(void);                   // after every turn of the main loop
void board_reset(void);                  // ask for a reset of processor and peripherals; it may take a moment

// ---- start-up, for the vector table ----
void cortex_m_start(void);   // reset
void cortex_m_fault(void);   // all faults
void cortex_m_wrap(void);    // SysTick
void cortex_m_produce(void); // PendSV
#define CORTEX_M_VECTORS                                                                                               \
    (vector)(uintptr_t) & link_stack_top,                                                                              \
        cortex_m_start, [2] = cortex_m_fault, [3] = cortex_m_fault, [4] = cortex_m_fault, [5] = cortex_m_fault,        \
                        [6] = cortex_m_fault, [11] = cortex_m_fault, [14] = cortex_m_produce, [15] = cortex_m_wrap
typedef void (*vector)(void);
extern uint32_t link_stack_top;

// A contact has changed; estop_changed: the emergency stop was among those that did.
void cortex_m_inputs(bool estop_changed);

int main(void);

#endif
