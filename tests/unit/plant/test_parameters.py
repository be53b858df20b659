"""Every number of every set has bounds, unit and source, and lies inside."""

import tomllib
from importlib import resources

import pytest

from hil.scenario.parameters import load_set
from plant.parameters import OstermeyerParameters, PlantParameters

SETS = {"paper_car.toml": PlantParameters, "pad_b.toml": OstermeyerParameters, "pad_c.toml": OstermeyerParameters}
FOLDER = resources.files("plant").joinpath("parameters")


@pytest.mark.parametrize("name", SETS)
def test_sets_are_read(name):
    load_set(FOLDER.joinpath(name), SETS[name])


def test_no_set_is_forgotten():
    assert {f.name for f in FOLDER.iterdir() if f.name.endswith(".toml")} == set(SETS)


@pytest.mark.parametrize("name", SETS)
def test_sources_begin_with_their_kind(name):
    table = tomllib.loads(FOLDER.joinpath(name).read_text(encoding="utf-8"))
    entries = table.values() if name.startswith("pad") else [e for part in table.values() for e in part.values()]
    for entry in entries:
        kind = entry["source"][:1]
        assert kind in "SMDC"
        if kind in "SM":
            assert len(entry["source"]) > 10, entry
