"use strict";
// A report: one time for the map, the charts and the slider.

const data = JSON.parse(document.getElementById("data").textContent);
const one = (id) => document.getElementById(id);
const map = new RunMap(one("map"), data);
const ends = data.charts.flatMap((c) => c.lines.flatMap((l) => [l.t[0], l.t[l.t.length - 1]]));
const span = data.times.length ? [data.times[0], data.times[data.times.length - 1]]
  : ends.length ? [Math.min(...ends), Math.max(...ends)] : [0, 0];
const states = data.jobs.length ? data.jobs[0].states : [];

const bands = [];
states.forEach((state, k) => {
  const next = k + 1 < states.length ? states[k + 1].time : span[1];
  if (k % 2) bands.push([Math.max(span[0], state.time), Math.min(span[1], next), state.name]);
});

let now = span[1], playing = false, last = 0;
const go = (time) => { now = time; show(); };
let charts = [];
const build = () => {
  charts = data.charts.map((spec) => new Chart(spec, span, bands, go));
  one("charts").replaceChildren(...charts.map((chart) => chart.figure));
  if (!charts.length) one("charts").textContent = "Nothing was recorded that could be drawn.";
};
build();

function show() {
  map.draw(now);
  for (const chart of charts) chart.show(now);
  one("time").value = span[1] > span[0] ? 1000 * (now - span[0]) / (span[1] - span[0]) : 0;
  one("clock").textContent = `${now.toFixed(2)} s`;
  one("state").textContent = data.jobs.map((job) => {
    const k = RunMap.at(job.states.map((s) => s.time), now);
    const name = data.jobs.length > 1 ? `${job.space}: ` : "";
    return k < 0 ? "" : `${name}${job.states[k].name}: ${job.states[k].reason}`;
  }).filter(Boolean).slice(0, 4).join(" · ");
}

function tick(moment) {
  if (!playing) return;
  const step = last ? (moment - last) / 1000 : 0;
  last = moment;
  now += step * Number(one("speed").value);
  if (now >= span[1]) { now = span[1]; play(false); }
  show();
  requestAnimationFrame(tick);
}

function play(on) {
  playing = on;
  last = 0;
  one("play").textContent = on ? "❚❚" : "▶";
  if (on && now >= span[1]) now = span[0];
  if (on) requestAnimationFrame(tick);
}

one("play").addEventListener("click", () => play(!playing));
one("time").addEventListener("input", (event) => {
  play(false);
  go(span[0] + Number(event.target.value) / 1000 * (span[1] - span[0]));
});
for (const link of document.querySelectorAll("[data-time]")) {
  link.addEventListener("click", () => go(Number(link.dataset.time)));
}

const key = (colour, name) => {
  const made = document.createElement("span"), mark = document.createElement("i");
  mark.style.background = shade(colour);
  made.append(mark, name);
  return made;
};
const known = new Map();
const colours = new Set(data.bodies.filter((body) => body.robot).map((body) => body.colour));
const robots = data.bodies.filter((body) => body.robot).length;
for (const body of data.bodies) {
  const own = body.robot ? colours.size === robots : data.bodies.length - robots <= 8;
  known.set(own ? body.name : body.robot ? "robots" : "objects", body.colour);
}
for (const moment of data.moments) for (const shape of moment.shapes) known.set(shape.layer, shape.colour);
if (data.jobs.some((job) => job.goals.length)) known.set("goal", "var(--goal)");
if (data.jobs.some((job) => job.plan.length)) known.set("plan", "var(--plan)");
one("legend").append(...[...known].map(([name, colour]) => key(colour, name)));

window.addEventListener("resize", show);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { build(); show(); });
show();
