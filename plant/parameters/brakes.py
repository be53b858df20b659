"""Electro-hydraulic brake, friction brake and pad friction. Pairs are (front, rear)."""

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, slots=True)
class EhbParameters:
    """Closed pressure loop of the electro-hydraulic brake, the same for every wheel, and its own pedal map."""

    natural_frequency_hz: Annotated[float, "Hz", 0.5, 50.0]
    damping_ratio: Annotated[float, "", 0.1, 3.0]
    dead_time_s: Annotated[float, "s", 0.0, 0.1]
    build_rate_pa_s: Annotated[float, "Pa/s", 1e5, 1e9]
    release_rate_pa_s: Annotated[float, "Pa/s", 1e5, 1e9]
    max_pressure_pa: Annotated[float, "Pa", 1e6, 4e7]
    pedal_free_travel: Annotated[float, "", 0.0, 0.5]
    pedal_map_linear_pa: Annotated[float, "Pa", 0.0, 4e7]
    pedal_map_square_pa: Annotated[float, "Pa", 0.0, 4e7]
    pedal_map_cubic_pa: Annotated[float, "Pa", 0.0, 4e7]


@dataclass(frozen=True, slots=True)
class FrictionBrakeParameters:
    """Caliper and disc."""

    piston_area_m2: Annotated[tuple[float, float], "m2", 1e-4, 2e-2]
    effective_radius_m: Annotated[tuple[float, float], "m", 0.02, 0.5]
    threshold_pressure_pa: Annotated[tuple[float, float], "Pa", 0.0, 1e6]
    efficiency: Annotated[float, "", 0.5, 1.0]
    heat_capacity_j_k: Annotated[tuple[float, float], "J/K", 100.0, 50000.0]
    cooling_w_k: Annotated[tuple[float, float], "W/K", 0.0, 200.0]
    cooling_speed_ws_m_k: Annotated[tuple[float, float], "W s/(m K)", 0.0, 20.0]
    ambient_k: Annotated[float, "K", 220.0, 340.0]


@dataclass(frozen=True, slots=True)
class OstermeyerParameters:
    """Pad friction, equations (3) and (4) of the paper.

    ``heating_with_mu`` is 0 for the heating term as printed (N v) and 1 for mu N v; ``temperature_of_disc`` is 0 when
    equation (4) makes the temperature and 1 when the disc's energy balance does.
    """

    a_1_ks: Annotated[float, "1/(K s)", 0.0, 1e-2]
    b_1_j: Annotated[float, "1/J", 0.0, 1e-3]
    c_1_s: Annotated[float, "1/s", 0.0, 1.0]
    gamma_k_w: Annotated[tuple[float, float], "K/W", 0.0, 10.0]
    epsilon_w: Annotated[float, "W", 1.0, 1e7]
    heating_with_mu: Annotated[float, "", 0.0, 1.0]
    temperature_of_disc: Annotated[float, "", 0.0, 1.0]
