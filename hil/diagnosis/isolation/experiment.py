"""Discriminating manoeuvres: the scenarios of the library that best isolate what the logs cannot.

For each scenario the signatures of the effects are simulated and whitened as in a diagnosis, with the noise of the
paper's sensors and typical disturbances of road and driver (`hil.diagnosis.noise.model`). The design criterion is the
smallest separation within the group: the standard deviations that remain of an effect of typical size after the best
imitation by all the others. Scenarios with a pressed pedal are left out: there a controller answers the effects.
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
from hil.diagnosis.detection.threshold import ISOLABILITY_SIGMA
from hil.diagnosis.estimation.information import finite_difference_jacobian, information_blocks, marginalise
from hil.diagnosis.estimation.terms import Candidate, Column, candidates, columns, summed
from hil.diagnosis.isolation.groups import remaining
from hil.diagnosis.noise.estimate import first_guess
from hil.diagnosis.noise.model import Noise, SampleMasks, tracks_of
from hil.diagnosis.simulation.measurement_model import Stack
from hil.diagnosis.simulation.parameter_set import ParameterSet, nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car
from hil.diagnosis.vehicle.spec import Vehicle
from hil.errors import BrakebenchError
from hil.scenario.scenario import Scenario, find_scenario, load_scenario, scenario_names
from plant.effects.effect import GROUND, Scope
from plant.model import pack
from plant.node import PlantNode
from plant.open_loop_manoeuvres import MANOEUVRES, ROW_S, Drive, Show, drive
from plant.signals import NAMES, noise, simulate
from plant.vectors import INPUT

MAX_RECOMMENDATIONS = 3
"""Scenarios recommended, at most."""
STRAIGHT_STOP = "straight_stop"
"""Reference manoeuvre of every recommendation, one of `plant.open_loop_manoeuvres`."""
FOLDER = "discriminating_manoeuvres"
_MAX_DURATION_S, _SETTLE_S = 90.0, 0.4
_MIN_SNR = 1.0


@dataclass(frozen=True, slots=True)
class Recommendation:
    """One scenario to drive.

    Attributes
    ----------
    scenario : name in the library.  why : one sentence.
    separation : smallest separation within the group, standard deviations.
    straight_stop : the same in a straight stop.
    both_ways : True where it is to be driven out and back on the same stretch.
    """

    scenario: str
    why: str
    separation: float
    straight_stop: float
    both_ways: bool

    def as_json(self, path: Path | None = None) -> dict[str, Any]:
        """Entry of ``discriminating_manoeuvres``; with a ``path``, the scenario is that file."""
        return {
            "scenario": self.scenario if path is None else str(path),
            "why": self.why,
            "separation": self.separation,
        }


def discriminating_manoeuvres(effects: Sequence[str], most: int = MAX_RECOMMENDATIONS) -> list[Recommendation]:
    """Scenarios that isolate these effects from each other, the best first; empty where none of the library does.

    Locations and parameters of one effect need not be isolable from each other.

    Parameters
    ----------
    effects : two or more names of effects, or of candidates, as ``headwind.wind_mps@car`` and ``pad_mu_gain@front``
        (`hil.diagnosis.estimation.terms.Candidate.name`). Of an effect given by its name alone the parameter counts
        that the others imitate best in a straight stop.
    most : recommendations, at most.

    Raises
    ------
    BrakebenchError
        Fewer than two effects, or an unknown one.
    """
    items = _items(effects)
    both = any(c.parameter.sign_along_road for c in items)
    straight = _separation(STRAIGHT_STOP, items, both)
    recommended = []
    for name in _library():
        reached = _separation(name, items, both)
        if reached >= ISOLABILITY_SIGMA:
            recommended.append(
                Recommendation(name, _why(name, items, reached, straight, both), reached, straight, both)
            )
    return sorted(recommended, key=lambda one: -one.separation)[:most]


def separation(scenario: str, effects: Sequence[str]) -> float:
    """Smallest separation within the group in one scenario of the library, or in `STRAIGHT_STOP`."""
    items = _items(effects)
    both = any(c.parameter.sign_along_road for c in items)
    return _separation(scenario, items, both)


def write(recommendations: Sequence[Recommendation], folder: Path) -> list[Path]:
    """Write the scenarios into ``folder/discriminating_manoeuvres`` for ``brakebench run FILE``; their paths."""
    into = Path(folder) / FOLDER
    if recommendations:
        into.mkdir(parents=True, exist_ok=True)
    paths = []
    for item in recommendations:
        path = into / f"{item.scenario}.toml"
        path.write_bytes(find_scenario(item.scenario).read_bytes())
        paths.append(path)
    return paths


@cache
def _all() -> tuple[list[Column], list[Candidate]]:
    every = columns()
    return every, candidates(every)


def _items(effects: Sequence[str]) -> list[Candidate]:
    """One candidate a name."""
    names = list(dict.fromkeys(effects))
    choices = [_choices(name) for name in names]
    if len({listed[0].effect.name for listed in choices}) < 2:
        given = ", ".join(names) or "none"
        raise BrakebenchError(f"discriminating_manoeuvres: expected two effects or more, got {given}")
    if all(len(listed) == 1 for listed in choices):
        return [listed[0] for listed in choices]
    flat = [candidate for listed in choices for candidate in listed]
    products = _products(STRAIGHT_STOP, flat, False)
    precision, sizes = np.array([c.prior_sd**-2.0 for c in flat]), [c.parameter.typical for c in flat]
    chosen, begin = [], 0
    for listed in choices:
        own = range(begin, begin + len(listed))
        others = [k for k in range(len(flat)) if k not in own]
        begin += len(listed)
        shares = []
        for k in own:
            alone = remaining(products, precision, k, sizes[k], [])
            left = remaining(products, precision, k, sizes[k], others)
            shares.append(round(left / alone, 1) if alone >= _MIN_SNR else 1.1)  # without any rival: the first
        chosen.append(listed[shares.index(min(shares))])
    return chosen


def _choices(name: str) -> list[Candidate]:
    """The candidate of this name, or all parameters of an effect on the whole car."""
    listed = _all()[1]
    exact = [c for c in listed if c.name == name]
    if exact:
        return exact
    of_effect = [c for c in listed if c.effect.name == name and (c.location == "car" or c.effect.scope is Scope.NODE)]
    if not of_effect:
        known = sorted({c.effect.name for c in listed} | {c.name for c in listed})
        near = get_close_matches(name, known, 3) or ["`brakebench effects` lists them"]
        raise BrakebenchError(f"discriminating_manoeuvres: no effect {name!r}; did you mean {', '.join(near)}?")
    return of_effect


@cache
def _scenario(name: str) -> Scenario:
    return load_scenario(name)


@cache
def _library() -> tuple[str, ...]:
    """Scenarios on a flat road without a pedal and without faults, at most a minute and a half long."""
    return tuple(name for name in scenario_names() if _is_eligible(_scenario(name)))


def _is_eligible(scenario: Scenario) -> bool:
    plan = scenario.manoeuvre
    sound = not scenario.faults and not scenario.effects.on
    flat = all(part.grade == 0.0 and part.friction_left == part.friction_right == 1.0 for part in plan.road)
    return sound and flat and not plan.pedal and not scenario.blending and plan.duration_s <= _MAX_DURATION_S


def _driven(scenario: Scenario) -> Drive:
    """Inputs of the plant in a scenario, those of a driver who holds a speed included."""
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
    """The nominal car and the noise in one scenario, ready for signatures."""

    simulator: Simulator
    masks: SampleMasks
    noise: Noise
    nominal: ParameterSet
    channels: Stack


@cache
def _linearise(name: str, both_ways: bool, to_ground: bool) -> _Linearisation:
    """A scenario as logs of the paper's car without effects, prepared like measured ones.

    ``to_ground``: with the speed over ground.
    """
    car = _car()
    if name == STRAIGHT_STOP:
        show = MANOEUVRES[name]
        driven, disc_k = drive(show, car.parameters), show.manoeuvre.initial_disc_temperature_k
    else:
        scenario = _scenario(name)
        driven, disc_k = _driven(scenario), scenario.manoeuvre.initial_disc_temperature_k
    radius = float(car.parameters.wheel.rolling_radius_m)
    logs = [_log(name, driven, disc_k, direction, to_ground) for direction in ((1, -1) if both_ways else (1,))]
    at = nominal(car)
    simulator = Simulator(prepare(logs, radius), car).prepared(at).with_baseline(at)
    masks, channels = _settled(SampleMasks.of(simulator.dataset)), simulator.run(at)
    residual = tracks_of(simulator.residual(at), masks, radius)
    return _Linearisation(simulator, masks, first_guess(residual, masks), at, channels)


def _settled(masks: SampleMasks) -> SampleMasks:
    """Masks without the first moments of each segment: a simulation starts them without slip, a driven car does not."""
    starts = np.flatnonzero((masks.log_start > 0.5) | (masks.segment_start > 0.5))
    settled = np.ones(len(masks.log_start))
    for k in starts:
        settled[k : k + round(_SETTLE_S / masks.sample_s)] = 0.0
    return replace(masks, present={name: known * settled for name, known in masks.present.items()})


@cache
def _car() -> Vehicle:
    return paper_car()


def _log(name: str, driven: Drive, disc_k: float, direction: int, to_ground: bool) -> Log:
    """A log of the model's signals with the noise of their sensors; with ``to_ground`` the speed over ground, too."""
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
    """Smallest separation of the items at their typical sizes."""
    products = _products(name, items, both_ways)
    precision = np.array([c.prior_sd**-2.0 for c in items])
    left = []
    for k, item in enumerate(items):
        others = [j for j, other in enumerate(items) if other.effect.name != item.effect.name]
        left.append(remaining(products, precision, k, item.parameter.typical, others))
    return min(left)


