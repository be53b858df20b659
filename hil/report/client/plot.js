"use strict";
// One plot: uPlot has canvas, axes, scales and the selection; lines, points and intervals are draw.js's.

const INK = "#1B2733"; // drawn in the paper's ink
const DOT = 2.7; // CSS px, radius of a point
const REACH = 40; // CSS px from which a chart's point is read

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Text that fits `most` CSS px.
const ruler = document.createElement("canvas").getContext("2d");
function fitted(text, font, most) {
  ruler.font = font;
  if (ruler.measureText(text).width <= most) return text;
  while (text && ruler.measureText(text + "…").width > most) text = text.slice(0, -1);
  return text + "…";
}

function widest(texts, font) {
  ruler.font = font;
  return Math.max(0, ...texts.map((text) => ruler.measureText(text).width));
}

// Numbers at an axis: no more digits than its step has.
function tickTexts(values, step) {
  const largest = Math.max(...values.map(Math.abs));
  if (largest >= 1e6 || (largest > 0 && largest < 1e-3)) {
    return values.map((v) => (v === 0 ? "0" : Number(v.toPrecision(7)).toExponential()));
  }
  let decimals = 0;
  while (decimals < 12 && Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) > 1e-6) decimals++;
  return values.map((v) => v.toFixed(decimals).replace(/^-(0\.?0*)$/, "$1")); // no minus zero
}

// A power of ten that brings values where uPlot can divide an axis; 1 for all usual ones.
function scaleFor(range) {
  const largest = Math.max(Math.abs(range[0]), Math.abs(range[1]));
  return largest > 1e12 || (largest > 0 && largest < 1e-9) ? 10 ** -Math.floor(Math.log10(largest)) : 1;
}

const gaps = (values) => values && Float64Array.from(values, (v) => v ?? NaN);

class Plot {
  constructor(element, figure, times) {
    this.element = element;
    this.figure = figure;
    this.rows = figure.rows;
    this.timed = figure.kind === "panel";
    this.traces = figure.traces.map((trace) => ({
      ...trace, shown: true, y: gaps(trace.y), low: gaps(trace.low), high: gaps(trace.high),
      x: typeof trace.x === "number" ? times[trace.x] : gaps(trace.x),
    }));
    this.full = this.all();
    [this.x, this.y] = this.full;
    [this.kx, this.ky] = this.full.map(scaleFor);
    this.font = `12px ${getComputedStyle(document.body).fontFamily}`;
    this.chips = [...element.closest("figure").querySelectorAll(".chip")];
    this.moved = (x) => this.show(x, this.y); // who links plots takes these over
    this.pointed = () => {};
    this.u = new uPlot(this.options(), [[0, 1], [null, null]], element);
    this.tip = this.u.over.appendChild(document.createElement("div"));
    this.tip.className = "tip";
    this.tip.hidden = true;
    new ResizeObserver(() => this.fit()).observe(element);
    for (const [i, chip] of this.chips.entries()) chip.onclick = () => this.toggle(i, chip);
  }

  // Ranges of x and y that show everything.
  all() {
    const x = [Infinity, -Infinity], y = [Infinity, -Infinity];
    const widen = (range, values) => {
      for (const v of values ?? []) if (Number.isFinite(v)) { range[0] = Math.min(range[0], v); range[1] = Math.max(range[1], v); }
    };
    for (const trace of this.traces.filter((trace) => trace.shown)) {
      widen(x, trace.x);
      widen(y, trace.y);
      widen(this.rows ? x : y, trace.low);
      widen(this.rows ? x : y, trace.high);
    }
    const roomy = ([low, high], part) => {
      if (low > high) return [0, 1];
      const room = high > low ? part * (high - low) : Math.max(Math.abs(low) * 0.1, low === 0 ? 1 : 0);
      return [low - room, high + room];
    };
    return [this.figure.x.range ?? roomy(x, 0.04), this.figure.y.range ?? roomy(y, 0.06)];
  }

