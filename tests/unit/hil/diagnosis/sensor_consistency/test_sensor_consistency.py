"""Sensors compared with synthetic motion: nothing is named where nothing is wrong, and errors by name and size."""

import numpy as np
import pytest
from motion_logs import RADIUS_M, STEP_S, coloured, motion_log

from hil.diagnosis.data.log import WHEEL_SPEED, Log, UnusableError, make_log
from hil.diagnosis.explain import explain
from hil.diagnosis.sensor_consistency.check import _rivals, why_not_simulatable
from hil.diagnosis.sensor_consistency.headline import headline
from hil.diagnosis.sensor_consistency.labels import Cause, Label
from hil.diagnosis.sensor_consistency.likelihood import fit
from hil.diagnosis.sensor_consistency.longitudinal import SLIP, LongitudinalModel, slip_prior
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel
from hil.diagnosis.sensor_consistency.motion import motion_of
from hil.diagnosis.sensor_consistency.selection import SelectionResult, select_parameters


def _select(log: Log, slip: Parameter | None = None) -> SelectionResult:
    motion = motion_of([log], RADIUS_M)
    model = LongitudinalModel(motion, slip)
    return select_parameters(model, motion.segment_id, {}, {}, lambda _: None, nuisances=[SLIP] if slip else [])


class _Cells(SensorModel):
    """A delay that gets likelier up to the edge of a cell, and is unlikely beyond; a scale whose best value is 0.5."""

    def __init__(self):
        self.noise = {}
        self.parameters = {"delay_s": Parameter(0.0, -0.5, 0.5, 0.02), "gain": Parameter(0.0, -1.0, 1.0, 0.05)}
        self.resolution = {"delay_s": 0.02}

    def log_likelihood(self, parameters, noise):
        delay = parameters["delay_s"]
        return np.array([(delay if delay < 0.12 else -10.0) - 100.0 * (parameters["gain"] - 0.5) ** 2])


def test_a_delay_at_the_edge_of_a_cell_holds_no_other_parameter_back():
    fitted = fit(_Cells(), {"delay_s": 0.11998, "gain": 0.0}, {})
    assert fitted.parameters["gain"] == pytest.approx(0.5, abs=1e-3)
    assert fitted.parameters["delay_s"] == pytest.approx(0.12, abs=1e-4)


class _Stairs(SensorModel):
    """A delay whose likelihood has an edge at every cell.

    0.16 to 0.20 is likeliest, with noise that takes long to fit (Rosenbrock, The Computer Journal 3 (1960)); for 0.08
    to 0.16 it is fitted at once.
    """

    def __init__(self):
        self.noise = {"a": Parameter(1.8, 0.1, 9.0, 1.0, False, 1e6), "b": Parameter(4.0, 0.1, 9.0, 1.0, False, 1e6)}
        self.parameters = {"delay_s": Parameter(0.0, -0.5, 0.5, 0.02)}
        self.resolution = {"delay_s": 0.02}

    def log_likelihood(self, parameters, noise):
        cell, within = divmod(parameters.get("delay_s", 0.0) / 0.04, 1.0)
        a, b = noise["a"] - 3.0, noise["b"] - 3.0
        value = 40.0 - 25.0 * ((1.0 - a) ** 2 + 100.0 * (b - a**2) ** 2) if cell == 4.0 else -200.0
        if cell in (2.0, 3.0):
            value = 6.0 * cell - (1.0 - a) ** 2 - (1.0 - b) ** 2
        return np.full(8, (value - 10.0 * (within - 0.5) ** 2) / 8.0)


