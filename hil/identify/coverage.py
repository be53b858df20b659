"""Does the joint region hold the truth as often as it says? Records made from equations (3) and (4) themselves."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.integrate import solve_ivp
from scipy.stats import binom

from hil.identify.fit import fit
from hil.identify.model import Brake, Heating, Pad, Start
from hil.identify.record import Floats, Record
from hil.identify.uncertainty import joint_limit, joint_statistic
from plant.friction import mu_rate, temperature_rate

Colour = Literal["white", "first-order"]
LEVEL = 0.99

TRUTHS: dict[Heating, Pad] = {
    "printed": Pad(a=3.6665e-5, b=9.5140e-7, c=2.0e-2, gamma=1.2667e-2, eps=3.943e4),
    "friction": Pad(a=2.7472e-5, b=8.9074e-7, c=4.0e-3, gamma=1.6667e-1, eps=3.054e4),
}
"""Sets whose record covers what pads do: a contact temperature as printed, a bulk disc heated by friction."""

_START = Start(0.42, 343.15)
_SPEED_MPS, _PEAK_PA, _FREQUENCY_HZ, _DURATION_S, _STEP_S = 4.0, 30e5, 0.1, 160.0, 0.05
_TORQUE_NOISE_NM, _TEMPERATURE_NOISE_K, _PRESSURE_NOISE_PA = 2.0, 0.4, 3e3
_CORRELATION = 0.9


@dataclass(frozen=True)
class Covered:
    """Outcome over the seeds for one heating form and one colour of noise.

    Attributes
    ----------
    inside : fits whose joint 99 % region held the truth.
    least : fewer than these happen once in 1000 experiments if the level is true.
    form_found : fits whose residuals also preferred the true heating form.
    """

    heating: Heating
    noise: Colour
    seeds: int
    inside: int
    least: int
    form_found: int

    @property
    def met(self) -> bool:
        """Whether the outcome agrees with the level."""
        return self.inside >= self.least


def coverage(
    brake: Brake, seeds: Sequence[int], progress: Callable[[float], None] = lambda _: None
) -> Iterator[Covered]:
    """Fit records of known truth; one outcome for each heating form and noise. ``progress`` takes the share done."""
    colours: tuple[Colour, ...] = ("white", "first-order")
    done, count = 0, len(TRUTHS) * len(colours) * len(seeds)
    for heating, truth in TRUTHS.items():
        clean = noiseless(brake, truth, heating)
        other: Heating = "friction" if heating == "printed" else "printed"
        for colour in colours:
            inside = found = 0
            for seed in seeds:
                record = with_noise(clean, colour, seed)
                fitted = fit(record, brake, heating)
                inside += joint_statistic(fitted, truth) <= joint_limit(fitted, LEVEL)
                found += fitted.log_likelihood > fit(record, brake, other).log_likelihood
                done += 1
                progress(done / count)
            least = int(binom.ppf(1e-3, len(seeds), LEVEL))
            yield Covered(heating, colour, len(seeds), inside, least, found)


def noiseless(brake: Brake, pad: Pad, heating: Heating) -> Record:
    """Record of equations (3) and (4), solved by scipy at a tight tolerance, before any noise."""
    time = np.arange(0.0, _DURATION_S, _STEP_S)

    def pressure(t: float) -> float:
        return float(0.5 * _PEAK_PA * (1.0 - np.cos(2.0 * np.pi * _FREQUENCY_HZ * t)))

    def rates(t: float, state: Floats) -> list[float]:
        power = float(brake.force_n(np.array([pressure(t)]))[0]) * _SPEED_MPS
        heat = power * state[0] if heating == "friction" else power
        return [
            mu_rate(state[0], power, state[1], pad.a, pad.b, pad.eps),
            temperature_rate(state[1], heat, brake.ambient_k, pad.c, pad.gamma),
        ]

    solved = solve_ivp(rates, (0.0, _DURATION_S), _START, "DOP853", time, rtol=1e-10, atol=1e-10, max_step=0.1)
    pressures = np.array([pressure(t) for t in time])
    torque = solved.y[0] * brake.torque_per_mu_nm(pressures)
    return Record("equations (3) and (4)", time, pressures, np.full(time.size, _SPEED_MPS), torque, solved.y[1])


def with_noise(clean: Record, colour: Colour, seed: int) -> Record:
    """Add sensor noise and quantisation."""
    rng = np.random.default_rng(seed)
    n = clean.time_s.size
    return Record(
        f"{clean.name}, seed {seed}",
        clean.time_s,
        _quantised(clean.pressure_pa + _PRESSURE_NOISE_PA * rng.standard_normal(n), 2e3),
        clean.speed_mps,
        _quantised(clean.torque_nm + _TORQUE_NOISE_NM * _noise(rng, n, colour), 0.25),
        _quantised(clean.temperature_k + _TEMPERATURE_NOISE_K * _noise(rng, n, colour), 0.1),
    )


def _noise(rng: np.random.Generator, n: int, colour: Colour) -> Floats:
    """Noise of size 1, white or with a correlation of 0.9 between neighbours."""
    white = rng.standard_normal(n)
    if colour == "white":
        return white
    out = np.empty(n)
    out[0] = white[0]
    for i in range(1, n):
        out[i] = _CORRELATION * out[i - 1] + np.sqrt(1.0 - _CORRELATION**2) * white[i]
    return out


def _quantised(values: Floats, step: float) -> Floats:
    return np.asarray(np.round(values / step) * step)
