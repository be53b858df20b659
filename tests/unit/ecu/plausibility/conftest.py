import pytest
from plausibility_samples import Judge


@pytest.fixture
def judged(parameters):
    return Judge(parameters)
