// SPDX-License-Identifier: BSD-3-Clause
// Writes docs/protocol.md from regmap.def to standard output.
#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>

static void range(int64_t minimum, int64_t maximum) {
    if (minimum == maximum)
        printf("any");
    else
        printf("%" PRId64 "..%" PRId64, minimum, maximum);
}

static void registers(void) {
    puts("| Address | Name | Type | Access | Unit | Range | Initial | |\n|---|---|---|---|---|---|---|---|");
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    printf("| 0x%04X | `%s`%s | %s | %s | %s | ", (unsigned)(address), #name, (count) > 1 ? " x 4" : "", #type,        \
           #access, unit);                                                                                             \
    range(minimum, maximum);                                                                                           \
    printf(" | %" PRId64 " | %s |\n", (int64_t)(initial), text);
#include "firmware/regmap.def"
}

#define ROW(value, name, text) printf("| %d | %s | %s |\n", (int)(value), #name, text);
#define HEAD "|---|---|---|\n"

static void bits(void) {
    printf("\n## Coils (functions 1, 5, 15)\n\n| Address | Name | |\n" HEAD);
#define COIL ROW
#include "firmware/regmap.def"
    printf("\n## Discrete inputs (function 2), bits of register `inputs`\n\n| Address | Name | 1 means |\n" HEAD);
#define CONTACT ROW
#include "firmware/regmap.def"
}

static void enumerations(void) {
    printf("\n## Outputs, bits of register `output_invert`\n\n| Bit | Name | |\n" HEAD);
#define OUTPUT ROW
#include "firmware/regmap.def"
    printf("\n## Commands\n\n| Value | Name | |\n" HEAD);
#define COMMAND ROW
#include "firmware/regmap.def"
    printf("\n## States\n\n| Value | Name | |\n" HEAD);
#define STATE ROW
#include "firmware/regmap.def"
    printf("\n## Alarms\n\n| Value | Name | |\n" HEAD);
#define ALARM ROW
#include "firmware/regmap.def"
    printf("\n## Refusals\n\n| Value | Name | |\n" HEAD);
#define REFUSAL ROW
#include "firmware/regmap.def"
    printf("\n## Lamp states\n\n| Value | Name | |\n" HEAD);
#define LAMP ROW
#include "firmware/regmap.def"
    printf("\n## Reset causes\n\n| Value | Name | |\n" HEAD);
#define CAUSE ROW
#include "firmware/regmap.def"
    printf("\n## Boards\n\n| Value | Name | |\n" HEAD);
#define BOARD ROW
#include "firmware/board/boards.def"
}

static const char introduction[] =
    "# The controller's protocol\n\n"
    "Made from `firmware/regmap.def` by `make protocol`; change that, not this.\n\n"
    "Modbus RTU, 8N1, address 1 and 115200 baud unless changed; the posix board also speaks Modbus TCP. Functions 1, "
    "2, "
    "3, 4, 5, 6, 8, 15, 16, 22, 23 and 43/14, after *MODBUS Application Protocol Specification V1.1b3* and *MODBUS "
    "over "
    "Serial Line V1.02*. Broadcasts (address 0) are carried out and not answered.\n\n"
    "- A value of several registers has its high word first; it is read and written whole. A write that holds one bad "
    "value, or whose command is refused, changes nothing.\n"
    "- A command is one write (function 16) of the block from `command_id` to `command`. Exception 4 or 6: register "
    "`refusal` says why. Repeating a block whose reply got lost is harmless: the same `command_id` is not carried out "
    "twice. STOP and HALT need no id and are never refused.\n"
    "- Positions are absolute. A move is over, and settled, when `finished_id` is its id.\n"
    "- Status: function 23, write a fresh number to `token`, read from `token` on. A reply with another token is "
    "stale.\n"
    "- One master holds the rig (register `owner`), the others may read, STOP, HALT and switch lamp and shutter off; "
    "whatever else they write is exception 4, refusal NOT_OWNER. A master claims it, while nobody holds it, by writing "
    "a number of its own to `heartbeat`: alone, or as the beginning of a command block that starts there (23 registers "
    "from 0x00FE on). Only that feeds the dead-man from then on. A block from `command_id` on, or a coil switched on, "
    "claims for its connection (a serial line is one) without a number, and every write of that connection feeds. "
    "Reading, the token and what ends in an exception never do. YIELD lets go; so does a silence.\n"
    "- After `deadman` ms in which the master that holds the rig fed nothing the machine stops and makes itself safe "
    "(alarm DEADMAN).\n"
    "- In the states ALARM and ESTOP the lamp and shutter cannot be switched on and nothing moves; CLEAR ends them.\n\n"
    "## Registers (functions 3, 4, 6, 16, 22, 23)\n\n"
    "Access: R read, W write, P parameter (write at rest; SAVE keeps it), C command (acts when written).\n\n";

int main(void) {
    fputs(introduction, stdout);
    registers();
    bits();
    enumerations();
    return 0;
}
