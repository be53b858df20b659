"""Tyre property files: what is read, and what is refused."""

from importlib import resources

import pytest

from hil.scenario.parameters import ParameterError, load_set
from hil.scenario.scenario import load_scenario
from hil.scenario.tyre_file import load_tir
from plant.parameters.plant import PlantParameters

HEAD = """[MDI_HEADER]
FILE_TYPE = 'tir'
$ a comment = 3
[UNITS]
LENGTH = 'meter'
FORCE  = 'newton'
ANGLE  = 'radians'
[MODEL]
PROPERTY_FILE_FORMAT = 'PAC2002'
FITTYP = 6 $ Magic Formula
[DIMENSION]
UNLOADED_RADIUS = 0.3135
"""


@pytest.fixture
def base():
    return load_set(resources.files("plant") / "parameters" / "paper_car.toml", PlantParameters).tyre


@pytest.fixture
def write(tmp_path, base):
    """A file with the coefficients of the base set, some changed or left out."""

    def make(changes=(), without=(), head=HEAD):
        skip = {"unloaded_radius", "relaxation_least_m", "low_speed_mps", "low_speed_damping_ns_m", *without}
        values = {name: getattr(base, name) for name in base.__slots__ if name not in skip} | dict(changes)
        path = tmp_path / "tyre.tir"
        lines = [f"{name.upper()} = {value!r}  $ text" for name, value in values.items()]
        path.write_text(head + "\n".join(lines) + "\nPDX3 = 11.5\n")
        return path

    return make


def test_coefficients_are_read(write, base):
    read = load_tir(write({"pkx1": 25.0}), base)
    assert (read.tyre.pkx1, read.tyre.unloaded_radius, read.tyre.pcx1) == (25.0, 0.3135, base.pcx1)
    assert read.tyre.low_speed_mps == base.low_speed_mps
    assert "pdx3" in read.unused
    assert read.kept == ()


def test_missing_scales_are_one_and_missing_combined_slip_is_kept(write, base):
    read = load_tir(write(without=("lmux", "rby1")), base)
    assert read.tyre.lmux == 1.0
    assert read.kept == ("rby1",)
    assert read.tyre.rby1 == base.rby1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"changes": {"rex1": 1.2568, "rcx1": 0.65225}}, r"REX1 = 1.2568 is above 1.*exchanged"),
        ({"without": ("pkx1", "pdy1")}, r"lacks PKX1, PDY1"),
        ({"head": HEAD.replace("= 6 ", "= 61 ").replace("PAC2002", "USER")}, r"expected FITTYP .*got 61"),
        ({"head": HEAD.replace("'meter'", "'mm'")}, r"expected LENGTH in m, got mm"),
        ({"head": HEAD.replace("0.3135", "big")}, r"UNLOADED_RADIUS: expected a number, got 'big'"),
        ({"head": HEAD.replace("0.3135", "31.35")}, r"unloaded_radius: expected 0.1 to 1 m"),
    ],
)
def test_refusals(write, base, arguments, message):
    with pytest.raises(ParameterError, match=message):
        load_tir(write(**arguments), base)


def test_a_missing_file_is_named(tmp_path, base):
    with pytest.raises(ParameterError, match=r"none.tir: cannot be read"):
        load_tir(tmp_path / "none.tir", base)


def test_a_scenario_drives_on_a_tyre_file(write, base, tmp_path):
    name = write({"pdx1": 0.8, "pkx1": 25.0}).name
    text = f"""title = "tyre"
[plant]
tyre_file = "{name}"
tyre.pkx1 = 24.0
[start]
speed_mps = 20.0
[end]
duration_s = 1.0
"""
    path = tmp_path / "tyre.toml"
    path.write_text(text)
    scenario = load_scenario(str(path))
    assert (scenario.plant.tyre.pdx1, scenario.plant.tyre.pkx1) == (0.8, 24.0)  # the single change comes last
    assert scenario.plant.tyre.pcx1 == base.pcx1
    (tmp_path / name).write_text((tmp_path / name).read_text().replace("0.8", "0.9"))
    assert load_scenario(str(path)).sha256 != scenario.sha256
    path.write_text(text.replace(name, "none.tir"))
    with pytest.raises(ParameterError, match=r"none\.tir: cannot be read"):
        load_scenario(str(path))
