# SPDX-License-Identifier: BSD-3-Clause
"""Driven by firmware.sh. Every check prints a TAP line; the registers' addresses come from firmware/regmap.def."""
import contextlib
import ctypes
import ctypes.util
import glob
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time

from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.diag_message import ReturnBusMessageCountRequest, ReturnQueryDataRequest
from pymodbus.register_read_message import ReadWriteMultipleRegistersRequest
from pymodbus.register_write_message import MaskWriteRegisterRequest
from pymodbus.mei_message import ReadDeviceInformationRequest

BUILD = sys.argv[1]
TRIES = 30  # an emulated line stalls with a busy host; the slave then rightly drops the frame, and a master asks again
WORDS = {"u16": 1, "u32": 2, "i32": 2, "i64": 4}
number = failures = 0


def ok(good, what):
    global number, failures
    number += 1
    failures += not good
    print(("ok" if good else "not ok"), number, "-", what, flush=True)
    return good


def skip(what, why):
    global number
    number += 1
    print("ok", number, "-", what, "# SKIP", why, flush=True)


def load_map():
    registers, values = {}, {}
    text = open("firmware/regmap.def", encoding="utf-8").read()
    for line in text.split("\n"):
        r = re.match(r"REGISTER\((\w+),\s*(\w+),\s*(\w+),\s*(\d+),\s*(\w),", line)
        e = re.match(r"(COMMAND|STATE|ALARM|CAUSE|REFUSAL)\((\d+),\s*(\w+),", line)
        if r:
            registers[r.group(2)] = (int(r.group(1), 0), r.group(3), int(r.group(4)))
        if e:
            values[e.group(1) + "_" + e.group(3)] = int(e.group(2))
    return registers, values


REGISTERS, E = load_map()
BOARDS = {name: int(number) for number, name in re.findall(r"^BOARD\((\d+),\s*(\w+),", open("firmware/board/boards.def",
                                                                                          encoding="utf-8").read(), re.M)}


class Controller:
    """The registers by name, through any pymodbus client."""

    def __init__(self, client):
        self.client, self.id = client, 0
        client.connect()

    def retry(self, call):
        for _ in range(TRIES):
            reply = call()
            if "Modbus Error" not in str(reply):
                return reply
            time.sleep(0.05)
        raise RuntimeError(str(reply))

    def ask(self, request):
        request.unit_id = 1  # pymodbus 3.0 forgets its slave argument in some requests
        return self.retry(lambda: self.client.execute(request))

    def get(self, name, axis=0):
        address, kind, _ = REGISTERS[name]
        words = WORDS[kind]
        reply = self.retry(lambda: self.client.read_holding_registers(address + axis * words, words, slave=1))
        value = 0
        for word in reply.registers:
            value = value << 16 | word
        return value - (1 << 16 * words) if kind[0] == "i" and value >> (16 * words - 1) else value

    def put(self, name, *values):
        address, kind, _ = REGISTERS[name]
        words = [v >> 16 * i & 0xFFFF for v in values for i in reversed(range(WORDS[kind]))]
        return self.retry(lambda: self.client.write_registers(address, words, slave=1))

    def command(self, name, axes=0, targets=(0, 0, 0, 0)):
        self.id += 1
        words = [self.id >> 16, self.id & 0xFFFF, axes, 1000]
        words += [t >> 16 * i & 0xFFFF for t in targets for i in reversed(range(4))] + [E["COMMAND_" + name]]
        return self.retry(lambda: self.client.write_registers(REGISTERS["command_id"][0], words, slave=1))

    def restarts(self, cause, address, values):
        """After this write, which dies before it is answered, or gets lost and is said again: why it started."""
        for _ in range(5):
            self.client.write_registers(REGISTERS[address][0], values, slave=1)
            if self.until("reset_cause", E["CAUSE_" + cause], 5):
                return True
        return False

    def until(self, name, value, seconds=30):
        end = time.time() + seconds
        while time.time() < end:
            if self.get(name) == value:
                return True
            time.sleep(0.02)
        return False


