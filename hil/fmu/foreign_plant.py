"""Somebody else's FMU in the place of our car: a node of the bench around it."""

import math
from pathlib import Path
from typing import Self

import numpy as np

from dbc.batch import Batch
from dbc.bench_messages import ManoeuvreState, PlantReception, StimulusDriver
from dbc.contract import spec_of
from dbc.exchange import Receiver
from dbc.frame import Frame, Received
from hil.fmu.foreign import ForeignFmu
from hil.fmu.model import FmuError
from hil.fmu.plant_map import REQUESTED, SENT, SPEED, PlantMap, Source, load_plant_map
from hil.scenario.scenario import Scenario
from plant import driver
from plant.demands import DEMANDS, Demands
from plant.manoeuvre import value_at
from plant.node import STANDING_MPS

_ROUNDING = 1e-6  # of a step


def checked_step_s(fmu: ForeignFmu, chart: PlantMap) -> float:
    """The step to take, s.

    Raises
    ------
    FmuError : the FMU has not what the chart names, or states no step; it is closed then.
    """
    known = set(fmu.description["outputs"])
    odd = [name for name in (*chart.inputs, *chart.wanted) if name not in known]
    if odd:
        fmu.close()
        raise FmuError(f"{fmu.name}: has no number {', '.join(odd)}; correct the map")
    step_s: float = chart.step_s or fmu.description["step_s"]
    if not step_s > 0.0:
        fmu.close()
        raise FmuError(f"{fmu.name}: states no step; give step_s in the map")
    return step_s


def steps_until(time_s: float, step_s: float) -> int:
    """Whole steps of ``step_s`` within ``time_s`` since the start."""
    return int(time_s / step_s + _ROUNDING)


