"""How often 95 % intervals of `explain` hold the truth in coloured noise, beside those of ordinary least squares.

Each draw is a short drive of the shipped car with weak front pads hidden in it. Uncertain numbers of the car are drawn
from their priors, and every channel has AR(1) noise of a coefficient that nobody is told. Cause, numbers and noise are
fitted and the interval is formed by `hil.diagnosis.estimation` and `hil.diagnosis.noise`; the rival takes the samples
for independent, with the same signatures and priors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from hil.diagnosis.data.log import Floats, Log, make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import finite_difference_jacobian
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.estimation.uncertainty import intervals
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car
from hil.validation.blind_trials.metrics import wilson
from hil.validation.perf.row import Progress, Row, unseen

COEFFICIENTS = (0.0, 0.5, 0.9)
"""AR(1) coefficients of the noise from sample to sample, 20 ms."""
DRAWS = 100
STATED = 0.95
"""Coverage that an interval states."""
CAUSE, VALUE = "pad_mu_gain@front", -0.036
"""What is hidden: three to six standard deviations of its value, so that the 5 % for its equation hardly count."""
UNCERTAIN = ("vehicle_mass_kg", "vehicle_drag_coefficient", "vehicle_rolling_resistance", "brake_gain_rear")
_NOISE_SD = {"wheel": 0.065, "ax": 0.05, "gps": 0.03, "pressure": 5e3, "motor": 1.0}
"""Noise by group of channels, in its unit (rad/s, m/s2, m/s, Pa, N m): a few times what good sensors have."""
_TWO_SIDED_95, _ROUNDS, _SETTLING = 1.96, 3, 300
WHEELS = ("fl", "fr", "rl", "rr")


@dataclass(frozen=True)
class Interval:
    """Estimate of one draw and the ends of its 95 % interval, in the unit of the cause's value."""

    value: float
    low: float
    high: float

    @property
    def error(self) -> float:
        """Error of the value, in standard deviations that the interval says."""
        return (self.value - VALUE) / ((self.high - self.low) / (2.0 * _TWO_SIDED_95))

    @property
    def holds(self) -> bool:
        """Whether the hidden value is within."""
        return self.low <= VALUE <= self.high


class Drives:
    """The drive, its masks and signatures; every draw changes what was measured of it."""

    def __init__(self) -> None:
        self._car = paper_car()
        radius_m = float(self._car.parameters.wheel.rolling_radius_m)
        dataset = prepare([_log(radius_m)], radius_m)
        self._masks, self._base = SampleMasks.of(dataset), nominal(self._car)
        self._simulator = Simulator(dataset, self._car)
        (self._recording,) = dataset.recordings
        self._nuisances = tuple(one for one in self._car.nuisances if one.name in UNCERTAIN)
        (self._cause,) = (one for one in candidates(columns()) if one.name == CAUSE)
        moved = [self._base.with_nuisances(self._nuisances, z) for z in np.eye(len(self._nuisances))]
        self._jacobian = finite_difference_jacobian(
            self._simulator, self._masks, self._simulator.run(self._base), moved, [1.0] * len(moved)
        )

    def _fitter(self) -> Fitter:
        return Fitter(self._simulator, self._masks, self._base, self._nuisances, self._jacobian)

    def draw(self, rng: np.random.Generator, coefficient: float) -> tuple[Interval, Interval]:
        """Our interval and that of least squares for one drive with noise of this coefficient."""
        true = self._fitter().parameter_set(rng.standard_normal(len(self._nuisances)), (Term(self._cause, VALUE),))
        for group, simulated in self._simulator.run(true).items():
            measured = self._recording.measured[group]
            measured[:] = simulated + _NOISE_SD[group] * coloured(rng, coefficient, simulated.shape)
        fitter = self._fitter()
        bare, noise = fitter.start()
        model = fitter.fit(fitter.at(bare.z, (Term(self._cause, 0.0),), noise), noise, _ROUNDS)
        model, noise = fitter.alternate_noise_and_fit(model, noise, _ROUNDS)
        ((low, high),) = intervals(fitter, model, noise)
        return Interval(model.terms[0].value, low, high), self._least_squares(fitter, model)

    def _least_squares(self, fitter: Fitter, model: Model) -> Interval:
        """One linear step from the fit, samples independent, each track weighted by what is left of it."""
        own = fitter.term_jacobian(model)
        rows, left = [], []
        for name, residual in model.residual.items():
            known = self._masks.present[name] > 0.5
            sd = float(residual[known].std())
            rows.append(np.hstack([own[name], self._jacobian[name]])[known] / sd)
            left.append(residual[known, 0] / sd)
        x, prior = np.vstack(rows), np.diag([0.0, *np.ones(len(self._nuisances))])
        covariance = np.linalg.inv(x.T @ x + prior)
        step = covariance @ (x.T @ np.concatenate(left) - prior @ np.array([0.0, *model.z]))
        value, half = model.terms[0].value + float(step[0]), _TWO_SIDED_95 * float(np.sqrt(covariance[0, 0]))
        return Interval(value, value - half, value + half)


