"""Somebody else's FMU in a process of its own, which may crash or hang without taking us along."""

import json
import signal
import socket
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.extras import missing
from hil.fmu.model import FmuError
from hil.rt.process import Piped

LOAD_TIMEOUT_S = 120.0  # an FMU may compile or start a tool of its own
STEP_TIMEOUT_S = 10.0  # a thousand times a tick
_LONGEST_ANSWER = 16 << 20


class ForeignFmu:
    """An FMU that is loaded, and its end.

    Parameters
    ----------
    path : the FMU.
    parameters : values to set before its initialisation.
    step_timeout_s : after which it is taken for stalled.

    Attributes
    ----------
    name : of the file, for people.
    description : what its model description says: name, fmi, tool, step_s (0: nothing), inputs, outputs.

    Raises
    ------
    FmuError : it cannot be loaded.
    """

    def __init__(
        self, path: Path, parameters: Mapping[str, float] | None = None, step_timeout_s: float = STEP_TIMEOUT_S
    ) -> None:
        self.name = path.name
        if not path.is_file():
            raise FmuError(f"{path}: no such FMU")
        if lacks := missing("fmpy"):
            raise FmuError(f"{path}: a foreign FMU {lacks}")
        self._step_timeout_s = step_timeout_s
        self._folder = TemporaryDirectory(prefix="brakebench-fmu-")
        self._line, other = socket.socketpair()
        with other:
            command = [sys.executable, "-P", "-m", "hil.fmu.host", str(other.fileno())]
            self._process = Piped(command, handed=[other.fileno()])
        self._rest = b""
        try:
            asked = {"path": str(path.resolve()), "folder": self._folder.name, "parameters": dict(parameters or {})}
            self.description: dict[str, Any] = self._ask(asked, LOAD_TIMEOUT_S)
        except BaseException:
            self.close()
            raise

    def step(self, values: Mapping[str, float], steps: int, step_s: float, wanted: Sequence[str]) -> list[float]:
        """Set inputs, make steps, and return outputs.

        Raises
        ------
        FmuError : it refused, crashed or stalled; it is closed then.
        """
        asked = {"set": dict(values), "steps": steps, "step_s": step_s, "get": list(wanted)}
        found: list[float] = self._ask(asked, self._step_timeout_s)["values"]
        return found

    def _ask(self, asked: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        self._line.settimeout(timeout_s)
        try:
            self._line.sendall(json.dumps(asked).encode() + b"\n")
            while b"\n" not in self._rest and len(self._rest) < _LONGEST_ANSWER:
                some = self._line.recv(1 << 16)
                if not some:
                    raise ConnectionResetError
                self._rest += some
        except TimeoutError as error:
            self.close()
            raise FmuError(f"{self.name}: the FMU has stalled: no answer for {timeout_s:g} s") from error
        except (BrokenPipeError, ConnectionResetError) as error:
            raise FmuError(f"{self.name}: the FMU has crashed: {_end(self.close())}") from error
        text, _, self._rest = self._rest.partition(b"\n")
        answer: dict[str, Any] = json.loads(text)
        if "error" in answer:
            self.close()
            raise FmuError(f"{self.name}: {answer['error']}")
        return answer

    def close(self) -> int:
        """End its process; its exit code, negative for a signal."""
        self._line.close()
        code = self._process.close()
        self._folder.cleanup()
        return code


def _end(code: int) -> str:
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
