// SPDX-License-Identifier: BSD-3-Clause
// What a board provides to the core: the line. The receiver's interrupt hands each byte to gonio_fw_modbus_receive with
// the tick at which its stop bit ended.
#ifndef FW_CONTRACT_UART_H
#define FW_CONTRACT_UART_H

#include <stdbool.h>
#include <stdint.h>

struct fw_core;

// 8 data bits, no parity, 1 stop bit. Main loop, at start.
void gonio_fw_board_uart_setup(struct fw_core *core, uint32_t baud);
// Give one byte to the transmitter; false: it is full, try later. Main loop.
bool gonio_fw_board_uart_send(struct fw_core *core, uint8_t byte);
// Whether the last stop bit has left. Main loop.
bool gonio_fw_board_uart_sent(struct fw_core *core);
// RS-485: drive the line (true) or listen. Main loop.
void gonio_fw_board_uart_drive(struct fw_core *core, bool on);

#endif