  options() {
    const line = (name) => () => style(name);
    const axis = (spec, more) => ({
      stroke: line("--soft"), grid: { stroke: line("--grid"), width: 1 }, font: this.font, gap: 3,
      ticks: { stroke: line("--rule"), width: 1, size: 4 }, border: { show: true, stroke: line("--rule"), width: 1 },
      ...(spec.label ? { label: spec.label, labelFont: this.font, labelSize: 17, labelGap: 0 } : {}), ...more,
    });
    const numbers = (k) => (u, splits, i, space, step) => tickTexts(splits.map((v) => v / k), step / k);
    const named = (names) => names && { splits: () => names.map((_, i) => i + (this.rows ? 1 : 0)), values: () => this.cut(names) };
    const names = this.rows ?? this.figure.y.names;
    return {
      width: this.element.clientWidth, height: this.element.clientHeight, legend: { show: false },
      padding: [6, parseFloat(style("--right")), 0, 0],
      scales: {
        x: { time: false, range: () => this.x.map((v) => v * this.kx) },
        y: { range: () => this.y.map((v) => v * this.ky), dir: this.rows ? -1 : 1 },
      },
      series: [{}, { stroke: null }],
      axes: [
        axis(this.figure.x, { space: 75, size: 24, values: numbers(this.kx) }),
        axis(this.figure.y, {
          space: 28, values: numbers(this.ky), ...named(names),
          size: (u, values) => this.left ?? Math.max(this.timed ? 0 : 34, widest(values ?? [], this.font) + 9),
        }),
      ],
      cursor: {
        x: false, y: false, points: { show: false }, drag: { x: true, y: true, uni: 24, dist: 4, setScale: false },
        bind: {
          dblclick: () => () => this.moved(null),
          mousedown: (u, target, select) => (event) => {
            if (event.button === 0) (event.shiftKey ? this.drag(event) : select(event));
          },
        },
      },
      hooks: { draw: [() => this.draw()], setCursor: [() => this.read()], setSelect: [() => this.zoom()] },
    };
  }

  cut(names) {
    const most = this.element.clientWidth * 0.4;
    return names.map((name) => fitted(name, this.font, most));
  }

  // CSS px that the y axis needs.
  need() {
    return this.figure.y.names ? widest(this.cut(this.figure.y.names), this.font) + 12 : 0;
  }

  show(x, y) {
    const kx = this.kx, ky = this.ky;
    if (x === null) [x, y] = this.all();
    const least = (this.full[0][1] - this.full[0][0]) * 1e-6;
    if (!(x[1] - x[0] >= least)) x = [(x[0] + x[1] - least) / 2, (x[0] + x[1] + least) / 2];
    [this.x, this.y] = [x, y ?? this.all()[1]];
    this.u.batch(() => {
      this.u.setScale("x", { min: this.x[0] * kx, max: this.x[1] * kx });
      this.u.setScale("y", { min: this.y[0] * ky, max: this.y[1] * ky });
    });
    this.u.redraw(false, true);
  }

  fit() {
    const width = this.element.clientWidth, height = this.element.clientHeight;
    if (width && (width !== this.u.width || height !== this.u.height)) this.u.setSize({ width, height });
  }

  toggle(i, chip) {
    const trace = this.traces[i];
    trace.shown = !trace.shown;
    chip.setAttribute("aria-pressed", trace.shown);
    this.show(this.x, null);
  }

  // What was selected with the mouse; a flat selection keeps all of y.
  zoom() {
    const { left, top, width, height } = this.u.select, all = this.u.over;
    this.u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    if (width < 4 && height < 4) return;
    const x = [left, left + width].map((px) => this.u.posToVal(px, "x") / this.kx);
    const y = [top + height, top].map((px) => this.u.posToVal(px, "y") / this.ky).sort((a, b) => a - b);
    this.moved(width < all.clientWidth ? x : this.x, height < all.clientHeight ? y : this.y);
  }

  // Moves what is shown with the mouse.
  drag(event) {
    const { clientX, clientY } = event, [x, y] = [this.x, this.y], over = this.u.over;
    const move = (now) => {
      const dx = (now.clientX - clientX) / over.clientWidth * (x[1] - x[0]);
      const dy = (now.clientY - clientY) / over.clientHeight * (y[1] - y[0]) * (this.rows ? -1 : 1);
      this.moved(x.map((v) => v - dx), this.timed ? this.y : y.map((v) => v + dy));
    };
    document.addEventListener("mousemove", move);
    document.addEventListener("mouseup", () => document.removeEventListener("mousemove", move), { once: true });
    event.preventDefault();
  }

