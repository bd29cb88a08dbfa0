// SPDX-License-Identifier: BSD-3-Clause
// What an STM32F4 board tells the code that they share, and the registers of STM32F405 and STM32F446 that it uses
// (RM0090 and RM0390, the reference manuals; sections are those of RM0090).
#ifndef FW_STM32F4_H
#define FW_STM32F4_H

#include "firmware/board/cortex_m/cortex_m.h"

// ---- each board has, beside board_number ----
struct stm32f4_line {
    uint32_t usart, bus_hz; // base of its registers, its bus' clock
    unsigned irq;
};
struct stm32f4_line stm32f4_line(void); // which USART is the line; its pins are set up here beyond those of USART 1
extern const uint32_t stm32f4_voltage;  // PWR_CR: voltage scale 1
extern const uint32_t stm32f4_crystal;  // RCC_CR: HSE_ON, and HSE_BYPASS where a clock comes instead of a crystal
enum { APB1_HZ = 42000000, APB2_HZ = 84000000 };

// RCC (RM0090 7.3)
#define RCC_CR REG32(0x40023800)
enum { HSE_ON = 1 << 16, HSE_BYPASS = 1 << 18 };
#define RCC_PLLCFGR REG32(0x40023804)
#define RCC_CFGR REG32(0x40023808)
#define RCC_AHB1ENR REG32(0x40023830)
#define RCC_APB1ENR REG32(0x40023840)
#define RCC_APB2ENR REG32(0x40023844)
#define RCC_CIR REG32(0x4002380C)
#define RCC_CSR REG32(0x40023874)
enum { CSR_CLEAR = 1 << 24, CSR_BOR = 1 << 25, CSR_PIN = 1 << 26, CSR_POR = 1 << 27, CSR_IWDG = 1 << 29 };

// PWR (5.4)
#define PWR_CR REG32(0x40007000)
#define PWR_CSR REG32(0x40007004)
enum { PWR_PVDE = 1 << 4, PWR_PLS_2V9 = 7 << 5, PWR_PVDO = 1 << 2 };

// Flash interface (3.9)
#define FLASH_ACR REG32(0x40023C00)
enum { ACR_CACHES = 3 << 9, ACR_RESET_CACHES = 3 << 11 };
#define FLASH_KEYR REG32(0x40023C04)
#define FLASH_SR REG32(0x40023C0C)
#define FLASH_CR REG32(0x40023C10)

// GPIO (8.4)
enum { GPIOA = 0x40020000, GPIOB = 0x40020400, GPIOC = 0x40020800 };
#define GPIO_MODER(base) REG32((base) + 0x00)
#define GPIO_PUPDR(base) REG32((base) + 0x0C)
#define GPIO_IDR(base) REG32((base) + 0x10)
#define GPIO_BSRR(base) REG32((base) + 0x18)
#define GPIO_AFRL(base) REG32((base) + 0x20)
#define GPIO_AFRH(base) REG32((base) + 0x24)

// SYSCFG and EXTI (9.2, 12.3)
#define SYSCFG_EXTICR(n) REG32(0x40013808 + 4 * (n))
#define EXTI_IMR REG32(0x40013C00)
#define EXTI_RTSR REG32(0x40013C08)
#define EXTI_FTSR REG32(0x40013C0C)
#define EXTI_PR REG32(0x40013C14)

// USARTs (30.6)
enum { USART1 = 0x40011000, USART2 = 0x40004400 };
#define USART_SR(base) REG32((base) + 0x00)
#define USART_DR(base) REG32((base) + 0x04)
#define USART_BRR(base) REG32((base) + 0x08)
#define USART_CR1(base) REG32((base) + 0x0C)
enum { USART_ORE = 1 << 3, USART_RXNE = 1 << 5, USART_TC = 1 << 6, USART_TXE = 1 << 7 };

// TIM 2 (steps) and TIM 3 (lamp) (18.4)
#define TIM2_CR1 REG32(0x40000000)
#define TIM2_DIER REG32(0x4000000C)
#define TIM2_SR REG32(0x40000010)
#define TIM2_EGR REG32(0x40000014)
#define TIM2_CNT REG32(0x40000024)
#define TIM2_ARR REG32(0x4000002C)
#define TIM3_CR1 REG32(0x40000400)
#define TIM3_CCMR1 REG32(0x40000418)
#define TIM3_CCER REG32(0x40000420)
#define TIM3_ARR REG32(0x4000042C)
#define TIM3_CCR1 REG32(0x40000434)

// TIM 11: counts the internal oscillator between edges of the crystal's (19.5)
#define TIM11_CR1 REG32(0x40014800)
#define TIM11_SR REG32(0x40014810)
#define TIM11_CCMR1 REG32(0x40014818)
#define TIM11_CCER REG32(0x40014820)
#define TIM11_CCR1 REG32(0x40014834)
#define TIM11_OR REG32(0x40014850)

// IWDG (21.4)
#define IWDG_KR REG32(0x40003000)
#define IWDG_PR REG32(0x40003004)
#define IWDG_RLR REG32(0x40003008)
#define IWDG_SR REG32(0x4000300C)
enum { IWDG_START = 0xCCCC, IWDG_UNLOCK = 0x5555, IWDG_FEED = 0xAAAA };

// ADC 1 (13.13)
#define ADC_SR REG32(0x40012000)
#define ADC_SMPR2 REG32(0x40012010)
#define ADC_CCR REG32(0x40012304)
#define ADC_CR2 REG32(0x40012008)
#define ADC_SQR3 REG32(0x40012034)
#define ADC_DR REG32(0x4001204C)

enum {
    IRQ_PVD = 1,
    IRQ_EXTI0 = 6,
    IRQ_EXTI9_5 = 23,
    IRQ_TIM2 = 28,
    IRQ_USART1 = 37,
    IRQ_USART2 = 38,
    IRQ_EXTI15_10 = 40
};
enum { IRQS = IRQ_EXTI15_10 + 1 }; // those that are used

#endif
