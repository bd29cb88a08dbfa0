// SPDX-License-Identifier: BSD-3-Clause
#define BOARD_C "firmware/board/nucleo_f446re/board.c"
enum { VOLTAGE = 3 << 14, CLOCKED = 1, STRAPPED = 12 };
#include "tests/unit/stm32f4_board.h"
