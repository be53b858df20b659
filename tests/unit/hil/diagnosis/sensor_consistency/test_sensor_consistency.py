"""Sensors against the motion, on motion made here: nothing in nothing, what was put in by its name and size."""

import numpy as np
import pytest
from motion_logs import RADIUS_M, STEP_S, coloured, motion_log

from hil.diagnosis.data.log import WHEEL_SPEED, Log, UnusableError, make_log
from hil.diagnosis.explain import explain
from hil.diagnosis.sensor_consistency.check import Consistency, _rivals, why_not_simulatable
from hil.diagnosis.sensor_consistency.labels import Cause, Label
from hil.diagnosis.sensor_consistency.likelihood import fit
from hil.diagnosis.sensor_consistency.longitudinal import SLIP, LongitudinalModel, known_slip
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel
from hil.diagnosis.sensor_consistency.motion import motion_of
from hil.diagnosis.sensor_consistency.page import _headline
from hil.diagnosis.sensor_consistency.selection import select_parameters


def _found(log: Log):
    motion = motion_of([log], RADIUS_M)
    return select_parameters(LongitudinalModel(motion), motion.block, {}, {}, lambda _: None)


class _Cells(SensorModel):
    """A delay that gets likelier up to the edge of a cell, and is unlikely beyond; a scale whose best value is 0.5."""

    def __init__(self):
        self.noise = {}
        self.parameters = {"delay_s": Parameter(0.0, -0.5, 0.5, 0.02), "gain": Parameter(0.0, -1.0, 1.0, 0.05)}
        self.resolution = {"delay_s": 0.02}

    def score(self, sensor, noise):
        late = sensor["delay_s"]
        return np.zeros((1, 1)), np.array([(late if late < 0.12 else -10.0) - 100.0 * (sensor["gain"] - 0.5) ** 2])


def test_a_delay_at_the_edge_of_a_cell_holds_no_other_number_back():
    found = fit(_Cells(), {"delay_s": 0.11998, "gain": 0.0}, {})
    assert found.sensor["gain"] == pytest.approx(0.5, abs=1e-3)
    assert found.sensor["delay_s"] == pytest.approx(0.12, abs=1e-4)


class _Stairs(SensorModel):
    """A delay whose likelihood has an edge at every cell: 0.16 to 0.20 is likeliest, by noise that takes long to find
    (Rosenbrock, The Computer Journal 3 (1960)), and 0.08 to 0.16 are found in no time."""

    def __init__(self):
        self.noise = {"a": Parameter(1.8, 0.1, 9.0, 1.0, False, 1e6), "b": Parameter(4.0, 0.1, 9.0, 1.0, False, 1e6)}
        self.parameters = {"delay_s": Parameter(0.0, -0.5, 0.5, 0.02)}
        self.resolution = {"delay_s": 0.02}

    def score(self, sensor, noise):
        cell, within = divmod(sensor.get("delay_s", 0.0) / 0.04, 1.0)
        a, b = noise["a"] - 3.0, noise["b"] - 3.0
        found = 40.0 - 25.0 * ((1.0 - a) ** 2 + 100.0 * (b - a**2) ** 2) if cell == 4.0 else -200.0
        if cell in (2.0, 3.0):
            found = 6.0 * cell - (1.0 - a) ** 2 - (1.0 - b) ** 2
        return np.zeros((8, 1)), np.full(8, (found - 10.0 * (within - 0.5) ** 2) / 8.0)


