#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draws the pictures of docs/build-a-rig.md, beside itself: python3 docs/wiring/draw.py"""
import os

FONT = "font-family='DejaVu Sans, Verdana, sans-serif'"
SIGNAL, POWER, SAFE, USB = "#1f4e8c", "#b03a2e", "#7d3c98", "#2e7d32"


class Picture:
    def __init__(self, width, height):
        self.width, self.height, self.parts = width, height, []

    def add(self, text):
        self.parts.append(text)

    def text(self, x, y, text, size=13, anchor="middle", colour="#222", bold=False):
        text = text.replace("&", "&amp;").replace("<", "&lt;")
        weight = " font-weight='bold'" if bold else ""
        self.add(f"<text x='{x}' y='{y}' {FONT} font-size='{size}' text-anchor='{anchor}' fill='{colour}'{weight}>{text}</text>")

    def box(self, x, y, w, h, title, lines=(), fill="#eef3fa", stroke="#345"):
        self.add(f"<rect x='{x}' y='{y}' width='{w}' height='{h}' rx='6' fill='{fill}' stroke='{stroke}' stroke-width='1.5'/>")
        if title:
            self.text(x + w / 2, y + 20, title, bold=True)
        for i, line in enumerate(lines):
            self.text(x + w / 2, y + 39 + 17 * i, line, 12)

    def wire(self, *points, colour=SIGNAL, dash="", width=2):
        path = " ".join(f"{x},{y}" for x, y in points)
        dashes = f" stroke-dasharray='{dash}'" if dash else ""
        self.add(f"<polyline points='{path}' fill='none' stroke='{colour}' stroke-width='{width}'{dashes}/>")

    def dot(self, x, y, colour=SIGNAL):
        self.add(f"<circle cx='{x}' cy='{y}' r='3.5' fill='{colour}'/>")

    def terminal(self, x, y, text, side="left", colour=SIGNAL):
        self.add(f"<circle cx='{x}' cy='{y}' r='4' fill='#fff' stroke='{colour}' stroke-width='2'/>")
        self.text(x + (-9 if side == "left" else 9), y + 4, text, 12, "end" if side == "left" else "start")

    def ground(self, x, y, colour="#333"):
        self.wire((x, y), (x, y + 8), colour=colour)
        for i, half in enumerate((10, 6, 2)):
            self.wire((x - half, y + 8 + 4 * i), (x + half, y + 8 + 4 * i), colour=colour)

    def supply(self, x, y, text, colour=POWER):
        self.wire((x - 9, y), (x + 9, y), colour=colour)
        self.text(x, y - 6, text, 12, colour=colour)

    def resistor(self, x, y, text, upright=False):
        w, h = (12, 34) if upright else (34, 12)
        self.add(f"<rect x='{x - w / 2}' y='{y - h / 2}' width='{w}' height='{h}' fill='#fff' stroke='#222' stroke-width='1.5'/>")
        self.text(x + (12 if upright else 0), y + (4 if upright else -11), text, 12, "start" if upright else "middle")

    def capacitor(self, x, y, text):
        self.add(f"<rect x='{x - 12}' y='{y - 4}' width='24' height='8' fill='#fff'/>")
        for d in (-4, 4):
            self.wire((x - 12, y + d), (x + 12, y + d), colour="#222")
        self.text(x + 17, y + 5, text, 12, "start")

    def contact(self, x, y, text, colour=SIGNAL):
        """Normally closed: from (x - 25, y) to (x + 25, y)."""
        self.add(f"<rect x='{x - 25}' y='{y - 12}' width='50' height='24' fill='#fff'/>")
        for d in (-25, 25):
            self.dot(x + d, y, colour)
        self.wire((x - 25, y), (x + 27, y - 3), colour=colour)
        self.wire((x + 20, y - 10), (x + 20, y), colour=colour)
        self.text(x, y - 16, text, 12)

    def led(self, x, y):
        """Of an optocoupler, pointing down, from (x, y - 12) to (x, y + 12)."""
        self.add(f"<polygon points='{x - 9},{y - 8} {x + 9},{y - 8} {x},{y + 8}' fill='#fff' stroke='#222' stroke-width='1.5'/>")
        self.wire((x - 9, y + 8), (x + 9, y + 8), colour="#222")
        for d in (0, 7):
            self.wire((x + 12 + d, y - 6), (x + 22 + d, y - 12), colour="#222", width=1)

    def save(self, name):
        path = os.path.join(os.path.dirname(os.path.abspath(__file__)), name)
        with open(path, "w", encoding="utf-8") as f:
            f.write(f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {self.width} {self.height}' "
                    f"width='{self.width}' height='{self.height}'>\n"
                    f"<rect width='{self.width}' height='{self.height}' fill='#fff'/>\n" + "\n".join(self.parts) + "\n</svg>\n")


