# SPDX-License-Identifier: BSD-3-Clause
"""A Modbus TCP slave by pymodbus that has the controller's table as far as identification and status go, made from
regmap.def: it stands in an alarm and refuses every command."""
import re
import socket
import sys

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.server import StartTcpServer

WORDS = {"u16": 1, "u32": 2, "i32": 2, "i64": 4}
SAYS = {"version": 0x070809, "board": 77, "state": 4, "alarm": 6, "alarm_axis": 2, "time": 1}


def number(text):
    return int(text, 0)


words = [0] * 0x400
with open("firmware/regmap.def", encoding="utf-8") as table:
    for match in re.finditer(r"^REGISTER\((\w+),\s*(\w+),\s*(\w+),\s*(\d+),[^,]*,\s*\"[^\"]*\",([^,]*),([^,]*),([^,]*),",
                             table.read(), re.M):
        address, name, kind, count = number(match[1]), match[2], match[3], int(match[4])
        value = SAYS.get(name, number(match[7].strip()))
        for k in range(count):
            for w in range(WORDS[kind]):
                words[address + k * WORDS[kind] + w] = value >> 16 * (WORDS[kind] - 1 - w) & 0xFFFF
store = ModbusSlaveContext(hr=ModbusSequentialDataBlock(0, words), zero_mode=True)
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
with open(sys.argv[1], "w", encoding="utf-8") as out:
    out.write(str(port))
StartTcpServer(context=ModbusServerContext(slaves={1: store}, single=False), address=("127.0.0.1", port))
