from importlib import resources

import pytest

from hil.parameters import load_set
from plant.parameters import PlantParameters


@pytest.fixture(scope="session")
def paper_car() -> PlantParameters:
    return load_set(resources.files("plant").joinpath("parameters/paper_car.toml"), PlantParameters)
