#!/usr/bin/env bash
# autosar-e2e 1.0.0 declares the data of its check functions as a readable buffer (its stub says ReadableBuffer), and a
# check has no reason to write; e2e_p01_check nevertheless refuses bytes, the type in which every CAN library hands
# over a payload, with "must be mutable". With a bytearray of the same content it works.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet autosar-e2e==1.0.0
"$folder/venv/bin/python" - <<'PY'
import e2e.p01

payload = bytes.fromhex("CC00000000000000")
print("bytearray:", e2e.p01.e2e_p01_check(bytearray(payload), 0x123))
assert e2e.p01.e2e_p01_check(bytearray(payload), 0x123)
try:
    e2e.p01.e2e_p01_check(payload, 0x123)
except ValueError as error:
    print("bytes: ValueError:", error)
    assert "mutable" in str(error)
else:
    raise SystemExit("bytes are taken now: the finding no longer holds")
PY
