// SPDX-License-Identifier: BSD-3-Clause
#ifndef FW_BOARDS_H
#define FW_BOARDS_H

enum fw_board {
#define BOARD(number, name, text) FW_BOARD_##name = (number),
#include "firmware/board/boards.def"
};

#endif