def test_what_cells_resolve_is_fitted_from_the_next_cells_too():
    """A delay of 0.2 s was told as 0.14 s, and lost to a filter."""
    found = select_parameters(_Stairs(), np.arange(8), {}, {}, lambda _: None)
    assert found.final.sensor["delay_s"] == pytest.approx(0.18, abs=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_is_found_in_nothing(seed):
    assert _found(motion_log(seed)).steps == []


@pytest.mark.slow
def test_a_sign_is_found_with_its_interval():
    found = _found(motion_log(4, gain=-2.0))
    assert [step.number for step in found.steps] == ["gain"]
    low, high = found.interval("gain")
    assert low < -2.0 < high
    assert high - low < 0.5


@pytest.mark.slow
def test_a_delay_is_found_with_its_interval():
    found = _found(motion_log(5, late=15))
    assert [step.number for step in found.steps] == ["delay_s"]
    low, high = found.interval("delay_s")
    assert low < 0.15 < high


def test_the_way_is_chosen_by_the_channels():
    log = motion_log(6)
    assert "forces cannot be replayed" in why_not_simulatable([log], RADIUS_M)
    torque = {f"motor_torque_{w}_nm": np.zeros(6000) for w in ("fl", "fr", "rl", "rr")}
    assert why_not_simulatable([make_log("made", log.t_s, {**log.channels, **torque})], RADIUS_M) == ""


def test_a_car_that_stands_is_unusable():
    t = np.arange(1000) * STEP_S
    with pytest.raises(UnusableError, match="moves for"):
        explain({"t_s": t, "speed_mps": np.zeros(1000), "ax_mps2": np.zeros(1000)})


@pytest.mark.slow
def test_a_delay_is_tied_with_a_filter_in_slow_manoeuvres():
    """A sine that takes 10 s is as late behind a low-pass. It was told as a filter for certain."""
    rng, n = np.random.default_rng(9), 12000
    t = np.arange(n) * STEP_S
    accel = 2.0 * np.sin(2.0 * np.pi * t / 10.0) + np.sin(2.0 * np.pi * t / 17.0 + 1.0)
    felt = accel + coloured(rng, n, 0.1, 8.0) + coloured(rng, n, 0.05, 0.15)
    speed = 25.0 + np.cumsum(accel) * STEP_S
    wheels = {name: (speed + 0.01 * rng.standard_normal(n)) / RADIUS_M for name in WHEEL_SPEED}
    late = np.concatenate((felt[:1].repeat(10), felt[:-10])) + 0.05 * rng.standard_normal(n)
    found = explain({"t_s": t, **wheels, "ax_mps2": late}).json
    assert found["verdict"] == "cannot_tell_apart"
    told = {c["effect"]: c for c in found["causes"] + found["rivals"]}
    assert set(told) == {"timestamp_offset", "imu_filter"}
    assert sum(c["probability"] for c in told.values()) == pytest.approx(1.0)
    low, high = told["timestamp_offset"]["parameters"]["delay_s"]["ci95"]
    assert low < 0.1 < high


@pytest.mark.slow
def test_slip_of_the_tyres_is_no_filter_of_the_accelerometer():
    """Wheels slip in proportion to the force: those of soft tyres lead the car by 0.2 s at 20 m/s."""
    made = motion_log(5)
    accel = np.gradient(made.channels[WHEEL_SPEED[0]] * RADIUS_M, STEP_S)
    smooth = np.convolve(accel, np.ones(15) / 15, mode="same")
    slip = 0.01
    channels = {n: v * (1.0 + slip * smooth) if n in WHEEL_SPEED else v for n, v in made.channels.items()}
    motion = motion_of([make_log("made", made.t_s, channels)], RADIUS_M)
    blind = select_parameters(LongitudinalModel(motion), motion.block, {}, {}, lambda _: None)
    assert {step.parameter for step in blind.steps} & {"filter_s", "delay_s"}
    model = LongitudinalModel(motion, known_slip(10.0, 0.2))
    found = select_parameters(model, motion.block, {}, {}, lambda _: None, always=[SLIP])
    assert found.steps == []
    assert found.parameters[SLIP] == pytest.approx(slip, rel=0.3)


def _late_or_filtered() -> tuple[Cause, Cause]:
    """An accelerometer that is filtered or, as likely, late; and pressures that are late."""

    def cause(number, name, channel, instead=()):
        return Cause(
            "along",
            number,
            (name,),
            (1.0,),
            0.1,
            0.08,
            0.12,
            50.0,
            (channel,),
            substitutes=instead,
            delta_criterion=1.0,
        )

    late = cause("delay_s", Label("timestamp_offset", "delay_s", "imu", 1.0, 0.02), "ax_mps2")
    filtered = cause("filter_s", Label("imu_filter", "time_s", "imu", 1.0, 0.02), "ax_mps2", (late,))
    return filtered, cause("delay_s", Label("timestamp_offset", "delay_s", "pressure", -1.0, 0.02), "pressure")


def test_a_rival_stays_where_its_effect_is_told_of_another_channel():
    """It was dropped, though the verdict counted the two as tied."""
    causes = _late_or_filtered()
    assert causes[0].is_ambiguous
    assert not causes[1].is_ambiguous
    rivals = _rivals(causes, [cause.as_json() for cause in causes])
    assert [(one["effect"], one["channels"]) for one in rivals] == [("timestamp_offset", ["ax_mps2"])]
    assert _rivals(causes[:1], [*(c.as_json() for c in causes), causes[0].substitutes[0].as_json()]) == []


def test_the_headline_names_all_that_are_tied():
    """It named the first alone."""
    told = _headline(Consistency({}, None, {}, _late_or_filtered(), ()))
    assert told == "ax_mps2: imu filter or timestamp offset; pressure: timestamp offset."
