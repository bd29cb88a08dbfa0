// SPDX-License-Identifier: BSD-3-Clause
#define BOARD_C "firmware/board/stm32f405/board.c"
enum { VOLTAGE = 1 << 14, CLOCKED = 0, STRAPPED = 0 };
#include "tests/unit/stm32f4_board.h"
