// SPDX-License-Identifier: BSD-3-Clause
#include "tests/board/cpu.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ROM_TABLE = 0x40, ROM_FUNCTIONS = 0x80, ROM_SIZE = 0x4000, BOOT_AT = 0x20041F00 };
enum { STACK = 0x20041F00, LEAVE = (int)0xFFFFFFF8, SYSTICK_CYCLES = 1 << 24 };

// ---- cycles: Cortex-M0+ Technical Reference Manual, table 3-1 ----

static unsigned cost_of(uint16_t code) {
    const unsigned registers = (unsigned)__builtin_popcount(code & 0x1FF);
    if ((code & 0xF600) == 0xB400) // push, pop
        return 1 + registers + ((code & 0x0900) == 0x0900 ? 2 : 0);
    if ((code & 0xF000) == 0xC000) // several
        return 1 + (unsigned)__builtin_popcount(code & 0xFF);
    if ((code & 0xF800) == 0x4800 || ((code & 0xF000) >= 0x5000 && (code & 0xF000) <= 0x9000)) // loads, stores
        return 2;
    if ((code & 0xF000) == 0xD000 || (code & 0xF800) == 0xE000 || (code & 0xFF00) == 0x4700) // branches, taken
        return 2;
    return (code & 0xF800) == 0xF000 ? 3 : 1; // bl, msr, dsb
}

static unsigned block_cost(struct cpu *c, uint64_t address, uint32_t size) {
    if (address < RP_SRAM || address + size > RP_SRAM + RP_SRAM_SIZE)
        return size; // the ROM's
    const uint64_t at = address - RP_SRAM;
    if (c->cost[at / 2] == 0) {
        unsigned cost = 0;
        for (uint32_t i = 0; i < size; i += 2) {
            uint16_t code;
            memcpy(&code, c->sram + at + i, 2);
            cost += cost_of(code);
            i += (code & 0xF800) == 0xF000 ? 2 : 0;
        }
        c->cost[at / 2] = (uint8_t)(cost < 255 ? cost : 255);
    }
    return c->cost[at / 2];
}

// ---- exceptions ----

static unsigned priority_of(const struct cpu *c, unsigned exception) {
    if (exception == FAULT)
        return 0;
    if (exception < 16)
        return (c->shpr3 >> (exception == SYSTICK ? 24 : 16) & 0xFF) + 1;
    return (c->priority[(exception - 16) / 4] >> 8 * (exception % 4) & 0xFF) + 1;
}

static unsigned running_priority(const struct cpu *c) {
    unsigned lowest = 256 + 1;
    for (unsigned i = 0; i < c->depth; i++)
        if (priority_of(c, c->active[i]) < lowest)
            lowest = priority_of(c, c->active[i]);
    return lowest;
}

// The exception that would be taken now; 0: none.
static unsigned to_take(const struct cpu *c) {
    unsigned best = 0, most = running_priority(c);
    const uint32_t lines = (c->latched | rp2040_interrupts(&c->chip)) & c->enabled;
    for (unsigned e = FAULT; e < EXCEPTIONS; e++) {
        const bool pending = e < 16 ? (c->icsr_pending >> e & 1) != 0 : (lines >> (e - 16) & 1) != 0;
        if (pending && priority_of(c, e) < most) {
            best = e;
            most = priority_of(c, e);
        }
    }
    return best;
}

static uint32_t get(struct cpu *c, int which) {
    uint32_t value = 0;
    uc_reg_read(c->engine, which, &value);
    return value;
}

static void set(struct cpu *c, int which, uint32_t value) { uc_reg_write(c->engine, which, &value); }

static const int framed[] = {UC_ARM_REG_R0,  UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3,
                             UC_ARM_REG_R12, UC_ARM_REG_LR, UC_ARM_REG_PC, UC_ARM_REG_XPSR};

static uint32_t word_at(struct cpu *c, uint32_t address) {
    uint32_t word = 0;
    uc_mem_read(c->engine, address, &word, 4);
    return word;
}

