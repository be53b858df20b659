"""The process that holds somebody else's FMU: loads it with FMPy and answers lines of JSON on a socket.

A crash or an endless loop of the FMU is this process's alone; `hil.fmu.foreign` is the other end.
"""

import contextlib
import json
import os
import socket
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from hil.rt.process import end_with_parent

NUMBERS = ("Real", "Float64", "Integer", "Int32", "Boolean", "Enumeration", "Float32", "Int64", "UInt64")


class _Host:
    """One co-simulation FMU."""

    def __init__(self, path: str, folder: str, parameters: Mapping[str, float], said: list[str]) -> None:
        import fmpy
        from fmpy.simulation import instantiate_fmu

        description = fmpy.read_model_description(path, validate=False)
        if description.coSimulation is None:
            raise ValueError("is no FMU for co-simulation")
        if not description.fmiVersion.startswith(("2.", "3.")):
            raise ValueError(f"is of FMI {description.fmiVersion}, expected 2 or 3")
        self._is_2 = description.fmiVersion.startswith("2.")
        self._variables = {v.name: v for v in description.modelVariables if v.type in NUMBERS}
        self._said = said
        self._fmu = instantiate_fmu(fmpy.extract(path, folder), description, "CoSimulation", logger=self._log)
        self._check(parameters)
        self._set(parameters)
        if self._is_2:
            self._fmu.setupExperiment(startTime=0.0)
            self._fmu.enterInitializationMode()
        else:
            self._fmu.enterInitializationMode(startTime=0.0)
        self._fmu.exitInitializationMode()
        self._time_s = 0.0
        inside = getattr(description.coSimulation, "fixedInternalStepSize", None)
        stated = description.defaultExperiment.stepSize if description.defaultExperiment else None
        self.told = {
            "name": description.modelName,
            "fmi": description.fmiVersion,
            "tool": description.generationTool or "",
            "step_s": float(inside or stated or 0.0),
            "inputs": [v.name for v in self._variables.values() if v.causality == "input"],
            "outputs": list(self._variables),
        }

    def _log(self, *words: object) -> None:
        """Keep what the FMU says: the last argument of the callback, in FMI 2 and 3 alike."""
        text = words[-1]
        self._said.append(text.decode(errors="replace") if isinstance(text, bytes) else str(text))

    def _check(self, names: Sequence[str] | Mapping[str, float]) -> None:
        odd = [name for name in names if name not in self._variables]
        if odd:
            raise ValueError(f"has no number {', '.join(odd)}")

    def _kind(self, name: str) -> str:
        kind = self._variables[name].type
        return "Integer" if self._is_2 and kind == "Enumeration" else "Int64" if kind == "Enumeration" else kind

    def _set(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            kind = self._kind(name)
            number: float | int | bool = value
            if kind == "Boolean":
                number = bool(value)
            elif kind not in ("Real", "Float64", "Float32"):
                number = round(value)
            getattr(self._fmu, f"set{kind}")([self._variables[name].valueReference], [number])

    def _get(self, names: Sequence[str]) -> list[float]:
        of = self._variables
        return [float(getattr(self._fmu, f"get{self._kind(name)}")([of[name].valueReference])[0]) for name in names]

    def step(self, values: Mapping[str, float], steps: int, step_s: float, wanted: Sequence[str]) -> list[float]:
        """Set inputs, make steps, give outputs."""
        self._set(values)
        for _ in range(steps):
            self._fmu.doStep(currentCommunicationPoint=self._time_s, communicationStepSize=step_s)
            self._time_s += step_s
        return self._get(wanted)

    def close(self) -> None:
        """Let go of it."""
        with contextlib.suppress(Exception):
            self._fmu.terminate()
            self._fmu.freeInstance()


def serve(line: socket.socket) -> None:
    """Answer until the other end closes."""
    host: _Host | None = None
    said: list[str] = []
    with line.makefile("rw", encoding="utf-8") as talk:
        for text in talk:
            asked = json.loads(text)
            answer: dict[str, Any]
            try:
                if host is None:
                    host = _Host(asked["path"], asked["folder"], asked["parameters"], said)
                    answer = host.told
                else:
                    answer = {"values": host.step(asked["set"], asked["steps"], asked["step_s"], asked["get"])}
            except Exception as error:
                answer = {"error": "; ".join([str(error), *said[-1:]])}
            talk.write(json.dumps(answer) + "\n")
            talk.flush()
    if host is not None:
        host.close()


if __name__ == "__main__":
    end_with_parent()
    with socket.socket(fileno=int(sys.argv[1])) as own, contextlib.suppress(BrokenPipeError, ConnectionResetError):
        os.set_inheritable(own.fileno(), False)
        serve(own)
