import os
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """The folder of measured logs; tests that need it skip where it is absent."""
    folder = Path(os.environ.get("BRAKEBENCH_DATA", PROJECT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"measured data not found: {folder} (set BRAKEBENCH_DATA)")
    return folder