static void take(struct cpu *c, unsigned exception) {
    uint32_t frame[8];
    for (unsigned i = 0; i < 8; i++)
        frame[i] = get(c, framed[i]);
    const uint32_t stack = get(c, UC_ARM_REG_SP), pad = stack & 4;
    frame[7] = (frame[7] & ~0x200u) | pad << 7 | 1 << 24;
    set(c, UC_ARM_REG_SP, stack - pad - 32);
    uc_mem_write(c->engine, stack - pad - 32, frame, 32);
    set(c, UC_ARM_REG_LR, 0xFFFFFFF9);
    set(c, UC_ARM_REG_PC, word_at(c, c->vtor + 4 * exception) | 1);
    if (exception < 16)
        c->icsr_pending &= ~(1u << exception);
    else
        c->latched &= ~(1u << (exception - 16));
    c->active[c->depth++] = exception;
    c->chip.cycles += 15;
}

static void leave(struct cpu *c) {
    uint32_t frame[8];
    const uint32_t stack = get(c, UC_ARM_REG_SP);
    uc_mem_read(c->engine, stack, frame, 32);
    for (unsigned i = 0; i < 8; i++)
        set(c, framed[i], i == 6 ? frame[i] | 1 : frame[i]);
    set(c, UC_ARM_REG_SP, stack + 32 + (frame[7] >> 7 & 4));
    c->depth--;
    c->chip.cycles += 15;
}

// ---- what the hooks see ----

static void systick_settle(struct cpu *c) {
    if (c->systick_on && c->chip.cycles >= c->systick_wrap) {
        c->systick_wrap += SYSTICK_CYCLES;
        c->icsr_pending |= 1u << SYSTICK;
    }
}

static void on_block(uc_engine *engine, uint64_t address, uint32_t size, void *context) {
    struct cpu *c = context;
    if (c->stopped_block != address)
        c->chip.cycles += block_cost(c, address, size);
    c->stopped_block = 0;
    if (c->chip.cycles < c->horizon) // this is the way of nearly all
        return;
    rp2040_settle(&c->chip);
    systick_settle(c);
    c->horizon = c->chip.next < c->stop_at ? c->chip.next : c->stop_at;
    c->horizon = c->systick_on && c->systick_wrap < c->horizon ? c->systick_wrap : c->horizon;
    if (c->chip.cycles >= c->stop_at || c->chip.want_reset || to_take(c) != 0) {
        c->stopped_block = address;
        uc_emu_stop(engine);
    }
}

static uint64_t read_chip(struct cpu *c, uint32_t address, unsigned size) {
    if (size != 4)
        rp2040_object(&c->chip, "0x%08X is read by %u bytes", address, size);
    return rp2040_read(&c->chip, address);
}

static void write_chip(struct cpu *c, uint32_t address, unsigned size, uint64_t value) {
    if (size != 4)
        rp2040_object(&c->chip, "0x%08X is written by %u bytes", address, size);
    rp2040_write(&c->chip, address, (uint32_t)value);
    c->horizon = 0;
    if (c->chip.want_reset)
        uc_emu_stop(c->engine);
}

static uint64_t read_bridged(uc_engine *engine, uint64_t offset, unsigned size, void *context) {
    (void)engine;
    ((struct cpu *)context)->chip.cycles += 2;
    return read_chip(context, 0x40000000 + (uint32_t)offset, size);
}

static void write_bridged(uc_engine *engine, uint64_t offset, unsigned size, uint64_t value, void *context) {
    (void)engine;
    ((struct cpu *)context)->chip.cycles += 2;
    write_chip(context, 0x40000000 + (uint32_t)offset, size, value);
}

static uint64_t read_sio(uc_engine *engine, uint64_t offset, unsigned size, void *context) {
    (void)engine;
    ((struct cpu *)context)->chip.cycles--;
    return read_chip(context, 0xD0000000 + (uint32_t)offset, size);
}

static void write_sio(uc_engine *engine, uint64_t offset, unsigned size, uint64_t value, void *context) {
    (void)engine;
    ((struct cpu *)context)->chip.cycles--;
    write_chip(context, 0xD0000000 + (uint32_t)offset, size, value);
}

static uint64_t read_ssi(uc_engine *engine, uint64_t offset, unsigned size, void *context) {
    (void)engine;
    return read_chip(context, 0x18000000 + (uint32_t)offset, size);
}

