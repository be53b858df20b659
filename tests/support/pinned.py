"""Small cases whose answers are on record: what `explain` says of them, as plain numbers and names."""

import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import motion_logs
import numpy as np
import outsider
import plant_logs

from hil.diagnosis.explain import explain
from plant.injection.theta import THETA

HERE = Path(__file__).parent.parent / "pinned"
RECORDS = HERE / "records"
KEYS: dict[str, str] = tomllib.loads((HERE / "keys.toml").read_text(encoding="utf-8"))
"""Paths as recorded (regular expressions), and as they are now; paths that match none have kept their keys."""
WORDS = (
    "remarks",
    "missing",
    "title",
    "extension",
    "pattern",
    "why",
    "stops",
    "channels_read",
    "headline",
    "text",
    "moved_numbers",
    "goodness_of_fit",
)
"""Texts for people, the account of what was read, and figures with tests of their own: not compared."""


def _drag(torque_nm: float, onset_s: float | None = None) -> np.ndarray:
    theta = THETA.set(THETA.neutral(), "residual_drag", {"torque_nm": {"rl": torque_nm}})
    if onset_s is not None:
        theta[THETA.slice("residual_drag", "onset_s")] = onset_s
    return theta


def _onset() -> list[dict[str, np.ndarray]]:
    """A drag that begins five seconds into the second of three logs."""
    thetas = (THETA.neutral(), _drag(40.0, 5.0), _drag(40.0))
    return [plant_logs.log(theta, 8, k) for k, theta in enumerate(thetas)]


def _bump(speed_mps: float, pressure_pa: np.ndarray) -> np.ndarray:
    """Pads that lose 30 % around 15 m/s."""
    return np.full(4, 1.0 - 0.3 * np.exp(-(((speed_mps - 15.0) / 3.0) ** 2)))


def _weak_rear_left(speed_mps: float, pressure_pa: np.ndarray) -> np.ndarray:
    """Pads of one wheel that give three quarters of their torque."""
    return np.array([1.0, 1.0, 0.75, 1.0])


CASES: dict[str, Callable[[Path], Any]] = {
    "null": lambda out: explain(plant_logs.logs(THETA.neutral(), 5), out=out),
    "single": lambda out: explain(plant_logs.logs(_drag(30.0), 6), out=out),
    "onset": lambda out: explain(_onset(), out=out),
    "nonparametric": lambda out: explain(outsider.logs(_bump), vehicle=outsider.VEHICLE, out=out),
    "foreign_car": lambda out: explain(outsider.logs(_weak_rear_left), vehicle=outsider.VEHICLE, out=out),
    "sensor_consistency": lambda out: explain(motion_logs.motion_log(5, gain=0.08, late=15), out=out),
}


def answer(case: str, folder: Path) -> dict[str, Any]:
    """What `explain` says of a case, its extension file beside it."""
    content = json.loads(json.dumps(CASES[case](folder).json))
    extension = tomllib.loads((folder / "extension.toml").read_text(encoding="utf-8"))
    return {"answer": content, "extension": extension}


def flat(content: Any, at: str = "") -> Iterator[tuple[str, str, Any]]:
    """Every value below: its path, its own key, and itself; texts for people are left out."""
    if isinstance(content, dict):
        for key, value in content.items():
            if key not in WORDS:
                yield from flat(value, f"{at}/{key}")
    elif isinstance(content, list):
        yield f"{at}/length", "length", len(content)
        for k, value in enumerate(content):
            yield from flat(value, f"{at}/{k}")
    else:
        key = at.rsplit("/", 1)[-1]
        yield at, key, Path(content).stem if key == "scenario" else content


def renamed(path: str) -> str:
    """A recorded path by the keys of now."""
    for then, now in KEYS.items():
        path = re.sub(then, now, path)
    return path


def family(path: str) -> str:
    """Values that have one scale: the same entry of a list's members, and the points of a curve."""
    return re.sub(r"/(y|low|high)$", "", re.sub(r"/\d+", "/#", path))


def group(path: str) -> str:
    """Part of the answer that a value belongs to, which has one numerical spread: ``/answer/held_out_error``."""
    return "/".join(path.split("/")[:3])


def scales(values: Mapping[str, Any]) -> dict[str, float]:
    """Largest magnitude of each family."""
    largest: dict[str, float] = {}
    for path, value in values.items():
        if isinstance(value, float):
            largest[family(path)] = max(largest.get(family(path), 0.0), abs(value))
    return largest


def spread(runs: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """How far numbers of the same code go apart from build to build, as a share of their scale, largest of a group."""
    largest: dict[str, float] = {}
    scale = scales(runs[0])
    for path, value in runs[0].items():
        if isinstance(value, float) and scale[family(path)] > 0.0:
            values = [float(run[path]) for run in runs]
            share = (max(values) - min(values)) / scale[family(path)]
            largest[group(path)] = max(largest.get(group(path), 0.0), share)
    return largest


def recorded(case: str) -> tuple[dict[str, Any], dict[str, float]]:
    """The stored record of a case by the keys of now, and its spread by group."""
    content = json.loads((RECORDS / f"{case}.json").read_text(encoding="utf-8"))
    values, spreads = content["values"], content["spread"]
    return {renamed(path): value for path, value in values.items()}, {
        group(renamed(f"{path}/")): share for path, share in spreads.items()
    }
