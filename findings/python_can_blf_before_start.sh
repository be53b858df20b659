#!/usr/bin/env bash
# Stamps of BLF objects are signed (a pre-trigger buffer holds frames from before the trigger). python-can 4.6.1 reads
# them as unsigned: a frame 2 s before the start gets a stamp in the year 2609, silently, and sorts behind all others.
# brakebench reads them as signed and keeps them in every format that can hold them (hil/log/blf).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet python-can==4.6.1
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import struct

import can

START = struct.pack("<8H", 2025, 1, 3, 15, 12, 0, 0, 0)  # 2025-01-15 12:00:00


def message(offset_ns, can_id):
    body = struct.pack("<HBBI8s", 1, 0, 8, can_id, bytes(8))
    head = struct.pack("<4sHHII", b"LOBJ", 32, 1, 32 + len(body), 1) + struct.pack("<IHHq", 2, 0, 0, offset_ns)
    return head + body


objects = message(-2_000_000_000, 0x100) + message(0, 0x101)
container = struct.pack("<4sHHII", b"LOBJ", 16, 1, 32 + len(objects), 10) + struct.pack("<H6xI4x", 0, len(objects))
size = 144 + len(container) + len(objects)
head = b"LOGG" + struct.pack("<IBBBBBBBBQQIIQ", 144, 0, 0, 0, 0, 0, 0, 0, 0, size, size, 2, 2, 0)[:36]
with open("a.blf", "wb") as file:
    file.write((head + START + START).ljust(144, b"\0") + container + objects)
with can.BLFReader("a.blf") as log:
    stamps = [message.timestamp - log.start_timestamp for message in log]
print("stamps from the start, written -2 s and 0 s, read:", stamps)
assert stamps[1] == 0.0
assert stamps[0] > 1e10, "the finding no longer holds"
PY
