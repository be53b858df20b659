"use strict";
// Values and faults that the page can ask for; what was asked is on the bench bus, and so on record.

const MOST_SAID = 6;

class Controls {
  constructor({ controls, faults }, send) {
    this.send = send;
    this.values = controls.map((control) => this.value(control));
    byId("values").replaceChildren(...this.values.map((one) => one.row));
    this.faults = faults.map((fault) => this.fault(fault));
    const families = [...new Set(faults.map((fault) => fault.family))];
    byId("faultlist").replaceChildren(...families.map((family) => element("fieldset", {}, element("legend", {}, family),
      ...this.faults.filter((one) => one.family === family).map((one) => one.row))));
  }

  value({ name, low, high, step, text, unit, factor }) {
    const input = element("input", { type: "range", id: `set-${name}`, min: low, max: high, step, value: Math.max(0, low) });
    const output = element("output", {}, "scenario"), release = element("button", { disabled: true }, "Release");
    release.setAttribute("aria-label", `Release: ${text}`);
    const show = (value) => {
      const decimals = factor === 1 ? 2 : 0;
      put(output, value === undefined ? "scenario" : `${(value * factor).toFixed(decimals)} ${unit}`.trim());
      release.disabled = value === undefined;
    };
    let waiting = false;
    input.oninput = () => {
      show(Number(input.value));
      if (waiting) return; // one command in a tick of the bench is enough
      waiting = true;
      setTimeout(() => { waiting = false; this.send({ do: "set", name, value: Number(input.value) }); }, 20);
    };
    release.onclick = () => this.send({ do: "set", name, value: null });
    const row = element("div", { class: "control" }, element("label", { for: input.id }, text), input, output, release);
    return { row, name, show, input };
  }

  fault({ name, family, text, usual, targets }) {
    const list = element("select", { "aria-label": `target of ${name}` }, ...targets.map((target) => element("option", {}, target)));
    list.value = usual[0];
    const button = element("button", { "aria-pressed": "false", title: text, id: `fault-${name}` }, name.replaceAll("_", " "));
    const one = { family, name, list, button };
    button.onclick = () => {
      const ends = button.getAttribute("aria-pressed") === "true";
      this.send({ do: ends ? "clear" : "fault", name, on: list.value });
    };
    list.onchange = () => this.press(one);
    one.row = element("div", { class: "fault" }, button, list);
    return one;
  }

  press(one) {
    one.button.setAttribute("aria-pressed", this.armed?.includes(`${one.name} on ${one.list.value}`) ?? false);
  }

  show(state) {
    byId("bench").hidden = !state.bench;
    byId("nobench").hidden = state.bench;
    this.armed = state.armed;
    put(byId("armed"), state.armed.length ? `armed: ${state.armed.join(", ")}` : "none armed");
    for (const one of this.faults) this.press(one);
    for (const one of this.values) {
      const value = state.values[one.name];
      if (document.activeElement === one.input && value !== undefined) continue; // it is being moved
      one.show(value);
      if (value !== undefined) one.input.value = value;
    }
  }

  said({ text, wrong }) {
    const log = byId("said");
    log.prepend(element("p", { class: wrong ? "wrong" : "" }, text));
    while (log.children.length > MOST_SAID) log.lastElementChild.remove();
  }
}
