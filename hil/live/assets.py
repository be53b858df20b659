"""The files of the page, and the headers under which they are served."""

from functools import cache
from importlib import resources

from hil.report.page import MARGIN_LEFT, MARGIN_RIGHT
from hil.report.palette import SERIES, WHEEL_COLOURS

_SCRIPT, _STYLE, _PAGE = (f"text/{kind}; charset=utf-8" for kind in ("javascript", "css", "html"))
_SCRIPTS = ("store.js", "plots.js", "car.js", "trace.js", "controls.js", "live.js")

SECURITY = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src {socket}; "
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
"""Nothing is loaded from elsewhere, no script stands in the page, nobody frames it, and nothing of it is kept."""


@cache
def assets() -> dict[str, tuple[str, bytes]]:
    """Return content type and bytes of each file by its path; ``/`` is the page itself."""
    ours, reports = resources.files("hil.live") / "client", resources.files("hil.report")
    uplot = reports / "vendor" / "uplot"
    wheels = " ".join(f"--{wheel}: {colour};" for wheel, colour in WHEEL_COLOURS.items())
    series = " ".join(f"--series{i}: {colour};" for i, colour in enumerate(SERIES))
    look = f":root {{ --left: {MARGIN_LEFT}px; --right: {MARGIN_RIGHT}px; {wheels} {series} }}\n"
    css = [(uplot / "uPlot.min.css").read_text(), look, (reports / "client" / "page.css").read_text()]
    css.append((ours / "live.css").read_text())
    licence = (uplot / "LICENSE").read_text()
    found = {
        "/": (_PAGE, (ours / "live.html").read_bytes()),
        "/live.css": (_STYLE, "\n".join(css).encode()),
        "/uplot.js": (_SCRIPT, f"/*\n{licence}*/\n{(uplot / 'uPlot.iife.min.js').read_text()}".encode()),
    }
    found["/draw.js"] = (_SCRIPT, (reports / "client" / "draw.js").read_bytes())
    return found | {f"/{name}": (_SCRIPT, (ours / name).read_bytes()) for name in _SCRIPTS}
