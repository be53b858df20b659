"use strict";
// The car from above, and what its controller says.

const MODES = { NORMAL: "passed", INIT: "incomplete", DEGRADED: "incomplete" }; // all else is red
const ROWS = [["slip", "%"], ["pad friction", ""], ["disc", "°C"], ["pressure", "bar"], ["motor", "N m"]];

class Car {
  constructor(car, codes) {
    this.radius = car.wheel_radius_m;
    this.constant = car.torque_constant_nm_a;
    this.texts = codes;
    this.found = new Map();
    this.cells = {};
    const cards = WHEELS.map((w) => {
      this.cells[w] = ROWS.map(() => element("output", {}, "–"));
      const rows = ROWS.map(([name, unit], i) => element("div", {}, element("dt", {}, name), element("dd", {}, this.cells[w][i], ` ${unit}`)));
      return element("dl", { class: `wheel ${w.toLowerCase()}`, "aria-label": `wheel ${w.toLowerCase()}` },
        element("div", { class: "name" }, w.toLowerCase()), ...rows);
    });
    byId("car").replaceChildren(...cards, this.picture());
  }

  picture() {
    const made = (name, attributes, parent) => {
      const one = document.createElementNS("http://www.w3.org/2000/svg", name);
      for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
      return parent ? parent.appendChild(one) : one;
    };
    const svg = made("svg", { viewBox: "0 0 120 220", class: "top", role: "img", "aria-label": "the car from above, front at the top" });
    made("path", { class: "body", d: "M32 18 Q60 2 88 18 L94 60 L92 190 Q60 212 28 190 L26 60 Z" }, svg);
    made("path", { class: "glass", d: "M36 70 Q60 58 84 70 L80 92 L40 92 Z" }, svg);
    made("path", { class: "glass", d: "M40 160 L80 160 L83 176 Q60 184 37 176 Z" }, svg);
    this.tyres = {};
    for (const [i, w] of WHEELS.entries()) {
      const x = i % 2 ? 92 : 12, y = i < 2 ? 36 : 146;
      made("rect", { class: "tyre", x, y, width: 16, height: 40, rx: 4 }, svg);
      this.tyres[w] = [made("rect", { class: "pressure", x: x + 1.5, width: 6, y: y + 39, height: 0 }, svg),
        made("rect", { class: "motor", x: x + 8.5, width: 6, y: y + 39, height: 0 }, svg), y];
      made("rect", { class: `rim ${w.toLowerCase()}`, x, y, width: 16, height: 40, rx: 4 }, svg);
    }
    made("title", {}, svg).textContent = "left half of a wheel: pressure up to 100 bar; right half: motor torque up to 700 N m";
    return svg;
  }

  show() {
    const v = store.value("TRUTH_MOTION.SPEED");
    const text = (value, digits) => (value === null ? "–" : value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1")); // no minus zero
    for (const w of WHEELS) {
      const omega = store.value(`WHEEL_SPEED_${AXLE[w]}.WHEEL_SPEED_${w}`);
      const current = store.value(`MOTOR_STATUS_${AXLE[w]}.CURRENT_${w}`);
      const temperature = store.value(`TRUTH_DISC_TEMPERATURE.DISC_TEMPERATURE_${w}`);
      const pressure = store.value(`EHB_PRESSURE_${AXLE[w]}.PRESSURE_${w}`);
      const torque = current === null ? null : current * this.constant;
      const slipping = v === null || omega === null || Math.abs(v) < 1 ? null : 100 * (v - omega * this.radius) / v;
      const shown = [text(slipping, 1), text(store.value(`BRAKE_ESTIMATE_${AXLE[w]}.PAD_FRICTION_${w}`), 3),
        text(temperature === null ? null : temperature - 273.15, 0), text(pressure, 1), text(torque, 0)];
      shown.forEach((value, i) => put(this.cells[w][i], value));
      const [left, right, y] = this.tyres[w];
      for (const [bar, part] of [[left, (pressure ?? 0) / 100], [right, Math.abs(torque ?? 0) / 700]]) {
        const height = 38 * Math.max(0, Math.min(1, part));
        bar.setAttribute("height", height);
        bar.setAttribute("y", y + 39 - height);
      }
    }
    this.controller();
  }

  controller() {
    const name = (signal) => {
      const value = store.value(signal);
      return value === null ? "–" : store.signal(signal).choices[value] ?? String(value);
    };
    const mode = name("BRAKE_STATUS.MODE"), state = MODES[mode] ?? "failed";
    put(byId("mode"), mode);
    byId("mode").className = `badge ${mode === "–" ? "incomplete" : state}`;
    const driven = name("TRUTH_MOTION.MANOEUVRE"), blending = store.value("BRAKE_STATUS.BLENDING_FACTOR");
    byId("manoeuvre").hidden = driven === "–";
    put(byId("manoeuvre"), `manoeuvre ${driven.toLowerCase()}, blending ${blending === null ? "–" : (100 * blending).toFixed(0)} %`);
    const [code, index, status] = ["TROUBLE_CODE", "CODE_INDEX", "STATUS"].map((s) => store.value(`BRAKE_TROUBLE_CODE.${s}`));
    const stored = store.value("BRAKE_TROUBLE_CODE.STORED_CODES") ?? 0;
    put(byId("stored"), String(stored));
    if (stored < this.found.size) this.found.clear();
    if (code) this.found.set(code, [status === null ? "" : name("BRAKE_TROUBLE_CODE.STATUS").toLowerCase(), store.value("BRAKE_TROUBLE_CODE.OCCURRENCES"), index]);
    const rows = [...this.found].sort(([a, [x]], [b, [y]]) => (y === "active") - (x === "active") || a - b).map(([number, [state, times]]) => {
      const [name, text] = this.texts[number] ?? ["", ""];
      return [number.toString(16).toUpperCase().padStart(4, "0"), name, state, String(times ?? ""), text];
    });
    const key = JSON.stringify(rows);
    if (key === this.drawn) return;
    this.drawn = key;
    byId("codes").replaceChildren(...rows.map(([number, name, state, times, text]) => element("tr", { class: state, title: text },
      element("td", { class: "s" }, number), element("td", { class: "s" }, name), element("td", { class: "s" }, state), element("td", { class: "n" }, times))));
  }
}
