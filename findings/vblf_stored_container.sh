#!/usr/bin/env bash
# vblf 0.3.1 writes, by default (compression NONE), containers whose content is stored as it is but whose header says
# "deflated" (method 2). python-can 4.6.1 then cannot read the file: its inflater meets bytes that are no stream.
# brakebench reads such containers (hil/log/blf) and writes method and content alike.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet vblf==0.3.1 python-can==4.6.1
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import can
from vblf.can import CanMessage
from vblf.constants import Compression, ObjFlags
from vblf.reader import BlfReader
from vblf.writer import BlfWriter

found = {}
for level in (Compression.DEFAULT, Compression.NONE):
    with BlfWriter("a.blf", level) as log:
        log.write(CanMessage.new(ObjFlags.TIME_ONE_NANS, 1000, 1, 0, 2, 0x123, b"\x11\x22" + bytes(6)))
    with BlfReader("a.blf") as log:
        own = len(list(log))
    try:
        with can.BLFReader("a.blf") as log:
            other = f"{len(list(log))} frame"
    except Exception as error:
        other = f"{type(error).__name__}: {error}"
    content = open("a.blf", "rb").read()
    method = int.from_bytes(content[160:162], "little")
    found[level.name] = other
    print(f"{level.name}: the container states method {method}; vblf reads {own} frame, python-can: {other}")
assert found["DEFAULT"] == "1 frame"
assert found["NONE"].startswith("error: Error -3"), "the finding no longer holds"
PY
