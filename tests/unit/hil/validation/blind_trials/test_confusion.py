"""The confusion matrix: what is counted, in which order, and that the picture shows it."""

import matplotlib.image
import numpy as np

from hil.validation.blind_trials.confusion import draw
from hil.validation.reference_car.cases import SEPARABLE


def _record(hidden: str, named: list[str], size: float = 15.0) -> dict[str, object]:
    return {"hidden": [{"effect": hidden}], "named": named, "size": size, "reached": True}


def _colours(path) -> tuple[int, int]:
    """Pixels that are blue (right) and red (wrong)."""
    red, green, blue = (np.asarray(matplotlib.image.imread(path))[..., k] for k in range(3))
    return int((blue > red + 0.2).sum()), int((red > green + 0.2).sum())


def test_right_ones_are_blue_and_wrong_ones_red(tmp_path) -> None:
    right, wrong = tmp_path / "right.png", tmp_path / "wrong.png"
    assert draw([_record("road_grade", ["road_grade"]), _record("mass_offset", [])], right)
    assert draw([_record("road_grade", ["mass_offset"])], wrong)
    blue, red = _colours(right)
    assert blue > 100
    assert red == 0
    blue, red = _colours(wrong)
    assert blue == 0
    assert red > 100


def test_every_effect_has_its_row_and_only_names_that_occur_a_column(tmp_path) -> None:
    few, all_named = tmp_path / "few.png", tmp_path / "all.png"
    names = [kind.name for kind in SEPARABLE]
    draw([_record(name, ["imu_bias"]) for name in names], few)
    draw([_record(name, [name]) for name in names], all_named)
    tall, wide = matplotlib.image.imread(few).shape[:2]
    assert matplotlib.image.imread(all_named).shape[0] == tall > 22 * len(names)
    assert matplotlib.image.imread(all_named).shape[1] > wide + 100


def test_small_signals_alone_make_no_figure(tmp_path) -> None:
    assert not draw([_record("road_grade", [], 5.0)], tmp_path / "none.png")
    assert not draw([], tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()
