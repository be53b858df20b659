"""Inside the fence: runs one function of a foreign library in this process, which is limited and told about by a pipe.

``python -m hil.log.foreign.fenced MODULE:FUNCTION PATH BYTES SECONDS`` calls one of `FUNCTIONS` with the path and
sends each piece of bytes it yields. `hil.log.foreign.fence` is the other side. What is sent: one letter, the length (4
bytes, big-endian) and the content: R ready, D data, E our own error, X a foreign error, M out of memory, Z the end.
"""

import importlib
import os
import resource
import struct
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from hil.errors import BrakebenchError
from hil.rt.process import end_with_parent

FUNCTIONS = frozenset({"hil.log.foreign.parquet_columns:batches", "hil.log.foreign.foreign_databases:database_json"})
"""What may run here: ``function(path) -> Iterable[bytes]``. Its module is imported, and the module's ``warm()`` called
where it has one, before the limits are set."""
_MAX_TEXT = 400


def main(arguments: list[str]) -> None:
    """Run ``MODULE:FUNCTION PATH BYTES SECONDS``; does not return."""
    name, path, more_bytes, seconds = arguments
    out = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # what a library prints must not reach the pipe
        os.dup2(nowhere, stream)
    end_with_parent()
    try:
        function = _function(name)
        limit(int(more_bytes), int(seconds))
        _send(out, b"R")
        for piece in function(Path(path)):
            _send(out, b"D", piece)
        _send(out, b"Z")
    except MemoryError:
        _send(out, b"M")
    except BrakebenchError as error:
        _send(out, b"E", str(error).encode()[:_MAX_TEXT])
    except Exception as error:  # whatever a foreign library raises
        text = f"{type(error).__name__}: {error}".splitlines()
        _send(out, b"X", " ".join(text[:1]).encode("utf-8", "replace")[:_MAX_TEXT])
    os._exit(0)  # a library's threads and its clearing up have no time here


def _function(name: str) -> Callable[[Path], Iterable[bytes]]:
    if name not in FUNCTIONS:
        raise BrakebenchError(f"{name} may not run behind the fence; known are {', '.join(sorted(FUNCTIONS))}")
    module_name, _, function = name.partition(":")
    module = importlib.import_module(module_name)
    if hasattr(module, "warm"):
        module.warm()
    found: Callable[[Path], Iterable[bytes]] = getattr(module, function)
    return found


def limit(more_bytes: int, seconds: int) -> None:
    """Allow this process so much memory and processor time beside what it has used."""
    used_bytes = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    used = resource.getrusage(resource.RUSAGE_SELF)
    used_s = int(used.ru_utime + used.ru_stime) + 1
    for kind, value in (
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_AS, used_bytes + more_bytes),
        (resource.RLIMIT_CPU, used_s + seconds),
    ):
        _, hard = resource.getrlimit(kind)
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(kind, (value, hard))


def _send(out: int, kind: bytes, content: bytes = b"") -> None:
    rest = memoryview(kind + struct.pack(">I", len(content)) + content)
    while rest:
        rest = rest[os.write(out, rest) :]


if __name__ == "__main__":
    main(sys.argv[1:])