def check_functions(c, where):
    read = c.retry(lambda: c.client.read_input_registers(0, 2, slave=1))
    ok(read.registers == [0x474F, 2], where + ": function 4")
    c.retry(lambda: c.client.write_register(REGISTERS["token"][0], 0x1234, slave=1))
    ok(c.get("token") == 0x1234, where + ": functions 6 and 3")
    c.ask(MaskWriteRegisterRequest(REGISTERS["token"][0], 0xF2F2, 0x2525))
    ok(c.get("token") == (0x1234 & 0xF2F2) | (0x2525 & ~0xF2F2 & 0xFFFF), where + ": function 22")
    request = ReadWriteMultipleRegistersRequest(read_address=REGISTERS["token"][0], read_count=8,
                                                write_address=REGISTERS["token"][0], write_registers=[0xBEEF])
    both = c.ask(request)
    ok(len(both.registers) == 8 and both.registers[0] == 0xBEEF, where + ": function 23 returns the token just written")
    c.retry(lambda: c.client.write_coil(1, True, slave=1))
    coils = c.retry(lambda: c.client.read_coils(0, 2, slave=1))
    ok(coils.bits[:2] == [False, True], where + ": functions 5 and 1")
    c.retry(lambda: c.client.write_coils(0, [False, False], slave=1))
    coils = c.retry(lambda: c.client.read_coils(0, 2, slave=1))
    ok(coils.bits[:2] == [False, False], where + ": function 15")
    contacts = c.retry(lambda: c.client.read_discrete_inputs(0, 14, slave=1))
    ok(contacts.bits[:14] == [False] * 14, where + ": function 2")
    query = c.ask(ReturnQueryDataRequest(0xA537))
    ok("42295" in str(query.message), where + ": function 8 returns the query")
    count = c.ask(ReturnBusMessageCountRequest())
    ok(count.sub_function_code == 11, where + ": function 8 counts")
    device = c.ask(ReadDeviceInformationRequest(2, 0))
    ok(device.information[0] == b"Gonio" and len(device.information) == 6, where + ": function 43/14")
    bad = c.retry(lambda: c.client.read_holding_registers(0x0A, 1, slave=1))
    ok(getattr(bad, "exception_code", 0) == 2, where + ": exception for a gap")


def home_in_place(c):
    c.put("home_order", 0, 0, 0, 0)
    c.put("speed_max", *[20000] * 4)
    c.put("acceleration", *[200000] * 4)
    c.put("jerk", *[20000000] * 4)
    c.put("settle", 1)
    c.put("deadman", 0)
    c.command("HOME", 15)
    return c.until("state", E["STATE_IDLE"]) and c.get("homed") == 15


def check_mbpoll(path, where):
    for _ in range(TRIES):
        run = subprocess.run(["mbpoll", "-m", "rtu", "-b", "115200", "-P", "none", "-a", "1", "-t", "4:hex", "-0", "-r",
                              "0", "-c", "2", "-1", "-o", "1", path], capture_output=True, text=True, check=False)
        if "0x474F" in run.stdout:
            break
    ok("0x474F" in run.stdout, where + ": mbpoll")


def check_libmodbus(path, where):
    lib = ctypes.CDLL("libmodbus.so.5")
    lib.modbus_new_rtu.restype = ctypes.c_void_p
    context = ctypes.c_void_p(lib.modbus_new_rtu(path.encode(), 115200, ctypes.c_char(b"N"), 8, 1))
    lib.modbus_set_slave(context, 1)
    lib.modbus_connect(context)
    got, put = (ctypes.c_uint16 * 8)(), (ctypes.c_uint16 * 1)(0x5AA5)
    token = REGISTERS["token"][0]
    for _ in range(TRIES):
        n = lib.modbus_write_and_read_registers(context, token, 1, put, token, 8, got)
        if n == 8:
            break
        time.sleep(0.1)
        lib.modbus_flush(context)
    ok(n == 8 and got[0] == 0x5AA5, where + ": libmodbus, function 23")
    lib.modbus_close(context)
    lib.modbus_free(context)


class Process:
    """A program that is ended with its block."""

    def __init__(self, *command, **options):
        self.p = subprocess.Popen(command, text=True, **options)

    def __enter__(self):
        return self.p

    def __exit__(self, *_):
        self.p.kill()
        self.p.wait()


