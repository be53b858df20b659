import re
from pathlib import Path

import pytest

from hil.diagnosis.vehicle.load import load_vehicle
from hil.validation.doc_pages.vehicle_page import page

PAGE = Path(__file__).parents[5] / "docs" / "vehicle-set.md"
SIX = {
    "mass_kg": 1650.0, "wheelbase_m": 2.72, "cog_to_front_axle_m": 1.3, "rolling_radius_m": 0.318,
    "brake_gain_front_nm_pa": 2.9e-4, "brake_gain_rear_nm_pa": 1.7e-4,
}  # fmt: skip


def keys() -> list[str]:
    """All keys in the first two columns of the tables."""
    rows = [line.split("|")[1:3] for line in page().splitlines() if line.startswith("| `")]
    return sorted({key for first, also in rows for key in re.findall("`([a-z0-9_]+)`", first + also)})


def test_documentation_is_current():
    assert PAGE.read_text(encoding="utf-8") == page(), "run python -m hil.validation.doc_pages.vehicle_page"


@pytest.mark.parametrize("key", keys())
def test_every_key_of_the_page_is_known(key):
    remarks = load_vehicle({**SIX, f"{key}_tolerance": 1e-9}).remarks
    assert not [remark for remark in remarks if "unknown key" in remark]
