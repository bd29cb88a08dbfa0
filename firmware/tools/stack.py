#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Worst-case stack of a firmware image, from the compiler's own call graph (-fcallgraph-info=su).

usage: stack.py ELF_SIZE_FILE FLASH_LIMIT RAM_LIMIT CI_FILE...
ELF_SIZE_FILE holds `arm-none-eabi-size` output. Prints flash, static RAM, stack and their limits; exit status 1 where
one is passed, or where the graph holds recursion, an indirect call, floating point below an interrupt, or a division by the
library in one that delays step edges.
"""
import re
import sys

# Interrupts by priority; each may preempt those after it, so their stacks add up. 32 bytes: what the processor pushes,
# and 4 to align it.
LEVELS = [["input_interrupt", "cortex_m_wrap", "supply_interrupt"], ["step_interrupt"], ["uart_interrupt"],
          ["cortex_m_produce"]]
FRAME = 36
# A chip's boot ROM, whose source is public but not ours: no usage is given; none of its functions takes more than this.
ROM = "boot ROM"
ROM_USAGE = 256
# gonio_fw_registers_walk calls back one of two functions of its own choice.
INDIRECT = {"gonio_fw_registers_walk": ["read_word", "write_word"],
            **dict.fromkeys(["rom", "flash_begin", "flash_end", "gonio_fw_board_store_erase", "gonio_fw_board_store_program"],
                            [ROM])}
# libgcc's, written in assembler: no usage is given; none pushes more than this.
LIBRARY = 64


def read_graph(paths):
    usage, calls = {}, {}
    for path in paths:
        for line in open(path, encoding="utf-8"):
            node = re.match(r'node: \{ title: "([^"]+)" label: "([^"\\]+)(?:\\n[^"]*?\\n(\d+) bytes)?', line)
            edge = re.match(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', line)
            if node and node.group(3) is not None:
                usage[node.group(1)] = int(node.group(3))
            elif edge:
                calls.setdefault(edge.group(1), set()).add(edge.group(2))
    usage[ROM] = ROM_USAGE
    return usage, calls


def short(name):
    return name.split(":")[-1]


class Graph:
    def __init__(self, usage, calls):
        self.usage, self.calls, self.deepest, self.problems = usage, calls, {}, []
        self.by_short = {}
        for name in usage:
            self.by_short.setdefault(short(name), name)

    def targets(self, name):
        for target in self.calls.get(name, ()):
            if target != "__indirect_call":
                yield target
                continue
            allowed = INDIRECT.get(short(name))
            if allowed is None:
                self.problems.append("indirect call in " + short(name))
            for other in allowed or ():
                yield self.by_short[other]

    def depth(self, name, above=()):
        if name in above:
            self.problems.append("recursion: " + " -> ".join(map(short, above + (name,))))
            return 0
        if name not in self.deepest:
            own = self.usage.get(name, LIBRARY)
            self.deepest[name] = own + max([self.depth(t, above + (name,)) for t in self.targets(name)], default=0)
        return self.deepest[name]

    def reach(self, name, seen):
        if name not in seen:
            seen.add(name)
            for target in self.targets(name):
                self.reach(target, seen)
        return seen


def main():
    size = open(sys.argv[1], encoding="utf-8").read().split("\n")[1].split()
    flash_limit, ram_limit = int(sys.argv[2]), int(sys.argv[3])
    graph = Graph(*read_graph(sys.argv[4:]))
    total = graph.depth(graph.by_short["main"])
    for level in LEVELS:
        names = [graph.by_short[n] for n in level if n in graph.by_short]
        total += FRAME + max(graph.depth(n) for n in names)
        for name in names:
            for used in graph.reach(name, set()):
                if re.match(r"__aeabi_(d|f|i2d|ui2d|l2d|ul2d|i2f|ui2f)", short(used)):
                    graph.problems.append(f"floating point below {short(name)}: {short(used)}")
                if level in LEVELS[:2] and re.match(r"__aeabi_(u?idiv|u?ldiv)", short(used)):
                    graph.problems.append(f"division below {short(name)}, for which edges wait: {short(used)}")
    flash, static = int(size[0]) + int(size[1]), int(size[1]) + int(size[2])
    print(f"flash {flash} of {flash_limit}   RAM {static} static + {total} stack = {static + total} of {ram_limit}")
    if flash > flash_limit or static + total > ram_limit:
        graph.problems.append("over the limit")
    for problem in sorted(set(graph.problems)):
        print("  " + problem)
    return 1 if graph.problems else 0


sys.exit(main())