static void open_flash(struct cpu *c) {
    uc_mem_protect(c->engine, RP_FLASH, RP_FLASH_SIZE, c->chip.xip ? UC_PROT_READ : UC_PROT_NONE);
}

static void write_ssi(uc_engine *engine, uint64_t offset, unsigned size, uint64_t value, void *context) {
    (void)engine;
    write_chip(context, 0x18000000 + (uint32_t)offset, size, value);
    open_flash(context);
}

static uint64_t read_core(uc_engine *engine, uint64_t offset, unsigned size, void *context) {
    (void)engine;
    struct cpu *c = context;
    if (size != 4)
        rp2040_object(&c->chip, "0x%08X is read by %u bytes", 0xE000E000 + (uint32_t)offset, size);
    systick_settle(c);
    if (offset == 0x18)
        return (uint32_t)(0 - (c->chip.cycles - c->systick_from)) % SYSTICK_CYCLES;
    if (offset >= 0x400 && offset < 0x420)
        return c->priority[(offset - 0x400) / 4];
    if (offset == 0xD04)
        return (c->icsr_pending >> SYSTICK & 1) << 26 | (c->icsr_pending >> PENDSV & 1) << 28;
    return offset == 0x100 ? c->enabled : 0;
}

static void write_core(uc_engine *engine, uint64_t offset, unsigned size, uint64_t wide, void *context) {
    (void)engine;
    struct cpu *c = context;
    const uint32_t value = (uint32_t)wide;
    c->horizon = 0;
    if (size != 4)
        rp2040_object(&c->chip, "0x%08X is written by %u bytes", 0xE000E000 + (uint32_t)offset, size);
    if (offset == 0x10)
        c->systick_on = (value & 7) == 7;
    else if (offset == 0x18) {
        c->systick_from = c->chip.tick_origin = c->chip.cycles;
        c->systick_wrap = c->chip.cycles + SYSTICK_CYCLES;
    } else if (offset == 0x100)
        c->enabled |= value;
    else if (offset == 0x200)
        c->latched |= value;
    else if (offset >= 0x400 && offset < 0x420)
        c->priority[(offset - 0x400) / 4] = value & 0xC0C0C0C0; // two bits are there
    else if (offset == 0xD04)
        c->icsr_pending |= (value >> 28 & 1) << PENDSV;
    else if (offset == 0xD08)
        c->vtor = value & 0xFFFFFF00;
    else if (offset == 0xD20)
        c->shpr3 = value & 0xC0C00000;
    else if (offset != 0x14 || value != SYSTICK_CYCLES - 1)
        rp2040_object(&c->chip, "0x%08X = 0x%08X", 0xE000E000 + (uint32_t)offset, value);
}

static void on_access(uc_engine *engine, uc_mem_type type, uint64_t address, int size, int64_t value, void *context) {
    (void)engine;
    (void)type;
    (void)value;
    if (address % (uint64_t)size != 0)
        rp2040_object(&((struct cpu *)context)->chip, "%d bytes at 0x%08X are not aligned", size, (uint32_t)address);
}

static bool on_bad_access(uc_engine *engine, uc_mem_type type, uint64_t address, int size, int64_t value,
                          void *context) {
    (void)engine;
    (void)type;
    rp2040_object(&((struct cpu *)context)->chip,
                  "%d bytes at 0x%08X, 0x%llX: no memory, or flash that cannot be read now", size, (uint32_t)address,
                  (unsigned long long)value);
    return false;
}

// ---- the ROM's functions (2.8.3): one instruction each, which returns; this is what they do ----

static const char names[][3] = {"", "IF", "EX", "RE", "RP", "FC", "CX"}; // 0: the look-up
enum { LOOK_UP, CONNECT, EXIT_XIP, ERASE, PROGRAM, FLUSH, ENTER_XIP, FUNCTIONS };

static uint32_t found(uint32_t code) {
    for (unsigned i = CONNECT; i < FUNCTIONS; i++)
        if (code == ((uint32_t)names[i][1] << 8 | (uint32_t)names[i][0]))
            return ROM_FUNCTIONS + 4 * i + 1;
    return 0;
}

