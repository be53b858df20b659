"""Rivals in one run: the same blind logs to our `explain` and to what others do with a residual.

The cases are fixed before anything is seen: singles evenly spaced over the list of separable effects, nulls in order.
Ours fits the vehicle's numbers within their tolerance and models the disturbances; the rivals
(`hil.validation.perf.rivals`) take the nominal vehicle and white noise, so that what a tolerance lets be off is a cause
to them.
"""

import importlib
import statistics
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.diagnosis.explain import explain
from hil.diagnosis.result.answer import Answer
from hil.errors import BrakebenchError
from hil.extras import pip_install
from hil.rt.clock import process_cpu_time_ns
from hil.validation.perf.rivals import NONE, RIVALS, Guess
from hil.validation.perf.row import Progress, Row, unseen
from hil.validation.perf.signatures import problem
from hil.validation.reference_car.cases import draw
from hil.validation.reference_car.files import read_answer, write

SEED, SNR = 1, 15.0
SINGLES = (7, 22, 37, 52)
NULLS = (0, 1, 2, 3)
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
    def wrong(self) -> bool:
        """Whether anything but what is hidden is named first."""
        return self.guess.named != self.hidden

    @property
    def brier(self) -> float:
        """Sum over all effects and `NONE` of (probability - outcome)^2, 0 to 2 (Brier 1950)."""
        chances = {self.hidden: 0.0, **self.guess.probability}
        return sum((chance - (name == self.hidden)) ** 2 for name, chance in chances.items())


def measure(progress: Progress = unseen) -> list[Row]:
    """Rows of ``brakebench perf explain``: for each figure one a rival. Takes some three minutes a case.

    Figures are shares of cases, the mean Brier score, and the median processor time of a case, all threads, reading the
    logs included; a rival's has the making of the signatures in it, ours the gain on held-out logs. Linear algebra has
    one thread: more of them poll for each other, and on a busy machine that is most of what would be measured.

    The ratio of shares is (1 + wrong answers of the other) / (1 + wrong answers of ours), that of Brier scores
    (1 + sum of the other) / (1 + sum of ours): one wrong case is added to both sides, so that no zero of a few cases
    makes it infinite. That of times is the median of the cases' ratios.

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
    """Our answer as a guess: its first cause; probabilities of causes and rivals, the rest on `NONE`.

    Several causes, or a set of tied ones, may add up to more than 1: they share it in proportion.
    """
    chances: dict[str, float] = {}
    for entry in (*answer["causes"], *answer["rivals"]):
        chances[entry["effect"]] = max(chances.get(entry["effect"], 0.0), float(entry["probability"]))
    total = max(sum(chances.values()), 1.0)
    chances = {name: chance / total for name, chance in chances.items()}
    chances[NONE] = max(1.0 - sum(chances.values()), 0.0)
    return Guess(answer["causes"][0]["effect"] if answer["causes"] else NONE, chances)


def rows_of(ours: Sequence[Outcome], others: Sequence[Outcome], rival: str) -> list[Row]:
    """One rival's rows; see `measure`."""
    rows = []
    for name, nothing, good in (("hidden cause named first", False, True), ("false alarms", True, False)):
        pairs = [(a.wrong, b.wrong) for a, b in zip(ours, others, strict=True) if (a.hidden == NONE) == nothing]
        mine, theirs = (sum(wrong) for wrong in zip(*pairs, strict=True))
        shares = [(len(pairs) - wrong if good else wrong) / len(pairs) for wrong in (mine, theirs)]
        title = f"{name}, {len(pairs)} {'with nothing hidden' if nothing else f'singles at SNR {SNR:g}'}"
        rows.append(Row(title, shares[0], shares[1], rival, (1 + theirs) / (1 + mine), "share"))
    mine_b, theirs_b = (sum(outcome.brier for outcome in side) for side in (ours, others))
    score = Row(
        "Brier score over all names, 0 to 2", mine_b / len(ours), theirs_b / len(ours), rival,
        (1.0 + theirs_b) / (1.0 + mine_b), "",
    )  # fmt: skip
    times = [[outcome.time_s for outcome in side] for side in (ours, others)]
    ratio = statistics.median(b / a for a, b in zip(*times, strict=True))
    took = Row(
        "processor time of a case", statistics.median(times[0]), statistics.median(times[1]), rival, ratio, "s"
    )  # fmt: skip
    return [*rows, score, took]
