"""What a manoeuvre can and cannot show: every effect's signature in every channel, against the noise."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ecu.node import EcuNode
from hil.bench.node_process import NODE_PERIOD_NS
from hil.bench.virtual import simulate as run
from hil.rt.lockstep import Step
from hil.scenario.effects import EffectError, layout, plugin_table, plugins
from hil.scenario.scenario import Scenario
from plant.effects.catalogue import BUILT_IN
from plant.effects.effect import NODES, Effect, Scope
from plant.injection.plugin import NO_PLUGINS
from plant.layout import Vector
from plant.model import pack
from plant.node import PlantNode
from plant.open_loop_manoeuvres import Drive
from plant.road import road_table
from plant.signals import NAMES, noise, simulate

SHOWN = 3.0  # times the noise, over the whole manoeuvre: below, nothing is to be seen
ALIKE = 0.995  # of the cosine between two signatures
_PLANT = 0


@dataclass(frozen=True, slots=True)
class Signature:
    """What one effect at its typical size leaves.

    Attributes
    ----------
    effect, member : which, and where it acts.
    sizes : rms of the change over the noise of one sample, for each channel.
    total : root of the sum of squares over all samples and channels: how many sigma it stands out.
    shape : the whitened change, of length 1.
    """

    effect: Effect
    member: str
    sizes: Vector
    total: float
    shape: Vector

    @property
    def name(self) -> str:
        """Name with the member it acts on."""
        return self.effect.name if self.member == "car" else f"{self.effect.name} {self.member}"


def recorded(scenario: Scenario, seed: int = 1) -> Drive:
    """Drive a scenario in closed loop once; what the plant was driven with is then replayed for every effect.

    Raises
    ------
    EffectError
        The manoeuvre was over before it began.
    """
    plant = PlantNode(scenario.plant, scenario.manoeuvre, seed, NODE_PERIOD_NS, **scenario.effects.for_node())
    start: list[Vector] = []
    rows: list[Vector] = []
    pedal: list[float] = []

    def each(step: Step) -> None:
        if step.member != _PLANT or plant.manoeuvre_start_ns is None:
            return
        if not start:
            start.append(plant.model_state)
        rows.append(plant.inputs)
        pedal.append(plant.pedal)

    run(scenario, seed, plant=plant, ecu=EcuNode(scenario.ecu, NODE_PERIOD_NS), each_tick=each)
    if not rows:
        raise EffectError(f"{scenario.name}: the manoeuvre has no sample")
    road = road_table(scenario.manoeuvre.road)
    return Drive(start[0], np.array(rows), pack(scenario.plant), np.array(pedal), NODE_PERIOD_NS * 1e-9, road)


def _members(effect: Effect) -> list[tuple[str, int | None]]:
    if effect.scope is Scope.CAR:
        return [("car", None)]
    if effect.scope is Scope.NODE:
        return [(node, k) for k, node in enumerate(NODES)]
    return [(effect.scope.members[0], 0)]


def signatures(drive: Drive) -> list[Signature]:
    """Signature of every effect at its typical size, in the order of the catalogue, then those from outside.

    Of wheels and axles the first.
    """
    neutral = layout().neutral()
    found = []
    for effects, table in ((sorted(BUILT_IN, key=lambda e: e.row), NO_PLUGINS), (plugins(), plugin_table(layout()))):
        cases = [(effect, name, k) for effect in effects for name, k in _members(effect)]
        thetas = np.array([neutral, *[layout().typical(effect.name, k) for effect, _, k in cases]])
        signals = simulate(drive, thetas, plugins=table)
        sigma = noise(signals[0])
        for (effect, member, _), changed in zip(cases, signals[1:], strict=True):
            white = (changed - signals[0]) / sigma
            total = float(np.sqrt((white**2).sum()))
            shape = white.ravel() / total if total > 0.0 else white.ravel()
            found.append(Signature(effect, member, np.sqrt((white**2).mean(axis=0)), total, shape))
    return found


def alike(found: list[Signature]) -> list[tuple[str, str, float]]:
    """Pairs that this manoeuvre shows but cannot tell apart, with the cosine between their signatures."""
    shown = [signature for signature in found if signature.total >= SHOWN]
    shapes = np.array([signature.shape for signature in shown])
    cosines = shapes @ shapes.T if len(shown) else np.empty((0, 0))
    pairs = [
        (shown[i].name, shown[k].name, float(cosines[i, k]))
        for i in range(len(shown))
        for k in range(i)
        if abs(cosines[i, k]) >= ALIKE and shown[i].effect.name != shown[k].effect.name
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def as_json(name: str, drive: Drive, found: list[Signature]) -> dict[str, Any]:
    """Table of the signatures as JSON values."""
    return {
        "scenario": name,
        "duration_s": len(drive.rows) * drive.row_s,
        "channels": list(NAMES),
        "effects": [
            {
                "name": s.effect.name,
                "member": s.member,
                "typical": {p.name: p.typical for p in s.effect.parameters},
                "total_sigma": s.total,
                "shown": s.total >= SHOWN,
                "rms_over_noise": dict(zip(NAMES, s.sizes.tolist(), strict=True)),
            }
            for s in found
        ],
        "not_shown": [s.name for s in found if s.total < SHOWN],
        "alike": [{"a": a, "b": b, "cosine": c} for a, b, c in alike(found)],
    }
