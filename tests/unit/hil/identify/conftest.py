from importlib import resources

import pytest

from hil.identify.coverage import TRUTHS, noiseless, with_noise
from hil.identify.fit import fit
from hil.identify.model import brake_of
from hil.identify.record import read_record
from hil.identify.study import identify, shipped_records
from hil.scenario.parameters import load_set
from plant.parameters.plant import PlantParameters


@pytest.fixture(scope="session")
def friction_brake():
    return load_set(resources.files("plant.parameters") / "paper_car.toml", PlantParameters).friction_brake


@pytest.fixture(scope="session")
def brake(friction_brake):
    return brake_of(friction_brake, 0)


@pytest.fixture(scope="session")
def shipped():
    first, second = shipped_records()
    return read_record(first), read_record(second)


@pytest.fixture(scope="session")
def study(shipped, brake):
    return identify(shipped[0], brake, shipped[1])


@pytest.fixture(scope="session")
def clean(brake):
    """Records of equations (3) and (4) without noise, by heating form."""
    return {heating: noiseless(brake, truth, heating) for heating, truth in TRUTHS.items()}


@pytest.fixture(scope="session")
def noisy(clean):
    return {heating: with_noise(record, "white", 5) for heating, record in clean.items()}


@pytest.fixture(scope="session")
def fitted(noisy, brake):
    """Fits of the true heating form to the noisy records."""
    return {heating: fit(record, brake, heating) for heating, record in noisy.items()}
