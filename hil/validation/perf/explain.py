"""Rivals in one run: the same blind logs to our `explain` and to what others do with a residual.

The cases are fixed before anything is seen: singles evenly spaced over the list of separable effects, nulls in order.
Ours fits the vehicle's numbers within their tolerance and models the disturbances; the rivals
(`hil.validation.perf.rivals`) take the nominal vehicle and white noise, so that what a tolerance lets be off is a cause
to them. Rank and isolation probability are those of `hil.validation.blind_trials.isolation`; a rival's probabilities or
its shares count, whichever put more on the right causes.
"""

import importlib
import statistics
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.diagnosis.explain import explain
from hil.diagnosis.result.answer import Answer
from hil.errors import BrakebenchError
from hil.extras import pip_install
from hil.rt.clock import process_cpu_time_ns
from hil.validation.blind_trials.isolation import probabilities, share_of_first
from hil.validation.blind_trials.metrics import mean, wilson
from hil.validation.perf.rivals import NONE, RIVALS, Guess
from hil.validation.perf.row import Progress, Row, unseen
from hil.validation.perf.signatures import problem
from hil.validation.reference_car.cases import draw
from hil.validation.reference_car.files import read_answer, write

SEED, SNR = 1, 15.0
SINGLES = (7, 14, 22, 29, 37, 44, 52, 59)
NULLS = (0, 1, 2, 3, 4, 5, 6, 7)
WARM_UP = ("m03_motor_20.parquet", "m05_stop_72_hot.parquet")
"""Logs that both sides look at before anything is timed: what is compiled at its first call is compiled then."""
OURS = "brakebench explain"


@dataclass(frozen=True)
class Outcome:
    """What one side said of one case: the ``hidden`` effect or `NONE`, its guess, and its processor time."""

    hidden: str
    guess: Guess
    time_s: float

    @property
    def detected(self) -> bool:
        """Whether anything is named at all."""
        return self.guess.named != NONE

    @property
    def first(self) -> float:
        """1 where what is hidden ranks first by probability, less in a tie."""
        return share_of_first(self.guess.probability, self.hidden)

    @property
    def mass(self) -> float:
        """Probability of what is hidden."""
        return float(self.guess.probability.get(self.hidden, 0.0))

    @property
    def brier(self) -> float:
        """Sum over all effects and `NONE` of (probability - outcome)^2, 0 to 2 (Brier 1950)."""
        chances = {self.hidden: 0.0, **self.guess.probability}
        return sum((chance - (name == self.hidden)) ** 2 for name, chance in chances.items())


def measure(progress: Progress = unseen) -> list[Row]:
    """Rows of ``brakebench perf explain``: for each figure one a rival. Takes about a minute a case.

    Figures are shares of cases, means of the probability of the hidden cause and of the Brier score, and the median
    processor time of a case, all threads, reading the logs included; a rival's has the making of the signatures in it,
    ours the gain on held-out logs. Linear algebra has one thread: more of them poll for each other, and on a busy
    machine that is most of what would be measured. Where a side detects nothing, its probability where detected is 0.

    The ratio of shares and probabilities is (1 + what the other lacks) / (1 + what ours lacks), each summed over its
    cases, that of Brier scores (1 + sum of the other) / (1 + sum of ours): one wrong case is added to both sides, so
    that no zero of a few cases makes it infinite. That of times is the median of the cases' ratios. Intervals of shares
    are Wilson's, those of means a bootstrap over cases.

    Raises
    ------
    BrakebenchError
        pysindy is not installed.
    """
    _require_pysindy()
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        said = _all_said(progress)
    ours = said.pop(OURS)
    figures = [rows_of(ours, others, rival) for rival, others in said.items()]
    return [row for of_one_figure in zip(*figures, strict=True) for row in of_one_figure]


def _all_said(progress: Progress) -> dict[str, list[Outcome]]:
    """What each side says of every case."""
    planned = [("single", k, SNR) for k in SINGLES] + [("null", k, None) for k in NULLS]
    said: dict[str, list[Outcome]] = {side: [] for side in (OURS, *RIVALS)}
    for number, (family, index, size) in enumerate(planned):
        progress(number / len(planned))
        with TemporaryDirectory() as folder:
            logs = Path(folder) / "logs"
            write(draw(family, index, SEED, size), logs)
            if not number:
                _answers([logs / name for name in WARM_UP], logs)
            answers = _answers([logs], logs)
            causes = read_answer(logs)["causes"]
        hidden = causes[0]["effect"] if causes else NONE
        for side, (guess, time_s) in answers.items():
            said[side].append(Outcome(hidden, guess, time_s))
        named = ", ".join(f"{guess.named} ({side})" for side, (guess, _) in answers.items())
        print(f"perf explain: {family} {index}, hidden {hidden}: {named}", file=sys.stderr)
    return said