def second_master(port):
    """Over TCP: who only reads keeps no dead host's move going, and drops nobody's connection."""
    first, second = (Controller(ModbusTcpClient("127.0.0.1", port)) for _ in range(2))
    home_in_place(first)
    first.put("speed_max", *[2000] * 4)
    first.put("deadman", 1000)
    first.command("MOVE", 3, (30000, -30000, 0, 0))
    ok(second.get("state") == E["STATE_MOVING"] and first.get("owner") == 0xFFFFFFFF,
       "posix, TCP: two masters read side by side")
    refused = second.put("deadman", 0)
    ok(getattr(refused, "exception_code", 0) in (4, 6) and first.get("deadman") == 1000,
       "posix, TCP: the second cannot disarm the dead-man")
    end = time.time() + 3
    while time.time() < end and second.get("state") == E["STATE_MOVING"]:
        time.sleep(0.1)
    ok(second.get("alarm") == E["ALARM_DEADMAN"], "posix, TCP: and does not feed it")
    second.client.close()
    first.client.close()


def posix(folder):
    link, flash = folder + "/line", folder + "/flash"
    command = [BUILD + "/gonio-controller", "--pty", link, "--flash", flash, "--speed", "10"]
    with Process(*command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as p:
        p.stdout.readline()
        c = Controller(ModbusSerialClient(link, baudrate=115200, timeout=1))
        check_functions(c, "posix")
        c.put("debounce", 7)
        c.put("deadman", 0)
        c.command("HOME", 15)
        ok(c.until("state", E["STATE_IDLE"], 60) and c.get("homed") == 15, "posix: homes on its simulated switches")
        c.command("MOVE", 3, (5000, -6000, 0, 0))
        ok(c.until("finished_id", c.id) and c.get("position", 1) == -6000, "posix: moves")
        c.command("SAVE")
        p.stdin.write("hold estop 1\n")
        p.stdin.flush()
        ok(c.until("state", E["STATE_ESTOP"], 5), "posix: emergency stop")
        c.client.close()
        check_mbpoll(link, "posix")
        check_libmodbus(link, "posix")
    with Process(BUILD + "/gonio-controller", "--tcp", "0", "--flash", flash, stdin=subprocess.DEVNULL,
                 stdout=subprocess.PIPE) as p:
        port = int(p.stdout.readline().split()[1])
        c = Controller(ModbusTcpClient("127.0.0.1", port))
        check_functions(c, "posix, TCP")
        ok(c.get("debounce") == 7 and c.get("store_slot") == 1, "posix: parameters came back from flash")
        c.client.close()
        second_master(port)


def qemu(machine, image, *more):
    return Process("qemu-system-arm", "-M", machine, "-kernel", f"{BUILD}/firmware/{image}.elf", "-display", "none",
                   "-monitor", "none", *more, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                   stderr=subprocess.STDOUT)


def line_of(p):
    for text in p.stdout:
        found = re.search(r"redirected to (\S+)", text)
        if found:
            return found.group(1)
    raise RuntimeError("QEMU did not start")


class Pins:
    """QEMU's qtest socket; it drives an input of a GPIO port."""

    PORT = "/machine/unattached/device[%d]"

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        for _ in range(100):
            try:
                self.socket.connect(path)
                break
            except OSError:
                time.sleep(0.05)
        self.file = self.socket.makefile("rw")

    def set(self, port, pin, level):
        self.file.write(f"set_irq_in {self.PORT % (8 + 'ABCDEFG'.index(port))} unnamed-gpio-in {pin} {level}\n")
        self.file.flush()
        return self.file.readline().startswith("OK")


def lm3s(folder):
    # 2 ns an instruction: slower than the host, so that its stalls are no gaps on the line.
    with qemu("lm3s6965evb", "lm3s6965evb", "-icount", "shift=1", "-serial", "pty", "-accel", "tcg", "-qtest",
              f"unix:{folder}/pins,server=on,wait=off", "-qtest-log", "/dev/null") as p:
        path = line_of(p)
        pins = Pins(folder + "/pins")
        c = Controller(ModbusSerialClient(path, baudrate=115200, timeout=1))
        c.put("deadman", 0)
        check_functions(c, "lm3s6965evb")
        ok(c.get("reset_cause") == E["CAUSE_POWER"] and c.get("board") == 2, "lm3s6965evb: power-up")
        ok(home_in_place(c), "lm3s6965evb: homes axes without switches")
        c.command("MOVE", 15, (1500, -1400, 1300, -1200))
        ok(c.until("finished_id", c.id) and [c.get("position", i) for i in range(4)] == [1500, -1400, 1300, -1200],
           "lm3s6965evb: four axes arrive")
        c.command("MOVE", 3, (30000, -30000, 0, 0))
        c.until("moving", 3)
        ok(pins.set("D", 4, 1) and c.until("state", E["STATE_ALARM"]) and c.get("alarm") == E["ALARM_LIMIT_MAX"],
           "lm3s6965evb: limit switch (a pin) stops all axes")
        where = c.get("position")
        ok(c.get("moving") == 0 and 1500 <= where < 30000 and c.get("position") == where and c.get("homed") == 12,
           "lm3s6965evb: and the positions of those that moved are unknown")
        pins.set("D", 4, 0)
        c.command("CLEAR")
        home_in_place(c)
        c.command("MOVE", 15, (30000, 30000, 30000, 30000))
        c.until("moving", 15)
        pins.set("F", 2, 1)
        pins.set("F", 2, 0)
        ok(c.until("state", E["STATE_ESTOP"]) and c.get("moving") == 0,
           "lm3s6965evb: a short press of the emergency stop (a pin) latches")
        c.command("CLEAR")
        ok(c.restarts("FAULT", "self_test", 0xFA17) and c.get("fault_address") > 0,
           "lm3s6965evb: a processor fault is told after the restart")
        ok(c.restarts("WATCHDOG", "self_test", 0xDEAD) and c.get("homed") == 0,
           "lm3s6965evb: the hardware watchdog resets")
        c.put("command_id", 1000)
        ok(c.restarts("COMMAND", "command", E["COMMAND_RESTART"]), "lm3s6965evb: restart")
        c.client.close()
        check_mbpoll(path, "lm3s6965evb")
        check_libmodbus(path, "lm3s6965evb")


def trace():
    run = ["qemu-system-arm", "-M", "lm3s6965evb", "-kernel", f"{BUILD}/firmware/lm3s6965evb-trace.elf", "-display",
           "none", "-monitor", "none", "-icount", "shift=5", "-serial", "null", "-accel", "tcg",
           "-semihosting-config", "enable=on,target=native"]
    first, second = (subprocess.run(run, capture_output=True, text=True, check=False, timeout=120).stderr
                     for _ in range(2))
    values = re.findall(r"^(\w+) (\d+)$", first, re.M)
    bins = [int(v) for n, v in values if n == "bin"]
    told = dict((n, int(v)) for n, v in values)
    print("# lateness, 0.2 us a bin from -2 us:", bins)
    print("# of the processor: main loop %(main_percent)d %%, producer %(producer_percent)d %% (at most "
          "%(producer_percent_most)d %% in a segment)" % told)
    ok([v for n, v in values if n == "arrived"] == ["1"] * 8 and told["alarm"] == 0,
       "step trace: four axes at more than 40,000 steps/s arrive in every phase to each other, no underrun")
    ok(told["wrong_edges"] == 0 and told["looked_at"] == 64000, "step trace: every edge on its pin, in order")
    ok(sum(bins[5:15]) == sum(bins) and told["late_edges"] == 0, "step trace: every edge within a tick")
    ok(told["main_percent"] >= 5, "step trace: the main loop goes on")
    ok(first == second, "step trace: identical run after run, hash %d" % told["hash"])


def stm32(name):
    """On a machine of an STM32F405. It reads 0 from every pin, so the Nucleo takes USART 1, its RS-485 line."""
    with qemu("netduinoplus2", name, "-icount", "shift=1", "-serial", "pty", "-accel", "tcg") as p:
        path = line_of(p)
        c = Controller(ModbusSerialClient(path, baudrate=115200, timeout=1))
        c.put("deadman", 0)
        check_functions(c, name)
        ok(c.get("board") == BOARDS[name], name + ": boots and answers")
        c.client.close()
        check_mbpoll(path, name)


# ---- the Raspberry Pi Pico, on tests/board/pico.c ----

class Pico:
    def __init__(self, p):
        self.p, self.path = p, p.stdout.readline().split()[1]

    def say(self, text):
        self.p.stdin.write(text + "\n")
        self.p.stdin.flush()
        for line in self.p.stdout:
            if not line.startswith("pico: "):
                return line
            print("#", line.strip())  # an objection
        raise RuntimeError("the emulator died")

    def pin(self, pin, level):
        return self.say(f"pin {pin} {level}") == "ok\n"

    def report(self):
        return json.loads(self.say("report"))


@contextlib.contextmanager
def pico_machine(*options):
    with Process(BUILD + "/tests/board/pico", BUILD + "/firmware/pico.uf2", *options, stdin=subprocess.PIPE,
                 stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as p:
        yield Pico(p)


PICO_ESTOP, PICO_LIMITS_0, PICO_LIMITS_PHI, PICO_OUTPUTS = 16, 18, 20, 0x10400FFC


def pico_moves(c, m):
    """Four axes at more than 40,000 steps/s each; what the step outputs did was counted outside of the firmware."""
    ways = [10300, -10200, 10100, -10000]
    c.put("speed_max", *[45000] * 4)
    c.put("acceleration", *[1000000] * 4)
    c.put("jerk", *[100000000] * 4)
    before = m.report()
    arrived = True
    for target in ways, [0] * 4:  # half a second: SysTick wraps in it, and whatever else delays an edge should come
        middle = m.report()
        c.command("MOVE", 15, target)
        arrived = arrived and c.until("finished_id", c.id) and [c.get("position", i) for i in range(4)] == list(target)
    ok(arrived, "pico: four axes arrive")
    after = m.report()
    moved = [b - a for a, b in zip(before["position"], middle["position"])]
    ok(after["position"] == before["position"], "pico: there and back")
    phase = [b - a for a, b in zip(before["phase"], after["phase"])]
    ok(moved == ways, "pico: and their outputs made just these steps")
    # Early by 40 cycles, late by less than a tick; the counter of whole ticks says that none was later.
    bins = [sum(phase[i:i + 25]) for i in range(0, 125, 25)]
    print("# steps by their time within a tick, 0.2 us a bin:", bins, "shortest pulse", after["shortest_pulse"] / 125, "us")
    ok(sum(bins) == 2 * sum(map(abs, ways)) and bins[2] + bins[3] < sum(bins) / 100 and c.get("late_edges") == 0,
       "pico: every edge within a tick")
    ok(after["shortest_pulse"] > 125 * (c.get("pulse") - 1), "pico: pulses are as long as they were asked to be")


def pico_contacts(c, m):
    """Each input is the contact that docs/build-a-rig.md says."""
    axes = ["light_theta", "light_phi", "camera_theta", "camera_phi"]
    bits = {"estop": 12, "door": 13}
    for i, axis in enumerate(axes):
        bits.update({"home_" + axis: i, "limit_min_" + axis: 4 + i, "limit_max_" + axis: 8 + i})
    rows = re.findall(r"^\| GP(\d+) \| \d+ \| (.*) \|$", open("docs/build-a-rig.md", encoding="utf-8").read(), re.M)
    seen, good = 0, True
    for pin, text in rows:
        named = sum(1 << bits[name] for name in re.findall(r"`(\w+)`", text) if name in bits)
        if named:
            m.pin(int(pin), 1)
            good = good and c.until("inputs", named, 5)
            m.pin(int(pin), 0)
            good = good and c.until("inputs", 0, 5)
        seen |= named
    ok(good and seen == 0x3FFF, "pico: every contact is on the pin that the documentation says")
    c.command("CLEAR")


def pico_stops(c, m):
    for pin, alarm in ((PICO_LIMITS_0, "LIMIT_MIN"), (PICO_LIMITS_PHI, "LIMIT_MAX")):
        home_in_place(c)
        c.command("MOVE", 15, (-30000, 30000, 30000, 30000) if alarm == "LIMIT_MIN" else (30000, 30000, 0, 0))
        c.until("state", E["STATE_MOVING"])
        m.pin(pin, 1)
        ok(c.until("state", E["STATE_ALARM"]) and c.get("alarm") == E["ALARM_" + alarm] and c.get("moving") == 0,
           f"pico: limit switches on GP{pin} stop all axes")
        m.pin(pin, 0)
        c.command("CLEAR")
    home_in_place(c)
    c.put("lamp_rise", 0)
    c.put("lamp_level", 8000)
    c.retry(lambda: c.client.write_coil(0, True, slave=1))
    c.until("lamp_output", 8000)
    c.command("MOVE", 15, (30000, 30000, 30000, 30000))
    c.until("state", E["STATE_MOVING"])
    ok(m.report()["lamp"] == 6250 * 80 // 100, "pico: the lamp burns at 80 %")
    m.pin(PICO_ESTOP, 1)
    m.pin(PICO_ESTOP, 0)
    ok(c.until("state", E["STATE_ESTOP"]) and c.get("moving") == 0,
       "pico: a short press of the emergency stop (a pin) latches")
    r = m.report()
    ok(r["out"] & 0x78 == 0 and r["lamp"] == 0, "pico: and leaves no step output up, and the lamp dark")
    c.command("CLEAR")


def pico_brakes(c, m):
    """One output for all brakes, instead of the camera trigger where there are any; motors hold while one is open."""
    motors, brake = 1 << 11, 1 << 28
    lit = lambda: m.report()["out"] & (motors | brake)
    c.command("TRIGGER")
    c.put("brake_delay", 50)  # ms of its time, of which a tenth passes while nobody asks
    c.put("brakes", 0b0101)
    home_in_place(c)
    c.command("RELEASE", 15)
    time.sleep(1)
    off = lit()
    c.command("TRIGGER")
    c.until("trigger_count", 2, 2)
    home_in_place(c)
    c.command("MOVE", 2, (0, 500, 0, 0))
    c.until("finished_id", c.id)
    ok(off == 0 and lit() == motors, "pico: an axis without a brake opens none, nor does the trigger")
    c.command("MOVE", 1, (500, 500, 0, 0))
    ok(c.until("finished_id", c.id) and lit() == motors | brake, "pico: an axis with a brake opens it")
    c.command("RELEASE", 2)
    held = lit()
    c.command("RELEASE", 15)
    closed = lit()
    time.sleep(2)
    ok(held == motors | brake and closed == motors and lit() == 0, "pico: the brake closes first, then the motors go")
    c.put("brakes_invert", 0b0101)
    ok(lit() == brake, "pico: a brake that opens at a low level is closed at a high one")
    c.put("brakes_invert", 0)
    c.put("brakes", 0)


def pico_restarts(c, m):
    c.put("debounce", 9)
    c.command("SAVE")
    ok(c.get("store_slot") == 1, "pico: keeps its parameters in flash")
    ok(c.restarts("FAULT", "self_test", 0xFA17) and 0x20010000 <= c.get("fault_address") < 0x2001C000,
       "pico: a processor fault is told after the restart")
    ok(c.get("debounce") == 9 and c.get("store_slot") == 1, "pico: the parameters come back from flash")
    ok(c.restarts("WATCHDOG", "self_test", 0xDEAD) and c.get("homed") == 0, "pico: the hardware watchdog resets")
    c.put("command_id", 1000)
    ok(c.restarts("COMMAND", "command", E["COMMAND_RESTART"]), "pico: restart")


def pico():
    with pico_machine() as m:
        c = Controller(ModbusSerialClient(m.path, baudrate=115200, timeout=1))
        c.put("deadman", 0)
        check_functions(c, "pico")
        ok(c.get("reset_cause") == E["CAUSE_POWER"] and c.get("board") == BOARDS["pico"], "pico: power-up")
        ok(home_in_place(c), "pico: homes axes without switches")
        pico_moves(c, m)
        ok(abs(c.get("temperature") - 310 * 330000 // 4095) < 100, "pico: reads the lamp's temperature")
        pico_contacts(c, m)
        pico_stops(c, m)
        pico_brakes(c, m)
        pico_restarts(c, m)
        c.client.close()
        check_mbpoll(m.path, "pico")
        check_libmodbus(m.path, "pico")
        ok(m.report()["wrong"] == 0, "pico: the model of the chip has no objection")
    with pico_machine("sensor_open=1", "aligned=1") as m:
        c = Controller(ModbusSerialClient(m.path, baudrate=115200, timeout=1))
        c.put("deadman", 0)
        ok(c.get("temperature") == -2**31, "pico: an open sensor wire is no temperature")
        home_in_place(c)
        c.command("MOVE", 15, (300, -200, 100, -50))
        ok(c.until("finished_id", c.id) and m.report()["wrong"] == 0, "pico: every access to memory is aligned")
        c.client.close()
    for option in ("crystal_mhz=0", "crystal_mhz=4", "ring_mhz=1.1", "ring_mhz=12"):
        with pico_machine(option) as m:
            c = ModbusSerialClient(m.path, baudrate=115200, timeout=1)
            c.connect()
            for _ in range(200):
                if m.report()["cycles"] > 5e6:  # 40 ms: by far
                    break
                time.sleep(0.02)
            answers = any("Modbus Error" not in str(c.read_holding_registers(0, 2, slave=1)) for _ in range(3))
            r = m.report()
            refused = option.startswith("crystal")
            ok(answers != refused and r["wrong"] == 0 and r["ever_high"] & ~4 == 0 and r["oe"] == PICO_OUTPUTS,
               f"pico: with {option} " + ("everything stays off and nobody answers" if refused else "it runs"))
            c.close()


def images():
    """The build prints what an image needs, and holds it to its limits."""
    for name in BOARDS:
        if name == "posix":
            continue
        fits = open(f"{BUILD}/firmware/{name}.fits", encoding="utf-8").read()
        n = [int(v) for v in re.findall(r"flash (\d+) of 49152   RAM \d+ static \+ \d+ stack = (\d+) of 12288", fits)[0]]
        print("#", name, fits.strip())
        ok(n[0] <= 49152 and n[1] <= 12288, name + ": within 48 KiB of flash and 12 KiB of memory")
        graphs = glob.glob(f"{BUILD}/firmware/{name}/**/*.ci", recursive=True)
        run = ["python3", "firmware/tools/stack.py", f"{BUILD}/firmware/{name}.size"]
        ends = [subprocess.run(run + [str(v) for v in limits] + graphs, capture_output=True, check=False).returncode
                for limits in (n, (n[0] - 1, n[1]), (n[0], n[1] - 1))]
        ok(ends == [0, 1, 1], name + ": and a byte too much would have failed the build")
    folders = {os.path.basename(os.path.dirname(p)) for p in glob.glob("firmware/board/*/board.mk")}
    ok(folders | {"posix"} == set(BOARDS) and len(set(BOARDS.values())) == len(BOARDS),
       "each board's folder has its line, and a number of its own, in boards.def")


def dependencies():
    """A header that changes makes every object anew that holds it, under whatever name the build folder is given."""
    for folder in (os.path.relpath(BUILD), os.path.abspath(BUILD)):
        run = subprocess.run(["make", "-n", "-W", "firmware/core/core.h", "firmware", "B=" + folder], capture_output=True,
                             text=True, check=False)
        for name in [n for n in BOARDS if n != "posix"] + ["lm3s6965evb-trace"]:
            made = set(re.findall(rf"ARMCC \S*/firmware/{name}/(?:firmware/)(\S+)\.o", run.stdout))
            ok({"core/core", "core/axis", "board/cortex_m/cortex_m"} <= made and "core/ramp" not in made,
               f"{name}: a changed header is seen, with B={'build' if folder[0] != '/' else '/.../build'}")


def main():
    with tempfile.TemporaryDirectory() as folder:
        posix(folder)
        if shutil.which("qemu-system-arm") is None or not os.path.exists(BUILD + "/firmware/lm3s6965evb.elf"):
            skip("emulated boards", "qemu-system-arm or gcc-arm-none-eabi is not installed")
        else:
            images()
            dependencies()
            lm3s(folder)
            trace()
            stm32("stm32f405")
            stm32("nucleo_f446re")
            pico()
    print(f"1..{number}")
    return failures > 0


sys.exit(main())
