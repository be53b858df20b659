"""The paper's numbers and ours, as rows: what was claimed, what is asked for, where the number comes from."""

from dataclasses import dataclass
from typing import Literal

Statistic = Literal["median", "p95"]


@dataclass(frozen=True)
class Claim:
    """One number.

    Attributes
    ----------
    figure, claim, unit : as printed.  paper : the paper's number, None where it gives none.
    case, key : where ours is measured (`cases.CASES`).  paper_key : the paper's method here, None where it has none.
    goal, statistic : asked of this statistic over the seeds; ``at_least`` turns the comparison round.
    """

    figure: str
    claim: str
    unit: str
    paper: float | None
    case: str
    key: str
    paper_key: str | None
    goal: float
    statistic: Statistic = "p95"
    at_least: bool = False


def _friction(alpha: str, median: float, p95: float) -> tuple[Claim, Claim]:
    name = f"pad friction RMSE, front left, alpha {alpha}"
    keys = ("estimation", f"joint friction {alpha}", f"paper friction {alpha}")
    return (
        Claim("11", f"{name}, median", "%", 8.0, *keys, median, "median"),
        Claim("11", f"{name}, 95th percentile", "%", 8.0, *keys, p95),
    )


def _not_worse(alpha: str) -> Claim:
    paper_key = f"paper worst {alpha}" if alpha in ("0", "0.7") else None
    name = f"torque error with compensation less that without, worst of three pads, alpha {alpha}"
    return Claim("13", name, "%", None, "compensation", f"worst {alpha}", paper_key, 0.0)


def _series(figure: str, alpha: str) -> tuple[Claim, Claim]:
    name = f"series from 130 km/h, slope of deceleration over pedal, alpha {alpha}"
    return (
        Claim(figure, f"{name}, stop 1", "%", None, "series", f"joint stop 1 {alpha}", f"paper stop 1 {alpha}", 3.0),
        Claim(figure, f"{name}, later stops", "%", None, "series", f"joint later {alpha}", f"paper later {alpha}", 1.0),
    )


def _failure(name: str, what: str, unit: str, key: str, goal: float) -> Claim:
    return Claim("-", f"{name} at alpha 0.7: {what}", unit, None, "failures", key, None, goal)


def _shift(what: str, key: str) -> Claim:
    claim = f"pads x0.7, alpha 0.5, series: {what} saved by moving work to the motors"
    return Claim("-", claim, "%", None, "shift", key, None, 5.0, "median", True)


_ALL, _AXLE = "all motors fail", "motors of the front axle fail"
_TOLD, _AT_ONCE = "battery refuses, announced 0.3 s ahead,", "battery refuses without notice"
_BELOW = "time more than {} m/s2 below demand"

CLAIMS: tuple[Claim, ...] = (
    Claim("9", "wheel-torque RMSE, base braking", "%", 6.0, "estimation", "joint torque 0", "paper torque 0", 3.0),
    Claim("9", "wheel-torque RMSE, base braking, absolute", "Nm", 19.0, "estimation", "joint torque Nm 0",
          "paper torque Nm 0", 15.0),
    Claim("10", "RMSE cut by the road correction", "%", 50.0, "patch", "joint cut", "paper cut", 85.0, "median", True),
    Claim("10", "wheel-torque RMSE over a mu 0.2 patch", "Nm", None, "patch", "joint patch", "paper patch", 25.0),
    Claim("10", "the same, road correction off", "Nm", None, "patch", "joint patch off", "paper patch off", 25.0),
    Claim("10", "time with more than 10 % error after the patch", "ms", None, "patch", "joint adaptation",
          "paper adaptation", 100.0),
    *_friction("0", 2.5, 3.5),
    *_friction("0.5", 4.0, 6.0),
    *_friction("0.7", 5.0, 8.0),
    Claim("12", "torque error cut by compensation after 0.8 s, alpha 0, pads -25 %", "%", None, "compensation",
          "cut pads -25 % 0", "paper cut pads -25 % 0", 90.0, "median", True),
    Claim("12", "torque error cut by compensation after 0.8 s, alpha 0, pads +25 %", "%", None, "compensation",
          "cut pads +25 % 0", "paper cut pads +25 % 0", 90.0, "median", True),
    *(_not_worse(alpha) for alpha in ("0", "0.3", "0.5", "0.7")),
    *_series("14", "0"),
    *_series("15", "0.7"),
    _failure("one motor fails", "depth of the dip", "m/s2", "one depth", 1.0),
    _failure(_AXLE, _BELOW.format("1.0"), "ms", "axle above 1.0", 100.0),
    _failure(_ALL, _BELOW.format("1.0"), "ms", "all above 1.0", 100.0),
    _failure(_ALL, _BELOW.format("0.3"), "ms", "all above 0.3", 150.0),
    _failure(_ALL, "speed lost by it", "m/s", "all lost", 0.2),
    _failure("battery becomes full in mid-stop", "depth of the dip", "m/s2", "full depth", 0.3),
    _failure(_TOLD, "depth of the dip", "m/s2", "announced depth", 0.3),
    _failure(_AT_ONCE, "depth of the dip", "m/s2", "at once depth", 0.3),
    _failure(_AT_ONCE, _BELOW.format("1.0"), "ms", "at once above 1.0", 100.0),
    _failure(_AT_ONCE, _BELOW.format("0.3"), "ms", "at once above 0.3", 150.0),
    _shift("friction heat", "heat saved"),
    _shift("rise of the front disc's temperature", "rise saved"),
    Claim("-", "pads x0.7, alpha 0.5, work moved to the motors: slope, later stops", "%", None, "shift", "shift slope",
          None, 1.0),
    Claim("-", "pads x0.7: error of the friction estimate", "%", None, "weak pads", "with estimate", "paper estimate",
          5.0),
    Claim("-", "pads x0.7: second stop's deceleration off demand", "%", None, "weak pads", "with second",
          "paper second", 3.0),
)  # fmt: skip
