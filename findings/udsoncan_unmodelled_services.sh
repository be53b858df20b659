#!/usr/bin/env bash
# udsoncan 1.26.1 knows ReadDataByPeriodicIdentifier (0x2A) and ReadScalingDataByIdentifier (0x24) by name, but not their
# layout (ISO 14229-1): both get a sub-function and a body in the answer. So the whole positive answer to 0x2A, its one
# byte 6A, is an invalid response; and of the request 24 F1 90, the scaling of an identifier that every ECU has, the
# first byte of the identifier is a sub-function whose highest bit says "no positive answer": a client that sends it by
# send_request does not wait for the answer.
# brakebench asks for periodic data by bytes over udsoncan's connection (hil/uds/tester.py).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet udsoncan==1.26.1
"$folder/venv/bin/python" - <<'PY'
from udsoncan import Request, Response

periodic = Response.from_payload(bytes([0x6A]))
cleared = Response.from_payload(bytes([0x54]))
print("6A:", periodic.valid, periodic.invalid_reason, "- 54, as short:", cleared.valid)
scaling = Request.from_payload(bytes.fromhex("24F190"))
print("24 F1 90: sub-function", scaling.subfunction, "no answer wanted:", scaling.suppress_positive_response)
assert not periodic.valid and "at least 2 bytes" in periodic.invalid_reason, "the finding no longer holds"
assert cleared.valid
assert scaling.subfunction == 0x71 and scaling.suppress_positive_response, "the finding no longer holds"
PY
