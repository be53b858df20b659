"""The process behind an FMU: answers calls of wrapper.c on its standard input, a socket, until that ends."""

import os
import socket
import sys
from enum import IntEnum
from pathlib import Path
from struct import Struct

import numpy as np

from hil.errors import BrakebenchError
from hil.fmu.model import Unit, load_unit

_REQUEST, _HEAD = Struct("=IIddIIII"), Struct("=II")
_REPLY = Struct("=dIIII")
_OK, _ERROR, _HAS_TX = 0, 3, 1


class Op(IntEnum):
    """What is asked; as in wrapper.c."""

    INSTANTIATE = 0
    SYNC = 1
    INITIALISE = 2
    STEP = 3
    EVENT = 4
    GET_STATE = 5
    SET_STATE = 6
    RESET = 7


class Server:
    """One instance of an FMU."""

    def __init__(self) -> None:
        self._unit: Unit | None = None
        self._asked: tuple[Path, str, bool] = (Path(), "", False)
        self._start_s = self._now_s = 0.0

    def answer(self, request: bytes) -> bytes:
        """Reply to a request; an error of the unit's becomes a text."""
        try:
            content, flags = self._do(request)
        except BrakebenchError as error:
            return _refusal(str(error))
        except Exception as error:
            return _refusal(f"{type(error).__name__}: {error}")
        assert self._unit is not None
        reals, integers = self._unit.table.reals, self._unit.table.integers
        body = _REPLY.pack(self._now_s, flags, len(content), reals.size, integers.size)
        body += reals.tobytes() + integers.tobytes() + content
        return _HEAD.pack(len(body), _OK) + body

    def _do(self, request: bytes) -> tuple[bytes, int]:
        _, op, a, b, n_real, n_integer, n_bytes, flags = _REQUEST.unpack_from(request)
        content = request[len(request) - n_bytes :] if n_bytes else b""
        if op == Op.INSTANTIATE:
            resources, _, token = content.decode().rpartition("\n")
            self._asked = Path(resources), token, bool(flags)
        if op in (Op.INSTANTIATE, Op.RESET):
            self._unit = load_unit(*self._asked)
            return b"", 0
        unit = self._unit
        assert unit is not None
        at = _REQUEST.size
        if n_real + n_integer:
            integers_at, indices_at = at + 8 * n_real, at + 8 * (n_real + n_integer)
            which = np.frombuffer(request, np.uint32, n_real + n_integer, indices_at)
            unit.table.reals[which[:n_real]] = np.frombuffer(request, np.float64, n_real, at)
            unit.table.integers[which[n_real:]] = np.frombuffer(request, np.int64, n_integer, integers_at)
        match op:
            case Op.SYNC:
                self._start_s = self._now_s = a
                unit.preview()
            case Op.INITIALISE:
                unit.initialise()
            case Op.STEP:
                unit.advance_to(a + b - self._start_s)
                self._now_s = a + b
            case Op.EVENT:
                unit.event(content)
            case Op.GET_STATE:
                return np.array([self._start_s, self._now_s]).tobytes() + unit.state(), 0
            case Op.SET_STATE:
                unit.restore(content[16:])
                self._start_s, self._now_s = np.frombuffer(content, np.float64, 2).tolist()
        return unit.outgoing, _HAS_TX if unit.outgoing else 0


def _refusal(text: str) -> bytes:
    words = text.encode(errors="replace")
    return _HEAD.pack(len(words), _ERROR) + words


def serve(line: socket.socket) -> None:
    """Answer until the other end closes."""
    server = Server()
    while True:
        head = _read(line, 4)
        if not head:
            return
        rest = _read(line, int.from_bytes(head, sys.byteorder) + 4)
        if not rest:
            return
        try:
            line.sendall(server.answer(head + rest))
        except (BrokenPipeError, ConnectionResetError):
            return


def _read(line: socket.socket, size: int) -> bytes:
    """So many bytes; none where the line ends before."""
    data = bytearray()
    while len(data) < size:
        try:
            some = line.recv(size - len(data))
        except ConnectionResetError:
            return b""
        if not some:
            return b""
        data += some
    return bytes(data)


if __name__ == "__main__":
    with socket.socket(fileno=os.dup(0)) as own:
        serve(own)