static void flash_work(struct cpu *c, unsigned what, uint32_t at, uint32_t second, uint32_t third) {
    const uint32_t size = what == ERASE ? 4096 : 256, count = what == ERASE ? second : third;
    if (c->chip.xip || at % size != 0 || count % size != 0 || at + count > RP_FLASH_SIZE || at < 48 * 1024) {
        rp2040_object(&c->chip, "flash function %u at 0x%X, %u bytes", what, at, count);
        return;
    }
    if (what == ERASE)
        memset(c->flash + at, 0xFF, count);
    for (uint32_t i = 0; what == PROGRAM && i < count; i++) {
        uint8_t byte = 0;
        uc_mem_read(c->engine, second + i, &byte, 1);
        c->flash[at + i] &= byte;
    }
    c->chip.cycles += (uint64_t)CLOCK_MHZ * (what == ERASE ? 45000 : 700); // typical of a W25Q16JV
}

static void on_rom(uc_engine *engine, uint64_t address, uint32_t size, void *context) {
    (void)engine;
    (void)size;
    struct cpu *c = context;
    const unsigned what = (unsigned)(address - ROM_FUNCTIONS) / 4;
    const uint32_t r0 = get(c, UC_ARM_REG_R0), r1 = get(c, UC_ARM_REG_R1), r2 = get(c, UC_ARM_REG_R2);
    if (what == LOOK_UP) {
        if (r0 != ROM_TABLE || found(r1) == 0)
            rp2040_object(&c->chip, "the ROM has no function 0x%04X in 0x%X", r1, r0);
        set(c, UC_ARM_REG_R0, found(r1));
    }
    if (what == ERASE || what == PROGRAM)
        flash_work(c, what, r0, r1, r2);
    if (what == EXIT_XIP || what == ENTER_XIP)
        c->chip.xip = what == ENTER_XIP;
    open_flash(c);
}

// ---- boot ----

static uint32_t checksum(const uint8_t *data, unsigned length) { // 2.8.1.3.1
    uint32_t crc = 0xFFFFFFFF;
    for (unsigned i = 0; i < 8 * length; i++) {
        const uint32_t bit = (crc >> 31) ^ (data[i / 8] >> (7 - i % 8) & 1u);
        crc = crc << 1 ^ (bit != 0 ? 0x04C11DB7 : 0);
    }
    return crc;
}

bool cpu_boot(struct cpu *c, uint32_t reason) {
    rp2040_reset(&c->chip, reason);
    c->icsr_pending = c->enabled = c->latched = c->shpr3 = c->depth = 0;
    memset(c->priority, 0, sizeof c->priority);
    c->systick_on = false;
    c->stopped_block = 0;
    uint32_t told;
    memcpy(&told, c->flash + 252, 4);
    if (checksum(c->flash, 252) != told) {
        fprintf(stderr, "pico: the second stage's checksum is 0x%08X, expected 0x%08X\n", told,
                checksum(c->flash, 252));
        return false;
    }
    memcpy(c->sram + (BOOT_AT - RP_SRAM), c->flash, 256);
    open_flash(c);
    set(c, UC_ARM_REG_SP, STACK);
    set(c, UC_ARM_REG_PC, BOOT_AT | 1);
    return true;
}

// Unicorn takes functions of several types in one place.
static void *hook_of(void (*function)(void)) {
    void *pointer;
    memcpy(&pointer, &function, sizeof pointer);
    return pointer;
}

