"""How the controller acts: pedal map, blending, supervision."""

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, slots=True)
class PedalParameters:
    """Reference deceleration over pedal travel: standard gravity times a cubic of the travel beyond the free travel."""

    free_travel: Annotated[float, "1", 0.0, 0.3]
    map_linear: Annotated[float, "1", 0.0, 2.0]
    map_quadratic: Annotated[float, "1", 0.0, 2.0]
    map_cubic: Annotated[float, "1", 0.0, 2.0]
    resistance_full_mps2: Annotated[float, "m/s2", 0.1, 5.0]


@dataclass(frozen=True, slots=True)
class BlendParameters:
    """Work between motors and friction brake."""

    blending_factor: Annotated[float, "1", 0.0, 1.0]
    fade_start_mps: Annotated[float, "m/s", 0.1, 20.0]
    fade_end_mps: Annotated[float, "m/s", 0.0, 10.0]
    friction_lead_s: Annotated[float, "s", 0.0, 0.5]
    charge_handover_s: Annotated[float, "s", 0.02, 2.0]


@dataclass(frozen=True, slots=True)
class SupervisionParameters:
    """Time-outs and transitions of the operating modes."""

    timeout_s: Annotated[float, "s", 0.005, 1.0]
    battery_timeout_s: Annotated[float, "s", 0.05, 5.0]
    demand_hold_s: Annotated[float, "s", 0.0, 2.0]
    frames_to_upgrade: Annotated[int, "1", 1, 100]
    upgrade_interval_s: Annotated[float, "s", 0.0, 60.0]
    bad_frames_to_downgrade: Annotated[int, "1", 1, 100]
    bad_frame_weight: Annotated[int, "1", 1, 100]
    foreign_frames_to_downgrade: Annotated[int, "1", 1, 100]
    foreign_frame_weight: Annotated[int, "1", 1, 100]
    communication_healing_s: Annotated[float, "s", 0.0, 60.0]
    start_tolerated_s: Annotated[float, "s", 0.0, 600.0]
    pedal_disagreement: Annotated[float, "1", 0.005, 0.5]
    pedal_disagreement_s: Annotated[float, "s", 0.0, 1.0]
    own_map_tolerated_s: Annotated[float, "s", 0.0, 5.0]
