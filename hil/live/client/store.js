"use strict";
// What the bus said: the last value of every signal, and courses of those that are drawn.

const KEPT = 1 << 13; // samples of a course: a minute at 100 Hz, and some more

const byId = (id) => document.getElementById(id);
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// An element with attributes and children; text is always text.
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made[key] = value;
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== null) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

function put(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

// A course in memory that never grows: when it is full the older half goes.
class Course {
  constructor() {
    this.t = new Float64Array(2 * KEPT);
    this.v = new Float64Array(2 * KEPT);
    this.end = 0;
  }

  add(t, v) {
    if (this.end && t < this.t[this.end - 1]) return; // frames of several members may be a little out of order
    if (this.end === this.t.length) {
      this.t.copyWithin(0, KEPT);
      this.v.copyWithin(0, KEPT);
      this.end = KEPT;
    }
    this.t[this.end] = t;
    this.v[this.end++] = v ?? NaN;
  }

  get x() { return this.t.subarray(0, this.end); }
  get y() { return this.v.subarray(0, this.end); }
  get last() { return this.end ? this.v[this.end - 1] : NaN; }
}

class Store {
  constructor() {
    this.begin([]);
  }

  begin(messages) {
    this.messages = messages;
    this.last = messages.map(() => null); // newest row: time, then values
    this.courses = messages.map(() => []); // of each message: [place of the signal, course, how to convert]
    this.places = new Map();
    this.now = 0;
    messages.forEach((message, m) => message.signals.forEach((signal, s) => {
      this.places.set(`${message.name}.${signal.name}`, [m, s + 1]);
    }));
  }

  has(name) { return this.places.has(name); }

  signal(name) {
    const [m, s] = this.places.get(name);
    return this.messages[m].signals[s - 1];
  }

  value(name) {
    const [m, s] = this.places.get(name) ?? [-1];
    return this.last[m]?.[s] ?? null;
  }

  // The course of a signal from now on; `convert` gets each value.
  follow(name, convert = (v) => v) {
    const course = new Course(), [m, s] = this.places.get(name) ?? [-1];
    if (m >= 0) this.courses[m].push([s, course, convert]);
    return course;
  }

  leave(course) {
    this.courses = this.courses.map((some) => some.filter((one) => one[1] !== course));
  }

  take(rows) {
    let unknown = false;
    for (const [number, some] of Object.entries(rows)) {
      if (!this.courses[number]) { unknown = true; continue; }
      this.last[number] = some[some.length - 1];
      for (const row of some) {
        this.now = Math.max(this.now, row[0]);
        for (const [s, course, convert] of this.courses[number]) {
          course.add(row[0], row[s] === null ? null : convert(row[s]));
        }
      }
    }
    return !unknown;
  }
}

const store = new Store();
