// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/modbus_table.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/table_file.h"

// ---- the tables that come with Gonio ----

static const gonio_table_text tables[] = {
    // Leadshine's drives with RS-485 in PR mode, by the user's manual of the CS2RS series (StepperOnline sells the same
    // drives as CLRS, and open-loop ones with the same registers): path 0 from 0x6200 on (5.5.4 "Immediate Trigger":
    // mode, where 1 is an absolute position, position with its high word first, turns a minute), triggered through
    // 0x6002 (Pr8.02); 0x1003 the motion's state, bit 0 fault, 2 running, 4 command and 6 homing completed, and 0x1014
    // the feedback position (4.3.4 "Status Monitoring Parameters"); 0x1801 takes 0x1111, "reset current alarm" (4.3.5);
    // 0x2203 the alarm (4.4.2), a bit each. The values of 0x6002 for homing and stop, and the meaning of an alarm's
    // bits, are as published programs for these drives have them.
    {"leadshine", "open = 0x6200 = 1\n"
                  "target = 0x6201:s32\n"
                  "speed = 0x6203\n"
                  "move = target && speed && 0x6002 = 0x10\n"
                  "home = 0x6002 = 0x20\n"
                  "stop = 0x6002 = 0x40\n"
                  "reset = 0x1801 = 0x1111\n"
                  "position = 0x1014:s32\n"
                  "moving = 0x1003 & 0x0004\n"
                  "arrived = 0x1003 & 0x0010\n"
                  "homed = 0x1003 & 0x0040\n"
                  "alarm = 0x1003 & 0x0001\n"
                  "fault = 0x2203\n"
                  "faults = 0x01 over-current | 0x02 over-voltage | 0x08 encoder cable | 0x20 position following error "
                  "| 0x40 current sampling | 0x80 locking the shaft failed | 0x100 auto-tuning | 0x200 EEPROM\n"},
    // Oriental Motor AZ series, Function Edition (HM-60262), its chapters on Modbus RTU: direct data operation from
    // 0x0058 on (number, type, where 1 is an absolute position, position, speed in Hz; trigger 1 at 0x0066 takes all of
    // them), driver input command that switches itself off at 0x0078 (bit 4 ZHOME, 5 STOP, 7 ALM-RST), driver output at
    // 0x007f (bit 5 READY, 7 ALM-A, 13 MOVE, 14 IN-POS), present alarm 0x0080, feedback position 0x00cc; 32 bits each,
    // the high word first. READY falls while the drive is at work. It knows its position without homing: absolute = 1.
    {"oriental-az",
     "move = 0x0058:u32 = 0 && 0x005a:u32 = 1 && target && speed && 0x0066:u32 = 1\n"
     "target = 0x005c:s32\n"
     "speed = 0x005e:s32\n"
     "home = 0x0078:u32 = 0x0010\n"
     "stop = 0x0078:u32 = 0x0020\n"
     "reset = 0x0078:u32 = 0x0080\n"
     "position = 0x00cc:s32\n"
     "moving = 0x007f & 0x2000 | 0x007f & 0x0020 == 0\n"
     "arrived = 0x007f & 0x4000\n"
     "alarm = 0x007f & 0x0080\n"
     "fault = 0x0080:u32\n"
     "faults = 0x10 excessive position deviation | 0x20 over-current | 0x21 main circuit overheat | 0x22 over-voltage "
     "| 0x23 main power off | 0x25 under-voltage | 0x26 motor overheat | 0x28 sensor error | 0x2a sensor communication "
     "| 0x30 overload | 0x31 over-speed | 0x33 absolute position error | 0x34 command pulse | 0x41 EEPROM | 0x42 "
     "sensor "
     "error at power on | 0x43 rotation at power on | 0x44 encoder EEPROM | 0x45 motor combination | 0x4a "
     "return-to-home "
     "incomplete | 0x53 HWTO input circuit | 0x60 limit sensors of both sides active | 0x61 limit sensors reversed | "
     "0x62 return-to-home | 0x63 no HOMES | 0x64 TIM, Z, SLIT signal | 0x66 hardware over-travel | 0x67 software "
     "over-travel | 0x68 HWTO input (power removed) | 0x6a return-to-home offset | 0x6d mechanical over-travel | 0x70 "
     "operation data | 0x71 electronic gear | 0x72 wrap setting | 0x81 network bus | 0x83 communication switch | 0x84 "
     "RS-485 communication | 0x85 RS-485 timeout | 0xf0 CPU\n"},
    {0},
};

// ---- parsing ----

static const char *skip(const char *at) { return at + strspn(at, " \t"); }

// A number behind blanks; NULL where there is none.
static const char *number(const char *at, int64_t low, int64_t high, int64_t *value) {
    char *end;
    at = skip(at);
    *value = strtoll(at, &end, 0);
    return end == at || *value < low || *value > high ? NULL : skip(end);
}

