"""Synthetic dynamometer: the shipped records come from here, not from a measurement.

The brake in this module is richer than equations (3) and (4) and shares no derivative with the plant, so that the
identification meets what a real record has and the model has not:

- friction carried by a film on the disc that grows faster when hot and is rubbed off by power, up to a full cover;
- a sliding-speed (Stribeck) term, a pressure term, and fade above a temperature of the surface;
- a lining that conforms to the disc with a lag, and a caliper seal that holds the force back in both directions;
- three temperatures: surface, disc body with cooling air and radiation, and a rubbing thermocouple that lags;
- a torque ripple once a turn, a drive that gives way under torque, noise and quantisation of every channel.

``python -m hil.identify.dyno OUTDIR`` writes the records again, byte for byte.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_INNER_STEP_S = 0.005
_RECORDED_EVERY = 10  # steps: 20 Hz
_REMARK = (
    "SYNTHETIC record, not measured: made by hil/identify/dyno.py from a friction model richer than the paper's",
    "fixed sliding speed, pressure a 0 to 30 bar sine, rising temperature, noise and quantisation; seed {seed}",
    "front brake: one piston of 25.5 cm2, effective radius 0.108 m, two pads",
)


@dataclass(frozen=True)
class Test:
    """One test on the dynamometer."""

    file: str
    frequency_hz: float
    start_degc: float
    film: float
    seed: int
    duration_s: float = 160.0
    peak_bar: float = 30.0
    speed_mps: float = 4.0


TESTS = (
    Test("dyno_test1.csv", frequency_hz=0.1, start_degc=70.0, film=0.48, seed=101),
    Test("dyno_test2.csv", frequency_hz=0.2, start_degc=70.0, film=0.44, seed=202),
)
"""As in the paper's Figure 3: test 2 at twice the frequency of test 1."""


@dataclass(frozen=True)
class Lining:
    """The brake under test; SI units and kelvin. Choices of the size the literature gives for organic pads."""

    piston_area_m2: float = 25.5e-4
    radius_m: float = 0.108
    seal_bar: float = 0.20  # half width of the band in which the force stands still
    retraction_bar: float = 0.45
    efficiency: float = 0.965
    mu_bare: float = 0.12
    mu_film: float = 0.50
    film_rate_1_s: float = 0.06  # at 400 K
    film_activation_k: float = 1400.0
    rubbing_1_j: float = 3.4e-6
    stribeck: float = 0.06
    stribeck_mps: float = 2.0
    pressure_exponent: float = 0.015
    conforming_s: float = 0.5
    conforming: float = 0.012
    fade_k: float = 640.0
    fade_width_k: float = 35.0
    fade_depth: float = 0.45
    surface_j_k: float = 420.0
    body_j_k: float = 9500.0
    conduction_w_k: float = 3000.0
    cooling_w_k: float = 40.0
    radiation_w_k4: float = 5.67e-8 * 0.12
    into_disc: float = 0.93
    air_k: float = 296.0
    thermocouple_s: float = 1.5
    ripple: float = 0.006
    speed_droop_mps_nm: float = 4e-5