def _products(name: str, items: Sequence[Candidate], both_ways: bool) -> Floats:
    """Information matrix of the items, (items, items)."""
    to_ground = any(GROUND in c.effect.nodes for c in items)
    at, every = _linearise(name, both_ways, to_ground), _all()[0]
    needed = sorted({k for candidate in items for k in candidate.columns})
    stepped = [every[k].stepped(at.nominal) for k in needed]
    steps = [every[k].step for k in needed]
    jacobian = finite_difference_jacobian(at.simulator, at.masks, at.channels, stepped, steps)
    residual = {track: np.zeros((len(values), 1)) for track, values in jacobian.items()}
    q = marginalise(information_blocks(residual, jacobian, at.masks, at.noise, 0).total(), 0).q
    return summed(q, [replace(c, columns=tuple(needed.index(k) for k in c.columns)) for c in items])


def _why(name: str, items: Sequence[Candidate], reached: float, straight: float, both_ways: bool) -> str:
    """The reason in one sentence."""
    title = _scenario(name).title
    ways = "; drive it out and back on the same stretch (direction 1 and -1 in logs.toml)" if both_ways else ""
    effects = " and ".join([", ".join(c.name for c in items[:-1]), items[-1].name])
    return (
        f"{title}: leaves at least {reached:.1f} standard deviations between {effects} of typical size, "
        f"where a straight stop leaves {straight:.1f}{ways}."
    )
