// SPDX-License-Identifier: BSD-3-Clause
// Registers of the LM3S6965 that this board uses (Stellaris LM3S6965 Microcontroller data sheet).
#ifndef FW_LM3S6965_H
#define FW_LM3S6965_H

#include "firmware/board/cortex_m/cortex_m.h"

// System control
#define SYSCTL_PBORCTL REG32(0x400FE030)
#define SYSCTL_RIS REG32(0x400FE050)
#define SYSCTL_RESC REG32(0x400FE05C)
#define SYSCTL_RCC REG32(0x400FE060)
#define SYSCTL_RCGC0 REG32(0x400FE100)
#define SYSCTL_RCGC1 REG32(0x400FE104)
#define SYSCTL_RCGC2 REG32(0x400FE108)
#define SYSCTL_USECRL REG32(0x400FE140)
enum { RESC_EXT = 1, RESC_POR = 2, RESC_BOR = 4, RESC_WDT = 8, RESC_SW = 16 };

// GPIO; data is masked by the address: GPIO_DATA(base, mask) touches only the bits in mask.
enum {
    GPIOA = 0x40004000,
    GPIOB = 0x40005000,
    GPIOC = 0x40006000,
    GPIOD = 0x40007000,
    GPIOE = 0x40024000,
    GPIOF = 0x40025000,
    GPIOG = 0x40026000
};
#define GPIO_DATA(base, mask) REG32((base) + ((uint32_t)(mask) << 2))
#define GPIO_DIR(base) REG32((base) + 0x400)
#define GPIO_IBE(base) REG32((base) + 0x408)
#define GPIO_IM(base) REG32((base) + 0x410)
#define GPIO_MIS(base) REG32((base) + 0x418)
#define GPIO_ICR(base) REG32((base) + 0x41C)
#define GPIO_AFSEL(base) REG32((base) + 0x420)
#define GPIO_PUR(base) REG32((base) + 0x510)
#define GPIO_DEN(base) REG32((base) + 0x51C)

// General-purpose timer 0
#define TIMER0_CFG REG32(0x40030000)
#define TIMER0_TAMR REG32(0x40030004)
#define TIMER0_CTL REG32(0x4003000C)
#define TIMER0_IMR REG32(0x40030018)
#define TIMER0_ICR REG32(0x40030024)
#define TIMER0_TAILR REG32(0x40030028)

// UART 0
#define UART0_DR REG32(0x4000C000)
#define UART0_FR REG32(0x4000C018)
#define UART0_IBRD REG32(0x4000C024)
#define UART0_FBRD REG32(0x4000C028)
#define UART0_LCRH REG32(0x4000C02C)
#define UART0_CTL REG32(0x4000C030)
#define UART0_IM REG32(0x4000C038)
#define UART0_ICR REG32(0x4000C044)
enum { UART_FR_BUSY = 1 << 3, UART_FR_RXFE = 1 << 4, UART_FR_TXFF = 1 << 5, UART_RX = 1 << 4 };

// Watchdog
#define WDT_LOAD REG32(0x40000000)
#define WDT_CTL REG32(0x40000008)
#define WDT_ICR REG32(0x4000000C)
#define WDT_LOCK REG32(0x40000C00)
#define WDT_UNLOCK 0x1ACCE551u

// Flash
#define FLASH_FMA REG32(0x400FD000)
#define FLASH_FMD REG32(0x400FD004)
#define FLASH_FMC REG32(0x400FD008)
enum { FMC_WRITE = 1, FMC_ERASE = 2 };
#define FMC_KEY 0xA4420000u

// ADC 0, sequencer 3: one sample
#define ADC_ACTSS REG32(0x40038000)
#define ADC_EMUX REG32(0x40038014)
#define ADC_PSSI REG32(0x40038028)
#define ADC_SSMUX3 REG32(0x400380A0)
#define ADC_SSCTL3 REG32(0x400380A4)
#define ADC_SSFIFO3 REG32(0x400380A8)
#define ADC_SSFSTAT3 REG32(0x400380AC)
enum { ADC_EMPTY = 1 << 8, ADC_SEQUENCER_3 = 1 << 3, ADC_LAST = 6 };

// PWM 0
#define PWM_ENABLE REG32(0x40028008)
#define PWM0_CTL REG32(0x40028040)
#define PWM0_LOAD REG32(0x40028050)
#define PWM0_CMPA REG32(0x40028058)
#define PWM0_GENA REG32(0x40028060)

enum { IRQ_GPIOA = 0, IRQ_GPIOD = 3, IRQ_UART0 = 5, IRQ_TIMER0A = 19, IRQ_GPIOF = 30, IRQS = 44 };

#endif