def record(test: Test, lining: Lining | None = None) -> str:
    """Text of the CSV that the dynamometer would write."""
    lining = lining or Lining()
    rng = np.random.default_rng(test.seed)
    remarks = [f"# {line.format(seed=test.seed)}" for line in _REMARK]
    lines = [*remarks, "time [s],pressure [bar],speed [m/s],torque [N m],temperature [degC]"]
    for time, bar, speed, torque, kelvin in _run(test, lining):
        noise = rng.standard_normal(4).tolist()
        cells = (
            f"{time:.2f}",
            f"{_quantised(bar + 0.03 * noise[0], 0.02):.2f}",
            f"{_quantised(speed + 0.003 * noise[1], 0.002):.3f}",
            f"{_quantised(torque + 1.8 * noise[2], 0.25):.2f}",
            f"{_quantised(kelvin - 273.15 + 0.35 * noise[3], 0.1):.1f}",
        )
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def write(folder: Path) -> list[Path]:
    """Write all records and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for test in TESTS:
        path = folder / test.file
        path.write_bytes(record(test).encode("ascii"))
        paths.append(path)
    return paths


def _quantised(value: float, step: float) -> float:
    return round(value / step) * step + 0.0  # no minus zero in the file


def _run(test: Test, lining: Lining) -> list[tuple[float, float, float, float, float]]:
    """Time s, pressure bar, speed m/s, torque N m and thermocouple K at every recorded sample, without noise."""
    start = test.start_degc + 273.15
    state = [test.film, start, start, start, 0.0]  # film, surface, body, thermocouple, force the lining conforms to
    seat_bar, angle, torque = 0.0, 0.0, 0.0
    rows = []
    for step in range(round(test.duration_s / _INNER_STEP_S)):
        time = step * _INNER_STEP_S
        bar = 0.5 * test.peak_bar * (1.0 - math.cos(2.0 * math.pi * test.frequency_hz * time))
        speed = test.speed_mps - lining.speed_droop_mps_nm * torque
        seat_bar = min(max(seat_bar, bar - lining.seal_bar), bar + lining.seal_bar)
        effective_bar = max(seat_bar - lining.retraction_bar, 0.0)
        force = lining.efficiency * lining.piston_area_m2 * 1e5 * effective_bar
        torque = 2.0 * lining.radius_m * force * _friction(lining, state, force, speed)
        if step % _RECORDED_EVERY == 0:
            rows.append((time, bar, speed, torque * (1.0 + lining.ripple * math.sin(angle)), state[3]))
        angle += speed / lining.radius_m * _INNER_STEP_S
        # mypy infers no type for a default of a lambda, which binds what this turn of the loop has
        state = _heun(lambda x, f=force, v=speed: _derivative(lining, x, f, v), state)  # type: ignore[misc]
    return rows


def _friction(lining: Lining, state: Sequence[float], force: float, speed: float) -> float:
    film, surface, _, _, conformed = state
    full_force = lining.piston_area_m2 * 3e6
    pressure = math.pow((force + 0.02 * full_force) / (0.5 * full_force), -lining.pressure_exponent)
    sliding = 1.0 + lining.stribeck * math.exp(-((speed / lining.stribeck_mps) ** 2))
    faded = 1.0 - lining.fade_depth / (1.0 + math.exp((lining.fade_k - surface) / lining.fade_width_k))
    conforming = 1.0 + lining.conforming * (force - conformed) / (0.25 * full_force)
    return (lining.mu_bare + lining.mu_film * film) * pressure * sliding * faded * conforming


def _derivative(lining: Lining, state: Sequence[float], force: float, speed: float) -> list[float]:
    film, surface, body, thermocouple, conformed = state
    growth = lining.film_rate_1_s * math.exp(lining.film_activation_k * (1.0 / 400.0 - 1.0 / surface))
    heat = lining.into_disc * 2.0 * force * speed * _friction(lining, state, force, speed)
    inward = lining.conduction_w_k * (surface - body)
    lost = lining.cooling_w_k * (body - lining.air_k) + lining.radiation_w_k4 * (body**4 - lining.air_k**4)
    return [
        growth * (1.0 - film) - lining.rubbing_1_j * force * speed * film,
        (heat - inward) / lining.surface_j_k,
        (inward - lost) / lining.body_j_k,
        (surface - thermocouple) / lining.thermocouple_s,
        (force - conformed) / lining.conforming_s,
    ]


def _heun(derivative: Callable[[Sequence[float]], list[float]], state: Sequence[float]) -> list[float]:
    first = derivative(state)
    trial = [x + _INNER_STEP_S * d for x, d in zip(state, first, strict=True)]
    second = derivative(trial)
    return [x + 0.5 * _INNER_STEP_S * (d + e) for x, d, e in zip(state, first, second, strict=True)]


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m hil.identify.dyno OUTDIR")
    for written in write(Path(sys.argv[1])):
        print(written)
