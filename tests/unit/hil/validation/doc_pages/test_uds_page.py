from pathlib import Path

from ecu.diagnostics.actuators import DEMANDS
from ecu.diagnostics.identifiers import IDENTIFIERS
from ecu.diagnostics.services import SERVICES
from hil.validation.doc_pages.uds_page import page

PAGE = Path(__file__).parents[5] / "docs" / "uds.md"


def test_documentation_is_current():
    assert PAGE.read_text(encoding="utf-8") == page(), "run python -m hil.validation.doc_pages.uds_page"


def test_every_service_and_identifier_has_one_row():
    numbers = [int(line.split("|")[1], 16) for line in page().splitlines() if line.startswith("| 0x")]
    assert [n for n in numbers if n < 0x100] == list(SERVICES)
    dids = [n for n in numbers if n >= 0x200]
    # routines have numbers of their own
    assert set(dids) >= {*IDENTIFIERS, *DEMANDS, 0xF186}
