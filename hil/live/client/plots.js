"use strict";
// Plots that run with the time: uPlot has canvas, axes and scales, draw.js the lines.

const WHEELS = ["FL", "FR", "RL", "RR"], AXLE = { FL: "FRONT", FR: "FRONT", RL: "REAR", RR: "REAR" };
const DASH = [3, 2];

// Traces of all wheels: `pattern` holds {w} and {a}.
const wheels = (pattern, name, dash, convert) => WHEELS.map((w) => ({
  name: `${name} ${w.toLowerCase()}`.trim(), dash, convert, colour: `--${w.toLowerCase()}`,
  signal: pattern.replaceAll("{w}", w).replaceAll("{a}", AXLE[w]),
}));

const slip = (car) => (omega) => {
  const v = store.value("TRUTH_MOTION.SPEED");
  return v === null || Math.abs(v) < 1 ? null : 100 * (v - omega * car.wheel_radius_m) / v; // braking is positive
};

// Panels of our own bench: title, unit, least height of the y range, traces.
const ownPanels = (car) => [
  ["Speed", "km/h", 10, [{ name: "car", signal: "TRUTH_MOTION.SPEED", colour: "--ink", convert: (v) => 3.6 * v }]],
  ["Deceleration", "m/s²", 2, [
    { name: "demanded", signal: "BRAKE_STATUS.DEMANDED_DECELERATION", colour: "--soft", dash: [6, 3] },
    { name: "true", signal: "TRUTH_MOTION.ACCELERATION", colour: "--series0", convert: (v) => -v },
    { name: "accelerometer", signal: "BODY_MOTION.LONGITUDINAL_ACCELERATION", colour: "--series1", dash: DASH, convert: (v) => -v }]],
  ["Brake pressure", "bar", 10, [
    ...wheels("EHB_DEMAND_{a}.PRESSURE_DEMAND_{w}", "demanded", DASH), ...wheels("EHB_PRESSURE_{a}.PRESSURE_{w}", "")]],
  ["Motor torque", "N m", 50, [
    ...wheels("MOTOR_DEMAND_{a}.TORQUE_DEMAND_{w}", "demanded", DASH),
    ...wheels("MOTOR_STATUS_{a}.CURRENT_{w}", "", undefined, (v) => v * car.torque_constant_nm_a)]],
  ["Slip", "%", 2, wheels("WHEEL_SPEED_{a}.WHEEL_SPEED_{w}", "", undefined, slip(car))],
  ["Pad friction", "", 0.1, [
    ...wheels("TRUTH_PAD_FRICTION.PAD_FRICTION_{w}", "true"),
    ...wheels("BRAKE_ESTIMATE_{a}.PAD_FRICTION_{w}", "estimate", DASH)]],
  ["Disc temperature", "°C", 20, wheels("TRUTH_DISC_TEMPERATURE.DISC_TEMPERATURE_{w}", "", undefined, (v) => v - 273.15)],
  ["Pedal travel", "%", 10, [{ name: "channel 1", signal: "BRAKE_PEDAL.PEDAL_TRAVEL_1", colour: "--ink" }]],
];

class LivePlot {
  constructor(title, unit, least, traces, removed) {
    this.title = title;
    this.least = least;
    this.traces = traces.filter((trace) => store.has(trace.signal)).map((trace) => (
      { ...trace, shown: true, course: store.follow(trace.signal, trace.convert) }));
    this.seen = true;
    this.holder = element("div", { class: "plot" });
    const chips = this.traces.map((trace) => this.chip(trace));
    const close = removed ? [element("button", { class: "remove", title: "Remove", onclick: () => this.remove(removed) }, "×")] : [];
    this.figure = element("figure", { class: "panel", "data-title": title },
      element("figcaption", {}, element("h3", {}, title, element("small", {}, unit)), ...chips, ...close), this.holder);
    byId("plots").append(this.figure);
    this.u = new uPlot(this.options(), [[0, 1], [null, null]], this.holder);
    this.resized = new ResizeObserver(() => {
      const width = this.holder.clientWidth, height = this.holder.clientHeight;
      if (width) this.u.setSize({ width, height });
    });
    this.resized.observe(this.holder);
    this.watched = new IntersectionObserver(([entry]) => { this.seen = entry.isIntersecting; });
    this.watched.observe(this.figure);
  }