def rig():
    p = Picture(1000, 640)
    p.box(30, 40, 170, 90, "Computer", ["gonio", "USB"])
    p.box(290, 40, 170, 90, "USB adapter", ["to RS-485", "isolated"])
    p.box(550, 40, 180, 90, "Controller", ["board + RS-485", "transceiver"], fill="#fdf3e1")
    p.box(30, 190, 170, 60, "Camera", ["USB, trigger input"])
    p.box(30, 290, 170, 60, "Power meter", ["USB"])
    p.box(790, 40, 180, 90, "Step drivers", ["four: step, direction,", "enable"])
    p.box(790, 190, 180, 60, "Motors", ["four axes"])
    p.box(550, 240, 180, 76, "Lamp driver", ["PWM input,", "over-heat switch"])
    p.box(550, 370, 180, 60, "Lamp, shutter", ["sensor on the lamp"])
    p.box(290, 370, 170, 94, "Contacts", ["4 home, limits", "door", "stop: second contact"])
    p.box(290, 520, 170, 76, "Emergency stop", ["two contacts,", "latching"], fill="#f7e6fb")
    p.box(550, 520, 180, 76, "Safety relay", ["24 V, two channels,", "reset by hand"], fill="#f7e6fb")
    p.box(790, 520, 180, 76, "Supply 24 to 48 V", ["for motors and lamp"], fill="#fbe9e7")
    for y in (85,):
        p.wire((200, y), (290, y), colour=USB)
        p.wire((460, y), (550, y))
        p.wire((730, y), (790, y))
    p.text(505, 76, "A, B, GND", 12)
    p.text(245, 76, "USB", 12, colour=USB)
    p.wire((115, 130), (115, 190), colour=USB)
    p.wire((60, 130), (60, 160), (14, 160), (14, 320), (30, 320), colour=USB)
    p.wire((200, 220), (600, 220), (600, 130))
    p.text(400, 212, "trigger, by an optocoupler", 12)
    p.wire((880, 130), (880, 190), colour=POWER)
    p.wire((640, 130), (640, 240))
    p.text(648, 180, "PWM, shutter", 12, "start")
    p.wire((640, 316), (640, 370), colour=POWER)
    p.wire((550, 400), (512, 400), (512, 120), (550, 120))
    p.text(504, 270, "temperature,", 12, "end")
    p.text(504, 287, "photodiode", 12, "end")
    p.wire((375, 370), (375, 240), (498, 240), (498, 106), (550, 106), colour=SAFE)
    p.text(367, 330, "inputs", 12, "end", SAFE)
    p.wire((375, 520), (375, 464), colour=SAFE)
    p.wire((460, 558), (550, 558), colour=SAFE)
    p.text(505, 550, "24 V loop", 12, colour=SAFE)
    p.wire((790, 558), (730, 558), colour=POWER)
    p.wire((690, 520), (690, 470), (760, 470), (760, 110), (790, 110), colour=POWER)
    p.wire((760, 278), (730, 278), colour=POWER)
    p.dot(760, 278, POWER)
    p.text(768, 400, "motor and lamp power,", 12, "start", POWER)
    p.text(768, 417, "off at once by the relay", 12, "start", POWER)
    for i, (colour, text) in enumerate(((SIGNAL, "signal"), (SAFE, "safety contacts"), (POWER, "power"), (USB, "USB"))):
        p.wire((30, 500 + 28 * i), (70, 500 + 28 * i), colour=colour)
        p.text(80, 504 + 28 * i, text, 12, "start")
    p.save("rig.svg")


