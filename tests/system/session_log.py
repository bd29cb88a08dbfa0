# SPDX-License-Identifier: BSD-3-Clause
"""Recompute a session.log from docs/formats.md alone, with nothing of Gonio. Usage: session_log.py SESSION.LOG"""
import hashlib
import json
import struct
import sys

COLUMNS = {
    "settings": "key value",
    "hosts": "host version commit_id hostname user utc command",
    "steps": "step kind theta_i_deg phi_i_deg theta_o_deg phi_o_deg done frames clock_end_s exposure_end_s utc",
    "frames": "step frame file sha256 x y width height exposure_s gain_db clock_s monitor monitor_sigma utc"
              " monotonic_s bytes",
    "samples": "step n channels rows sha256",
    "final_samples": "step n channels rows sha256",
    "radiance": "step channels means sha256",
    "files": "key role name sha256 size bytes",
    "flagged": "step",
    "events": "event utc kind text",
}


def after_length(data):
    return struct.pack("<Q", len(data)) + data


def encode(value):
    if isinstance(value, int):
        return b"i" + struct.pack("<q", value)
    if isinstance(value, float):
        return b"r" + struct.pack("<d", value)
    if isinstance(value, str):
        return b"t" + after_length(value.encode())
    ((kind, digits),) = value.items()
    data = bytes.fromhex(digits)
    return {"blob": b"b" + after_length(data), "text": b"t" + after_length(data), "real": b"r" + data}[kind]


def content(record):
    if "row" not in record:
        return record.get("content", "")
    row, columns = record["row"], COLUMNS[record["tbl"]].split()
    assert set(row) <= set(columns), record
    return hashlib.sha256(b"".join(after_length(c.encode()) + encode(row[c]) for c in columns if c in row)).hexdigest()


before = "0" * 64
with open(sys.argv[1], encoding="utf-8") as log:
    for number, line in enumerate(log, 1):
        r = json.loads(line)
        text = f'{before} {r["seq"]} {r.get("tbl", "")} {r["op"]} {content(r)} {r.get("key", "")}'
        assert r["seq"] == number and r["prev"] == before, f"line {number}"
        before = hashlib.sha256(text.encode()).hexdigest()
        assert r["hash"] == before, f"line {number}"
print(f"{number} lines prove themselves")
