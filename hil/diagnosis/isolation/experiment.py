"""What to drive next: the scenario of the library that best tells apart what the logs cannot.

For each scenario the signatures of the tied effects are simulated and whitened as in a diagnosis, with the noise of the
paper's sensors and what road and driver usually add (`hil.diagnosis.noise.model`). Its worth is the worst separation
in the set: the standard deviations left of an effect of usual size after the best imitation by all the others. Only
scenarios in which nobody presses the pedal take part (demands stand in the controller's place): no controller answers
the effects there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from dbc.bench_messages import ManoeuvreState
from hil.diagnosis.data.log import CHANNELS, MOTOR_DEMAND, PRESSURE_DEMAND, Floats, Log, make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.estimation.information import finite_difference_jacobian, information_blocks, marginalise
from hil.diagnosis.estimation.terms import Candidate, Column, candidates, columns
from hil.diagnosis.isolation.groups import ISOLABILITY_SIGMA, remaining, summed
from hil.diagnosis.noise.estimate import first_guess
from hil.diagnosis.noise.model import Noise, SampleMasks, tracks_of
from hil.diagnosis.simulation.measurement_model import Stack
from hil.diagnosis.simulation.parameter_set import ParameterSet, nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car
from hil.diagnosis.vehicle.spec import Vehicle
from hil.errors import BrakebenchError
from hil.scenario import Scenario, find_scenario, load_scenario, scenario_names
from plant.effects.effect import GROUND, Scope
from plant.effects.manoeuvres import MANOEUVRES, ROW_S, Drive, Show, drive
from plant.effects.signals import NAMES, noise, simulate
from plant.model import pack
from plant.node import PlantNode
from plant.vectors import INPUT

MAX_RECOMMENDATIONS = 3
STRAIGHT_STOP = "straight_stop"
"""Of `plant.effects.manoeuvres`: what every drive is compared with."""
FOLDER = "discriminating_manoeuvres"
_LONGEST_S, _SETTLE_S = 90.0, 0.4
_VISIBLE = 1.0
_OF_THE_ROAD = ("road_grade.grade", "headwind.wind_mps")
"""Numbers that change sign when the same stretch is driven back."""


@dataclass(frozen=True, slots=True)
class Recommendation:
    """One drive.

    Attributes
    ----------
    scenario : name in the library.  why : one sentence.
    separation : worst separation it reaches inside the set, standard deviations.
    straight_stop : the same of a straight stop.
    both_ways : whether it is to be driven out and back on the same stretch.
    """

    scenario: str
    why: str
    separation: float
    straight_stop: float
    both_ways: bool

    def as_json(self, path: Path | None = None) -> dict[str, Any]:
        """Entry of ``discriminating_manoeuvres``; the scenario by its file where it was written."""
        return {
            "scenario": self.scenario if path is None else str(path),
            "why": self.why,
            "separation": self.separation,
        }


def discriminating_manoeuvres(effects: Sequence[str], most: int = MAX_RECOMMENDATIONS) -> list[Recommendation]:
    """Scenarios that tell these effects apart, the best first; none where no scenario of the library does.

    Places and numbers of one effect need not be told from each other.

    Parameters
    ----------
    effects : two or more names of effects, or of one of their numbers at a place, as ``headwind.wind_mps@car`` and
        ``pad_mu_gain@front`` (`hil.diagnosis.estimation.terms.Candidate.name`). Of an effect with several numbers that is
        given by its name alone, the one counts that the others imitate best in a straight stop.

    Raises
    ------
    BrakebenchError
        Fewer than two effects, or one nobody knows.
    """
    items = _items(effects)
    both = any(f"{c.effect.name}.{c.parameter.name}" in _OF_THE_ROAD for c in items)
    before = _separation(STRAIGHT_STOP, items, both)
    found = []
    for name in _library():
        apart = _separation(name, items, both)
        if apart >= ISOLABILITY_SIGMA:
            found.append(Recommendation(name, _why(name, items, apart, before, both), apart, before, both))
    return sorted(found, key=lambda advice: -advice.separation)[:most]


def separation(scenario: str, effects: Sequence[str]) -> float:
    """Worst separation inside the set that one scenario of the library reaches; `STRAIGHT_STOP` too."""
    items = _items(effects)
    both = any(f"{c.effect.name}.{c.parameter.name}" in _OF_THE_ROAD for c in items)
    return _separation(scenario, items, both)


def write(advice: Sequence[Recommendation], folder: Path) -> list[Path]:
    """Write the scenarios into ``folder/discriminating_manoeuvres``, for ``brakebench run FILE``; their paths, in order."""
    into = Path(folder) / FOLDER
    if advice:
        into.mkdir(parents=True, exist_ok=True)
    paths = []
    for item in advice:
        path = into / f"{item.scenario}.toml"
        path.write_bytes(find_scenario(item.scenario).read_bytes())
        paths.append(path)
    return paths


@cache
def _all() -> tuple[list[Column], list[Candidate]]:
    found = columns()
    return found, candidates(found)


def _items(effects: Sequence[str]) -> list[Candidate]:
    """One candidate for each name."""
    names = list(dict.fromkeys(effects))
    choices = [_choices(name) for name in names]
    if len({listed[0].effect.name for listed in choices}) < 2:
        given = ", ".join(names) or "none"
        raise BrakebenchError(f"decide_with: expected two effects or more to tell apart, got {given}")
    if all(len(listed) == 1 for listed in choices):
        return [listed[0] for listed in choices]
    flat = [candidate for listed in choices for candidate in listed]
    products = _products(STRAIGHT_STOP, flat, False)
    precision, sizes = np.array([c.prior_sd**-2.0 for c in flat]), [c.parameter.typical for c in flat]
    found, begin = [], 0
    for listed in choices:
        own = range(begin, begin + len(listed))
        others = [k for k in range(len(flat)) if k not in own]
        begin += len(listed)
        shares = []
        for k in own:
            alone = remaining(products, precision, k, sizes[k], [])
            left = remaining(products, precision, k, sizes[k], others)
            shares.append(round(left / alone, 1) if alone >= _VISIBLE else 1.1)  # where none is in doubt, the first
        found.append(listed[shares.index(min(shares))])
    return found


def _choices(name: str) -> list[Candidate]:
    """The candidate of this name, or all numbers of an effect on the whole car."""
    listed = _all()[1]
    exact = [c for c in listed if c.name == name]
    if exact:
        return exact
    of_effect = [c for c in listed if c.effect.name == name and (c.location == "car" or c.effect.scope is Scope.NODE)]
    if not of_effect:
        known = sorted({c.effect.name for c in listed} | {c.name for c in listed})
        near = get_close_matches(name, known, 3) or ["`brakebench effects` lists them"]
        raise BrakebenchError(f"decide_with: no effect {name!r}; did you mean {', '.join(near)}?")
    return of_effect


@cache
def _scenario(name: str) -> Scenario:
    return load_scenario(name)


@cache
def _library() -> tuple[str, ...]:
    """Scenarios on a flat road without a pedal and without faults, at most a minute and a half long."""
    return tuple(name for name in scenario_names() if _takes_part(_scenario(name)))


def _takes_part(scenario: Scenario) -> bool:
    plan = scenario.manoeuvre
    sound = not scenario.faults and not scenario.frame_faults and not scenario.effects.on
    flat = all(part.grade == 0.0 and part.friction_left == part.friction_right == 1.0 for part in plan.road)
    return sound and flat and not plan.pedal and not scenario.blending and plan.duration_s <= _LONGEST_S


def _driven(scenario: Scenario) -> Drive:
    """What the plant is driven with in a scenario, the driver who holds a speed included."""
    plan = replace(scenario.manoeuvre, wait_for_demands=False)
    if not plan.speed_phases:
        return drive(Show(scenario.title, plan), scenario.plant)
    period_ns = round(ROW_S * 1e9)
    plant = PlantNode(scenario.plant, plan, 1, period_ns)
    start: list[Floats] = []
    rows: list[Floats] = []
    while plant.state is not ManoeuvreState.FINISHED:
        plant.step(len(rows) * period_ns, [])
        if not start:
            start.append(plant.model_state)
        rows.append(plant.inputs)
    return Drive(start[0], np.array(rows), pack(scenario.plant), np.zeros(len(rows)), ROW_S)


@dataclass(frozen=True, eq=False)
class _Linearisation:
    """A drive ready for signatures: the car in the study as it is, and the noise."""

    rig: Simulator
    frame: SampleMasks
    noise: Noise
    world: ParameterSet
    base: Stack


@cache
def _ground(name: str, both_ways: bool, to_ground: bool) -> _Linearisation:
    """A scenario as logs of our own car with nothing hidden, prepared as measured ones are; ``to_ground``: with the
    speed over ground."""
    car = _car()
    if name == STRAIGHT_STOP:
        show = MANOEUVRES[name]
        driven, disc_k = drive(show, car.parameters), show.manoeuvre.initial_disc_temperature_k
    else:
        scenario = _scenario(name)
        driven, disc_k = _driven(scenario), scenario.manoeuvre.initial_disc_temperature_k
    radius = float(car.parameters.wheel.rolling_radius_m)
    logs = [_log(name, driven, disc_k, direction, to_ground) for direction in ((1, -1) if both_ways else (1,))]
    world = nominal(car)
    rig = Simulator(prepare(logs, radius), car).prepared(world).with_baseline(world)
    frame, base = _settled(SampleMasks.of(rig.dataset)), rig.run(world)
    residual = tracks_of(rig.residual(world), frame, radius)
    return _Linearisation(rig, frame, first_guess(residual, frame), world, base)


def _settled(frame: SampleMasks) -> SampleMasks:
    """Without the first moments of each segment: replays begin them without slip, a driven car does not."""
    begun = np.flatnonzero((frame.log_start > 0.5) | (frame.segment_start > 0.5))
    late = np.ones(len(frame.log_start))
    for k in begun:
        late[k : k + round(_SETTLE_S / frame.sample_s)] = 0.0
    return replace(frame, present={name: known * late for name, known in frame.present.items()})


@cache
def _car() -> Vehicle:
    return paper_car()


def _log(name: str, driven: Drive, disc_k: float, direction: int, to_ground: bool) -> Log:
    """A recording of the bus, and of the speed ``to_ground``: the model's signals with the noise of their sensors."""
    left_out = {"pedal"} if to_ground else {"pedal", "speed_mps"}
    signals = simulate(driven)[0]
    signals += noise(signals) * np.random.default_rng([1, direction + 1]).standard_normal(signals.shape)
    channels = {n: signals[:, k] for k, n in enumerate(NAMES) if n in CHANNELS and n not in left_out}
    for part, names in (("pressure_demand_pa", PRESSURE_DEMAND), ("motor_demand_nm", MOTOR_DEMAND)):
        channels |= dict(zip(names, driven.rows[:, INPUT.slice(part)].T, strict=True))
    channels["steer_rad"] = driven.rows[:, INPUT.slice("steering_wheel_rad")][:, 0]
    log = make_log(name, np.arange(len(driven.rows)) * driven.row_s, channels)
    return replace(log, direction=direction, disc_temperature_k=disc_k)