def driver():
    p = Picture(1000, 470)
    p.text(250, 28, "Driver with optocouplers (DM542 style)", 15, bold=True)
    p.box(30, 60, 120, 330, "Controller", fill="#fdf3e1")
    p.box(360, 60, 220, 330, "Driver")
    p.box(225, 60, 70, 250, "74HCT", ["at 5 V"], fill="#f4f4f4")
    for i, (pin, plus, minus) in enumerate((("step", "PUL+", "PUL-"), ("direction", "DIR+", "DIR-"), ("motor on", "ENA+", "ENA-"))):
        y = 130 + 75 * i
        p.terminal(150, y, pin)
        p.wire((154, y), (225, y))
        p.wire((295, y), (356, y))
        p.terminal(360, y, plus, "right")
        p.terminal(360, y + 32, minus, "right")
        p.wire((356, y + 32), (325, y + 32), colour="#333")
        p.wire((360 + 50, y), (470, y), (470, y + 4), colour="#222")
        p.resistor(440, y, "270")
        p.led(470, y + 16)
        p.wire((470, y + 28), (470, y + 32), (410, y + 32), colour="#222")
        p.wire((325, y + 32), (325, 385), colour="#333")
        p.wire((174, y), (174, y + 12), colour="#222")
        p.resistor(174, y + 28, "10k", upright=True)
        p.ground(174, y + 45)
    p.ground(325, 385)
    p.text(340, 404, "GND of the controller", 12, "start")
    p.text(530, 300, "M+ M-", 12)
    p.text(530, 318, "24 to 48 V", 12, colour=POWER)
    p.text(530, 336, "from the relay", 12, colour=POWER)
    p.text(800, 28, "Logic-level driver (A4988, TMC2209)", 15, bold=True)
    p.box(640, 60, 110, 330, "Controller", fill="#fdf3e1")
    p.box(830, 60, 140, 330, "Driver", ["VIO = 3.3 V"])
    for i, (pin, there) in enumerate((("step", "STEP"), ("direction", "DIR"), ("motor on", "EN (low: on)"))):
        y = (130, 172, 262)[i]
        p.terminal(750, y, pin)
        p.wire((754, y), (826, y))
        p.terminal(830, y, there, "right")
    p.wire((790, 262), (790, 212), colour="#222")
    p.resistor(790, 236, "10k", upright=True)
    p.supply(790, 212, "3.3 V")
    p.dot(790, 262)
    p.wire((754, 310), (826, 310), colour="#333")
    p.terminal(750, 310, "GND", colour="#333")
    p.terminal(830, 310, "GND", "right", colour="#333")
    p.terminal(830, 350, "VM, 100 uF", "right", colour=POWER)
    p.wire((800, 350), (826, 350), colour=POWER)
    p.text(797, 354, "relay", 12, "end", POWER)
    p.text(500, 430, "Left: no step in reset, by the 10k; with no current in ENA most such drivers are on: motors_invert, or leave ENA open.", 12)
    p.text(500, 448, "Right: EN is on at a low level, so a pull-up holds it off in reset; motors_invert as well.", 12)
    p.save("driver.svg")


