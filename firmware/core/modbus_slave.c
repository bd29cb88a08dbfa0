// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/modbus_slave.h"

#include "firmware/contract/tick.h"
#include "firmware/contract/uart.h"
#include "firmware/core/core.h"

// AP 6: the function codes served here.
enum function {
    READ_COILS = 1,
    READ_CONTACTS = 2,
    READ_HOLDING = 3,
    READ_INPUT = 4,
    WRITE_COIL = 5,
    WRITE_REGISTER = 6,
    DIAGNOSTICS = 8,
    WRITE_COILS = 15,
    WRITE_REGISTERS = 16,
    MASK_WRITE = 22,
    READ_WRITE = 23,
    ENCAPSULATED = 43
};
enum { EXCEPTION_FLAG = 0x80, BROADCAST = 0, CRC_BYTES = 2, SHORTEST = 4, COIL_ON = 0xFF00 };
enum { READ_MAX = 125, READ_BITS_MAX = 2000, WRITE_MAX = FW_WRITE_MAX, WRITE_BITS_MAX = 1968, READ_WRITE_MAX = 121 };

// One request on its way to a reply.
struct request {
    struct fw_core *core;
    const uint8_t *data; // after the function code
    size_t length;       // of data
    uint8_t *reply;      // after the function code
    size_t reply_length;
    bool silent; // no reply at all
};

static unsigned word_at(const uint8_t *bytes) { return (unsigned)bytes[0] << 8 | bytes[1]; }

static void put_word(uint8_t *bytes, unsigned word) {
    bytes[0] = (uint8_t)(word >> 8);
    bytes[1] = (uint8_t)word;
}

static void echo(struct request *r, size_t length) {
    for (size_t i = 0; i < length; i++)
        r->reply[i] = r->data[i];
    r->reply_length = length;
}

// ---- functions 1, 2, 5, 15: bits ----

static unsigned coils(const struct fw_core *core) {
    return (unsigned)core->lamp.on << FW_COIL_lamp | (unsigned)core->lamp.open << FW_COIL_shutter;
}

// Coils from `address` on, by their bits: all of them, or none. Off is never refused.
static enum fw_exception set_coils(struct fw_core *core, unsigned address, unsigned count, unsigned bits) {
    const bool any_on = (bits & ((1u << count) - 1)) != 0;
    enum fw_refusal refusal = gonio_fw_owner_allows_coils(core, any_on) ? FW_REFUSAL_NONE : FW_REFUSAL_NOT_OWNER;
    if (refusal == FW_REFUSAL_NONE && any_on && gonio_fw_core_ready(core) != FW_REFUSAL_BUSY)
        refusal = gonio_fw_core_ready(core);
    core->registers.refusal[0] = (uint16_t)refusal;
    if (refusal != FW_REFUSAL_NONE)
        return FW_EXCEPTION_FAILURE;
    bool done = true;
    for (unsigned i = 0; i < count; i++) {
        const bool on = (bits >> i & 1) != 0;
        done &= address + i == FW_COIL_lamp ? gonio_fw_lamp_switch(core, on) : gonio_fw_lamp_shutter(core, on);
    }
    if (!done) // the emergency stop has been pressed since, and has all off
        return FW_EXCEPTION_FAILURE;
    gonio_fw_owner_switched(core, any_on);
    return FW_EXCEPTION_NONE;
}

static enum fw_exception read_bits(struct request *r, unsigned bits, unsigned available) {
    if (r->length != 4)
        return FW_EXCEPTION_VALUE;
    const unsigned address = word_at(r->data), count = word_at(r->data + 2);
    if (count == 0 || count > READ_BITS_MAX)
        return FW_EXCEPTION_VALUE;
    if (address + count > available)
        return FW_EXCEPTION_ADDRESS;
    const unsigned bytes = (count + 7) / 8;
    bits = bits >> address & ((1u << count) - 1);
    r->reply[0] = (uint8_t)bytes;
    for (unsigned i = 0; i < bytes; i++)
        r->reply[1 + i] = (uint8_t)(bits >> 8 * i);
    r->reply_length = 1 + bytes;
    return FW_EXCEPTION_NONE;
}