def _require_pysindy() -> None:
    try:
        importlib.import_module("pysindy.optimizers")
    except ImportError as error:
        raise BrakebenchError(
            f"perf explain: pysindy is not installed; install it with: {pip_install('perf')}"
        ) from error


def _answers(of: Sequence[Path], logs: Path) -> dict[str, tuple[Guess, float]]:
    """What each side says of the logs ``of``, and its processor time, s."""
    vehicle = logs / "vehicle.toml"
    begin = process_cpu_time_ns()
    answered = explain(list(of), vehicle)
    assert isinstance(answered, Answer)  # the reference car's logs tell forces
    answers = {OURS: (guess_of(answered.json), _since_s(begin))}
    begin = process_cpu_time_ns()
    given = problem(of, vehicle)
    made_s = _since_s(begin)
    for rival, guess in RIVALS.items():
        begin = process_cpu_time_ns()
        answers[rival] = guess(given), made_s + _since_s(begin)
    return answers


def _since_s(begin_ns: int) -> float:
    return (process_cpu_time_ns() - begin_ns) * 1e-9


def guess_of(answer: dict[str, Any]) -> Guess:
    """Our answer as a guess: its first cause; probabilities of causes and rivals, the rest on `NONE`."""
    chances = probabilities((*answer["causes"], *answer["rivals"]))
    chances[NONE] = max(1.0 - sum(chances.values()), 0.0)
    return Guess(answer["causes"][0]["effect"] if answer["causes"] else NONE, chances)


def rows_of(ours: Sequence[Outcome], others: Sequence[Outcome], rival: str) -> list[Row]:
    """One rival's rows; see `measure`."""
    sides = ours, _kinder_reading(others)
    singles = [[one for one in side if one.hidden != NONE] for side in sides]
    nulls = [[one for one in side if one.hidden == NONE] for side in sides]
    found = [[one for one in side if one.detected] for side in singles]
    at = f"{len(singles[0])} singles at SNR {SNR:g}"
    rows = [
        _row(f"right cause has rank 1, {at}", [[one.first for one in side] for side in singles], rival),
        _row(f"probability of the right cause, {at}", [[one.mass for one in side] for side in singles], rival),
        _row("the same, of those detected", [[one.mass for one in side] for side in found], rival),
        _row(f"detected, {at}", [[one.detected for one in side] for side in singles], rival),
        _row(
            f"false alarms, {len(nulls[0])} with nothing hidden", [[one.detected for one in side] for side in nulls],
            rival, good=False,
        ),
    ]  # fmt: skip
    mine_b, theirs_b = (sum(outcome.brier for outcome in side) for side in sides)
    score = Row(
        "Brier score over all names, 0 to 2", mine_b / len(ours), theirs_b / len(ours), rival,
        (1.0 + theirs_b) / (1.0 + mine_b), "",
    )  # fmt: skip
    times = [[outcome.time_s for outcome in side] for side in sides]
    ratio = statistics.median(b / a for a, b in zip(*times, strict=True))
    took = Row(
        "processor time of a case", statistics.median(times[0]), statistics.median(times[1]), rival, ratio, "s"
    )  # fmt: skip
    return [*rows, score, took]


def _kinder_reading(others: Sequence[Outcome]) -> Sequence[Outcome]:
    """A rival's outcomes with probabilities or with shares for them, as more is on what is hidden in the singles."""
    by_share = [
        one if one.guess.shares is None else replace(one, guess=Guess(one.guess.named, one.guess.shares))
        for one in others
    ]
    return max((others, by_share), key=lambda of: sum(one.mass for one in of if one.hidden != NONE))


def _row(name: str, sides: Sequence[Sequence[float]], rival: str, good: bool = True) -> Row:
    """Means of values from 0 to 1 of both sides, by case, with their intervals."""
    (mine, mine_95), (theirs, theirs_95) = (_mean(side) for side in sides)
    lacking = [1.0 + sum((1.0 - value) if good else value for value in side) for side in sides]
    return Row(name, mine, theirs, rival, lacking[1] / lacking[0], "share", mine_95, theirs_95)


def _mean(values: Sequence[float]) -> tuple[float, tuple[float, float]]:
    """Mean of values from 0 to 1, and its interval: of whole hits and misses Wilson's, else a bootstrap's."""
    if set(values) <= {0.0, 1.0}:
        return sum(values) / max(len(values), 1), wilson(round(sum(values)), len(values))
    entry = mean(values)
    return entry["value"], (entry["low"], entry["high"])
