"""The controller: the paper's 16-state filter against filterpy's, and the whole controller tick against its budget.

filterpy is named on stderr and its rows are left out where it is not installed.
"""

import resource
import sys
from collections.abc import Callable
from functools import partial
from importlib import resources

import numpy as np

from dbc.bench_messages import StimulusEcu
from dbc.exchange import Transmitter
from dbc.frame import Frame
from dbc.messages import (
    BatteryStatus,
    BodyMotion,
    BrakePedal,
    EhbPressureFront,
    EhbPressureRear,
    EhbState,
    MotorState,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    WheelSpeedFront,
    WheelSpeedRear,
)
from ecu.law.estimator import joint_parameters
from ecu.law.joint import layout
from ecu.law.joint.filter import joint_step
from ecu.law.paper_observer import kalman_run, kalman_step
from ecu.node import EcuNode
from ecu.parameters.ecu import EcuParameters
from hil.rt.clock import monotonic_ns
from hil.scenario.parameters import load_set
from hil.validation.perf.row import Progress, Row, paired, time_per_call_ns, unseen

STEPS = 2_000
BULK = 50_000
TICKS = 3_000
CORE_SHARE = 0.1
FAST_NS, BUS_NS = 1_000_000, 10_000_000
RADIUS_M, INERTIA_KG_M2, STEP_S = 0.308, 1.5, 0.01
_Q = np.array([1e-6, 9.0, 1600.0, 2.0e4])
_R = np.array([0.01, 3600.0])


def measure(progress: Progress = unseen) -> list[Row]:
    """Return the rows of ``brakebench perf ecu``."""
    parameters = load_set(resources.files("ecu.parameters") / "paper_ecu.toml", EcuParameters)
    rows = _against_filterpy()
    progress(1 / 3)
    rows.append(_joint(parameters))
    progress(2 / 3)
    return [*rows, *_tick(parameters)]