static enum fw_exception write_coil(struct request *r) {
    if (r->length != 4)
        return FW_EXCEPTION_VALUE;
    const unsigned address = word_at(r->data), value = word_at(r->data + 2);
    if (value != 0 && value != COIL_ON)
        return FW_EXCEPTION_VALUE;
    if (address >= FW_COILS)
        return FW_EXCEPTION_ADDRESS;
    echo(r, 4);
    return set_coils(r->core, address, 1, value == COIL_ON);
}

static enum fw_exception write_coils(struct request *r) {
    if (r->length < 6)
        return FW_EXCEPTION_VALUE;
    const unsigned address = word_at(r->data), count = word_at(r->data + 2), bytes = r->data[4];
    if (count == 0 || count > WRITE_BITS_MAX || bytes != (count + 7) / 8 || r->length != 5 + bytes)
        return FW_EXCEPTION_VALUE;
    if (address + count > FW_COILS)
        return FW_EXCEPTION_ADDRESS;
    echo(r, 4);
    return set_coils(r->core, address, count, r->data[5]); // there are fewer than eight
}

// ---- functions 3, 4, 6, 16, 22, 23: registers ----

static enum fw_exception read_registers(struct request *r, unsigned address, unsigned count) {
    uint16_t *words = r->core->modbus.words;
    const enum fw_exception exception = gonio_fw_registers_read(r->core, (uint16_t)address, (uint16_t)count, words);
    if (exception != FW_EXCEPTION_NONE)
        return exception;
    r->reply[0] = (uint8_t)(2 * count);
    for (unsigned i = 0; i < count; i++)
        put_word(r->reply + 1 + 2 * i, words[i]);
    r->reply_length = 1 + 2 * count;
    return FW_EXCEPTION_NONE;
}

static enum fw_exception write_registers(struct request *r, unsigned address, unsigned count, const uint8_t *bytes) {
    uint16_t *words = r->core->modbus.words;
    for (unsigned i = 0; i < count; i++)
        words[i] = (uint16_t)word_at(bytes + 2 * i);
    return gonio_fw_registers_write(r->core, (uint16_t)address, (uint16_t)count, words);
}

static enum fw_exception read_holding(struct request *r) {
    if (r->length != 4)
        return FW_EXCEPTION_VALUE;
    const unsigned count = word_at(r->data + 2);
    if (count == 0 || count > READ_MAX)
        return FW_EXCEPTION_VALUE;
    return read_registers(r, word_at(r->data), count);
}

static enum fw_exception write_register(struct request *r) {
    if (r->length != 4)
        return FW_EXCEPTION_VALUE;
    echo(r, 4);
    return write_registers(r, word_at(r->data), 1, r->data + 2);
}

static enum fw_exception write_multiple(struct request *r) {
    if (r->length < 5)
        return FW_EXCEPTION_VALUE;
    const unsigned count = word_at(r->data + 2), bytes = r->data[4];
    if (count == 0 || count > WRITE_MAX || bytes != 2 * count || r->length != 5 + bytes)
        return FW_EXCEPTION_VALUE;
    echo(r, 4);
    return write_registers(r, word_at(r->data), count, r->data + 5);
}

static enum fw_exception mask_write(struct request *r) {
    if (r->length != 6)
        return FW_EXCEPTION_VALUE;
    const unsigned address = word_at(r->data), and_mask = word_at(r->data + 2), or_mask = word_at(r->data + 4);
    uint16_t word;
    const enum fw_exception exception = gonio_fw_registers_read(r->core, (uint16_t)address, 1, &word);
    if (exception != FW_EXCEPTION_NONE)
        return exception;
    word = (uint16_t)((word & and_mask) | (or_mask & ~and_mask)); // AP 6.16
    echo(r, 6);
    return gonio_fw_registers_write(r->core, (uint16_t)address, 1, &word);
}

static enum fw_exception read_write(struct request *r) {
    if (r->length < 9)
        return FW_EXCEPTION_VALUE;
    const unsigned from = word_at(r->data), wanted = word_at(r->data + 2), to = word_at(r->data + 4),
                   count = word_at(r->data + 6), bytes = r->data[8];
    if (wanted == 0 || wanted > READ_MAX || count == 0 || count > READ_WRITE_MAX || bytes != 2 * count ||
        r->length != 9 + bytes)
        return FW_EXCEPTION_VALUE;
    enum fw_exception exception = gonio_fw_registers_readable(r->core, (uint16_t)from, (uint16_t)wanted);
    if (exception == FW_EXCEPTION_NONE)
        exception = write_registers(r, to, count, r->data + 9);
    return exception != FW_EXCEPTION_NONE ? exception : read_registers(r, from, wanted);
}

