// SPDX-License-Identifier: BSD-3-Clause
// The Nucleo-F446RE (UM1724, MB1136): its 8 MHz come as a clock from the ST-LINK beside it, whose USB cable is also the
// line, by USART 2 on PA2 and PA3. With PC12 wired to ground at start the line is USART 1 with an RS-485 driver
// instead. The other pins are as stm32f4/stm32f4.c has them; PA5 (camera trigger) lights LD2.
#include "firmware/board/stm32f4/stm32f4.h"

const uint16_t board_number = FW_BOARD_nucleo_f446re;
const uint32_t stm32f4_voltage = 3u << 14; // scale 1, which 168 MHz need, without over-drive (RM0390 5.1.4)
const uint32_t stm32f4_crystal = HSE_ON | HSE_BYPASS;

enum { STRAP = 12 };

struct stm32f4_line stm32f4_line(void) {
    GPIO_PUPDR(GPIOC) |= 1u << 2 * STRAP;
    bool open = false;
    for (unsigned i = 0; i < 1000; i++) // 20 us at least: 40 kOhm lift a wire of 100 pF in 10
        open = (GPIO_IDR(GPIOC) >> STRAP & 1) != 0;
    if (!open)
        return (struct stm32f4_line){USART1, APB2_HZ, IRQ_USART1};
    GPIO_MODER(GPIOA) |= 2u << 6 | 2u << 4;
    GPIO_AFRL(GPIOA) |= 7u << 12 | 7u << 8;
    return (struct stm32f4_line){USART2, APB1_HZ, IRQ_USART2};
}
