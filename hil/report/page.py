"""The fixed parts of the HTML report: head, style and script."""

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

STYLE = """
:root {
  --paper: #ffffff; --sheet: #ffffff; --ink: #1b2733; --soft: #57636f; --rule: #d9dfe5; --grid: #e8ecf0;
  --wash: #f5f7f9; --good: #1d7a4f; --bad: #b3261e; --open: #9a6700;
}
@media (prefers-color-scheme: dark) {
  :root {
    --paper: #12161b; --sheet: #171c22; --ink: #e3e8ed; --soft: #9aa6b2; --rule: #303943; --grid: #262e37;
    --wash: #1d242c; --good: #4fbf8b; --bad: #f2827a; --open: #e0b04c;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--paper); color: var(--ink);
  font: 14px/1.45 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, "DejaVu Sans", sans-serif;
}
main { max-width: 1240px; margin: 0 auto; padding: 28px 24px 40px; }
h1 { font-size: 24px; line-height: 1.2; font-weight: 650; margin: 0 0 8px; overflow-wrap: anywhere; }
h2 { font-size: 18px; font-weight: 650; margin: 0 0 10px; padding-top: 22px; border-top: 1px solid var(--rule); }
h3 { font-size: 14px; font-weight: 650; margin: 0; }
h4 { font-size: 12px; font-weight: 500; color: var(--soft); margin: 0; }
h3 small { font-weight: 400; color: var(--soft); font-size: 12px; margin-left: 3px; }
p { margin: 0 0 10px; max-width: 80ch; overflow-wrap: anywhere; }
header p { font-size: 15px; display: flex; flex-wrap: wrap; gap: 6px 10px; align-items: center; }
section { margin-top: 26px; }
.badge { font-weight: 650; font-size: 13px; padding: 3px 11px; border-radius: 4px; color: #fff; white-space: nowrap; }
.badge.passed { background: #1d7a4f; }
.badge.failed, .badge.broken { background: #b3261e; }
.badge.inconclusive, .badge.incomplete { background: #9a6700; }

.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(178px, 1fr)); gap: 10px; margin: 18px 0 0; }
.card { border: 1px solid var(--rule); border-radius: 6px; padding: 9px 12px 10px; background: var(--sheet); }
.card.long { grid-column: span 2; }
.card.missed { border-color: var(--bad); box-shadow: inset 3px 0 var(--bad); }
.card dt { color: var(--soft); font-size: 12px; overflow-wrap: anywhere; }
.card dd { margin: 0; overflow-wrap: anywhere; }
.card .value { font-size: 22px; line-height: 1.3; font-weight: 600; font-variant-numeric: tabular-nums; }
.card.long .value { font-size: 15px; line-height: 1.9; }
.card .value small { font-size: 13px; font-weight: 400; color: var(--soft); }
.card .limit, .card .note, .note { font-size: 12px; color: var(--soft); }
.met .limit { color: var(--good); } .missed .limit { color: var(--bad); }

.tools {
  display: flex; justify-content: space-between; align-items: center; gap: 10px; position: sticky; top: 0; z-index: 5;
  background: var(--paper); padding: 6px 0; font-variant-numeric: tabular-nums; color: var(--soft); font-size: 12px;
}
.at { color: var(--ink); }
.hint { margin-left: auto; }
@media (pointer: coarse), (max-width: 640px) { .hint { display: none; } }
.buttons { display: flex; gap: 4px; }
.buttons button {
  font: inherit; color: var(--ink); background: var(--wash); border: 1px solid var(--rule); border-radius: 4px;
  min-width: 32px; height: 26px; cursor: pointer;
}
.timeline { position: relative; padding-bottom: 4px; }
.lane { margin: 4px 0 6px; }
.lane h4 { margin-left: var(--left); }
.lane:not(:has(h4)) { margin-top: -3px; }
.bar {
  position: relative; height: 22px; margin: 1px var(--right) 0 var(--left); background: var(--wash); overflow: hidden;
  border-radius: 3px;
}
.span, .event { position: absolute; top: 0; height: 100%; font-size: 11.5px; line-height: 22px; white-space: nowrap; }
.span {
  background: color-mix(in srgb, var(--mark) 22%, var(--sheet)); border-left: 3px solid var(--mark); overflow: hidden;
  min-width: 3px;
}
.span b[hidden] { display: none; }
.span b { font-weight: 550; padding: 0 5px; display: block; overflow: hidden; text-overflow: ellipsis; }
.event i {
  position: absolute; left: -4.5px; top: 6.5px; width: 9px; height: 9px; background: var(--mark);
  transform: rotate(45deg);
}
.event b { font-weight: 450; position: absolute; left: 9px; }
.event.flip b { left: auto; right: 9px; }
.event.bare b { visibility: hidden; }
.warning b, .error b { font-weight: 600; }

.linked { position: relative; }
figure { margin: 12px 0 0; break-inside: avoid; }
figcaption { display: flex; flex-wrap: wrap; align-items: baseline; gap: 2px 4px; padding-left: var(--left); }
figcaption h3 { margin-right: 8px; }
.chip {
  font: inherit; font-size: 12px; color: var(--ink); background: none; border: 0; border-radius: 4px; padding: 1px 6px;
  cursor: pointer; display: inline-flex; align-items: center; gap: 6px; max-width: 100%; overflow-wrap: anywhere;
  text-align: left;
}
.chip:hover, .buttons button:hover { background: var(--grid); }
.chip[aria-pressed=false] { opacity: 0.4; text-decoration: line-through; }
.chip svg { flex: none; }
.chip output { font-variant-numeric: tabular-nums; font-weight: 600; }
.linked .chip output { min-width: 6.2ch; }  /* reading at the cursor moves nothing */
.holder { position: relative; }
.plot { height: 190px; }
.chart .plot { height: 300px; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 440px), 1fr)); gap: 8px 24px; }
.charts figcaption { padding-left: 0; }
.cursor {
  position: absolute; top: 0; bottom: 0; width: 0; border-left: 1px solid var(--soft); display: none;
  pointer-events: none;
}
.holder .cursor { top: 6px; bottom: 26px; }
.axis { text-align: center; color: var(--soft); font-size: 12px; margin: 0; max-width: none; }

details { margin-top: 10px; }
summary { cursor: pointer; color: var(--soft); }
.table { margin-top: 16px; }
.scroll { overflow-x: auto; margin-top: 6px; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 4px 14px 4px 0; border-bottom: 1px solid var(--grid); vertical-align: top; }
td { overflow-wrap: anywhere; }
thead th { color: var(--soft); font-weight: 550; border-bottom-color: var(--rule); }
.n { text-align: right; }
.run th { font-weight: 450; color: var(--soft); white-space: nowrap; }
.run td { font-family: ui-monospace, "SF Mono", Consolas, "DejaVu Sans Mono", monospace; font-size: 12px; }
.dot { display: inline-block; width: 8px; height: 8px; border-radius: 2px; background: var(--mark); margin-right: 7px; }

@media (max-width: 640px) {
  main { padding: 16px 12px 28px; }
  h1 { font-size: 20px; }
  .cards { grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 8px; }
  figcaption, .lane h4 { padding-left: 0; margin-left: 0; }
  figcaption h3 { flex-basis: 100%; }
  .chip { padding-left: 0; }
  .buttons button { min-width: 38px; height: 32px; }
}
@media print {
  main { max-width: none; padding: 0; }
  .tools { display: none; }
  .card, .lane, tr { break-inside: avoid; }
}
"""

