"use strict";
// The table of messages: how each comes, by its cycle and its protection.

class Trace {
  constructor() {
    this.body = document.querySelector("#trace tbody");
    this.body.replaceChildren();
    this.rows = new Map();
    byId("filter").oninput = () => this.choose();
  }

  show(state) {
    for (const [number, count, cycle, age, data, status, sound, lost, corrupt] of state.rows) {
      const message = store.messages[number];
      if (!message) continue;
      const { row, cells } = this.rows.get(number) ?? this.add(number, message);
      const late = message.cycle !== null && age > 4e-3 * message.cycle; // as receivers of our own messages wait
      const said = status === null ? "none" : status.toLowerCase().replaceAll("_", " ");
      const texts = [String(count), cycle?.toFixed(1) ?? "", message.cycle?.toFixed(0) ?? "", age.toFixed(1), said,
        lost === null ? "" : String(lost), corrupt === null ? "" : String(corrupt), data.replace(/(..)(?=.)/g, "$1 ")];
      texts.forEach((text, i) => put(cells[i], text));
      row.className = !sound ? "bad" : late ? "late" : "";
    }
    put(byId("further"), state.further ? `${state.further} frames of further identifiers are not shown` : "");
  }

  add(number, message) {
    const cells = Array.from({ length: 8 }, (_, i) => element("td", { class: i === 4 ? "s" : i === 7 ? "s hex" : "n" }));
    const id = `0x${message.id.replace("x", "")}`;
    const row = element("tr", {}, ...[message.bus, id, message.name].map((text) => element("td", { class: "s" }, text)), ...cells);
    row.dataset.number = number;
    row.dataset.words = `${message.bus} ${id} ${message.name}`.toLowerCase();
    const next = [...this.body.children].find((other) => Number(other.dataset.number) > number);
    this.body.insertBefore(row, next ?? null);
    const made = { row, cells };
    this.rows.set(number, made);
    this.choose();
    return made;
  }

  choose() {
    const words = byId("filter").value.toLowerCase();
    for (const { row } of this.rows.values()) row.hidden = !row.dataset.words.includes(words);
  }
}