static const char *parse_register_at(const char *at, gonio_modbus_register *r) {
    static const struct {
        const char *name;
        int words;
        bool is_signed;
    } types[] = {{":u16", 1, false}, {":s16", 1, true}, {":u32", 2, false}, {":s32", 2, true}};
    int64_t address;
    at = skip(at);
    *r = (gonio_modbus_register){.there = true, .words = 1, .shared = *at == '@'};
    at = number(at + r->shared, 0, 65535, &address);
    r->address = (int)address;
    for (size_t i = 0; at != NULL && i < sizeof types / sizeof *types; i++) {
        if (strncmp(at, types[i].name, 4) == 0) {
            r->words = types[i].words;
            r->is_signed = types[i].is_signed;
            return skip(at + 4);
        }
    }
    return at != NULL && *at == ':' ? NULL : at;
}

static bool parse_register(const char *text, void *value) {
    gonio_modbus_register r;
    const char *end = parse_register_at(text, &r);
    if (end == NULL || *end != 0) {
        return false;
    }
    *(gonio_modbus_register *)value = r;
    return true;
}

static const char *parse_term(const char *at, struct gonio_modbus_term *t) {
    int64_t mask = UINT32_MAX, value = 0;
    at = parse_register_at(at, &t->at);
    if (at != NULL && *at == '&') {
        at = number(at + 1, 0, UINT32_MAX, &mask);
    }
    t->equals = at != NULL && strncmp(at, "==", 2) == 0;
    if (t->equals) {
        at = number(at + 2, 0, UINT32_MAX, &value);
    }
    t->mask = (uint32_t)mask;
    t->value = (uint32_t)value;
    return at;
}

static bool parse_condition(const char *text, void *value) {
    gonio_modbus_condition c = {0};
    for (const char *at = text; c.n < GONIO_MODBUS_TERMS; at++) {
        at = parse_term(at, &c.terms[c.n++]);
        if (at == NULL || *at != '|') {
            *(gonio_modbus_condition *)value = at != NULL && *at == 0 ? c : *(gonio_modbus_condition *)value;
            return at != NULL && *at == 0;
        }
    }
    return false;
}

// One thing to write; what follows it.
static const char *parse_item(const char *at, struct gonio_modbus_item *item) {
    static const char *const names[] = {"target", "speed"};
    at = skip(at);
    for (int i = 0; i < 2; i++) {
        const size_t n = strlen(names[i]);
        if (strncmp(at, names[i], n) == 0) {
            item->what = i == 0 ? GONIO_MODBUS_TARGET : GONIO_MODBUS_SPEED;
            return skip(at + n);
        }
    }
    item->what = GONIO_MODBUS_NUMBER;
    at = parse_register_at(at, &item->at);
    return at != NULL && *at == '=' ? number(at + 1, INT32_MIN, UINT32_MAX, &item->value) : NULL;
}

static bool parse_command(const char *text, void *value) {
    gonio_modbus_command c = {0};
    for (const char *at = text; c.n < GONIO_MODBUS_WRITES; at += 2) {
        at = parse_item(at, &c.writes[c.n++]);
        if (at == NULL || strncmp(at, "&&", 2) != 0) {
            *(gonio_modbus_command *)value = at != NULL && *at == 0 ? c : *(gonio_modbus_command *)value;
            return at != NULL && *at == 0;
        }
    }
    return false;
}

static bool parse_faults(const char *text, void *value) {
    gonio_modbus_faults f = {0};
    for (const char *at = text; *at != 0;) {
        int64_t one = 0;
        at = f.n < GONIO_MODBUS_FAULTS ? number(at, 0, UINT32_MAX, &one) : NULL;
        size_t n = at != NULL ? strcspn(at, "|") : 0;
        if (n == 0) {
            return false;
        }
        const char *next = at[n] == '|' ? at + n + 1 : at + n;
        while (n > 0 && isspace((unsigned char)at[n - 1])) {
            n--;
        }
        f.texts[f.n].number = (uint32_t)one;
        snprintf(f.texts[f.n].text, sizeof f.texts[f.n].text, "%.*s", (int)n, at);
        f.n++;
        at = next;
    }
    *(gonio_modbus_faults *)value = f;
    return true;
}

// ---- keys ----

static const gonio_key_form registers = {"a register: ADDRESS[:u16|s16|u32|s32], @ before it where a slave has it once",
                                         parse_register, NULL};
static const gonio_key_form conditions = {"REGISTER [& MASK] [== NUMBER], several with | between them", parse_condition,
                                          NULL};
static const gonio_key_form commands = {"REGISTER = NUMBER, target or speed, several with && between them",
                                        parse_command, NULL};
static const gonio_key_form fault_texts = {"NUMBER text, several with | between them", parse_faults, NULL};
GONIO_KEY_NAMES(orders, "high-first", "low-first")
#define KEY(member, kind) .section = "", GONIO_KEY(gonio_modbus_table, member, kind)
#define OWN(member, how)                                                                                               \
    { KEY(member, OWN), .form = &how }