  read() {
    const { left, top } = this.u.cursor;
    if (this.timed) return this.pointed(left < 0 ? null : this.u.posToVal(left, "x") / this.kx);
    this.tip.hidden = true;
    if (left < 0) return;
    const [X, Y] = this.places(false);
    const found = { distance: REACH };
    for (const [k, trace] of this.traces.entries()) {
      for (let i = 0; trace.shown && i < trace.x.length; i++) {
        const distance = Math.hypot(X(trace.x[i]) - left, Y(trace.y[i]) - top);
        if (distance < found.distance) Object.assign(found, { distance, k, i });
      }
    }
    if (found.k !== undefined) this.tell(found, X, Y);
  }

  tell({ k, i }, X, Y) {
    const trace = this.traces[k], { x, y } = this.figure;
    const value = (v, axis) => `${Number(v.toPrecision(5))} ${axis.unit ?? ""}`.trim();
    const lines = [trace.name, value(trace.x[i], x)];
    if (!this.rows) lines.push(value(trace.y[i], y));
    else if (trace.points) lines.unshift(this.rows[Math.round(trace.y[i]) - 1]);
    if (trace.low) lines.push(`${value(trace.low[i], this.rows ? x : y)} to ${value(trace.high[i], this.rows ? x : y)}`);
    this.tip.textContent = lines.join("\n");
    this.tip.hidden = false;
    const px = X(trace.x[i]), right = px > this.u.over.clientWidth / 2;
    this.tip.style.left = right ? "" : `${px + 8}px`;
    this.tip.style.right = right ? `${this.u.over.clientWidth - px + 8}px` : "";
    this.tip.style.top = `${Math.max(0, Math.min(Y(trace.y[i]) - 8, this.u.over.clientHeight - this.tip.offsetHeight))}px`;
  }

  // Text of a trace's value at time t.
  text(k, t) {
    const { x, y, steps } = this.traces[k], { names, decimals } = this.figure.y;
    if (!x.length) return "";
    const v = y[steps ? latest(x, t) : nearest(x, t)];
    if (Number.isNaN(v)) return "–";
    if (names) return names[v] ?? "";
    return decimals === null ? v.toPrecision(4) : v.toFixed(decimals).replace(/^-(0\.?0*)$/, "$1");
  }

  // Values to px of the canvas, or to CSS px of the plotting area.
  places(canvas) {
    return [["x", this.kx], ["y", this.ky]].map(([key, k]) => {
      const { min, max } = this.u.scales[key];
      const from = this.u.valToPos(min, key, canvas), slope = (this.u.valToPos(max, key, canvas) - from) / (max - min);
      return (v) => Math.max(-1e6, Math.min(1e6, from + (v * k - min) * slope)); // far outside stays a number; NaN stays
    });
  }

  draw() {
    const { ctx, bbox } = this.u, ratio = uPlot.pxRatio;
    const [X, Y] = this.places(true), seen = this.timed ? this.x : null;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const trace of this.traces.filter((trace) => trace.shown)) {
      const colour = trace.colour === INK ? style("--ink") : trace.colour;
      ctx.strokeStyle = ctx.fillStyle = colour;
      ctx.lineJoin = "round";
      ctx.lineWidth = 1.2 * ratio;
      ctx.setLineDash([]);
      if (trace.low) (trace.points ? drawBars : drawBand)(ctx, trace, X, Y, this.rows, ratio);
      if (trace.points) {
        ctx.globalAlpha = 0.75;
        drawDots(ctx, trace, X, Y, seen, DOT * ratio, () => true);
      } else {
        ctx.lineWidth = trace.width * ratio;
        ctx.setLineDash((trace.dash ?? []).map((length) => length * ratio));
        drawLine(ctx, trace, X, Y, seen);
        const { y } = trace; // no line shows a sample between two gaps
        drawDots(ctx, trace, X, Y, seen, 1.3 * ratio, (i) => !(y[i - 1] === y[i - 1]) && !(y[i + 1] === y[i + 1]));
      }
      ctx.globalAlpha = 1;
    }
    ctx.restore();
  }
}