SCRIPT = r"""
"use strict";
(() => {
  const spec = JSON.parse(document.getElementById("data").textContent);
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const INK = "#1B2733";  // drawn in the paper's ink
  const touch = matchMedia("(pointer: coarse)").matches;
  const config = {
    displayModeBar: false, responsive: true, typesetMath: false, doubleClick: "reset",
  };

  // Paper and ink follow the reader's light or dark setting; the colours of the traces suit both.
  function ink() {
    const colours = { "font.color": style("--soft") };
    colours["paper_bgcolor"] = colours["plot_bgcolor"] = "rgba(0,0,0,0)";
    colours["hoverlabel.bgcolor"] = style("--sheet");
    colours["hoverlabel.bordercolor"] = style("--rule");
    colours["hoverlabel.font.color"] = style("--ink");
    for (const axis of ["xaxis", "yaxis"]) {
      colours[axis + ".gridcolor"] = style("--grid");
      colours[axis + ".linecolor"] = colours[axis + ".tickcolor"] = style("--rule");
    }
    return colours;
  }

  async function draw(gd) {
    const figure = spec.figures[gd.dataset.figure];
    for (const trace of figure.data) if (typeof trace.x === "number") trace.x = spec.times[trace.x];
    const font = { family: getComputedStyle(document.body).fontFamily, size: 12 };
    const layout = { ...figure.layout, font, dragmode: touch ? false : "zoom", hoverlabel: { namelength: -1 } };
    gd.inked = figure.data.flatMap((trace, i) => trace.line?.color === INK ? [i] : []);
    await Plotly.newPlot(gd, figure.data, layout, config);
    await paint(gd);
  }

  function paint(gd) {
    return Plotly.update(gd, gd.inked.length ? { "line.color": style("--ink") } : {}, ink(), gd.inked);
  }

  function digits(v, decimals) {
    if (v === null || v === undefined) return "–";
    return decimals === null ? v.toPrecision(4) : v.toFixed(decimals).replace(/^-(0\.?0*)$/, "$1");  // no minus zero
  }

  function nearest(x, t) {
    let low = 0, high = x.length - 1;
    while (high - low > 1) { const mid = (low + high) >> 1; if (x[mid] > t) high = mid; else low = mid; }
    return Math.abs(x[low] - t) <= Math.abs(x[high] - t) ? low : high;
  }

  // Everything under one time axis: panels and timeline of a section.
  class Linked {
    constructor(root) {
      this.root = root;
      this.full = [Number(root.dataset.start), Number(root.dataset.end)];
      this.range = this.full;
      this.plots = [...root.querySelectorAll(".plot")];
      this.lanes = [...root.querySelectorAll(".bar")];
      for (const gd of this.plots) this.follow(gd);
      for (const button of root.querySelectorAll("[data-do]")) button.onclick = () => this.move(button.dataset.do);
      addEventListener("resize", () => this.place());
      this.place();
    }

    follow(gd) {
      gd.on("plotly_relayout", (change) => {
        if (change["xaxis.autorange"]) this.show(this.full, null);
        else if (change["xaxis.range"]) this.show(change["xaxis.range"], gd);
        else if ("xaxis.range[0]" in change) this.show([change["xaxis.range[0]"], change["xaxis.range[1]"]], gd);
      });
      gd.on("plotly_hover", (event) => this.point(event.points[0].x));
      gd.on("plotly_unhover", () => this.point(null));
    }

    show(range, origin) {
      const next = range.map(Number);
      if (next[0] === this.range[0] && next[1] === this.range[1] && origin) return;  // an echo of ourselves
      this.range = next;
      for (const gd of this.plots) if (gd !== origin) Plotly.relayout(gd, { "xaxis.range": [...next] });
      this.point(null);
      this.place();
    }

    move(how) {
      if (how === "all") return this.show(this.full, null);
      const [a, b] = this.range, length = b - a, middle = (a + b) / 2;
      const half = length * { in: 0.25, out: 1, left: 0.5, right: 0.5 }[how];
      const shift = length * ({ left: -0.25, right: 0.25 }[how] || 0);
      this.show([middle + shift - half, middle + shift + half], null);
    }

    place() {
      const [a, b] = this.range;
      this.root.querySelector(".window").textContent = `${a.toFixed(3)} s to ${b.toFixed(3)} s`;
      for (const bar of this.lanes) {
        const width = bar.clientWidth, px = (t) => (t - a) / (b - a) * width;
        for (const span of bar.querySelectorAll(".span")) {
          const from = Math.max(0, px(Number(span.dataset.start))), to = Math.min(width, px(Number(span.dataset.end)));
          span.style.left = from + "px";
          span.style.width = Math.max(0, to - from) + "px";
          span.style.visibility = to < from ? "hidden" : "";
          span.lastElementChild.hidden = to - from < 26;
        }
        // A label stands right of its mark, else left of it, else only in the table and the tip.
        const events = [...bar.querySelectorAll(".event")], at = events.map((e) => px(Number(e.dataset.start)));
        let used = 0;
        events.forEach((event, i) => {
          const label = event.lastElementChild.offsetWidth + 20;
          const room = Math.min(width, at[i + 1] ?? width) - at[i];
          const right = label <= room, left = !right && at[i] - label >= used;
          event.style.left = at[i] + "px";
          event.classList.toggle("flip", left);
          event.classList.toggle("bare", !right && !left);
          used = right ? at[i] + label : at[i] + 6;
        });
      }
    }

    point(t) {
      const [a, b] = this.range;
      this.root.querySelector(".at").textContent = t === null ? "" : `cursor at ${t.toFixed(3)} s`;
      for (const cursor of this.root.querySelectorAll(".cursor")) {
        const width = cursor.parentElement.clientWidth, left = parseFloat(style("--left"));
        cursor.style.display = t === null || t < a || t > b ? "none" : "block";
        cursor.style.left = left + (t - a) / (b - a) * (width - left - parseFloat(style("--right"))) + "px";
      }
      for (const gd of this.plots) {
        for (const chip of gd.closest("figure").querySelectorAll(".chip")) {
          const trace = gd.data[chip.dataset.trace];
          const none = t === null || !trace.x.length;
          chip.lastElementChild.textContent = none ? "" : digits(trace.y[nearest(trace.x, t)], gd.layout.meta.decimals);
        }
      }
    }
  }

  for (const chip of document.querySelectorAll(".chip")) {
    chip.onclick = () => {
      const on = chip.getAttribute("aria-pressed") !== "true";
      chip.setAttribute("aria-pressed", on);
      const gd = chip.closest("figure").querySelector(".plot");
      Plotly.restyle(gd, { visible: on }, [Number(chip.dataset.trace)]);
    };
  }

  const plots = [...document.querySelectorAll(".plot")];
  Promise.all(plots.map(draw)).then(() => {
    for (const root of document.querySelectorAll(".linked")) new Linked(root);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plots.forEach(paint));
    addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => part.open = true));
    document.documentElement.dataset.ready = "yes";
  });
})();
"""
