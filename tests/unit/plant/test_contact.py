"""The contact of tyre and road at standstill."""

import numpy as np
import pytest

from plant.model import Scene, initial_state, pack, replay
from plant.road import RoadSegment, road_table
from plant.tyre import load_offset, relaxation_longitudinal, slip_stiffness
from plant.vectors import INPUT

WHEELS = ("fl", "fr", "rl", "rr")


@pytest.mark.parametrize(("pressure_pa", "friction"), [(80e5, 1.0), (180e5, 1.0), (120e5, 0.5), (60e5, 0.2)])
def test_a_car_springs_back_with_the_energy_of_its_springs(paper_car, pressure_pa, friction):
    """At the stop the tyres hold F^2 sigma / 2 K and the wound-up brakes F^2 R^2 / 2 K_b; all but the first locked."""
    p = pack(paper_car)
    demands = np.zeros((1500, INPUT.size))
    demands[20:, INPUT.slice("pressure_demand_pa")] = pressure_pa
    columns = ["speed_mps", *(f"{part}_{w}" for part in ("longitudinal_force_n", "wheel_load_n") for w in WHEELS)]
    road = road_table((RoadSegment(-1e9, friction, friction),))
    table = replay(initial_state(paper_car, 15.0, 423.15, 0.7), demands, p, columns, Scene(road=road))[0]
    speed = table[:, 0]
    stop = int(np.flatnonzero(speed <= 0.0)[0])
    held_j = 0.0
    for force, load in zip(table[stop - 1, 1:5], table[stop - 1, 5:], strict=True):
        dfz = load_offset(load, p)
        tyre_m_n = relaxation_longitudinal(load, dfz, p) / slip_stiffness(load, dfz, p)
        brake_m_n = paper_car.wheel.rolling_radius_m**2 / paper_car.wheel.brake_windup_nm_rad
        held_j += 0.5 * force * force * (tyre_m_n + brake_m_n)
    back_j = 0.5 * paper_car.vehicle.mass_kg * float(speed[stop:].min()) ** 2
    assert 0.2 * held_j < back_j < held_j
    assert abs(speed[stop + 300 :]).max() < 0.01