class ForeignPlant:
    """The node.

    Until the controller's demands are followed the FMU stands at its start: nobody brakes it then.

    Parameters
    ----------
    fmu : the FMU, initialised.  chart : what is what.
    scenario : whose driver, start and end it takes; road and effects are the FMU's own.
    seed : of the noise that the chart asks for.

    Raises
    ------
    FmuError : the FMU has not what the chart names, or states no step.
    """

    def __init__(self, fmu: ForeignFmu, chart: PlantMap, scenario: Scenario, seed: int) -> None:
        self._fmu, self._map, self._manoeuvre = fmu, chart, scenario.manoeuvre
        self.step_s = checked_step_s(fmu, chart)
        self._receiver = Receiver((*DEMANDS, StimulusDriver))
        self._demands = Demands(self._receiver, scenario.plant.ehb)
        self._batch = Batch(SENT)
        self._places: dict[str, int] = {}
        for kind in SENT:
            for field in spec_of(kind).fields:
                self._places[f"{spec_of(kind).name}.{field.signal}"] = len(self._places)
                self._batch.values[len(self._places) - 1] = math.nan if field.sna is not None else 0.0
        self._random = np.random.default_rng(seed)
        self._asked: dict[str, float] = dict.fromkeys(REQUESTED, 0.0)
        self._values: dict[str, float] = {}
        self._start_ns: int | None = None
        self._steps = 0
        self._distance_m = 0.0
        self._standing_ns = self._last_ns = 0
        self.state = ManoeuvreState.HOLDING

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Bring the FMU to ``now_ns`` with what was asked at the last tick; take the inbox and measure."""
        elapsed_ns, self._last_ns = now_ns - self._last_ns, now_ns
        self._advance(now_ns)
        self._receiver.accept(now_ns, inbox)
        self._follow(now_ns, elapsed_ns)
        self._ask(now_ns)
        told = {name: self._value(source, noisy=True) for name, source in self._map.outputs.items()}
        self._distance_m += told[SPEED] * elapsed_ns * 1e-9 if self.state is not ManoeuvreState.HOLDING else 0.0
        front, rear = (brake.state for brake in self._demands.pressure)
        travel = self._asked["DRIVER.PEDAL"]
        receiver = self._receiver
        reception = (*receiver.counters[: len(DEMANDS)], receiver.lost, receiver.corrupt)
        names = [f"PLANT_RECEPTION.{field.signal}" for field in spec_of(PlantReception).fields]
        own: dict[str, float] = dict(zip(names, reception, strict=True)) | {
            "BRAKE_PEDAL.PEDAL_TRAVEL_1": travel,
            "BRAKE_PEDAL.PEDAL_TRAVEL_2": travel,
            "STEERING.STEERING_WHEEL_ANGLE": self._asked["DRIVER.STEERING_WHEEL_ANGLE"],
            "EHB_PRESSURE_FRONT.EHB_STATE_FRONT": front,
            "EHB_PRESSURE_REAR.EHB_STATE_REAR": rear,
            "TRUTH_MOTION.DISTANCE": self._distance_m,
            "TRUTH_MOTION.MANOEUVRE": self.state,
        }
        for name, value in (own | told).items():
            self._batch.values[self._places[name]] = value
        return self._batch.frames(now_ns)

    def _advance(self, now_ns: int) -> None:
        due = 0 if self._start_ns is None else steps_until((now_ns - self._start_ns) * 1e-9, self.step_s)
        steps = due - self._steps
        if steps > 0 or not self._values:
            inputs = {name: self._value(source) for name, source in self._map.inputs.items()}
            wanted = self._map.wanted
            found = self._fmu.step(inputs, steps, self.step_s, wanted)
            self._values = dict(zip(wanted, found, strict=True))
            self._steps = due

    def _value(self, source: Source, noisy: bool = False) -> float:
        total = source.value(self._values, self._asked, 1.0)
        return total + (source.noise * self._random.standard_normal() if noisy and source.noise else 0.0)

    def _follow(self, now_ns: int, elapsed_ns: int) -> None:
        manoeuvre = self._manoeuvre
        if self._start_ns is None:
            if not self._demands.followed and manoeuvre.wait_for_demands:
                return
            self._start_ns = now_ns
            self.state = ManoeuvreState.RUNNING
        moving = abs(self._value(self._map.outputs[SPEED])) > STANDING_MPS
        self._standing_ns = 0 if moving else self._standing_ns + elapsed_ns
        limit_s = manoeuvre.end_after_standstill_s
        stood = limit_s is not None and self._standing_ns >= limit_s * 1e9
        if stood or now_ns - self._start_ns >= manoeuvre.duration_s * 1e9:
            self.state = ManoeuvreState.FINISHED

    def _ask(self, now_ns: int) -> None:
        """What driver and controller ask for from this tick on, SI units; a target that is none is 0."""
        manoeuvre, start = self._manoeuvre, self._start_ns
        time_s = 0.0 if start is None else (now_ns - start) * 1e-9
        pedal = 0.0 if start is None else driver.pedal_travel(manoeuvre, time_s)
        steering = 0.0 if start is None else value_at(manoeuvre.steering_wheel_rad, time_s)
        target = manoeuvre.initial_speed_mps if start is None else driver.target_speed(manoeuvre, time_s)
        pressure, motor = self._demands.update(now_ns, pedal)
        told = (*pressure, *motor, pedal, steering, target or 0.0)
        self._asked = dict(zip(REQUESTED, told, strict=True))


class OpenPlant:
    """A foreign plant between the command line and a bench; closes the FMU at its end."""

    def __init__(self, fmu: ForeignFmu, chart: PlantMap, seed: int) -> None:
        self._fmu, self._map, self._seed = fmu, chart, seed

    def node(self, scenario: Scenario) -> ForeignPlant:
        """The node for a scenario."""
        return ForeignPlant(self._fmu, self._map, scenario, self._seed)

    def __str__(self) -> str:
        """For people."""
        told, step_s = self._fmu.description, self._map.step_s or self._fmu.description["step_s"]
        return f"{self._fmu.name} ({told['name']}, FMI {told['fmi']}, {told['tool']}), steps of {step_s * 1e3:g} ms"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._fmu.close()


def open_plant(fmu: Path, chart: Path, seed: int, start_mps: float) -> OpenPlant:
    """Read a map and load the FMU with its parameters, to start at ``start_mps``.

    Raises
    ------
    hil.scenario.table.ScenarioError : a wrong map.
    FmuError : the FMU cannot be loaded.
    """
    found = load_plant_map(chart)
    return OpenPlant(ForeignFmu(fmu, found.parameters_at(start_mps)), found, seed)