// ---- function 8: diagnostics (AP 6.8) ----

static void clear_counters(struct fw_modbus *modbus) {
    for (unsigned i = 0; i < FW_COUNTERS; i++)
        modbus->counter[i] = 0;
    modbus->overruns = 0;
}

static bool deaf(const struct fw_modbus *modbus) {
    return modbus->listen_only && modbus->listen_channel == modbus->channel;
}

// Who is deaf does not hear STOP: not while something moves (gonio_fw_core_poll ends it when something begins to).
static enum fw_exception listen_only(struct request *r) {
    struct fw_modbus *modbus = &r->core->modbus;
    if (!gonio_fw_core_at_rest(r->core)) {
        r->core->registers.refusal[0] = FW_REFUSAL_BUSY;
        return FW_EXCEPTION_BUSY;
    }
    modbus->listen_only = r->silent = true;
    modbus->listen_channel = modbus->channel;
    return FW_EXCEPTION_NONE;
}

static enum fw_exception diagnostics(struct request *r) {
    enum { RETURN_DATA, RESTART, REGISTER, LISTEN_ONLY = 4, CLEAR = 10, FIRST = 11, LAST = 18, CLEAR_OVERRUN = 20 };
    struct fw_modbus *modbus = &r->core->modbus;
    if (r->length < 2)
        return FW_EXCEPTION_VALUE;
    const unsigned sub = word_at(r->data);
    if (sub == RETURN_DATA) {
        echo(r, r->length);
        return FW_EXCEPTION_NONE;
    }
    if (r->length != 4)
        return FW_EXCEPTION_VALUE;
    const unsigned value = word_at(r->data + 2);
    if (value != 0 && !(sub == RESTART && value == COIL_ON))
        return FW_EXCEPTION_VALUE;
    echo(r, 4);
    modbus->counter[FW_COUNT_OVERRUNS] = modbus->overruns;
    switch (sub) {
    case RESTART:
        r->silent = deaf(modbus);
        modbus->listen_only = false;
        clear_counters(modbus);
        return FW_EXCEPTION_NONE;
    case REGISTER:
        put_word(r->reply + 2, (unsigned)r->core->state << 8 | r->core->registers.alarm[0]);
        return FW_EXCEPTION_NONE;
    case LISTEN_ONLY:
        return listen_only(r);
    case CLEAR:
        clear_counters(modbus);
        return FW_EXCEPTION_NONE;
    case CLEAR_OVERRUN:
        modbus->overruns = 0;
        return FW_EXCEPTION_NONE;
    default:
        if (sub < FIRST || sub > LAST)
            return FW_EXCEPTION_FUNCTION;
        put_word(r->reply + 2, modbus->counter[sub - FIRST]);
        return FW_EXCEPTION_NONE;
    }
}

// ---- function 43/14: device identification (AP 6.21) ----

static enum fw_exception identification(struct request *r) {
    enum { TYPE = 14, BASIC = 1, REGULAR, EXTENDED, ONE, CONFORMITY = 0x82, OBJECTS_BASIC = 3, OBJECTS = 6 };
    static const char *const object[OBJECTS] = {
        "Gonio", "GONIO-4", "0.1.0", "https://gonio.invalid/", "Goniometer controller", "firmware/core"};
    if (r->length != 3 || r->data[0] != TYPE)
        return r->length >= 1 && r->data[0] != TYPE ? FW_EXCEPTION_FUNCTION : FW_EXCEPTION_VALUE;
    const unsigned code = r->data[1];
    unsigned first = r->data[2];
    if (code < BASIC || code > ONE)
        return FW_EXCEPTION_VALUE;
    const unsigned end = code == BASIC ? OBJECTS_BASIC : OBJECTS;
    if (first >= end && code == ONE)
        return FW_EXCEPTION_ADDRESS;
    if (first >= end)
        first = 0; // AP 6.21: as if the beginning had been asked for
    uint8_t *to = r->reply;
    const unsigned last = code == ONE ? first + 1 : end;
    *to++ = TYPE;
    *to++ = (uint8_t)code;
    *to++ = CONFORMITY;
    *to++ = 0; // no more follows
    *to++ = 0;
    *to++ = (uint8_t)(last - first);
    for (unsigned i = first; i < last; i++) {
        uint8_t *length = to + 1;
        *to = (uint8_t)i;
        to += 2;
        for (const char *c = object[i]; *c != '\0'; c++)
            *to++ = (uint8_t)*c;
        *length = (uint8_t)(to - length - 1);
    }
    r->reply_length = (size_t)(to - r->reply);
    return FW_EXCEPTION_NONE;
}

