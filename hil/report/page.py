"""The fixed parts of the HTML report: head, style, uPlot and the page's own script."""

from functools import cache
from pathlib import Path

from hil.report.palette import SEVERITY_COLOURS

MARGIN_LEFT, MARGIN_RIGHT = 58, 14  # CSS px beside a panel; the timeline keeps to them too

HEAD = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline'; \
style-src 'unsafe-inline'; img-src data: blob:">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>
{style}
</style>
</head>
<body>
<main>"""

FOOT = """</main>
</body>
</html>
"""

_HERE = Path(__file__).parent
_UPLOT = _HERE / "vendor" / "uplot"


@cache
def style() -> str:
    """Return the page's style sheet."""
    margins = f":root {{ --left: {MARGIN_LEFT}px; --right: {MARGIN_RIGHT}px; }}"
    severities = "\n".join(f".{name} {{ --mark: {colour}; }}" for name, colour in SEVERITY_COLOURS.items())
    return "\n".join([_text(_UPLOT / "uPlot.min.css"), margins, severities, _text(_HERE / "client" / "page.css")])


@cache
def scripts() -> tuple[str, str]:
    """Return uPlot with its licence, and the page's own script."""
    own = [_text(_HERE / "client" / name) for name in ("draw.js", "plot.js", "page.js")]
    return f"/*\n{_text(_UPLOT / 'LICENSE')}*/\n{_text(_UPLOT / 'uPlot.iife.min.js')}", "\n".join(own)


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")
