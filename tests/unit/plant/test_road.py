import pytest

from plant.road import RoadSegment, road_table, segment_at


@pytest.mark.parametrize(("x", "row"), [(-100.0, 0), (0.0, 0), (29.9, 0), (30.0, 1), (44.0, 1), (45.0, 2), (1e6, 2)])
def test_segment_at(plain, x, row):
    table = road_table((RoadSegment(45.0), RoadSegment(0.0), RoadSegment(30.0, 0.2, 0.3)))
    assert plain(segment_at)(table, x) == row


def test_rows_are_in_order():
    table = road_table((RoadSegment(45.0), RoadSegment(30.0, 0.2, 0.3, 0.05)))
    assert table.tolist() == [[30.0, 0.2, 0.3, 0.05], [45.0, 1.0, 1.0, 0.0]]
