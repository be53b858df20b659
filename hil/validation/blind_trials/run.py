"""Blind trials: draw a case, explain its logs, open the answer, note what came out; append and resume."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.campaign.engine import Killed, LocalWorkers, work
from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.detection.result import Settings
from hil.diagnosis.explain import explain
from hil.diagnosis.result.answer import Answer
from hil.errors import BrakebenchError
from hil.validation.blind_trials import oracle
from hil.validation.blind_trials.sources import STRANGERS, state
from hil.validation.reference_car.case import Case
from hil.validation.reference_car.cases import draw, followed_by
from hil.validation.reference_car.files import read_answer, write
from hil.validation.strangers import cases as strangers

SIZES = (15.0, 8.0, 5.0, 3.0)
"""Signal-to-noise ratios of the family of single causes, in the order they are run."""
SURE = (15.0, 8.0)
"""Those at which parameters, gain and calibration are scored."""
Record = dict[str, Any]
CaseKey = tuple[str, int, float | None]
"""Family that a case is drawn from, number, size."""
Say = Callable[[str], None]


def plan(family: str, count: int) -> list[CaseKey]:
    """Cases of a family in the order they are run: which family they are drawn from, number, size.

    ``single`` has ``count`` cases a size, effects in turn. ``parameters``, ``gain`` and ``calibration`` have ``count``
    in all, half of them at each size of `SURE`, and share them with ``single``.
    """
    if family == "single":
        return [("single", k, size) for size in SIZES for k in range(count)]
    if family in ("parameters", "gain", "calibration"):
        halves = ((count + 1) // 2, count // 2)
        return [("single", k, size) for size, half in zip(SURE, halves, strict=True) for k in range(half)]
    return [(family, k, None) for k in range(count)]


def run_family(
    family: str,
    count: int,
    seed: int,
    out: Path,
    say: Say,
    settings: Settings | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> list[Record]:
    """Run what is not yet in ``out/cases.jsonl``; all records of the family, in order of the plan.

    Several processes may do so with different families.
    """
    out.mkdir(parents=True, exist_ok=True)
    path = out / "cases.jsonl"
    done = {_key(record): record for record in _read(path) if record["seed"] == seed}
    cases = plan(family, count)
    missing = [case for case in cases if case not in done]
    if len(missing) < len(cases):
        say(f"{family}: {len(cases) - len(missing)} of {len(cases)} cases stand in {path}")
    # one worker: a case takes all processors by itself, and the lines come in the order of the plan
    found = work([[case] for case in missing], partial(_run, seed=seed, settings=settings), LocalWorkers(1))
    for n, ((case,), (record,)) in enumerate(found, len(cases) - len(missing) + 1):
        if isinstance(record, Killed):
            raise BrakebenchError(f"{case}: ended its worker process {record.times} times")
        with path.open("ab", buffering=0) as file:  # one write: other families may be appending too
            file.write(f"{json.dumps(record)}\n".encode())
        done[case] = record
        drawn, index, size = case
        say(f"{drawn} {index} {'' if size is None else size}: {record['verdict']} {record['named'][:1]}")
        progress(n / len(cases))
    return [done[case] for case in cases]


def _run(case: CaseKey, seed: int, settings: Settings | None) -> Record:
    """In a worker."""
    drawn, index, size = case
    if drawn in strangers.FAMILIES:
        return run_stranger(strangers.draw(drawn, index, seed), seed, settings)
    return run_case(draw(drawn, index, seed, size), seed, size, settings)


def _key(record: Record) -> CaseKey:
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
    """Hide, explain, open; ``seed`` is the trials', ``size`` the signal-to-noise ratio of the family.

    Where ``oracle`` is given, it is the held-out error of a model that knows what is hidden (`oracle.oracle`).
    A confounded case has ``follow_up``: what is said of the manoeuvres that decide, by themselves.
    """
    sources = state()  # of what runs now: a case takes minutes, and files may change
    with TemporaryDirectory() as folder:
        answered, said = _explained(lambda logs: write(case, logs), Path(folder), settings)
        truth = read_answer(Path(folder) / "logs")
    record = {
        "family": case.family, "index": case.index, "seed": seed, "size": size, "sources": sources,
        "snr": truth["snr"], "reached": truth["reached"], "noise": case.noise_level,
        "hidden": truth["causes"], **said,
    }  # fmt: skip
    if case.family == "single" and size in SURE and answered is not None:
        record["oracle"] = oracle.true_model_error(answered.diagnosis, truth["causes"][0])
    if case.family == "unlisted":
        record["oracle"] = oracle.untouched(case)
    if case.family == "confounded":
        with TemporaryDirectory() as folder:
            then = followed_by(case)
            record["follow_up"] = _explained(lambda logs: write(then, logs), Path(folder), settings)[1]
    return record


def run_stranger(case: strangers.Case, seed: int, settings: Settings | None = None) -> Record:
    """As `run_case`, of a car that a stranger wrote; no file holds what is hidden.

    ``accepted`` are the right answers to the hidden cause (`hil.validation.strangers.car.Cause`).
    """
    sources = state(STRANGERS)
    with TemporaryDirectory() as folder:
        before = None
        if case.reference is not None:
            before = Path(folder) / "reference"
            strangers.write(case.car, case.seed, None, before, case.reference)
        _, said = _explained(
            lambda logs: strangers.write(case.car, case.seed, case.hidden, logs), Path(folder), settings, before
        )
    hidden, cause = case.hidden, case.cause
    causes: list[Record] = []
    if hidden is not None and cause is not None:
        number = {"value": hidden.size, "unit": cause.unit}
        causes.append({"effect": cause.name, "location": case.car.name, "parameters": {"size": number}})
    return {
        "family": case.family, "index": case.index, "seed": seed, "size": None, "sources": sources, "snr": case.snr,
        "reached": case.reached, "car": case.car.name, "hidden": causes,
        "accepted": [] if cause is None else sorted(cause.accepted), **said,
    }  # fmt: skip


def _explained(
    written: Callable[[Path], object], folder: Path, settings: Settings | None, reference: Path | None = None
) -> tuple[Answer | None, Record]:
    """What `explain` says of the logs written; data that nothing can be concluded from are an answer too."""
    logs = folder / "logs"
    written(logs)
    try:
        vehicle = logs / "vehicle.toml"
        answered = explain(logs, vehicle, out=folder / "out", reference=reference, settings=settings)
    except UnusableError as error:
        return None, {
            "verdict": "unusable", "why": str(error), "named": [], "causes": [], "rivals": [], "rivals_at": [],
            "rival_probabilities": [], "undetectable_effects": [], "held_out_error": {},
        }  # fmt: skip
    assert isinstance(answered, Answer)  # the logs tell forces
    found = answered.json
    return answered, {
        "verdict": found["verdict"], "named": [cause["effect"] for cause in found["causes"]],
        "causes": found["causes"], "rivals": [rival["effect"] for rival in found["rivals"]],
        "rivals_at": [f"{rival['effect']}@{rival['location']}" for rival in found["rivals"]],
        "rival_probabilities": [rival["probability"] for rival in found["rivals"]],
        "undetectable_effects": found["undetectable_effects"], "held_out_error": found["held_out_error"],
    }  # fmt: skip
