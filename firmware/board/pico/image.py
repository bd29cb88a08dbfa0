#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What the RP2040's boot ROM asks of an image (RP2040 Datasheet 2.8).

usage: image.py crc SECOND_STAGE CHECKSUM   the four bytes that follow the 252 of the second stage
       image.py uf2 BIN UF2                 an image from the start of flash, as the file that is copied to the USB drive
"""
import struct
import sys

FLASH, FAMILY, PAYLOAD = 0x10000000, 0xE48BFF56, 256


def crc32(data):
    """Polynomial 0x04C11DB7, from all ones, neither reflected nor inverted (2.8.1.3.1)."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04C11DB7 if crc >> 31 else 0)) & 0xFFFFFFFF
    return crc


def uf2(image):
    count = -(-len(image) // PAYLOAD)
    blocks = b""
    for number in range(count):
        data = image[number * PAYLOAD:(number + 1) * PAYLOAD]
        head = struct.pack("<8I", 0x0A324655, 0x9E5D5157, 0x2000, FLASH + number * PAYLOAD, PAYLOAD, number, count, FAMILY)
        blocks += head + data.ljust(476, b"\0") + struct.pack("<I", 0x0AB16F30)
    return blocks


def main():
    what, source, target = sys.argv[1:]
    data = open(source, "rb").read()
    if what == "crc" and len(data) != 252:
        sys.exit(f"{source}: the second stage has {len(data)} bytes, expected 252")
    open(target, "wb").write(struct.pack("<I", crc32(data)) if what == "crc" else uf2(data))


main()
