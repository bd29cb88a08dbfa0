// SPDX-License-Identifier: BSD-3-Clause
// What a board provides to the core: two pages of flash for parameters. Bits fall from 1 to 0 when programmed and rise
// when the page is erased. Main loop only, and only while nothing moves: a page erase may take tens of milliseconds.
#ifndef FW_CONTRACT_STORE_H
#define FW_CONTRACT_STORE_H

#include <stdbool.h>
#include <stdint.h>

struct fw_core;

enum { FW_STORE_SLOTS = 2, FW_STORE_WORDS = 256 };

// The 256 words of a page; valid for ever.
const uint32_t *gonio_fw_board_store_page(struct fw_core *core, unsigned slot);
// Set all words of the page to 0xFFFFFFFF; false: it did not work.
bool gonio_fw_board_store_erase(struct fw_core *core, unsigned slot);
// Program one word; false: it did not work.
bool gonio_fw_board_store_program(struct fw_core *core, unsigned slot, unsigned index, uint32_t word);

#endif
