// Playback: the same scene and figures at any time of one bag, or of several bags side by side.

import {Charts} from "./charts.js";
import {setUp} from "./frame.js";
import {Pointer} from "./pointer.js";
import {Recording} from "./recording.js";
import {Scene} from "./scene.js";
import {get} from "./server.js";
import {showSide, teamName} from "./side.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16, 32];
const at = id => document.getElementById(id);
let recordings = [], scenes = [], frame = null, charts = null, charted = "";
let time = 0, playing = false, speed = 1, loop = false, before = 0, chosen = [0, ""], dirty = false;

const longest = () => Math.max(...recordings.map(r => r.duration));
const soon = () => { if (!dirty) { dirty = true; requestAnimationFrame(show); } };
const model = () => recordings[chosen[0]].model;

function seek(t) { time = Math.min(Math.max(t, 0), longest()); soon(); }

function show(now) {
  dirty = false;
  if (playing) {
    time += speed * Math.min(now - before, 250) / 1e3;
    if (time >= longest()) { time = loop ? 0 : longest(); playing = loop; }
    soon();
  }
  before = now;
  recordings.forEach((r, i) => scenes[i].draw(r.seek(time), i === chosen[0] ? chosen[1] : r.model.spaces[0] ?? "", null));
  at("now").textContent = `${time.toFixed(2)} of ${longest().toFixed(1)} s`;
  at("slider").value = time; at("go").textContent = playing ? "❚❚" : "▶";
  frame.legend(chosen[1]);
  showSide(model(), chosen[1], null, "", seek);
  showCharts();
}

function showCharts() {
  const own = model().teams.get(chosen[1])?.series ?? new Map(), several = recordings.length > 1;
  const errors = several ? recordings.map(r => [r.name, pick(r.teams[0]?.series, n => n.endsWith("ion error"))]) : [];
  const rest = pick(own, n => !several || !n.endsWith("ion error"));
  const marks = recordings[chosen[0]].teams.find(t => t.space === chosen[1])?.states.map(s => [s.t, s.state]) ?? [];
  const key = `${chosen} ${at("charts").clientWidth}`;
  if (key !== charted) { charts.show([...errors, ["", rest]], marks, time); charted = key; }
  else charts.move(time);
}
const pick = (series, good) => new Map([...series ?? []].filter(([name]) => good(name)));

function makeTimeline() {
  const bar = at("timeline");
  bar.hidden = false;
  bar.innerHTML = `<div class="row"><button id="go" aria-label="play or pause">▶</button>
    <button id="back" aria-label="a frame back">◀|</button><button id="on" aria-label="a frame on">|▶</button>
    <input id="slider" type="range" min="0" step="0.01" aria-label="time"><output id="now"></output>
    <select id="speed" aria-label="speed"></select><label><input id="loop" type="checkbox">loop</label></div>`;
  at("slider").max = longest();
  at("speed").replaceChildren(...SPEEDS.map(s => new Option(`${s} ×`, s, s === 1, s === 1)));
  at("slider").oninput = event => seek(Number(event.target.value));
  at("go").onclick = () => { if (time >= longest()) time = 0; playing = !playing; before = performance.now(); soon(); };
  at("back").onclick = () => { playing = false; seek(recordings[chosen[0]].step(time, -1)); };
  at("on").onclick = () => { playing = false; seek(recordings[chosen[0]].step(time, 1)); };
  at("speed").onchange = event => { speed = Number(event.target.value); };
  at("loop").onchange = event => { loop = event.target.checked; };
  addEventListener("keydown", event => {
    if (event.target.matches("select, #loop, textarea")) return;
    const act = {" ": at("go"), ArrowLeft: at("back"), ArrowRight: at("on")}[event.key];
    if (act) { event.preventDefault(); act.onclick(); }
  });
}

function makeViews() {
  const first = at("scene").parentElement;
  scenes = recordings.map((recording, i) => {
    const view = i ? first.cloneNode(true) : first, caption = document.createElement("figcaption");
    view.querySelectorAll("figcaption").forEach(c => c.remove());
    caption.textContent = recordings.length > 1 ? recording.name : "";
    view.append(caption);
    if (i) { view.querySelector("canvas").id = `scene${i}`; first.parentElement.insertBefore(view, at("trouble")); }
    const scene = new Scene(view.querySelector("canvas"));
    new Pointer(scene.canvas, scene, {tools: {}, tool: () => "pan", model: () => recording.model, soon, hover: m => frame.hover(m)});
    return scene;
  });
}

function makeChoice() {
  const all = recordings.flatMap((r, i) => r.teams.map(t => [i, t.space]));
  chosen = all[0] ?? [0, ""];
  at("choice").hidden = all.length < 2;
  document.querySelector("label[for=team]").textContent = "figures of";
  at("team").replaceChildren(...all.map(([i, space], n) => new Option(
    [recordings.length > 1 ? recordings[i].name : "", recordings[i].teams.length > 1 ? teamName(space) : ""].filter(Boolean).join(", "), n)));
  at("team").onchange = event => { chosen = all[Number(event.target.value)]; soon(); };
}

// bags: paths that bags are fetched from; data: bags that are there already
export async function begin({bags = [], data = null}) {
  document.body.classList.add("playback");
  at("state").textContent = "reading"; at("reason").textContent = "";
  try {
    recordings = (data ?? await Promise.all(bags.map(get))).map(bag => new Recording(bag));
  } catch (error) {
    at("trouble").hidden = false; at("trouble").textContent = `the bag cannot be shown: ${error.message}`;
    return;
  }
  at("title").textContent = recordings.map(r => r.trouble ? `${r.name} (${r.trouble})` : r.name).join(" | ");
  at("hint").textContent = matchMedia("(pointer: coarse)").matches
    ? "drag to move the map, two fingers zoom; touch a chart or the log to jump"
    : "drag to move the map, turn the wheel to zoom; space plays, arrows step; click a chart or the log to jump";
  charts = new Charts(at("charts"), seek);
  makeViews(); makeTimeline(); makeChoice();
  for (const link of document.querySelectorAll("[data-time]")) {
    link.addEventListener("click", () => seek(Number(link.dataset.time) - recordings[0].begin));
  }
  frame = setUp(scenes, model, soon);
  seek(data ? longest() : 0);   // a report begins with the result
}