const gonio_key gonio_modbus_table_keys[] = {
    {KEY(read, INTEGER), 3, 4},
    {KEY(write, INTEGER), 6, 16},
    {.section = "", GONIO_KEY_NAMED(gonio_modbus_table, low_first, "words", CHOICE), .names = orders},
    OWN(target, registers),
    OWN(speed, registers),
    OWN(position, registers),
    OWN(fault, registers),
    OWN(open, commands),
    OWN(move, commands),
    OWN(home, commands),
    OWN(stop, commands),
    OWN(reset, commands),
    OWN(moving, conditions),
    OWN(homed, conditions),
    OWN(alarm, conditions),
    OWN(arrived, conditions),
    OWN(limit, conditions),
    OWN(faults, fault_texts),
    {0}};

// ---- a whole table ----

static bool writes(const gonio_modbus_command *command, gonio_modbus_what what) {
    bool found = false;
    for (int i = 0; i < command->n; i++) {
        found = found || command->writes[i].what == what;
    }
    return found;
}

static const char *lacks(const void *given) {
    const gonio_modbus_table *t = given;
    if (t->write != 6 && t->write != 16) {
        return "a write of 6 or 16";
    }
    if (writes(&t->move, GONIO_MODBUS_SPEED) && !t->speed.there) {
        return "the register `speed`, which its move writes";
    }
    return t->target.there && t->position.there && writes(&t->move, GONIO_MODBUS_TARGET) && t->home.n > 0 &&
                   t->moving.n > 0
               ? NULL
               : "target, position, moving, home and a move that writes its target";
}

// A named table need not be whole: the rig file may add to it.
static const char *lacks_nothing(const void *given) {
    (void)given;
    return NULL;
}

static gonio_status take_texts(const gonio_modbus_texts *texts, gonio_modbus_table *table, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && gonio_modbus_table_keys[i].name != NULL; i++) {
        const char *text = (const char *)texts + (size_t)i * GONIO_MODBUS_TEXT;
        gonio_error why = {0};
        if (text[0] != 0 && gonio_key_parse(&gonio_modbus_table_keys[i], table, text, &why) != GONIO_OK) {
            status = gonio_fail(error, GONIO_E_INPUT, "[drive]%.400s", why.message);
        }
    }
    return status;
}

gonio_status gonio_modbus_table_read(const char *name, const gonio_modbus_texts *texts, gonio_modbus_table *table,
                                     gonio_error *error) {
    static const gonio_table_form form = {"table of registers", tables, gonio_modbus_table_keys, lacks_nothing};
    *table = (gonio_modbus_table){.read = 3, .write = 16};
    gonio_status status = name[0] != 0 ? gonio_table_file_read(&form, name, table, error) : GONIO_OK;
    status = status == GONIO_OK ? take_texts(texts, table, error) : status;
    const char *missing = lacks(table);
    return status != GONIO_OK || missing == NULL
               ? status
               : gonio_fail(error, GONIO_E_INPUT, "the table of registers '%.60s' needs %s", name, missing);
}

static bool is_bit(uint32_t number_) { return number_ != 0 && (number_ & (number_ - 1)) == 0; }

// Where all that the table names are bits, several may be on.
static uint32_t bits_of(const gonio_modbus_faults *faults) {
    uint32_t bits = 0;
    for (int i = 0; i < faults->n; i++) {
        if (!is_bit(faults->texts[i].number)) {
            return 0;
        }
        bits |= faults->texts[i].number;
    }
    return bits;
}

void gonio_modbus_fault_text(const gonio_modbus_table *table, uint32_t number_, char *text, size_t size) {
    const bool several = (number_ & ~bits_of(&table->faults)) == 0;
    size_t n = 0;
    text[0] = 0;
    for (int i = 0; i < table->faults.n && n < size; i++) {
        const uint32_t one = table->faults.texts[i].number;
        if (one == number_ || (several && (one & number_) != 0)) {
            n += (size_t)snprintf(text + n, size - n, "%s%s", n > 0 ? ", " : "", table->faults.texts[i].text);
        }
    }
}

// ---- words ----

void gonio_modbus_pack(const gonio_modbus_table *table, const gonio_modbus_register *at, int64_t value,
                       uint16_t words[2]) {
    const uint32_t bits = (uint32_t)value;
    words[0] = (uint16_t)bits;
    if (at->words == 2) {
        words[table->low_first ? 1 : 0] = (uint16_t)(bits >> 16);
        words[table->low_first ? 0 : 1] = (uint16_t)bits;
    }
}

int64_t gonio_modbus_unpack(const gonio_modbus_table *table, const gonio_modbus_register *at, const uint16_t words[2]) {
    if (at->words == 1) {
        return at->is_signed ? (int16_t)words[0] : words[0];
    }
    const uint32_t bits = (uint32_t)words[table->low_first ? 1 : 0] << 16 | words[table->low_first ? 0 : 1];
    return at->is_signed ? (int32_t)bits : (int64_t)bits;
}
