from pathlib import Path

from ecu.law.trouble_codes import CODES
from hil.validation.doc_pages.trouble_codes_page import page

PAGE = Path(__file__).parents[5] / "docs" / "trouble-codes.md"


def test_documentation_is_current():
    assert PAGE.read_text(encoding="utf-8") == page(), "run python -m hil.validation.doc_pages.trouble_codes_page"


def test_every_code_has_one_row():
    rows = [line for line in page().splitlines() if line.startswith("| 0x")]
    assert [int(row.split("|")[1], 16) for row in rows] == [code.number for code in CODES]
