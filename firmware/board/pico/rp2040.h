// SPDX-License-Identifier: BSD-3-Clause
// Registers of the RP2040 that this board uses (RP2040 Datasheet; its sections in brackets).
#ifndef FW_RP2040_H
#define FW_RP2040_H

#include "firmware/board/cortex_m/cortex_m.h"

// Aliases of a peripheral's register, but not of the SIO's: what is written sets or clears bits (2.1.2).
#define SET_BITS(address) REG32((address) + 0x2000)
#define CLEAR_BITS(address) REG32((address) + 0x3000)

// The flash behind its cache, and the serial interface that reads it (2.6.3, 4.10)
enum { FLASH_BASE = 0x10000000, FLASH_SECTOR = 4096, FLASH_PAGE = 256 };
#define SSI_CTRLR0 REG32(0x18000000)
#define SSI_CTRLR1 REG32(0x18000004)
#define SSI_SSIENR REG32(0x18000008)
#define SSI_BAUDR REG32(0x18000014)
#define SSI_SPI_CTRLR0 REG32(0x180000F4)
enum { SSI_FRAME_32 = 31 << 16, SSI_EEPROM_READ = 3 << 8, SSI_READ_03 = 3 << 24, SSI_COMMAND_8 = 2 << 8 };
enum { SSI_ADDRESS_24 = 6 << 2 };

// Power-on state machine (2.13) and resets (2.14)
#define PSM_WDSEL REG32(0x40010008)
enum { PSM_ALL_BUT_OSCILLATORS = 0x1FFFC };
enum { RESETS_RESET = 0x4000C000 };
#define RESETS_DONE REG32(0x4000C008)
enum {
    RESET_ADC = 1 << 0,
    RESET_IO_BANK0 = 1 << 5,
    RESET_IO_QSPI = 1 << 6,
    RESET_PADS_BANK0 = 1 << 8,
    RESET_PADS_QSPI = 1 << 9,
    RESET_PLL_SYS = 1 << 12,
    RESET_PLL_USB = 1 << 13,
    RESET_PWM = 1 << 14,
    RESET_SYSCFG = 1 << 18,
    RESET_UART0 = 1 << 22,
    RESET_ALL = 0x01FFFFFF
};
#define CHIP_RESET REG32(0x40064008)
enum { CHIP_HAD_POR = 1 << 8, CHIP_HAD_RUN = 1 << 16 };

// Clocks (2.15)
#define CLK_REF_CTRL REG32(0x40008030)
#define CLK_REF_SELECTED REG32(0x40008038)
#define CLK_SYS_CTRL REG32(0x4000803C)
#define CLK_SYS_SELECTED REG32(0x40008044)
#define CLK_PERI_CTRL REG32(0x40008048)
#define CLK_ADC_CTRL REG32(0x40008060)
#define FC0_REF_KHZ REG32(0x40008080)
#define FC0_MIN_KHZ REG32(0x40008084)
#define FC0_MAX_KHZ REG32(0x40008088)
#define FC0_INTERVAL REG32(0x40008090)
#define FC0_SRC REG32(0x40008094)
#define FC0_STATUS REG32(0x40008098)
#define FC0_RESULT REG32(0x4000809C)
enum { CLK_ON = 1 << 11, REF_ROSC = 0, REF_XOSC = 2, SYS_REF = 0, SYS_AUX = 1, FC0_ROSC = 3, FC0_DONE = 1 << 4 };

// Crystal oscillator (2.16) and PLLs (2.18)
#define XOSC_CTRL REG32(0x40024000)
#define XOSC_STATUS REG32(0x40024004)
#define XOSC_STARTUP REG32(0x4002400C)
enum { XOSC_ON = 0xFAB << 12, XOSC_1_TO_15_MHZ = 0xAA0 };
#define XOSC_STABLE 0x80000000u
enum { PLL_SYS = 0x40028000, PLL_USB = 0x4002C000 };
#define PLL_CS(base) REG32((base) + 0x0)
#define PLL_PWR(base) REG32((base) + 0x4)
#define PLL_FBDIV(base) REG32((base) + 0x8)
#define PLL_PRIM(base) REG32((base) + 0xC)
enum { PLL_PD = 1 << 0, PLL_POSTDIVPD = 1 << 3, PLL_VCOPD = 1 << 5 };
#define PLL_LOCK 0x80000000u

// Pins (2.19) and the processor's own port to them (2.3.1)
#define GPIO_CTRL(pin) REG32(0x40014004 + 8 * (pin))
enum { FUNCTION_UART = 2, FUNCTION_PWM = 4, FUNCTION_SIO = 5 };
#define IO_INTR(n) REG32(0x400140F0 + 4 * (n)) // of eight pins: level low, level high, fallen, risen each
#define IO_INTE(n) REG32(0x40014100 + 4 * (n)) // processor 0
enum { IO_EDGES = 12 };
#define PAD(pin) REG32(0x4001C004 + 4 * (pin))
enum {
    PAD_SCHMITT = 1 << 1,
    PAD_PULL_DOWN = 1 << 2,
    PAD_PULL_UP = 1 << 3,
    PAD_INPUT = 1 << 6,
    PAD_OUTPUT_OFF = 1 << 7
};
#define SIO_IN REG32(0xD0000004)
#define SIO_OUT_SET REG32(0xD0000014)
#define SIO_OUT_CLR REG32(0xD0000018)
#define SIO_OE REG32(0xD0000020)

// UART 0, a PL011 (4.2)
#define UART_DR REG32(0x40034000)
#define UART_FR REG32(0x40034018)
#define UART_IBRD REG32(0x40034024)
#define UART_FBRD REG32(0x40034028)
#define UART_LCR_H REG32(0x4003402C)
#define UART_CR REG32(0x40034030)
#define UART_IMSC REG32(0x40034038)
enum { FR_BUSY = 1 << 3, FR_RXFE = 1 << 4, FR_TXFF = 1 << 5, UART_RXI = 1 << 4 };

// ADC (4.9)
#define ADC_CS REG32(0x4004C000)
#define ADC_RESULT REG32(0x4004C004)
enum { ADC_ON = 1 << 0, ADC_START = 1 << 2, ADC_READY = 1 << 8 };

// PWM (4.5)
#define PWM_CSR(slice) REG32(0x40050000 + 0x14 * (slice))
#define PWM_CTR(slice) REG32(0x40050008 + 0x14 * (slice))
#define PWM_CC(slice) REG32(0x4005000C + 0x14 * (slice))
#define PWM_TOP(slice) REG32(0x40050010 + 0x14 * (slice))
#define PWM_INTR REG32(0x400500A4)
#define PWM_INTE REG32(0x400500A8)

// Watchdog (4.7)
#define WATCHDOG_CTRL REG32(0x40058000)
#define WATCHDOG_LOAD REG32(0x40058004)
#define WATCHDOG_REASON REG32(0x40058008)
#define WATCHDOG_SCRATCH4 REG32(0x4005801C)
#define WATCHDOG_TICK REG32(0x4005802C)
enum { WATCHDOG_ON = 1 << 30, WATCHDOG_DEBUG_PAUSES = 7 << 24, REASON_TIMER = 1, REASON_FORCE = 2, TICK_ON = 1 << 9 };
#define WATCHDOG_TRIGGER 0x80000000u

enum { IRQ_PWM = 4, IRQ_IO_BANK0 = 13, IRQ_UART0 = 20, IRQS = IRQ_UART0 + 1 };

#endif