static enum fw_exception serve(struct request *r, unsigned function) {
    switch (function) {
    case READ_COILS:
        return read_bits(r, coils(r->core), FW_COILS);
    case READ_CONTACTS:
        return read_bits(r, r->core->interlock.active, FW_CONTACTS);
    case READ_HOLDING:
    case READ_INPUT:
        return read_holding(r);
    case WRITE_COIL:
        return write_coil(r);
    case WRITE_REGISTER:
        return write_register(r);
    case DIAGNOSTICS:
        return diagnostics(r);
    case WRITE_COILS:
        return write_coils(r);
    case WRITE_REGISTERS:
        return write_multiple(r);
    case MASK_WRITE:
        return mask_write(r);
    case READ_WRITE:
        return read_write(r);
    case ENCAPSULATED:
        return identification(r);
    default:
        return FW_EXCEPTION_FUNCTION;
    }
}

void gonio_fw_modbus_hung_up(struct fw_core *core, uint32_t channel) {
    if (core->modbus.listen_channel == channel)
        core->modbus.listen_only = false;
    gonio_fw_owner_hung_up(core, channel);
}

size_t gonio_fw_modbus_pdu(struct fw_core *core, uint32_t channel, const uint8_t *request, size_t length,
                           uint8_t *reply) {
    struct fw_modbus *modbus = &core->modbus;
    modbus->channel = channel;
    if (length == 0 || length > FW_PDU_MAX)
        return 0;
    struct request r = {.core = core, .data = request + 1, .length = length - 1, .reply = reply + 1};
    // AP 6.8, sub-function 4: deaf to everything but the restart.
    const bool restart = request[0] == DIAGNOSTICS && length >= 3 && word_at(request + 1) == 1;
    if (deaf(modbus) && !restart) {
        modbus->counter[FW_COUNT_SILENT]++;
        return 0;
    }
    const enum fw_exception exception = serve(&r, request[0]);
    reply[0] = request[0];
    if (exception != FW_EXCEPTION_NONE) {
        modbus->counter[FW_COUNT_EXCEPTIONS]++;
        if (exception == FW_EXCEPTION_BUSY)
            modbus->counter[FW_COUNT_BUSY]++;
        reply[0] |= EXCEPTION_FLAG;
        reply[1] = (uint8_t)exception;
        return 2;
    }
    if (r.silent) {
        modbus->counter[FW_COUNT_SILENT]++;
        return 0;
    }
    return 1 + r.reply_length;
}

// ---- RTU framing (SL 2.5.1) ----

uint16_t gonio_fw_modbus_crc(const uint8_t *bytes, size_t length) { // SL 6.2.2
    unsigned crc = 0xFFFF;
    for (; length > 0; length--) {
        crc ^= *bytes++;
        for (int i = 0; i < 8; i++)
            crc = (crc & 1) != 0 ? crc >> 1 ^ 0xA001 : crc >> 1;
    }
    return (uint16_t)crc;
}

void gonio_fw_modbus_setup(struct fw_core *core, uint32_t baud) {
    struct fw_modbus *modbus = &core->modbus;
    const uint32_t half = 11 * (FW_TICK_HZ / 2); // a character is 11 bits long (SL 2.5.1); here in half bits
    modbus->character = (2 * half + baud - 1) / baud;
    // SL 2.5.1.1: fixed above 19200 baud.
    modbus->gap = baud > 19200 ? 750 : (3 * half + baud - 1) / baud;
    modbus->silence = baud > 19200 ? 1750 : (7 * half + baud - 1) / baud;
    modbus->last = gonio_fw_board_now(core);
    gonio_fw_board_uart_setup(core, baud);
    gonio_fw_board_uart_drive(core, false);
}

