import pytest

from plant.layout import Layout, dataclass_sizes, flatten
from plant.model import pack
from plant.parameters import PlantParameters
from plant.vectors import CUT, INPUT, OUTPUT, PARAMETER, RATES, STATE, SWITCH, P


def test_parts_follow_each_other():
    layout = Layout("L", {"a": 1, "b": 4, "c": 2})
    assert (layout.at.a, layout.at.b, layout.at.c, layout.size) == (0, 1, 5, 7)
    assert layout.slice("b") == slice(1, 5)
    assert layout.columns() == ["a", "b_fl", "b_fr", "b_rl", "b_rr", "c_front", "c_rear"]
    assert layout.zeros().shape == (7,)


@pytest.mark.parametrize("layout", [STATE, RATES, INPUT, CUT, SWITCH, OUTPUT, PARAMETER])
def test_every_element_has_one_name(layout):
    columns = layout.columns()
    assert len(columns) == layout.size == len(set(columns))


def test_rates_are_the_first_part_of_the_state():
    assert STATE.columns()[: RATES.size] == RATES.columns()


def test_parameters_keep_their_places(paper_car):
    assert {name: len(values) for name, values in flatten(paper_car).items()} == dataclass_sizes(PlantParameters)
    p = pack(paper_car)
    assert p[P.vehicle_mass_kg] == 1463.0
    assert p[P.vehicle_track_m + 1] == 1.510
    assert p[P.tyre_pkx1] == 22.303
