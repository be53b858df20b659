"use strict";
// The page: unpacks the numbers, draws the plots, and links all that lies under one time axis.

// Panels and timeline of a section.
class Linked {
  constructor(root, plots) {
    this.root = root;
    this.full = [Number(root.dataset.start), Number(root.dataset.end)];
    this.range = this.full;
    this.plots = plots;
    this.bars = [...root.querySelectorAll(".bar")];
    for (const plot of plots) this.follow(plot);
    for (const button of root.querySelectorAll("[data-do]")) button.onclick = () => this.move(button.dataset.do);
    new ResizeObserver(() => this.fit()).observe(root);
    this.fit();
  }

  follow(plot) {
    plot.moved = (x, y) => this.show(x ?? this.full, plot, y);
    plot.pointed = (t) => this.point(t);
    plot.element.tabIndex = 0;
    plot.element.onkeydown = (event) => {
      const [a, b] = this.range, steps = { ArrowLeft: -0.01, ArrowRight: 0.01 };
      const how = { "+": "in", "-": "out", "0": "all", Escape: "all" }[event.key];
      if (how) this.move(how);
      else if (!(event.key in steps)) return;
      else this.point(Math.max(a, Math.min(b, (this.at ?? (a + b) / 2) + steps[event.key] * (b - a))));
      event.preventDefault();
    };
    plot.element.onblur = () => this.point(null);
  }

  // One axis width for all panels, so that their times stand below each other.
  fit() {
    const least = parseFloat(style("--left")), left = Math.max(least, ...this.plots.map((plot) => plot.need()));
    this.root.style.setProperty("--axis", `${left}px`);
    for (const plot of this.plots) {
      if (plot.left !== left) { plot.left = left; plot.u.redraw(false, true); }
      plot.fit();
    }
    this.left = left;
    this.place();
  }

  // All panels over `range`; y only where it was selected, and of all panels when all is shown.
  show(range, origin, y) {
    const all = range === this.full;
    this.range = range;
    for (const plot of this.plots) plot.show(range, all ? null : plot === origin ? y ?? plot.y : plot.y);
    this.point(null);
    this.place();
  }

  move(how) {
    if (how === "all") return this.show(this.full);
    const [a, b] = this.range, length = b - a, middle = (a + b) / 2;
    const half = length * { in: 0.25, out: 1, left: 0.5, right: 0.5 }[how];
    const shift = length * ({ left: -0.25, right: 0.25 }[how] || 0);
    this.show([middle + shift - half, middle + shift + half]);
  }

  place() {
    const [a, b] = this.range;
    this.root.querySelector(".window").textContent = `${a.toFixed(3)} s to ${b.toFixed(3)} s`;
    for (const bar of this.bars) {
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
    const [a, b] = this.range, right = parseFloat(style("--right"));
    this.at = t;
    this.root.querySelector(".at").textContent = t === null ? "" : `cursor at ${t.toFixed(3)} s`;
    for (const cursor of this.root.querySelectorAll(".cursor")) {
      const width = cursor.parentElement.clientWidth;
      cursor.style.display = t === null || t < a || t > b ? "none" : "block";
      cursor.style.left = this.left + (t - a) / (b - a) * (width - this.left - right) + "px";
    }
    for (const plot of this.plots) {
      plot.chips.forEach((chip, k) => { chip.lastElementChild.textContent = t === null ? "" : plot.text(k, t); });
    }
  }
}

async function unpacked() {
  const packed = Uint8Array.from(atob(document.getElementById("data").textContent), (c) => c.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).json();
}

async function start() {
  const { times, figures } = await unpacked();
  const shared = times.map((t) => Float64Array.from(t));
  const plots = [...document.querySelectorAll(".plot")].map((e) => new Plot(e, figures[e.dataset.figure], shared));
  const linked = [...document.querySelectorAll(".linked")].map((root) =>
    new Linked(root, plots.filter((plot) => plot.timed && root.contains(plot.element))));
  const repaint = () => plots.forEach((plot) => plot.u.redraw(false, true));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  const print = (on) => { // dark ink on a sheet's width
    document.documentElement.toggleAttribute("data-print", on);
    if (on) for (const part of document.querySelectorAll("details")) part.open = true;
    plots.forEach((plot) => plot.fit());
    linked.forEach((part) => part.fit());
    repaint();
  };
  addEventListener("beforeprint", () => print(true));
  addEventListener("afterprint", () => print(false));
  return { plots, linked };
}

const page = start();
page.then(() => { document.documentElement.dataset.ready = "yes"; }, (error) => {
  const note = document.createElement("p");
  note.className = "badge failed";
  note.textContent = `No plots: ${error.message}. Chrome 111, Firefox 121, Safari 16.4 or newer draws them.`;
  document.querySelector("main").prepend(note);
});
