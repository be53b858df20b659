"""Harmless functions that behave as foreign readers at their worst; in place of `hil.log.foreign.fenced` in tests."""

import importlib
import os
import signal
import sys
from pathlib import Path

from hil.log.foreign import fenced

MODULES = ("log_mutants", "hil.log.foreign.parquet_columns")  # of parquet_mutants alone


def warm():
    if sys.argv[1].endswith(":parquet_mutants"):
        sys.path.append(str(Path(__file__).parent))
        for name in MODULES:
            importlib.import_module(name)
        sys.modules["hil.log.foreign.parquet_columns"].warm()


def well(path):
    yield path.read_bytes()
    print("what a library prints is nobody's business")
    os.write(1, b"nor this")
    yield b""
    yield bytes(3_000_000)


def takes_memory(path):
    yield b"begun"
    held = [bytes(1 << 20)]
    while True:
        held.append(held[-1] * 2)


def sleeps(path):
    signal.pause()
    yield b""


def spins(path):
    while True:
        pass
    yield b""


def killed(path):
    os.kill(os.getpid(), signal.SIGSEGV)
    yield b""


def leaves(path):
    os._exit(3)
    yield b""


def raises(path):
    yield b"begun"
    raise ValueError("first line\x1b[31m\nsecond line")


def without_end(path):
    while True:
        yield bytes(100_000)


def parquet_mutants(path):
    """For each mutant of a file, from the seed in the path's suffix on: its seed, then what the reader yields."""
    log_mutants, parquet_columns = (sys.modules[name] for name in MODULES)
    content = path.with_suffix("").read_bytes()
    for seed in range(int(path.suffix[1:]), 2000):
        yield b"%d" % seed
        target = path.with_suffix(".now")
        target.write_bytes(log_mutants.mutant(seed, content))
        try:
            yield from parquet_columns.batches(target)
        except Exception as error:  # any error of a foreign library
            yield b"!" + str(error).encode()


if __name__ == "__main__":
    names = ("parquet_mutants", "well", "takes_memory", "sleeps", "spins", "killed", "leaves", "raises", "without_end")
    fenced.FUNCTIONS = frozenset(f"__main__:{name}" for name in names)
    fenced.main(sys.argv[1:])
