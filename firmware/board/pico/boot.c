// SPDX-License-Identifier: BSD-3-Clause
// The second stage of the start (RP2040 Datasheet 2.8.1): the boot ROM copies the first 256 bytes of flash to memory,
// looks at their checksum (image.py puts it there) and runs them, wherever they lie. They let the processor read flash
// as memory, by the plain read command 03h that every serial flash knows, copy the program from there to memory, and
// start it.
//
// The program runs from memory, all of it: flash is then never on the way of an interrupt, whose time would hang on the
// cache before it, and can be erased while interrupts go on.
#include "firmware/board/pico/rp2040.h"

extern uint32_t link_program_load[], link_program_start[], link_program_end[];

// clk_sys over this: 31 MHz at 125 MHz; 03h is good for 50 MHz (W25Q16JV).
enum { FLASH_CLOCK_DIVIDER = 4 };

__attribute__((section(".boot2"), used, noreturn, optimize("Os", "no-tree-loop-distribute-patterns"))) void
pico_boot(void) {
    SSI_SSIENR = 0;
    SSI_BAUDR = FLASH_CLOCK_DIVIDER;
    SSI_CTRLR0 = SSI_FRAME_32 | SSI_EEPROM_READ;
    SSI_CTRLR1 = 0; // one frame of data
    SSI_SPI_CTRLR0 = SSI_READ_03 | SSI_COMMAND_8 | SSI_ADDRESS_24;
    SSI_SSIENR = 1;
    const volatile uint32_t *from = link_program_load;
    for (uint32_t *to = link_program_start; to < link_program_end;)
        *to++ = *from++;
    SCB_VTOR = (uint32_t)(uintptr_t)link_program_start;
    __asm volatile("msr msp, %0\n"
                   "bx %1" ::"r"(link_program_start[0]),
                   "r"(link_program_start[1])
                   : "memory");
    __builtin_unreachable();
}
