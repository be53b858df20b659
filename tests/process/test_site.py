"""The site of the documentation: built without a warning, whole, and without anything from elsewhere."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOADED = re.compile(
    r"""<(?:script|img|iframe|source)\b[^>]*\bsrc=["'](?:https?:)?//|<link\b[^>]*\bhref=["'](?:https?:)?//"""
)
LOADED_BY_STYLE = re.compile(r"""url\(["']?(?:https?:)?//|@import ["'](?:https?:)?//""")


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path):
    pytest.importorskip("sphinx", reason="pip install --editable '.[docs]'")
    site = tmp_path / "site"
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", tmp_path / "trees", ROOT / "docs", site],
        capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    pages = sorted(path.relative_to(ROOT / "docs").with_suffix(".html") for path in (ROOT / "docs").rglob("*.md"))
    assert len(pages) > 40
    home = (site / "index.html").read_text()
    for page in pages:
        text = (site / page).read_text()
        assert not LOADED.search(text), page
        assert page.parts[0] == "decisions" or page.as_posix() in home, f"{page} is in no list of index.md"
    for style in site.rglob("*.css"):
        assert not LOADED_BY_STYLE.search(style.read_text()), style
    for group in ("Tutorials", "How to", "Reference", "Background"):
        assert f'<span class="caption-text">{group}</span>' in home


def test_the_extra_that_builds_the_site_is_among_those_for_developers():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert any(name.startswith("sphinx>") for name in extras["docs"])
    assert any("docs" in name for name in extras["dev"])
