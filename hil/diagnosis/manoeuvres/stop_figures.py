"""`explain` of stops by speed alone: their figures, and nothing on causes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hil.diagnosis.data.log import MOTOR_DEMAND, MOTOR_TORQUE, PRESSURE, PRESSURE_DEMAND, Log
from hil.diagnosis.manoeuvres.stops import section
from hil.diagnosis.vehicle.spec import Vehicle
from hil.report.report import Number, Report, Section, Table, Verdict
from plant.injection.theta import THETA

_ALONE = "no force is measured: the stops have their figures, causes cannot be found"


@dataclass(frozen=True, eq=False)
class StopFigures:
    """What `explain` returns for stops of which the speed alone is known: the answer as JSON."""

    json: dict[str, Any]


def stop_figures(logs: Sequence[Log], vehicle: Vehicle, stops: Sequence[dict[str, Any]]) -> StopFigures | None:
    """The answer for ``stops`` without measured forces; None where there are forces, or no stops."""
    forces = (PRESSURE, PRESSURE_DEMAND, MOTOR_TORQUE, MOTOR_DEMAND)
    if not stops or any(all(log.has(*names) for log in logs) for names in forces):
        return None
    content: dict[str, Any] = {
        "verdict": "not_testable", "causes": [], "rivals": [],
        "undetectable_effects": sorted(effect.name for effect in THETA.effects), "discriminating_manoeuvres": [],
        "residual_patterns": [], "held_out_error": {}, "extension": None,
        "missing": ["without pressure at the wheels or torque of the motors: nothing shows what braked the car"],
        "remarks": [_ALONE, *vehicle.remarks, *(f"{log.name}: {text}" for log in logs for text in log.remarks)],
        "stops": list(stops),
    }  # fmt: skip
    return StopFigures(content)


def build_report(answer: StopFigures, sources: Sequence[str]) -> Report:
    """Build the report; ``sources`` are the names of the logs."""
    content = answer.json
    found = content["stops"]
    numbers = tuple(
        Number(f"MFDD, {one['log']} at {one['t_s']:.1f} s", round(one["mfdd_mps2"], 2), "m/s²") for one in found
    )
    rows = tuple(("remark", text) for text in (*content["missing"], *content["remarks"]))
    limits = Section("What these data cannot show", tables=(Table("Limits", ("what", "which"), rows),))
    reason = f"{_ALONE[0].upper()}{_ALONE[1:]}."
    provenance = {"logs": list(sources), "remarks": content["remarks"]}
    return Report("Stops", Verdict.INCONCLUSIVE, reason, numbers, (*section(found), limits), provenance)