  chip(trace) {
    const line = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    line.setAttribute("width", 20);
    line.setAttribute("height", 10);
    line.setAttribute("aria-hidden", "true");
    const stroke = line.appendChild(document.createElementNS(line.namespaceURI, "line"));
    const place = { x1: 0, x2: 20, y1: 5, y2: 5, "stroke-width": 2.4, "stroke-dasharray": (trace.dash ?? []).join(" ") };
    for (const [key, value] of Object.entries(place)) stroke.setAttribute(key, value);
    stroke.style.stroke = `var(${trace.colour})`;
    trace.output = element("output");
    const chip = element("button", { class: "chip", "aria-pressed": "true", title: "Show or hide" }, line, trace.name, trace.output);
    chip.onclick = () => { trace.shown = !trace.shown; chip.setAttribute("aria-pressed", trace.shown); };
    return chip;
  }

  remove(removed) {
    for (const trace of this.traces) store.leave(trace.course);
    this.resized.disconnect();
    this.watched.disconnect();
    this.u.destroy();
    this.figure.remove();
    removed(this);
  }

  options() {
    const font = `12px ${getComputedStyle(document.body).fontFamily}`, line = (name) => () => style(name);
    const axis = (more) => ({
      stroke: line("--soft"), grid: { stroke: line("--grid"), width: 1 }, font, gap: 3,
      ticks: { stroke: line("--rule"), width: 1, size: 4 }, ...more,
    });
    this.x = [0, 1];
    this.y = [0, 1];
    return {
      width: this.holder.clientWidth || 300, height: this.holder.clientHeight || 170, legend: { show: false },
      padding: [6, parseFloat(style("--right")), 0, 0],
      scales: { x: { time: false, range: () => this.x }, y: { range: () => this.y } },
      series: [{}, { stroke: null }],
      axes: [axis({ space: 75, size: 24 }), axis({ space: 28, size: parseFloat(style("--left")) })],
      cursor: { show: false },
      hooks: { draw: [() => this.paint()] },
    };
  }

  // Shows the stretch from `from` to `to`, s.
  show(from, to) {
    for (const trace of this.traces) {
      const last = trace.course.last;
      put(trace.output, Number.isNaN(last) ? "–" : Math.abs(last) >= 1000 ? last.toFixed(0) : last.toPrecision(3));
    }
    if (!this.seen) return;
    let low = Infinity, high = -Infinity;
    for (const { course, shown } of this.traces) {
      const { x, y } = course;
      for (let i = x.length - 1; shown && i >= 0 && x[i] >= from; i--) {
        if (y[i] < low) low = y[i];
        if (y[i] > high) high = y[i];
      }
    }
    if (low > high) [low, high] = [0, this.least];
    const room = Math.max(this.least - (high - low), 0.06 * (high - low)) / 2;
    this.x = [from, to];
    this.y = [low - room, high + room];
    this.u.batch(() => {
      this.u.setScale("x", { min: from, max: to });
      this.u.setScale("y", { min: this.y[0], max: this.y[1] });
    });
    this.u.redraw(false, true);
  }

  paint() {
    const { ctx, bbox, scales } = this.u, ratio = uPlot.pxRatio;
    const place = (key) => {
      const { min, max } = scales[key], from = this.u.valToPos(min, key, true);
      const slope = (this.u.valToPos(max, key, true) - from) / (max - min);
      return (v) => from + (v - min) * slope;
    };
    const [X, Y] = [place("x"), place("y")];
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineJoin = "round";
    ctx.lineWidth = 1.6 * ratio;
    for (const { course, colour, dash, shown } of this.traces) {
      if (!shown || !course.end) continue;
      ctx.strokeStyle = style(colour);
      ctx.setLineDash((dash ?? []).map((length) => length * ratio));
      drawLine(ctx, { x: course.x, y: course.y }, X, Y, this.x);
    }
    ctx.restore();
  }
}
