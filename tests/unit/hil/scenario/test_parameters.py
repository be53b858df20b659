"""Parameter sets: what is read, and what is refused with file and key."""

from dataclasses import dataclass
from typing import Annotated, Literal

import pytest

from hil.scenario.parameters import ParameterError, load_set, override


@dataclass(frozen=True)
class Body:
    mass_kg: Annotated[float, "kg", 500.0, 5000.0]
    track_m: Annotated[tuple[float, float], "m", 1.0, 2.0]
    wheels: Annotated[int, "", 3, 4]
    form: Literal["bulk", "contact"]


@dataclass(frozen=True)
class Car:
    body: Body


GOOD = """
[body]
mass_kg = { value = 1463, unit = "kg", tolerance = 75, source = "paper" }
track_m = { value = [1.52, 1.51], unit = "m", tolerance = 0.02, source = "data sheet" }
wheels = { value = 4, unit = "", tolerance = 0, source = "counted" }
form = { value = "bulk", source = "decision" }
"""


@pytest.fixture
def read(tmp_path):
    def write_and_read(text):
        path = tmp_path / "set.toml"
        path.write_text(text)
        return load_set(path, Car)

    return write_and_read


def test_a_good_set(read):
    car = read(GOOD)
    assert car == Car(Body(1463.0, (1.52, 1.51), 4, "bulk"))
    assert isinstance(car.body.mass_kg, float)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass_kg =", "mass =", r"set.toml: unknown key 'body.mass'; known here: .*mass_kg"),
        ('form = { value = "bulk", source = "decision" }', "", r"set.toml: missing body.form"),
        ('1463, unit = "kg"', '1463, unit = "t"', r"body.mass_kg: expected unit 'kg', got 't'"),
        ("value = 1463", "value = 14630", r"body.mass_kg: expected 500 to 5000 kg, got 14630"),
        ("value = 1463", "value = nan", r"body.mass_kg: expected a number, got nan"),
        ("value = 1463", "value = 1" + 400 * "0", r"body.mass_kg: expected a number, got 10000"),
        ("tolerance = 75", "tolerance = 1" + 400 * "0", r"body.mass_kg: expected a tolerance >= 0"),
        ("value = 1463", "value = true", r"body.mass_kg: expected a number, got True"),
        ("value = 4,", "value = 3.5,", r"body.wheels: expected a whole number, got 3.5"),
        ("[1.52, 1.51]", "[1.52]", r"body.track_m: expected a list of 2 numbers in 'm', got \[1.52\]"),
        ("[1.52, 1.51]", "[1.52, 15]", r"body.track_m\[1\]: expected 1 to 2 m, got 15"),
        ('"bulk"', '"skin"', r"body.form: expected one of 'bulk', 'contact', got 'skin'"),
        (', source = "paper"', "", r"body.mass_kg: has no source"),
        ("tolerance = 75, ", "", r"body.mass_kg: expected a tolerance >= 0 in 'kg'"),
        ("tolerance = 75", "tolerance = -1", r"body.mass_kg: expected a tolerance >= 0"),
        ("[body]", "[body", r"set.toml: not valid TOML"),
        ("{ value = 1463, unit", "{ val = 1463, unit", r"body.mass_kg: expected \{ value"),
    ],
)
def test_refusals_name_file_and_key(read, old, new, message):
    assert old in GOOD
    with pytest.raises(ParameterError, match=message):
        read(GOOD.replace(old, new, 1))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ParameterError, match=r"none.toml: cannot be read"):
        load_set(tmp_path / "none.toml", Car)


def test_override_replaces_and_checks(read):
    car = read(GOOD)
    changed = override(car, {"body": {"mass_kg": 1600, "form": "contact"}}, "stop.toml: plant")
    assert (changed.body.mass_kg, changed.body.form, changed.body.track_m) == (1600.0, "contact", (1.52, 1.51))
    assert car.body.mass_kg == 1463.0
    for change, message in (
        ({"body": {"mass_kg": 1.0}}, r"stop.toml: plant.body.mass_kg: expected 500 to 5000"),
        ({"boddy": {}}, r"stop.toml: plant: unknown key 'boddy'"),
        ({"body": 3}, r"stop.toml: plant.body: expected a table"),
    ):
        with pytest.raises(ParameterError, match=message):
            override(car, change, "stop.toml: plant")
