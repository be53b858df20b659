#!/usr/bin/env bash
# isal 1.9.1 offers isal_zlib "as a drop-in replacement for zlib", but isal_zlib.error is no subclass of zlib.error:
# code that catches zlib.error and only swaps the import of the module it inflates with no longer catches damage.
# Shown without a damaged stream: the class tree alone, and that both raise for the same bytes, which are no stream.
# brakebench catches the error of the very module it inflates with (hil/log/source.py).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet isal==1.9.1
"$folder/venv/bin/python" - <<'PY'
import zlib
from isal import isal_zlib

print("isal_zlib.error:", isal_zlib.error.__mro__)
for module in (zlib, isal_zlib):
    try:
        module.decompress(b"plain text")
    except zlib.error as error:
        print(module.__name__, "raises a zlib.error:", error)
        assert module is zlib, "isal's error is a zlib.error now: the finding no longer holds"
    except Exception as error:
        print(module.__name__, "raises", type(error).__name__, "which is no zlib.error:", error)
        assert module is isal_zlib
assert not issubclass(isal_zlib.error, zlib.error), "the finding no longer holds"
PY