def _log(radius_m: float) -> Log:
    """20 s from 33 m/s with pulses of brakes and motors; which values are measured does not matter."""
    t = np.arange(2000) * 0.01
    brakes, pulses = (t % 7.0 > 3.0) & (t % 7.0 < 4.5), t % 4.0 < 1.5
    speed = 33.0 - np.cumsum(0.3 + 1.4 * brakes + 0.6 * pulses) * 0.01
    channels = {"ax_mps2": np.gradient(speed, t), "speed_mps": speed}
    for wheel in WHEELS:
        channels |= {
            f"wheel_speed_{wheel}_rad_s": speed / radius_m,
            f"pressure_{wheel}_pa": 9e5 * brakes, f"pressure_demand_{wheel}_pa": 9e5 * brakes,
            f"motor_torque_{wheel}_nm": -60.0 * pulses, f"motor_torque_demand_{wheel}_nm": -60.0 * pulses,
        }  # fmt: skip
    return make_log("drive", t, channels)


def coloured(rng: np.random.Generator, coefficient: float, shape: tuple[int, ...]) -> Floats:
    """AR(1) noise of variance 1 along the first axis, settled."""
    white = rng.standard_normal((shape[0] + _SETTLING, *shape[1:]))
    made = lfilter([np.sqrt(1.0 - coefficient**2)], [1.0, -coefficient], white, axis=0)
    return np.asarray(made[_SETTLING:])


def measure(progress: Progress = unseen) -> list[Row]:
    """Rows of ``brakebench perf coverage``: one a coefficient, shares of draws whose interval holds the truth.

    The ratio is (1 + draws by which the other's coverage misses 95 %) / (1 + draws by which ours does).
    """
    drives = Drives()
    rows = []
    for k, coefficient in enumerate(COEFFICIENTS):
        progress(k / len(COEFFICIENTS))
        rows.append(row_of(coefficient, drawn(drives, coefficient, DRAWS)))
    return rows


def drawn(drives: Drives, coefficient: float, count: int) -> list[tuple[Interval, Interval]]:
    """So many draws of one coefficient, always the same."""
    rng = np.random.default_rng([52, round(100 * coefficient)])
    return [drives.draw(rng, coefficient) for _ in range(count)]


def row_of(coefficient: float, found: Sequence[tuple[Interval, Interval]]) -> Row:
    """One coefficient's row; see `measure`."""
    count = len(found)
    hits = [sum(one.holds for one in side) for side in zip(*found, strict=True)]
    ours, other = (1.0 + abs(hit - STATED * count) for hit in hits)
    return Row(
        f"95 % interval holds the truth, AR(1) {coefficient:g}, {count} draws", hits[0] / count, hits[1] / count,
        "ordinary least squares", other / ours, "share", wilson(hits[0], count), wilson(hits[1], count),
    )  # fmt: skip
