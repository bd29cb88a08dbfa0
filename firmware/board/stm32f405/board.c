// SPDX-License-Identifier: BSD-3-Clause
// An STM32F405 board with an 8 MHz crystal; pins as stm32f4/stm32f4.c has them.
#include "firmware/board/stm32f4/stm32f4.h"

const uint16_t board_number = FW_BOARD_stm32f405;
const uint32_t stm32f4_voltage = 1u << 14;
const uint32_t stm32f4_crystal = HSE_ON;

struct stm32f4_line stm32f4_line(void) {
    return (struct stm32f4_line){USART1, APB2_HZ, IRQ_USART1};
}
