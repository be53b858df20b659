from collections.abc import Callable
from importlib import resources
from typing import Any

import pytest

from hil.scenario.parameters import load_set
from plant.parameters import PlantParameters


@pytest.fixture(scope="session")
def paper_car() -> PlantParameters:
    return load_set(resources.files("plant").joinpath("parameters/paper_car.toml"), PlantParameters)


@pytest.fixture(scope="session")
def plain() -> Callable[[Any], Any]:
    """The Python function behind a compiled equation that calls no other."""
    return lambda function: getattr(function, "py_func", function)