def inputs():
    p = Picture(1000, 480)
    p.box(820, 40, 150, 410, "Controller", fill="#fdf3e1")
    for i, (title, name, r, c) in enumerate((("stop and door: 1k, 100 nF", "emergency stop, door", "1k", "100 nF"),
                                             ("home and limits: 1k, 10 nF", "home, limits", "1k", "10 nF"))):
        y = 110 + 150 * i
        p.ground(70, y)
        p.wire((70, y), (195, y), colour=SAFE)
        p.contact(220, y, "normally closed", SAFE)
        p.wire((245, y), (820, y), colour=SIGNAL)
        p.text(360, y + 20, "twisted pair, shield to ground at the controller", 12)
        p.wire((540, y), (540, y - 45))
        p.resistor(540, y - 24, "2.2k", upright=True)
        p.supply(540, y - 48, "3.3 V")
        p.dot(540, y)
        p.resistor(630, y, r)
        p.wire((730, y), (730, y + 28))
        p.wire((730, y + 32), (730, y + 50), colour="#222")
        p.capacitor(730, y + 28, c)
        p.ground(730, y + 46)
        p.dot(730, y)
        p.terminal(820, y, name, "right")
        p.text(180, y - 52, title, 13, bold=True)
    y = 420
    p.text(70, y - 52, "24 V safety relay", 13, "start", bold=True)
    p.wire((70, y), (150, y), colour=POWER)
    p.text(64, y + 4, "24 V", 12, "end", POWER)
    p.contact(175, y, "", SAFE)
    p.wire((200, y), (300, y), colour=SAFE)
    p.resistor(260, y, "2.2k")
    p.wire((300, y), (330, y), (330, y - 14), colour=SAFE)
    p.wire((330, y - 14), (330, y), colour=SAFE)
    p.box(312, y - 34, 110, 56, "", fill="#f4f4f4")
    p.text(367, y - 3, "optocoupler", 12)
    p.wire((422, y - 20), (820, y - 20))
    p.wire((540, y - 20), (540, y - 68))
    p.resistor(540, y - 46, "2.2k", upright=True)
    p.supply(540, y - 68, "3.3 V")
    p.resistor(630, y - 20, "1k")
    p.wire((730, y - 20), (730, y))
    p.capacitor(730, y + 4, "100 nF")
    p.wire((730, y + 8), (730, y + 20), colour="#222")
    p.ground(730, y + 18)
    p.dot(730, y - 20)
    p.dot(540, y - 20)
    p.terminal(820, y - 20, "emergency stop", "right")
    p.wire((422, y + 12), (450, y + 12), colour="#333")
    p.ground(450, y + 12)
    p.save("inputs.svg")


def rs485():
    p = Picture(1000, 360)
    p.box(30, 50, 160, 260, "Controller", fill="#fdf3e1")
    p.box(430, 50, 180, 260, "Transceiver", ["3.3 V, MAX3485 kind"])
    p.box(850, 50, 120, 260, "Adapter", ["at the computer"])
    for y, pin, there in ((120, "transmit", "DI"), (170, "driver on", "DE"), (260, "receive", "RO")):
        p.terminal(190, y, pin)
        p.wire((194, y), (426, y))
        p.terminal(430, y, there, "right")
    p.terminal(430, 212, "RE (low: on)", "right")
    p.wire((426, 212), (380, 212), (380, 170))
    p.dot(380, 170)
    p.wire((290, 170), (290, 180), colour="#222")
    p.resistor(290, 196, "10k", upright=True)
    p.ground(290, 213)
    p.dot(290, 170)
    p.wire((330, 260), (330, 282), colour="#222")
    p.resistor(330, 298, "10k", upright=True)
    p.wire((330, 314), (330, 326), colour="#222")
    p.text(342, 336, "to 3.3 V: RO floats while RE is off", 12, "start")
    p.dot(330, 260)
    for y, name in ((130, "A"), (210, "B")):
        p.terminal(610, y, name)
        p.wire((614, y), (846, y))
        p.terminal(850, y, name, "right")
    p.wire((610, 280), (846, 280), colour="#333")
    p.terminal(610, 280, "GND", colour="#333")
    p.terminal(850, 280, "GND", "right", colour="#333")
    p.wire((690, 130), (690, 210), colour="#222")
    p.resistor(690, 170, "120", upright=True)
    p.wire((780, 130), (780, 210), colour="#222")
    p.resistor(780, 170, "120", upright=True)
    p.wire((650, 130), (650, 90), colour="#222")
    p.resistor(650, 106, "680", upright=True)
    p.supply(650, 84, "3.3 V")
    p.wire((650, 210), (650, 250), colour="#222")
    p.resistor(650, 232, "680", upright=True)
    p.wire((650, 249), (650, 280), colour="#333")
    for x, y in ((690, 130), (690, 210), (780, 130), (780, 210), (650, 130), (650, 210), (650, 280)):
        p.dot(x, y, "#333" if y == 280 else SIGNAL)
    p.text(735, 330, "twisted pair; 120 ohms at both ends, bias at one", 12)
    p.save("rs485.svg")


rig()
driver()
inputs()
rs485()
