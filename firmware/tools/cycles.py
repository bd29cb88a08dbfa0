#!/usr/bin/python3
"""Bound of a function's longest loop-free path, in cycles, from its disassembly (arm-none-eabi-objdump -d).

usage: cycles.py LISTING FUNCTION WAIT_STATES BYTES_A_FETCH
Every instruction at its worst: Cortex-M3 Technical Reference Manual r2p1, table 18-1 (loads and stores 2 cycles,
multiples 1 + n, taken branches 1 + 3 to refill, UDIV 12, 64-bit multiplications 7), the processor's entry and exit (12
and 12), and WAIT_STATES for each new line of BYTES_A_FETCH that the path touches and for each literal, as if nothing
were cached. Backward branches (waiting for the clock, looking for the next word with an event) are left out; each turn
of the second costs what is printed for it.
"""
import re
import sys

ENTRY_AND_EXIT = 24


def read(path, function):
    lines, on = [], False
    for line in open(path, encoding="utf-8"):
        head = re.match(r"[0-9a-f]+ <([^>]+)>:", line)
        if head:
            on = head.group(1) == function
        code = re.match(r"\s+([0-9a-f]+):\t(\S+)\s*(.*)", line)
        if on and code and not code.group(2).startswith("."):
            lines.append((int(code.group(1), 16), code.group(2), code.group(3)))
    return lines


def cost(name, operands, wait):
    base = name.split(".")[0]
    listed = operands.count(",") + 1
    if re.match(r"(push|pop|ldm|stm)", base):
        return 1 + listed + (4 if "pc" in operands else 0)
    if re.match(r"(ldrd|strd)", base):
        return 3
    if base.startswith("ldr"):
        return 2 + (wait if "pc" in operands else 0)
    if base.startswith("str"):
        return 2
    if re.match(r"(umull|smull|umlal|smlal)", base):
        return 7
    if re.match(r"[us]div", base):
        return 12
    if re.match(r"(mla|mls)", base):
        return 2
    return 1


def main():
    listing, function, wait, fetch = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    code = read(listing, function)
    where = {address: i for i, (address, _, _) in enumerate(code)}
    longest = [0] * (len(code) + 1)
    count = [0] * (len(code) + 1)
    for i in reversed(range(len(code))):  # forward branches only: the graph has no circle
        address, name, operands = code[i]
        ways = []
        target = re.match(r"(?:\w+, )?([0-9a-f]+) <", operands) if re.match(r"(b|cb)", name) and name != "bic.w" else None
        line = wait if i == 0 or address // fetch != code[i - 1][0] // fetch else 0
        own = cost(name, operands, wait) + line
        if target and int(target.group(1), 16) in where and int(target.group(1), 16) > address:
            to = where[int(target.group(1), 16)]
            ways.append((own + 3 + wait + longest[to], 1 + count[to]))
        unconditional = re.match(r"b(\.[nw])?$", name) or "pc" in operands and re.match(r"(pop|ldm)", name) or name == "bx"
        if not unconditional:
            ways.append((own + longest[i + 1], 1 + count[i + 1]))
        longest[i], count[i] = max(ways) if ways else (own + 3, 1)
    print(f"{function}: at most {longest[0] + ENTRY_AND_EXIT} cycles, {count[0]} instructions an event "
          f"({wait} wait states, {fetch} bytes a fetch)")


main()