def _against_filterpy() -> list[Row]:
    try:
        from filterpy.kalman import KalmanFilter
    except ImportError:
        print("perf ecu: filterpy is not installed; its rows are left out", file=sys.stderr)
        return []
    one = np.array(
        [
            [1.0, STEP_S, 0.0, 0.0],
            [0.0, 0.0, -RADIUS_M / INERTIA_KG_M2, 1.0 / INERTIA_KG_M2],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    rng = np.random.default_rng(1)
    z, rate = rng.normal(size=(BULK, 8)), rng.normal(size=(BULK, 4))
    by_wheel = np.array([k // 2 + (4 if k % 2 else 0) for k in range(8)])  # the dense filter's order of measurements

    def dense() -> KalmanFilter:
        kf = KalmanFilter(dim_x=16, dim_z=8, dim_u=4)
        kf.F = np.kron(np.eye(4), one)
        kf.H = np.kron(np.eye(4), np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]))
        kf.B = np.zeros((16, 4))
        kf.B[2::4] = STEP_S * np.eye(4)
        kf.Q, kf.R, kf.P = np.kron(np.eye(4), np.diag(_Q)), np.diag(np.tile(_R, 4)), np.eye(16)
        return kf

    def start() -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(16), np.tile(np.eye(4).ravel(), 4)

    kf, (x, p) = dense(), start()
    for n in range(200):
        kf.predict(u=rate[n][:, None])
        kf.update(z[n][by_wheel][:, None])
        kalman_step(x, p, z[n], rate[n], _Q, _R, RADIUS_M, INERTIA_KG_M2, STEP_S)
    if not np.allclose(x, kf.x[:, 0], rtol=1e-8, atol=1e-8):
        raise RuntimeError("perf ecu: our filter and filterpy's give different states; neither time means anything")

    def theirs() -> float:
        kf, at = dense(), iter(range(STEPS))

        def step() -> None:
            n = next(at)
            kf.predict(u=rate[n][:, None])
            kf.update(z[n][by_wheel][:, None])

        return time_per_call_ns(step, STEPS) * 1e-3

    def ours() -> float:
        (x, p), at = start(), iter(range(STEPS))

        def step() -> None:
            n = next(at)
            kalman_step(x, p, z[n], rate[n], _Q, _R, RADIUS_M, INERTIA_KG_M2, STEP_S)

        return time_per_call_ns(step, STEPS) * 1e-3

    def bulk() -> float:
        (x, p), out = start(), np.empty((BULK, 16))
        begin = monotonic_ns()
        kalman_run(x, p, z, rate, _Q, _R, RADIUS_M, INERTIA_KG_M2, STEP_S, out)
        return (monotonic_ns() - begin) * 1e-3 / BULK

    bulk()
    return [
        paired("observer step, 16 states, on line", ours, theirs, "filterpy KalmanFilter", "us"),
        paired("observer step, 16 states, in bulk", bulk, theirs, "filterpy KalmanFilter, on line", "us"),
    ]


def _joint(parameters: EcuParameters) -> Row:
    """The joint filter's step against the whole tick's budget."""
    p = joint_parameters(parameters)
    z = np.zeros(layout.INPUTS)
    z[layout.WHEEL : layout.WHEEL + 4] = 60.0
    z[layout.AX], z[layout.DEMAND] = -3.2, 3.2
    z[layout.PRESSURE : layout.PRESSURE + 4] = 25e5
    state = joint_step(np.zeros(layout.SIZE), z, p, STEP_S)

    def step() -> float:
        return _cpu_us(lambda: joint_step(state, z, p, STEP_S), STEPS)

    return paired(
        "joint filter step",
        step,
        lambda: CORE_SHARE * FAST_NS * 1e-3,
        "a tenth of a core at 1 kHz (processor time)",
        "us",
    )


def _cpu_us(function: Callable[[], object], calls: int) -> float:
    """Processor time of one call, us: what is left to others counts, not what they take."""
    before = resource.getrusage(resource.RUSAGE_SELF)
    for _ in range(calls):
        function()
    after = resource.getrusage(resource.RUSAGE_SELF)
    used_s = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return 1e6 * used_s / calls


def _tick(parameters: EcuParameters) -> list[Row]:
    rows = []
    for name, period_ns in (("1 kHz", FAST_NS), ("100 Hz", BUS_NS)):
        frames = _car(period_ns)

        def tick(period_ns: int = period_ns, frames: list[list[Frame]] = frames) -> float:
            node, number = EcuNode(parameters, period_ns), iter(range(TICKS))

            def step() -> None:
                n = next(number)
                node.step(n * period_ns, list(frames[n]))

            return _cpu_us(step, TICKS)

        budget_us = CORE_SHARE * period_ns * 1e-3
        share = f"a tenth of a core at {name} (processor time)"
        rows.append(paired(f"controller tick at {name}", tick, partial(float, budget_us), share, "us"))
    return rows


def _car(period_ns: int) -> list[list[Frame]]:
    """Frames of a braking car for each tick, as they come over the bus."""
    transmitter = Transmitter()
    result: list[list[Frame]] = []
    for n in range(TICKS):
        w = 65.0 - 0.5 * n / TICKS
        motor = ((MotorStatusFront, -197.0), (MotorStatusRear, -85.0))  # about what the controller asks for
        messages = [
            BrakePedal(0.6, 0.6),
            WheelSpeedFront(w, w),
            WheelSpeedRear(w, w),
            BodyMotion(-3.2 + 0.01 * (n % 3), 0.0, 0.0),  # a living sensor never repeats itself for long
            EhbPressureFront(8e5, 8e5, EhbState.DEMAND),
            EhbPressureRear(8e5, 8e5, EhbState.DEMAND),
            *(kind(a, 600.0, MotorState.OK, a, 600.0, MotorState.OK) for kind, a in motor),
            Steering(0.0),
            BatteryStatus(0.5, 2e5),
            StimulusEcu(0.7),
        ]
        result.append(transmitter.frames(n * period_ns, messages))
    return result