// A transceiver whose receiver stays on while it sends hears the reply itself. Nobody else may speak then, and no
// request's first byte can have ended within a character of it; the last byte of an echo may, where there is one.
static bool echo_of_reply(struct fw_modbus *modbus, uint32_t now) {
    const bool outstanding = modbus->echoed > 0 && modbus->echoed < modbus->reply_length;
    if (!modbus->sending && !(outstanding && now - modbus->driven_until < modbus->character))
        return false;
    modbus->echoed = (uint16_t)(modbus->echoed + 1);
    return true;
}

void gonio_fw_modbus_receive(struct fw_core *core, uint8_t byte, uint32_t now) {
    struct fw_modbus *modbus = &core->modbus;
    if (echo_of_reply(modbus, now))
        return;
    // From stop bit to start bit; the byte that just ended took a character itself.
    const uint32_t since = now - modbus->last, idle = since > modbus->character ? since - modbus->character : 0;
    const uint16_t length = modbus->length;
    modbus->last = now;
    if (length > 0 && idle >= modbus->silence)
        modbus->taken = true; // the frame before was whole, and the main loop late
    if (modbus->taken) {
        modbus->overruns++;
        return;
    }
    if (length > 0 && idle > modbus->gap)
        modbus->bad = true; // SL 2.5.1.1: a gap of more than 1.5 characters spoils the frame
    if (length == FW_ADU_MAX) {
        modbus->bad = true;
        return;
    }
    modbus->frame[length] = byte;
    modbus->length = (uint16_t)(length + 1);
}

static void serve_frame(struct fw_core *core) {
    struct fw_modbus *modbus = &core->modbus;
    const size_t length = modbus->length;
    const uint8_t *frame = modbus->frame, unit = frame[0];
    if (modbus->bad || length < SHORTEST ||
        gonio_fw_modbus_crc(frame, length - CRC_BYTES) != (frame[length - 2] | (unsigned)frame[length - 1] << 8)) {
        modbus->counter[FW_COUNT_ERRORS]++;
        return;
    }
    modbus->counter[FW_COUNT_MESSAGES]++;
    if (unit != BROADCAST && unit != core->registers.slave_address[0])
        return;
    modbus->counter[FW_COUNT_OWN]++;
    const size_t reply =
        gonio_fw_modbus_pdu(core, FW_CHANNEL_LINE, frame + 1, length - 1 - CRC_BYTES, modbus->reply + 1);
    if (unit == BROADCAST && reply != 0)
        modbus->counter[FW_COUNT_SILENT]++;
    if (unit == BROADCAST || reply == 0)
        return;
    modbus->reply[0] = unit;
    const uint16_t crc = gonio_fw_modbus_crc(modbus->reply, reply + 1);
    modbus->reply[reply + 1] = (uint8_t)crc;
    modbus->reply[reply + 2] = (uint8_t)(crc >> 8);
    modbus->reply_length = (uint16_t)(reply + 3);
    modbus->reply_sent = 0;
    modbus->echoed = 0;
    modbus->sending = true;
    gonio_fw_board_uart_drive(core, true);
}

static void send(struct fw_core *core) {
    struct fw_modbus *modbus = &core->modbus;
    while (modbus->reply_sent < modbus->reply_length) {
        if (!gonio_fw_board_uart_send(core, modbus->reply[modbus->reply_sent]))
            return;
        modbus->reply_sent++;
    }
    if (!gonio_fw_board_uart_sent(core))
        return;
    gonio_fw_board_uart_drive(core, false);
    modbus->driven_until = gonio_fw_board_now(core);
    modbus->sending = false;
}

void gonio_fw_modbus_poll(struct fw_core *core) {
    struct fw_modbus *modbus = &core->modbus;
    if (modbus->sending) {
        send(core);
        return;
    }
    if (modbus->length == 0)
        return;
    // The last byte's time before the clock: a byte between the two then counts as no silence, not as a long one.
    const uint32_t last = modbus->last;
    if (!modbus->taken && gonio_fw_board_now(core) - last < modbus->silence)
        return;
    modbus->taken = true;
    serve_frame(core);
    modbus->length = 0;
    modbus->bad = false;
    modbus->taken = false;
    if (modbus->sending)
        send(core);
}