def _separation(name: str, items: Sequence[Candidate], both_ways: bool) -> float:
    """Worst separation of the items at their usual sizes."""
    products = _products(name, items, both_ways)
    precision = np.array([c.prior_sd**-2.0 for c in items])
    left = []
    for k, item in enumerate(items):
        others = [j for j, other in enumerate(items) if other.effect.name != item.effect.name]
        left.append(remaining(products, precision, k, item.parameter.typical, others))
    return min(left)


def _products(name: str, items: Sequence[Candidate], both_ways: bool) -> Floats:
    """Products of the whitened signatures of the items, (items, items)."""
    to_ground = any(GROUND in c.effect.nodes for c in items)
    ground, of = _ground(name, both_ways, to_ground), _all()[0]
    needed = sorted({k for candidate in items for k in candidate.columns})
    worlds = [of[k].stepped(ground.world) for k in needed]
    tracks = finite_difference_jacobian(ground.rig, ground.frame, ground.base, worlds, [of[k].step for k in needed])
    nothing = {track: np.zeros((len(values), 1)) for track, values in tracks.items()}
    q = marginalise(information_blocks(nothing, tracks, ground.frame, ground.noise, 0).total(), 0).q
    return summed(q, [replace(c, columns=tuple(needed.index(k) for k in c.columns)) for c in items])


def _why(name: str, items: Sequence[Candidate], apart: float, before: float, both_ways: bool) -> str:
    """One sentence."""
    title = _scenario(name).title
    ways = "; drive it out and back on the same stretch (direction 1 and -1 in logs.toml)" if both_ways else ""
    effects = " and ".join([", ".join(c.name for c in items[:-1]), items[-1].name])
    return (
        f"{title}: leaves at least {apart:.1f} standard deviations between {effects} of usual size, "
        f"where a straight stop leaves {before:.1f}{ways}."
    )
