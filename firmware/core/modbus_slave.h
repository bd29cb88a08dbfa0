// SPDX-License-Identifier: BSD-3-Clause
// Modbus RTU slave: framing by silence and the function codes, as the two specifications have them:
// "MODBUS Application Protocol Specification V1.1b3" (AP) and "MODBUS over Serial Line Specification and
// Implementation Guide V1.02" (SL).
#ifndef FW_MODBUS_SLAVE_H
#define FW_MODBUS_SLAVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct fw_core;

enum { FW_ADU_MAX = 256, FW_PDU_MAX = 253 }; // SL 2.5.1.2, AP 4.1

// The counters of function 8 (AP 6.8), by sub-function 11 to 18.
enum fw_modbus_counter {
    FW_COUNT_MESSAGES,   // frames with a right CRC, for anyone
    FW_COUNT_ERRORS,     // wrong CRC, length or gap
    FW_COUNT_EXCEPTIONS, // exception replies
    FW_COUNT_OWN,        // requests for this slave or for all
    FW_COUNT_SILENT,     // of these, not answered
    FW_COUNT_NAK,
    FW_COUNT_BUSY,
    FW_COUNT_OVERRUNS,
    FW_COUNTERS
};

struct fw_modbus {
    // receiver, written by its interrupt
    uint8_t frame[FW_ADU_MAX];
    volatile uint16_t length;
    volatile uint32_t last; // tick of the last byte
    volatile bool bad;      // a gap of more than 1.5 characters inside, or too long
    volatile bool taken;    // the main loop works on the frame: bytes are dropped
    volatile uint16_t overruns;
    uint32_t character, gap, silence; // ticks of one character, of 1.5, of 3.5
    // sender
    uint8_t reply[FW_ADU_MAX];
    uint16_t reply_length, reply_sent;
    volatile bool sending;          // the line is driven: what is received is the reply's own echo
    volatile uint16_t echoed;       // bytes of that echo so far; 0: the receiver is off while the line is driven
    volatile uint32_t driven_until; // tick at which the reply had left
    uint32_t channel;               // of the request in hand (core/owner.h)
    bool listen_only;               // on that channel
    uint32_t listen_channel;
    uint16_t counter[FW_COUNTERS];
    uint16_t words[125];
};

void gonio_fw_modbus_setup(struct fw_core *core, uint32_t baud);
// A byte has come; `now` is the tick at which its stop bit ended. From the receiver's interrupt.
void gonio_fw_modbus_receive(struct fw_core *core, uint8_t byte, uint32_t now);
// Main loop.
void gonio_fw_modbus_poll(struct fw_core *core);
// Carry out one PDU (function code and data) that came by a channel (core/owner.h) and write the reply's PDU; returns
// its length, 0: no reply. For boards that have a framing of their own (Modbus TCP). reply has room for FW_PDU_MAX
// bytes.
size_t gonio_fw_modbus_pdu(struct fw_core *core, uint32_t channel, const uint8_t *request, size_t length,
                           uint8_t *reply);
// A connection is gone: what belonged to it ends.
void gonio_fw_modbus_hung_up(struct fw_core *core, uint32_t channel);
uint16_t gonio_fw_modbus_crc(const uint8_t *bytes, size_t length);

#endif
