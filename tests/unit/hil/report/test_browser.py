"""The page in a real browser: it draws, zooms together, and runs nothing that a log wrote."""

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from hil.report.html import render_html
from hil.report.report import Event, Lane, Panel, Report, Section, Span, Trace

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--virtual-time-budget=20000",
    "--dump-dom",
]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine (Debian: apt-get install chromium)"),
]


def run_in_browser(report: Report, script: str, folder: Path) -> dict:
    """Open the report, run ``script`` once all is drawn, and return what it gives to ``done``."""
    driver = f"""<script>
    (function wait() {{
      if (document.documentElement.dataset.ready !== "yes") return setTimeout(wait, 20);
      const gds = [...document.querySelectorAll(".plot")];
      const later = () => new Promise((resolve) => setTimeout(resolve, 200));
      const done = (value) => {{
        const pre = document.createElement("pre");
        pre.id = "outcome";
        pre.textContent = JSON.stringify(value);
        document.body.append(pre);
      }};
      (async () => {{ {script} }})().catch((error) => done({{ error: String(error) }}));
    }})();
    </script>"""
    path = folder / "report.html"
    path.write_text(render_html(report).replace("</body>", driver + "</body>"), encoding="utf-8")
    assert CHROMIUM is not None
    command = [CHROMIUM, *FLAGS, f"--user-data-dir={folder / 'profile'}", "--window-size=1200,900", path.as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    found = re.search(r'<pre id="outcome">(.*?)</pre>', dom, re.DOTALL)
    assert found, "the script did not finish"
    outcome = json.loads(unescape(found.group(1)))
    assert "error" not in outcome
    return outcome


def test_zooming_one_panel_zooms_the_others_and_the_timeline(full_report: Report, tmp_path: Path) -> None:
    script = """
      const state = () => ({
        ranges: gds.slice(0, 2).map((gd) => gd.layout.xaxis.range.map(Number)),
        span: document.querySelectorAll(".span")[1].style.cssText,
        event: document.querySelector(".event").style.left,
        window: document.querySelector(".window").textContent,
      });
      const before = state();
      await Plotly.relayout(gds[1], { "xaxis.range[0]": 0.5, "xaxis.range[1]": 1.5 });
      await later();
      const zoomed = state();
      document.querySelector("[data-do=in]").click();
      await later();
      const button = state();
      await Plotly.relayout(gds[0], { "xaxis.autorange": true });
      await later();
      const width = document.querySelector(".bar").clientWidth;
      done({ before, zoomed, button, after: state(), width, chart: gds[2].layout.xaxis.range });
    """
    outcome = run_in_browser(full_report, script, tmp_path)
    assert outcome["before"]["ranges"] == [[0.0, 2.0]] * 2
    assert outcome["zoomed"]["ranges"] == [[0.5, 1.5]] * 2
    assert outcome["zoomed"]["window"] == "0.500 s to 1.500 s"
    assert outcome["button"]["ranges"] == [[0.75, 1.25]] * 2
    assert outcome["after"] == outcome["before"]
    assert outcome["chart"][1] > 2.0  # a chart has an axis of its own
    # NORMAL lasts from 0.25 to 2 s, bus off is at 1.25 s.
    assert outcome["zoomed"]["span"].startswith("left: 0px")
    at = float(outcome["zoomed"]["event"].removesuffix("px"))
    assert at == pytest.approx(0.75 * outcome["width"], abs=1.0)


def test_pointing_at_one_panel_reads_all(full_report: Report, tmp_path: Path) -> None:
    script = """
      gds[0].emit("plotly_hover", { points: [{ x: 1.0 }] });
      const read = () => [...document.querySelectorAll(".linked .chip output")].map((output) => output.textContent);
      const cursor = document.querySelector(".linked .cursor");
      const shown = { values: read(), display: cursor.style.display };
      gds[0].emit("plotly_unhover", {});
      done({ shown, after: read(), hidden: cursor.style.display });
    """
    outcome = run_in_browser(full_report, script, tmp_path)
    assert outcome["shown"] == {"values": ["54.00", "68.40", "1.000", "1.000"], "display": "block"}
    assert outcome["after"] == [""] * 4
    assert outcome["hidden"] == "none"


def test_a_chip_hides_its_trace(full_report: Report, tmp_path: Path) -> None:
    script = """
      const chip = document.querySelectorAll(".chip")[1];
      chip.click();
      await later();
      const off = [gds[0].data[1].visible, chip.getAttribute("aria-pressed")];
      chip.click();
      await later();
      done({ off, on: [gds[0].data[1].visible, chip.getAttribute("aria-pressed")] });
    """
    outcome = run_in_browser(full_report, script, tmp_path)
    assert outcome == {"off": [False, "false"], "on": [True, "true"]}


def test_names_from_a_log_are_text_in_the_browser_too(tmp_path: Path) -> None:
    hostile = "<img src=x onerror=document.title='hit'></script><script>document.title='hit'</script><b>%{y}</b>&lt;"
    x = np.array([0.0, 1.0, 2.0])
    lane = Lane(hostile, (Span(0.0, 1.0, hostile),), (Event(1.5, hostile),))
    panel = Panel(hostile, hostile, (Trace(hostile, x, x, group=hostile),))
    report = Report(hostile, sections=(Section(hostile, (panel,), (lane,)),))
    script = """
      Plotly.Fx.hover(gds[0], [{ curveNumber: 0, pointNumber: 1 }]);
      await later();
      const hover = gds[0].querySelector(".hoverlayer");
      done({
        title: document.title, scripts: document.scripts.length, images: document.images.length,
        hover: hover.textContent, bold: hover.innerHTML.includes("font-weight:bold"),
        chip: document.querySelector(".chip").textContent, lane: document.querySelector(".lane h4").textContent,
      });
    """
    outcome = run_in_browser(report, script, tmp_path)
    assert outcome["title"] == outcome["lane"] == hostile
    assert outcome["chip"].startswith(hostile)
    assert hostile in outcome["hover"]
    assert (outcome["scripts"], outcome["images"], outcome["bold"]) == (4, 0, False)
