"""Equations (3) and (4) of the paper over a record: what torque and temperature the model expects."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.identify.record import Record
from plant.compiled import equation
from plant.friction import mu_rate, temperature_rate
from plant.hydraulics import pad_force
from plant.parameters.brakes import FrictionBrakeParameters

Floats = NDArray[np.float64]
Heating = Literal["printed", "friction"]
HEATINGS: tuple[Heating, ...] = ("printed", "friction")
"""Heating term of equation (4): N v as printed, or mu N v (what really heats)."""


class Pad(NamedTuple):
    """Parameters of equations (3) and (4): a 1/(K s), b 1/J, c 1/s, gamma K/W, eps W."""

    a: float
    b: float
    c: float
    gamma: float
    eps: float


class Start(NamedTuple):
    """State at the first sample: friction coefficient and temperature, K."""

    mu: float
    temperature_k: float


@dataclass(frozen=True)
class Brake:
    """Brake on the dynamometer: what turns pressure into force on a pad, and friction into torque.

    ``pads`` is the number of rubbing faces; ``ambient_k`` is T0 of equation (4).
    """

    piston_area_m2: float
    effective_radius_m: float
    threshold_pressure_pa: float
    efficiency: float
    ambient_k: float
    pads: int = 2

    def force_n(self, pressure_pa: Floats) -> Floats:
        """Force on one pad, N; shape of ``pressure_pa``."""
        area, threshold, efficiency = self.piston_area_m2, self.threshold_pressure_pa, self.efficiency
        return np.array([pad_force(p, area, threshold, efficiency) for p in pressure_pa])

    def torque_per_mu_nm(self, pressure_pa: Floats) -> Floats:
        """Braking torque for each unit of friction coefficient, N m: n N r (paper, equation 16)."""
        return self.pads * self.effective_radius_m * self.force_n(pressure_pa)


def brake_of(parameters: FrictionBrakeParameters, axle: int, pads: int = 2) -> Brake:
    """Brake of the plant's parameter set; ``axle`` is 0 front, 1 rear."""
    return Brake(
        parameters.piston_area_m2[axle],
        parameters.effective_radius_m[axle],
        parameters.threshold_pressure_pa[axle],
        parameters.efficiency,
        parameters.ambient_k,
        pads,
    )


@dataclass(frozen=True, eq=False)
class Drive:
    """What drives the model over a record: time, s; N v of one pad, W; torque per unit of friction, N m; T0, K."""

    time_s: Floats
    power_w: Floats
    torque_per_mu_nm: Floats
    ambient_k: float


def drive(record: Record, brake: Brake) -> Drive:
    """Turn pressure and speed of a record into what the equations take."""
    force = brake.force_n(record.pressure_pa)
    gain = brake.pads * brake.effective_radius_m * force
    return Drive(record.time_s, force * record.speed_mps, gain, brake.ambient_k)


@dataclass(frozen=True, eq=False)
class Course:
    """What the model expects: friction coefficient, torque N m, temperature K; (n,) each."""

    mu: Floats
    torque_nm: Floats
    temperature_k: Floats


def predict(driven: Drive, pad: Pad, start: Start, heating: Heating) -> Course:
    """Integrate equations (3) and (4) from ``start`` without looking at torque or temperature again."""
    states = np.empty((2, driven.time_s.size))
    with_mu = float(heating == "friction")
    _integrate(driven.time_s, driven.power_w, driven.ambient_k, with_mu, *pad, *start, states)
    return Course(states[0], states[0] * driven.torque_per_mu_nm, states[1])


@equation
def _rates(
    mu: float, temperature_k: float, power_w: float, ambient_k: float, with_mu: float,
    a: float, b: float, c: float, gamma: float, eps: float,
) -> tuple[float, float]:  # fmt: skip
    heating = power_w * (1.0 + with_mu * (mu - 1.0))
    return (
        mu_rate(mu, power_w, temperature_k, a, b, eps),
        temperature_rate(temperature_k, heating, ambient_k, c, gamma),
    )


@equation
def _integrate(
    time_s: Floats, power_w: Floats, ambient_k: float, with_mu: float,
    a: float, b: float, c: float, gamma: float, eps: float, mu: float, temperature_k: float, states: Floats,
) -> None:  # fmt: skip
    """Fill ``states`` (2, n) with mu and T: one Runge-Kutta step a sample, N v linear between samples."""
    states[0, 0], states[1, 0] = mu, temperature_k
    for i in range(time_s.size - 1):
        h = time_s[i + 1] - time_s[i]
        middle = 0.5 * (power_w[i] + power_w[i + 1])
        m1, k1 = _rates(mu, temperature_k, power_w[i], ambient_k, with_mu, a, b, c, gamma, eps)
        m2, k2 = _rates(
            mu + 0.5 * h * m1, temperature_k + 0.5 * h * k1, middle, ambient_k, with_mu, a, b, c, gamma, eps
        )
        m3, k3 = _rates(
            mu + 0.5 * h * m2, temperature_k + 0.5 * h * k2, middle, ambient_k, with_mu, a, b, c, gamma, eps
        )
        m4, k4 = _rates(mu + h * m3, temperature_k + h * k3, power_w[i + 1], ambient_k, with_mu, a, b, c, gamma, eps)
        mu += h / 6.0 * (m1 + 2.0 * (m2 + m3) + m4)
        temperature_k += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        states[0, i + 1], states[1, i + 1] = mu, temperature_k
