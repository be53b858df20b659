"""The page in a real browser: it draws, zooms together, and runs nothing that a log wrote."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.report.html import render_html
from hil.report.report import Chart, Curve, Event, Lane, Panel, Report, Section, Span, Table, Trace

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--hide-scrollbars",
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


def run_in_browser(report: Report, script: str, folder: Path, *flags: str) -> Any:
    """Open the report, run ``script`` once all is drawn, and return what it gives to ``done``."""
    driver = f"""<script>
    (function wait() {{
      if (document.documentElement.dataset.ready !== "yes") return setTimeout(wait, 20);
      const overs = [...document.querySelectorAll(".u-over")];
      const mouse = (plot, kind, x, y, more) => {{  // x and y from 0 to 1 of the plotting area
        const box = overs[plot].getBoundingClientRect();
        const place = {{ clientX: box.left + x * box.width, clientY: box.top + y * box.height }};
        const init = {{ bubbles: true, button: 0, movementX: 1, ...place, ...more }};
        overs[plot].dispatchEvent(new MouseEvent(kind, init));
        return later();
      }};
      const drag = async (plot, from, to, more) => {{
        await mouse(plot, "mousemove", ...from);
        await mouse(plot, "mousedown", ...from, more);
        await mouse(plot, "mousemove", ...to, more);
        await mouse(plot, "mouseup", ...to, more);
      }};
      const later = () => new Promise((resolve) => setTimeout(resolve, 60));
      const inked = (plot, ...colour) => {{  // whether a line of this colour is drawn
        const {{ ctx, bbox }} = plots[plot].u;
        const {{ data }} = ctx.getImageData(bbox.left, bbox.top, bbox.width, bbox.height);
        let count = 0;
        for (let i = 0; i < data.length; i += 4) {{
          count += data[i + 3] > 200 && colour.every((c, k) => data[i + k] === c);
        }}
        return count > 200;
      }};
      let plots;
      const done = (value) => {{
        const pre = document.createElement("pre");
        pre.id = "outcome";
        pre.textContent = JSON.stringify(value);
        document.body.append(pre);
      }};
      (async () => {{ ({{ plots }} = await page); {script} }})().catch((error) => done({{ error: String(error) }}));
    }})();
    </script>"""
    path = folder / "report.html"
    path.write_text(render_html(report).replace("</body>", driver + "</body>"), encoding="utf-8")
    assert CHROMIUM is not None
    command = [
        CHROMIUM,
        *FLAGS,
        f"--user-data-dir={folder / 'profile'}",
        "--window-size=1200,900",
        *flags,
        path.as_uri(),
    ]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    found = re.search(r'<pre id="outcome">(.*?)</pre>', dom, re.DOTALL)
    assert found, "the script did not finish"
    outcome = json.loads(unescape(found.group(1)))
    assert "error" not in outcome, outcome
    return outcome


def test_zooming_one_panel_zooms_the_others_and_the_timeline(full_report: Report, tmp_path: Path) -> None:
    script = """
      const state = () => ({
        ranges: plots.slice(0, 2).map((plot) => [plot.u.scales.x.min, plot.u.scales.x.max]),
        y: plots[1].y,
        span: document.querySelectorAll(".span")[1].style.cssText,
        event: document.querySelector(".event").style.left,
        window: document.querySelector(".window").textContent,
      });
      const before = state();
      await drag(1, [0.25, 0.5], [0.75, 0.5]);
      const zoomed = state();
      document.querySelector("[data-do=in]").click();
      await later();
      const button = state();
      await drag(0, [0.5, 0.5], [0.25, 0.5], { shiftKey: true });
      const panned = state();
      await drag(1, [0.1, 0.25], [0.9, 0.75]);
      const boxed = state();
      await mouse(0, "dblclick", 0.5, 0.5);
      const width = document.querySelector(".bar").clientWidth;
      done({ before, zoomed, button, panned, boxed, after: state(), width, chart: plots[2].u.scales.x.max });
    """
    outcome = run_in_browser(full_report, script, tmp_path)

    def near(start: float, end: float) -> list[object]:
        return [[pytest.approx(start, abs=0.01), pytest.approx(end, abs=0.01)]] * 2

    assert outcome["before"]["ranges"] == [[0.0, 2.0]] * 2
    assert outcome["zoomed"]["ranges"] == near(0.5, 1.5)
    assert outcome["zoomed"]["ranges"][0] == outcome["zoomed"]["ranges"][1]
    assert outcome["zoomed"]["y"] == outcome["before"]["y"]  # a flat selection is one of times
    assert re.fullmatch(r"(0.49|0.50)\d s to (1.49|1.50)\d s", outcome["zoomed"]["window"])
    assert outcome["button"]["ranges"] == near(0.75, 1.25)
    assert outcome["panned"]["ranges"] == near(0.875, 1.375)
    low, high = outcome["before"]["y"]
    assert outcome["boxed"]["y"] == [pytest.approx(low + part * (high - low), abs=0.05) for part in (0.25, 0.75)]
    assert outcome["after"] == outcome["before"]
    assert outcome["chart"] > 300.0  # a chart has an axis of its own, in %
    # NORMAL lasts from 0.25 to 2 s, bus off is at 1.25 s.
    assert outcome["zoomed"]["span"].startswith("left: 0px")
    at = float(outcome["zoomed"]["event"].removesuffix("px"))
    assert at == pytest.approx(0.75 * outcome["width"], abs=3.0)


def test_pointing_at_one_panel_reads_all(full_report: Report, tmp_path: Path) -> None:
    script = """
      const read = () => [...document.querySelectorAll(".linked .chip output")].map((output) => output.textContent);
      const cursor = document.querySelector(".linked .cursor");
      await mouse(0, "mousemove", 0.5, 0.5);
      const shown = { values: read(), display: cursor.style.display };
      await mouse(0, "mousemove", 0.3, 0.5);
      const gap = read();
      overs[0].dispatchEvent(new MouseEvent("mouseleave"));
      await later();
      const after = read();
      plots[1].element.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
      done({ shown, gap, after, keys: read(), tab: plots[1].element.tabIndex });
    """
    outcome = run_in_browser(full_report, script, tmp_path)
    assert outcome["shown"] == {"values": ["54.00", "68.40", "1.000", "1.000"], "display": "block"}
    assert outcome["gap"][2:] == ["–", "0.600"]
    assert outcome["after"] == [""] * 4
    assert outcome["keys"] == ["53.64", "68.33", "1.020", "1.020"]  # a hundredth right of the middle
    assert outcome["tab"] == 0


def test_a_chart_tells_the_point_under_the_mouse(full_report: Report, tmp_path: Path) -> None:
    script = """
      const told = async (k, x, y) => {
        const { u } = plots[k], box = u.over;
        await mouse(k, "mousemove", u.valToPos(x, "x") / box.clientWidth, u.valToPos(y, "y") / box.clientHeight);
        const tip = box.querySelector(".tip");
        return [tip.hidden, tip.textContent];
      };
      done({ band: await told(2, 200, 4), row: await told(3, 200, 2), line: await told(3, 150, 0.5),
             none: await told(3, 260, 1) });
    """
    outcome = run_in_browser(full_report, script, tmp_path)
    assert outcome == {
        "band": [False, "model\n200 %\n4 N\n2 N to 6 N"],
        "row": [False, "radius\ngain\n200\n180 to 220"],
        "line": [False, "asked\n150"],
        "none": [True, "asked\n150"],
    }


def test_a_chip_hides_its_trace(full_report: Report, tmp_path: Path) -> None:
    script = """
      const chip = document.querySelectorAll(".chip")[1];
      const state = () => [chip.getAttribute("aria-pressed"), inked(0, 0x00, 0x72, 0xb2)];
      const before = state();
      chip.focus();
      chip.click();
      await later();
      const off = state();
      chip.click();
      await later();
      done({ before, off, on: state(), focused: document.activeElement === chip });
    """
    outcome = run_in_browser(full_report, script, tmp_path)
    on = ["true", True]
    assert outcome == {"before": on, "off": ["false", False], "on": on, "focused": True}


def test_the_paper_follows_the_reader_while_open(full_report: Report, tmp_path: Path) -> None:
    script = """
      const seen = () => ({
        bright: inked(0, 0xe3, 0xe8, 0xed), dark: inked(0, 0x1b, 0x27, 0x33),
        paper: getComputedStyle(document.body).backgroundColor,
      });
      const open = seen();
      dispatchEvent(new Event("beforeprint"));
      await later();
      const printed = { ...seen(), wide: document.querySelector("main").offsetWidth };
      dispatchEvent(new Event("afterprint"));
      await later();
      done({ open, printed, again: seen() });
    """
    light = {"bright": False, "dark": True, "paper": "rgb(255, 255, 255)"}
    outcome = run_in_browser(full_report, script, tmp_path)
    assert outcome["open"] == outcome["again"] == light
    outcome = run_in_browser(full_report, script, tmp_path, "--blink-settings=preferredColorScheme=0")
    assert outcome["open"] == outcome["again"] == {"bright": True, "dark": False, "paper": "rgb(18, 22, 27)"}
    assert outcome["printed"] == light | {"wide": 700}


def test_a_gap_is_no_line_a_step_holds_and_a_lonely_sample_is_a_dot(tmp_path: Path) -> None:
    t_s = np.arange(5.0)
    gap = Trace("gap", t_s, np.array([1.0, 1.0, np.nan, 1.0, 1.0]))
    lonely = Trace("lonely", t_s, np.array([np.nan, 1.0, np.nan, 1.0, 1.0]))
    steps = Trace("steps", np.array([0.0, 4.0]), np.array([0.0, 1.0]), "steps")
    line = Trace("line", np.array([0.0, 4.0]), np.array([0.0, 1.0]))
    panels = tuple(Panel(trace.name, "", (trace,)) for trace in (gap, lonely, steps, line))
    script = """
      const drawn = (k, t, y) => {
        const { u } = plots[k];
        const at = [u.valToPos(t, "x", true), u.valToPos(y, "y", true)].map(Math.round);
        const { data } = u.ctx.getImageData(at[0] - 1, at[1] - 2, 3, 5);
        return Array.from({ length: 15 }, (_, i) => data.slice(4 * i, 4 * i + 3)).some((c) => c[2] > c[0] + 60);
      };
      done({
        gap: [drawn(0, 0.5, 1), drawn(0, 1.5, 1), drawn(0, 2.5, 1), drawn(0, 3.5, 1)],
        lonely: [drawn(1, 0.5, 1), drawn(1, 1, 1), drawn(1, 1.5, 1), drawn(1, 3.5, 1)],
        steps: [drawn(2, 2, 0), drawn(2, 2, 0.5)],
        line: [drawn(3, 2, 0), drawn(3, 2, 0.5)],
      });
    """
    outcome = run_in_browser(Report("r", sections=(Section("s", panels),)), script, tmp_path)
    assert outcome == {
        "gap": [True, False, False, True],
        "lonely": [False, True, False, True],
        "steps": [True, False],
        "line": [False, True],
    }


@pytest.mark.parametrize("width", [500, 1400])  # no window of Chromium is narrower than 500 px
def test_no_number_is_broken_and_nothing_lies_beside_the_page(width: int, full_report: Report, tmp_path: Path) -> None:
    wide = Table(
        "Wide",
        ("claim", "found (95 %)", "unit", *(f"number {k}" for k in range(12))),
        (("a claim in many words that may well take two lines or more", "0.001 / 596", "m/s²", *[-0.8125e-3] * 12),)
        * 2,
    )
    report = replace(full_report, sections=(*full_report.sections, Section("Tables", tables=(wide,))))
    script = """
      const lines = (cell) => {
        const range = document.createRange();
        range.selectNodeContents(cell);
        return new Set([...range.getClientRects()].map((box) => Math.round(box.top))).size;
      };
      const broken = [...document.querySelectorAll("td.n, td.s")].filter((cell) => lines(cell) > 1);
      done({ broken: broken.map((cell) => cell.textContent), page: document.documentElement.scrollWidth,
             window: innerWidth, plots: plots.map((plot) => plot.u.width <= innerWidth) });
    """
    outcome = run_in_browser(report, script, tmp_path, f"--window-size={width},900")
    assert outcome == {"broken": [], "page": width, "window": width, "plots": [True] * 4}


def test_odd_values_are_drawn(tmp_path: Path) -> None:
    x = np.array([0.0, 1.0, 2.0])
    ys = (
        [1e300, -1e300, 0.0],
        [1e-30, 3e-30, np.nan],
        [5.0, 5.0, 5.0],
        [np.nan] * 3,
        [np.inf, 1.0, -np.inf],
        [0.0] * 3,
    )
    panels = [Panel("p", "", (Trace("t", x, np.array(y)),)) for y in ys]
    panels.append(Panel("names", "", (Trace("t", x, np.array([0.0, 2.0, 1.0]), "steps"),), ("off", "on", "failed")))
    panels += [Panel("empty", ""), Panel("never", "", (Trace("t", np.empty(0), np.empty(0)),))]
    report = Report("odd", sections=(Section("s", tuple(panels)),))
    script = """
      await mouse(0, "mousemove", 0.7, 0.5);
      const read = [...document.querySelectorAll(".chip output")].map((output) => output.textContent);
      const ticks = plots.map((plot) => plot.u.axes[1]._values ?? []);
      done({ read, ticks, lefts: [...new Set(plots.map((plot) => plot.u.bbox.left / uPlot.pxRatio))] });
    """
    outcome = run_in_browser(report, script, tmp_path)
    assert outcome["read"] == ["-1.000e+300", "3.000e-30", "5.000", "–", "1.000", "0", "failed", ""]
    assert outcome["ticks"][6] == ["off", "on", "failed"]
    assert "1e+300" in outcome["ticks"][0]
    assert all(len(ticks) > 1 for ticks in outcome["ticks"])
    assert len(outcome["lefts"]) == 1  # the times of all panels stand below each other


def test_names_from_a_log_are_text_in_the_browser_too(tmp_path: Path) -> None:
    hostile = "<img src=x onerror=document.title='hit'></script><script>document.title='hit'</script><b>%{y}</b>&lt;"
    x = np.array([0.0, 1.0, 2.0])
    lane = Lane(hostile, (Span(0.0, 1.0, hostile),), (Event(1.5, hostile),))
    panel = Panel(hostile, hostile, (Trace(hostile, x, x, group=hostile),), (hostile, "b", "c"))
    chart = Chart(hostile, hostile, hostile, hostile, hostile, (Curve(hostile, x, x),))
    rows = Chart(hostile, hostile, "", hostile, hostile, (Curve(hostile, x + 1.0, x, style="points"),), (hostile,) * 3)
    report = Report(hostile, sections=(Section(hostile, (panel,), (lane,), (chart, rows)),))
    script = """
      await mouse(0, "mousemove", 0.02, 0.5);
      await mouse(1, "mousemove", 0.5, 0.5);
      await mouse(2, "mousemove", 0.5, 0.5);
      const tips = [1, 2].map((k) => overs[k].querySelector(".tip"));
      done({
        title: document.title, scripts: document.scripts.length, images: document.images.length,
        tips: tips.map((tip) => tip.textContent), tags: tips.map((tip) => tip.childElementCount),
        chip: document.querySelector(".chip").textContent, lane: document.querySelector(".lane h4").textContent,
        bold: document.querySelectorAll("main b").length,
      });
    """
    outcome = run_in_browser(report, script, tmp_path)
    assert outcome["title"] == outcome["lane"] == hostile
    assert outcome["chip"] == hostile + hostile  # name, and the value's name at the cursor
    assert outcome["tips"] == [
        "\n".join((hostile, f"1 {hostile}", f"1 {hostile}")),
        "\n".join((hostile,) * 2 + (f"1 {hostile}",)),
    ]
    assert outcome["tags"] == [0, 0]
    assert (outcome["scripts"], outcome["images"], outcome["bold"]) == (4, 0, 2)  # of span and event


def test_a_long_run_is_small_and_quickly_drawn(tmp_path: Path) -> None:
    t_s = np.arange(0.0, 60.0, 0.01)
    noise = np.random.default_rng(1).normal(size=(39, t_s.size))
    panels = tuple(
        Panel(f"p{i}", "N", tuple(Trace(f"{i}.{k}", t_s, noise[3 * i + k]) for k in range(3))) for i in range(13)
    )
    report = Report("r", sections=(Section("s", panels),))
    assert len(render_html(report)) < 1_000_000
    script = "done(plots.map((plot) => plot.traces.map((trace) => trace.y.length)));"
    outcome = run_in_browser(report, script, tmp_path)
    assert len(outcome) == 13
    assert sum(map(sum, outcome)) > 100_000
