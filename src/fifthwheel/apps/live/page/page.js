// Receives the snapshots of the node, and shows them.
import { drawings } from "/drawings.js";
import { bandPlot } from "/plots.js";

const SECONDS = 60;
const QUANTITIES = [
  ["sideslip", "deg", 180 / Math.PI], ["articulation", "deg", 180 / Math.PI],
  ["yaw_rate", "deg/s", 180 / Math.PI], ["roll", "deg", 180 / Math.PI], ["load_transfer", "", 1],
];
const MOST_ESTIMATES = 1200;
const element = (id) => document.getElementById(id);
const truck = await (await fetch("/truck.json")).json();
const draw = drawings(truck, element("above"), element("behind"));
const units = Object.fromEntries(truck.units.map((unit) => [unit.name, unit]));
element("name").textContent = truck.name;
document.title = `${truck.name} live`;

let snapshots = [];
let plots = null;
const estimates = new Map();  // by path: plot and points [time, value, sigma]
let waiting = false;

function figure(parent, caption) {
  const made = document.createElement("figure");
  made.innerHTML = "<figcaption></figcaption><canvas></canvas>";
  made.firstChild.append(...caption);
  parent.append(made);
  return made;
}

function text(tag, content, name = "") {
  const made = document.createElement(tag);
  made.textContent = content;
  made.className = name;
  return made;
}

function legend(names) {
  const made = text("span", "", "legend");
  for (const name of names) {
    const colour = document.createElement("i");
    colour.style.background = units[name].colour;
    made.append(colour, units[name].title);
  }
  return made;
}

function nameOf(states, name) {  // of a state of a unit, or of its last axle group
  return Object.keys(states).filter((n) => n === name || (n.startsWith(`${name}.`) && !n.endsWith(".sigma"))).at(-1);
}

function makePlots(states) {
  return QUANTITIES.flatMap(([quantity, unit, factor]) => {
    const names = truck.units.map((u) => nameOf(states, `${quantity}.${u.name}`)).filter(Boolean);
    if (!names.length) return [];
    const title = quantity.replace("_", " ") + (unit && ` (${unit})`);
    const made = figure(element("plots"), [title, legend(names.map((name) => name.split(".")[1]))]);
    const lines = names.map((name) => ({ name, colour: units[name.split(".")[1]].colour }));
    return [{ canvas: made.querySelector("canvas"), lines, factor }];
  });
}

function show() {
  waiting = false;
  const now = snapshots.at(-1);
  if (!now) return;
  const status = element("status");
  status.textContent = now.status.toLowerCase().replace("_", " ");
  status.className = `status ${now.status === "OK" ? "ok" : ""}`;
  element("time").textContent = `${now.time.toFixed(1)} s`;
  const [, ...faults] = now.text.split("  ");
  element("text").textContent = [...faults, now.change].filter(Boolean).join("; ");
  draw(now.states);
  plots ??= makePlots(now.states);
  for (const { canvas, lines, factor } of plots) {
    bandPlot(canvas, lines.map(({ name, colour }) => ({
      colour,
      points: snapshots.map((s) => [s.time, scaled(s.states[name], factor), scaled(s.states[`${name}.sigma`], factor)]),
    })), [Math.min(snapshots[0].time, now.time - 10), now.time]);
  }
  if (now.coach) showAdvice(now.coach);
  showEstimates(now);
}

const LARGEST_RATIO = 6;  // of sigma to target at the full length of a bar

function showAdvice({ headline, text: hint, obstacle, targets }) {
  element("coach").hidden = false;
  element("headline").textContent = headline;
  element("headline").className = obstacle ? "obstacle" : "";
  element("coached").textContent = hint;
  element("targets").replaceChildren(...targets.map(({ name, text: label, ratio, reached }) => {
    const row = text("div", "", reached ? "reached" : "");
    const bar = document.createElement("meter");
    [bar.max, bar.high, bar.value] = [LARGEST_RATIO, 1, Math.min(ratio, LARGEST_RATIO)];
    bar.title = "sigma in units of its target";
    row.append(text("span", name), bar, text("span", `${reached ? "✓ " : ""}${label}`));
    return row;
  }));
}

const scaled = (value, factor) => (value === null || value === undefined ? null : value * factor);

function addEstimates(snapshot) {
  for (const { path, value, sigma } of snapshot.parameters) {
    if (!estimates.has(path)) estimates.set(path, { points: [], next: -Infinity, step: 1 });
    const kept = estimates.get(path);
    if (snapshot.time < kept.next) continue;
    kept.next = snapshot.time + kept.step;
    kept.points.push([snapshot.time, value, sigma]);
    if (kept.points.length > MOST_ESTIMATES) {
      kept.points = kept.points.filter((_, i) => i % 2 === 0);
      kept.step *= 2;
    }
  }
}

function showEstimates(now) {
  if (!now.parameters.length) return;
  element("learning").hidden = false;
  element("trailer").textContent = `Trailer: ${now.trailer}. Bands: ± 2 sigma.`;
  for (const { path, name, text: label, verdict } of now.parameters) {
    const kept = estimates.get(path);
    if (!kept.canvas) {
      const made = figure(element("parameters"), [text("span", name), text("span", "", "value")]);
      made.firstChild.title = path;
      kept.canvas = made.querySelector("canvas");
      kept.label = made.querySelector(".value");
    }
    kept.label.textContent = label;
    kept.label.className = `value ${verdict}`;
    const first = kept.points[0][0];
    bandPlot(kept.canvas, [{ colour: "#0072B2", points: kept.points }], [first, Math.max(first + 10, now.time)]);
  }
}

function add(news) {
  if (news.length && snapshots.length && news[0].time < snapshots.at(-1).time) {
    snapshots = [];  // the node has started again
    estimates.forEach((kept) => { kept.points = []; kept.next = -Infinity; });
  }
  news.forEach(addEstimates);
  snapshots.push(...news);
  const newest = snapshots.at(-1)?.time ?? 0;
  snapshots = snapshots.filter((s) => s.time >= newest - SECONDS);
  if (!waiting) {
    waiting = true;
    requestAnimationFrame(show);
  }
}

function disconnected(reason) {
  element("status").textContent = reason;
  element("status").className = "status";
}

const events = new EventSource("/events");
events.addEventListener("history", (event) => { snapshots = []; add(JSON.parse(event.data)); });
events.addEventListener("message", (event) => add([JSON.parse(event.data)]));
events.addEventListener("end", () => { events.close(); disconnected("ended"); });
events.addEventListener("error", () => disconnected("no connection"));
