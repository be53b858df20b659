"use strict";
// The page: takes what the viewer tells, and draws once in a frame of the screen.

const AGAIN_MS = 1000; // until it asks for a lost connection again
const MOST_LISTED = 2000; // signals in the list to choose from

let socket, plots = [], car, trace, controls, ended = false, fresh = false, frozen = null, asked = 0;

function tell(text, kind) {
  put(byId("link"), text);
  byId("link").className = `badge ${kind}`;
}

function connect() {
  const token = new URLSearchParams(location.search).get("token") ?? "";
  socket = new WebSocket(`ws://${location.host}/socket?token=${encodeURIComponent(token)}`);
  socket.onopen = () => tell("live", "passed");
  socket.onmessage = ({ data }) => take(JSON.parse(data));
  socket.onclose = () => {
    tell(ended ? "ended" : "no connection", ended ? "incomplete" : "failed");
    if (!ended) setTimeout(connect, AGAIN_MS);
  };
}

function send(command) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
  else controls?.said({ text: "no connection: nothing was sent", wrong: true });
}

const takers = {
  hello(message) {
    const chosen = plots.filter((plot) => plot.chosen).map((plot) => plot.title);
    for (const plot of plots) plot.remove(() => {});
    store.begin(message.messages);
    put(byId("bus"), message.bus);
    byId("state").hidden = !message.own;
    plots = message.own ? ownPanels(message.car).map((panel) => new LivePlot(...panel)) : [];
    car = message.own ? new Car(message.car, message.codes) : undefined;
    trace = new Trace();
    controls = new Controls(message, send);
    const names = [...store.places.keys()].filter((name) => !/\.(CRC|ALIVE_COUNTER)$/.test(name)).slice(0, MOST_LISTED);
    byId("signals").replaceChildren(...names.map((name) => element("option", { value: name })));
    const first = message.own ? [] : names.filter((name) => store.messages[store.places.get(name)[0]].bus === "vehicle").slice(0, 4);
    for (const name of chosen.length ? chosen : first) choose(name);
  },
  data({ rows }) {
    fresh = true;
    if (!store.take(rows) && performance.now() - asked > AGAIN_MS) {
      asked = performance.now();
      send({ do: "hello" }); // it speaks of messages that we do not know
    }
  },
  state(message) {
    put(byId("load"), message.load === null ? "–" : `${(100 * message.load).toFixed(1)} %`);
    trace.show(message);
    controls.show(message);
    byId("dropped").hidden = !message.dropped;
    put(byId("dropped"), `${message.dropped} updates dropped for slow pages`);
    for (const text of message.events) controls.said({ text, wrong: true });
  },
  said(message) { controls.said(message); },
  end() { ended = true; },
};

function take(message) { takers[message.kind]?.(message); }

function choose(name) {
  if (!store.has(name) || plots.some((plot) => plot.chosen && plot.title === name)) return false;
  const { unit } = store.signal(name), trace = { name: "", signal: name, colour: "--series0" };
  const plot = new LivePlot(name, unit, 1e-9, [trace], (gone) => { plots = plots.filter((one) => one !== gone); });
  plot.chosen = true;
  plots.push(plot);
  return true;
}

function draw() {
  requestAnimationFrame(draw);
  if (!fresh || document.hidden) return;
  fresh = false;
  const to = frozen ?? store.now, from = to - Number(byId("window").value);
  for (const plot of plots) plot.show(from, to);
  car?.show();
}

byId("find").onchange = ({ target }) => { if (choose(target.value.trim())) target.value = ""; };
byId("find").oninput = ({ target, inputType }) => {
  if (!inputType || inputType === "insertReplacementText") target.onchange({ target }); // picked from the list
};
byId("window").onchange = () => { fresh = true; };
byId("pause").onclick = (event) => {
  frozen = frozen === null ? store.now : null;
  event.target.setAttribute("aria-pressed", frozen !== null);
  fresh = true;
};
connect();
requestAnimationFrame(draw);