bool cpu_open(struct cpu *c, uint8_t *flash) {
    c->flash = flash;
    c->sram = calloc(1, RP_SRAM_SIZE);
    c->rom = calloc(1, ROM_SIZE);
    if (c->sram == NULL || c->rom == NULL ||
        uc_open(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS, &c->engine) != UC_ERR_OK)
        return false;
    const uint16_t table = ROM_TABLE, look_up = ROM_FUNCTIONS + 1, back = 0x4770; // bx lr
    memcpy(c->rom + 0x14, &table, 2);
    memcpy(c->rom + 0x18, &look_up, 2);
    for (unsigned i = 0; i < FUNCTIONS; i++)
        memcpy(c->rom + ROM_FUNCTIONS + 4 * i, &back, 2);
    uc_engine *e = c->engine;
    uc_hook hook;
    uc_ctl_set_cpu_model(e, UC_CPU_ARM_CORTEX_M0);
    if (c->aligned)
        uc_hook_add(e, &hook, UC_HOOK_MEM_READ | UC_HOOK_MEM_WRITE, hook_of((void (*)(void))on_access), c, 1, 0);
    return uc_mem_map_ptr(e, 0, ROM_SIZE, UC_PROT_READ | UC_PROT_EXEC, c->rom) == UC_ERR_OK &&
           uc_mem_map_ptr(e, RP_FLASH, RP_FLASH_SIZE, UC_PROT_READ, flash) == UC_ERR_OK &&
           uc_mem_map_ptr(e, RP_SRAM, RP_SRAM_SIZE, UC_PROT_ALL, c->sram) == UC_ERR_OK &&
           uc_mmio_map(e, 0x40000000, 0x70000, read_bridged, c, write_bridged, c) == UC_ERR_OK &&
           uc_mmio_map(e, 0x18000000, 0x1000, read_ssi, c, write_ssi, c) == UC_ERR_OK &&
           uc_mmio_map(e, 0xD0000000, 0x1000, read_sio, c, write_sio, c) == UC_ERR_OK &&
           uc_mmio_map(e, 0xE000E000, 0x1000, read_core, c, write_core, c) == UC_ERR_OK &&
           uc_hook_add(e, &hook, UC_HOOK_BLOCK, hook_of((void (*)(void))on_block), c, 1, 0) == UC_ERR_OK &&
           uc_hook_add(e, &hook, UC_HOOK_MEM_INVALID, hook_of((void (*)(void))on_bad_access), c, 1, 0) == UC_ERR_OK &&
           uc_hook_add(e, &hook, UC_HOOK_CODE, hook_of((void (*)(void))on_rom), c, (uint64_t)ROM_FUNCTIONS,
                       (uint64_t)ROM_FUNCTIONS + 4 * FUNCTIONS - 1) == UC_ERR_OK;
}

void cpu_close(struct cpu *c) {
    uc_close(c->engine);
    free(c->sram);
    free(c->rom);
}

// ---- run ----

enum { WFI = 0xBF30, UDF = 0xDE00 };

// Unicorn has come back: why? After a stop at a block's begin its program counter may be that of a block before.
static bool go_on(struct cpu *c, uc_err error) {
    if (error == UC_ERR_OK && c->stopped_block != 0) {
        set(c, UC_ARM_REG_PC, (uint32_t)c->stopped_block | 1);
        return true;
    }
    const uint32_t pc = get(c, UC_ARM_REG_PC) & ~1u;
    if (pc == (uint32_t)LEAVE && c->depth > 0) {
        leave(c);
        return true;
    }
    const uint16_t code = (uint16_t)word_at(c, pc);
    if (error != UC_ERR_OK && (code & 0xFF00) == UDF && c->depth == 0) {
        c->icsr_pending |= 1u << FAULT;
        return true;
    }
    if (error != UC_ERR_OK) {
        fprintf(stderr, "pico: %s at 0x%08X\n", uc_strerror(error), pc);
        return false;
    }
    if ((uint16_t)word_at(c, pc - 2) == WFI) // it sleeps, and nothing but time passes
        c->chip.cycles = c->stop_at;
    return true;
}

bool cpu_run(struct cpu *c, uint64_t cycles) {
    c->stop_at = cycles;
    while (!c->dead && c->chip.cycles < cycles) {
        if (c->chip.want_reset) {
            if (!cpu_boot(c, c->chip.reason))
                c->dead = true;
            continue;
        }
        const unsigned exception = to_take(c);
        if (exception != 0) {
            c->stopped_block = 0;
            take(c, exception);
        }
        c->horizon = 0;
        const uc_err error = uc_emu_start(c->engine, get(c, UC_ARM_REG_PC) | 1, (uint32_t)LEAVE, 0, 0);
        c->dead = !go_on(c, error);
    }
    return !c->dead;
}
