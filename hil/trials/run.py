"""Blind trials: draw a case, explain its logs, open the answer, note what came out; append and resume."""

import json
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.errors import BrakebenchError
from hil.hide.case import Case
from hil.hide.cases import draw
from hil.hide.files import read_answer, write
from hil.study.diagnose import Settings
from hil.study.explain import explain

SIZES = (3.0, 5.0, 8.0, 15.0)
"""Signal-to-noise ratios of the family of single causes."""
Record = dict[str, Any]
Say = Callable[[str], None]


def plan(family: str, count: int) -> list[tuple[str, int, float | None]]:
    """Cases of a family: which family they are drawn from, number, size."""
    if family == "null":
        return [("null", k, None) for k in range(count)]
    if family == "single":
        return [("single", k, size) for k in range(count) for size in SIZES]
    return [("single", k, 8.0 if k % 2 else 15.0) for k in range(count)]  # parameters, gain


def run_family(
    family: str, count: int, seed: int, out: Path, say: Say, settings: Settings | None = None
) -> list[Record]:
    """Run what is not yet in ``out/cases.jsonl``; all records of the family, in order of the plan."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / "cases.jsonl"
    done = {_key(record): record for record in _read(path) if record["seed"] == seed}
    records = []
    for drawn, index, size in plan(family, count):
        key = (drawn, index, size)
        if key not in done:
            done[key] = run_case(draw(drawn, index, seed, size), seed, size, settings)
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(done[key]) + "\n")
        records.append(done[key])
        say(f"{family} {index} {'' if size is None else size}: {done[key]['verdict']} {done[key]['named'][:1]}")
    return records


def _key(record: Record) -> tuple[str, int, float | None]:
    return str(record["family"]), int(record["index"]), record["size"]


def _read(path: Path) -> list[Record]:
    if not path.exists():
        return []
    lines = path.read_text(encoding="utf-8").splitlines()
    try:
        return [json.loads(line) for line in lines if line.strip()]
    except ValueError as error:
        raise BrakebenchError(f"{path}: a line is no JSON ({error}); remove it, the case is run again") from error


def run_case(case: Case, seed: int, size: float | None, settings: Settings | None = None) -> Record:
    """Hide, explain, open; ``seed`` is the trials', ``size`` the signal-to-noise ratio asked for."""
    with TemporaryDirectory() as folder:
        logs = Path(folder) / "logs"
        write(case, logs)
        found = explain(logs, logs / "vehicle.toml", out=Path(folder) / "out", settings=settings).json
        truth = read_answer(logs)
    return {
        "family": case.family, "index": case.index, "seed": seed, "size": size,
        "snr": truth["snr"], "reached": truth["reached"], "noise": case.noise_level,
        "hidden": truth["causes"], "verdict": found["verdict"],
        "named": [cause["effect"] for cause in found["causes"]], "causes": found["causes"],
        "rivals": [rival["effect"] for rival in found["rivals"]], "not_testable": found["not_testable"],
        "gain": found["gain"],
    }  # fmt: skip
