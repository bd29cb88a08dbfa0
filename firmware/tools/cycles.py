#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bound of the step interrupt in cycles, from its disassembly (arm-none-eabi-objdump -d).

usage: cycles.py LISTING MHZ WAIT_STATES BYTES_A_FETCH [m0]
Every instruction at its worst: Cortex-M3 Technical Reference Manual r2p1, table 18-1 (loads and stores 2 cycles,
multiples 1 + n, taken branches 1 + 3 to refill, multiply-accumulate 2, UDIV 12, 64-bit multiplications 7), the
processor's entry and exit (12 and 12), and WAIT_STATES for each new line of BYTES_A_FETCH that the path touches and for
each literal, as if nothing were cached. With m0, Cortex-M0+ Technical Reference Manual r0p1, table 3-1: the same but for
taken branches (1 + 1), entry and exit (15 and 15) and 2 more for each access behind the peripherals' bridge, of which an
interrupt makes BRIDGED. Waiting for an event that is not due yet costs nothing that anybody needs.

Three paths are told apart: an interrupt with one event; each further event in the same interrupt; what the change to the
next segment, once in 256 ticks, adds. The load is that of four axes at 40,000 steps/s in the worst phases: every rising
edge in an interrupt of its own, 160,000 a second, 3,906 ends of segments, and 40,000 falling edges alone. More of those
there cannot be: pulses of 4 us fall alone 14 ticks after the first of them rose, if no axis rises between 4 ticks after
the last of them and then. Alone twice within the 25 ticks of a period, the second group would have to begin 15 ticks
after the first and last 10 ticks more, until the first axis rises again, without 4 ticks between two of its three edges.
Exit status 1 where edges that follow each other tick by tick would pile up (a further event takes more than 1.1 ticks,
with counting it as late), or where that load is above 60 %. The producer needs the rest (tests/system/firmware.py).
"""
import re
import sys

FUNCTION = "step_interrupt"
M0 = "m0" in sys.argv[5:]
BRIDGED = 5
ENTRY, EXIT = (15, 15 + 2 * BRIDGED) if M0 else (12, 12)
REFILL = 1 if M0 else 3
PEND_PRODUCER = "#3332", 0xE000ED04  # SCB_ICSR, as an offset or a literal: only the change of segment stores there
EVENTS = 160000 + 40000 + 1000000 / 256
MOST_LOAD = 0.60


def read(path):
    lines, words, on = [], {}, False
    for line in open(path, encoding="utf-8"):
        word = re.match(r"\s*([0-9a-f]+):\t\.word\s+0x([0-9a-f]+)", line)
        if word:
            words[word.group(1)] = int(word.group(2), 16)
        head = re.match(r"[0-9a-f]+ <([^>]+)>:", line)
        if head:
            on = head.group(1) == FUNCTION
        code = re.match(r"\s*([0-9a-f]+):\t(\S+)\s*([^@\n]*)(?:@ \(([0-9a-f]+) )?", line)
        if on and code and not code.group(2).startswith("."):
            lines.append((int(code.group(1), 16), code.group(2), code.group(3).strip(), code.group(4)))
    return [(a, name, operands, words.get(literal)) for a, name, operands, literal in lines]


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


def graph(code, wait, fetch):
    """For each instruction: [(next, cycles)]; next None: it returns."""
    where = {line[0]: i for i, line in enumerate(code)}
    ways = []
    for i, (address, name, operands, _) in enumerate(code):
        own = cost(name, operands, wait)
        line = wait if i + 1 < len(code) and address // fetch != code[i + 1][0] // fetch else 0
        out = []
        target = re.search(r"([0-9a-f]+) <", operands)
        returns = name == "bx" or (re.match(r"(pop|ldm)", name) and "pc" in operands)
        if re.match(r"(b|cb)", name) and target and not name.startswith(("bic", "bfi", "bfc")):
            out.append((where[int(target.group(1), 16)], own + REFILL + wait))
        if returns:
            out.append((None, own + (REFILL if name == "bx" else 0)))
        elif not re.match(r"b(\.[nw])?$", name) and i + 1 < len(code):
            out.append((i + 1, own + line))
        ways.append(out)
    return ways


def longest(ways, start, end, banned):
    """Cycles of the longest path from start to end that takes no instruction twice."""
    best, seen = -1, [False] * len(ways)

    def follow(at, cycles):
        nonlocal best
        seen[at] = True
        for to, more in ways[at]:
            if to == end:
                best = max(best, cycles + more)
            elif to is not None and not seen[to] and to not in banned:
                follow(to, cycles + more)
        seen[at] = False

    follow(start, 0)
    return best


def main():
    path, mhz, wait, fetch = sys.argv[1], *map(int, sys.argv[2:5])
    code = read(path)
    ways = graph(code, wait, fetch)
    offset, address = PEND_PRODUCER
    change = {i for i, (_, _, operands, literal) in enumerate(code) if offset in operands or literal == address}
    # The turns of the loop that takes events begin where it looks for lateness.
    heads = [i for i, (_, name, _, _) in enumerate(code) if name.startswith(("cmn", "adds", "cmp")) and
             any(to is not None and to > i for to, _ in ways[i])]
    alone = longest(ways, 0, None, change) + ENTRY + EXIT + wait
    turns = [longest(ways, i, i, change) for i in heads]
    further = max(turns)
    changing = max(longest(ways, i, i, set()) for i in heads) - further
    load = EVENTS * alone / (1e6 * mhz)
    print(f"{FUNCTION}: an event alone {alone} cycles, each further one {further} (a tick has {mhz}), the change of segment "
          f"{changing} more; four axes at 40,000 steps/s, every edge alone: at most {100 * load:.0f} % "
          f"({wait} wait states, {fetch} bytes a fetch)")
    return 1 if further > 1.1 * mhz or load > MOST_LOAD else 0


sys.exit(main())