def test_what_cells_resolve_is_fitted_from_the_neighbouring_cells_too():
    """Otherwise a delay of 0.2 s is estimated as 0.14 s, and loses to a filter."""
    result = select_parameters(_Stairs(), np.arange(8), {}, {}, lambda _: None)
    assert result.final.parameters["delay_s"] == pytest.approx(0.18, abs=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_is_accepted_where_nothing_is_wrong(seed):
    assert _select(motion_log(seed)).steps == []


@pytest.mark.slow
def test_a_sign_is_accepted_with_its_interval():
    result = _select(motion_log(4, gain=-2.0))
    assert [step.parameter for step in result.steps] == ["gain"]
    low, high = result.interval("gain")
    assert low < -2.0 < high
    assert high - low < 0.5


@pytest.mark.slow
def test_a_delay_is_accepted_with_its_interval():
    result = _select(motion_log(5, late=15))
    assert [step.parameter for step in result.steps] == ["delay_s"]
    low, high = result.interval("delay_s")
    assert low < 0.15 < high


def test_the_channels_decide_whether_the_car_is_simulated():
    log = motion_log(6)
    assert "cannot be simulated" in why_not_simulatable([log], RADIUS_M)
    torque = {f"motor_torque_{w}_nm": np.zeros(6000) for w in ("fl", "fr", "rl", "rr")}
    assert why_not_simulatable([make_log("made", log.t_s, {**log.channels, **torque})], RADIUS_M) == ""


def test_a_car_that_stands_is_unusable():
    t = np.arange(1000) * STEP_S
    with pytest.raises(UnusableError, match="moves for"):
        explain({"t_s": t, "speed_mps": np.zeros(1000), "ax_mps2": np.zeros(1000)})


@pytest.mark.slow
def test_a_delay_and_a_filter_are_indistinguishable_in_slow_manoeuvres():
    """A sine of 10 s is as late behind a low-pass."""
    rng, n = np.random.default_rng(9), 12000
    t = np.arange(n) * STEP_S
    accel = 2.0 * np.sin(2.0 * np.pi * t / 10.0) + np.sin(2.0 * np.pi * t / 17.0 + 1.0)
    felt = accel + coloured(rng, n, 0.1, 8.0) + coloured(rng, n, 0.05, 0.15)
    speed = 25.0 + np.cumsum(accel) * STEP_S
    wheels = {name: (speed + 0.01 * rng.standard_normal(n)) / RADIUS_M for name in WHEEL_SPEED}
    late = np.concatenate((felt[:1].repeat(10), felt[:-10])) + 0.05 * rng.standard_normal(n)
    answer = explain({"t_s": t, **wheels, "ax_mps2": late}).json
    assert answer["verdict"] == "cannot_tell_apart"
    named = {c["effect"]: c for c in answer["causes"] + answer["rivals"]}
    assert set(named) == {"timestamp_offset", "imu_filter"}
    assert sum(c["probability"] for c in named.values()) == pytest.approx(1.0)
    low, high = named["timestamp_offset"]["parameters"]["delay_s"]["ci95"]
    assert low < 0.1 < high


@pytest.mark.slow
def test_slip_of_the_tyres_is_no_filter_of_the_accelerometer():
    """Wheels slip in proportion to the force: those of soft tyres lead the car by 0.2 s at 20 m/s."""
    made = motion_log(5)
    accel = np.gradient(made.channels[WHEEL_SPEED[0]] * RADIUS_M, STEP_S)
    smooth = np.convolve(accel, np.ones(15) / 15, mode="same")
    slip = 0.01
    channels = {n: v * (1.0 + slip * smooth) if n in WHEEL_SPEED else v for n, v in made.channels.items()}
    log = make_log("made", made.t_s, channels)
    assert {step.parameter for step in _select(log).steps} & {"filter_s", "delay_s"}
    result = _select(log, slip_prior(10.0, 0.2))
    assert result.steps == []
    assert result.parameters[SLIP] == pytest.approx(slip, rel=0.3)


def _cause(parameter: str, label: Label, channel: str, substitutes: tuple[Cause, ...] = ()) -> Cause:
    return Cause(
        "along", parameter, (label,), (0.0,), 0.1, 0.08, 0.12, 50.0, (channel,), substitutes=substitutes,
        delta_criterion=1.0,
    )  # fmt: skip


def _late_or_filtered() -> tuple[Cause, Cause]:
    """An accelerometer that is filtered or, as likely, late; and pressures that are late."""
    late = _cause("delay_s", Label("timestamp_offset", "delay_s", "imu", 1.0, 0.02), "ax_mps2")
    filtered = _cause("filter_s", Label("imu_filter", "time_s", "imu", 1.0, 0.02), "ax_mps2", (late,))
    return filtered, _cause("delay_s", Label("timestamp_offset", "delay_s", "pressure", -1.0, 0.02), "pressure")


def test_a_rival_is_reported_though_its_effect_is_a_cause_in_another_channel():
    causes = _late_or_filtered()
    assert causes[0].is_ambiguous
    assert not causes[1].is_ambiguous
    rivals = _rivals(causes, [cause.as_json() for cause in causes])
    assert [(one["effect"], one["channels"]) for one in rivals] == [("timestamp_offset", ["ax_mps2"])]
    assert _rivals(causes[:1], [*(c.as_json() for c in causes), causes[0].substitutes[0].as_json()]) == []


def test_the_headline_names_all_indistinguishable_effects():
    text = headline(_late_or_filtered())
    assert text == (
        "ax_mps2: Inertial sensor has a further low-pass of 100 ms (95 %: 80 to 120 ms) or one node's samples are "
        "older than their stamps, or newer; pressure: Pressures are 100 ms newer than their stamps "
        "(95 %: 80 to 120 ms)."
    )
