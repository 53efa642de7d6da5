// The live page: events in, goals out. It redraws changed parts when the screen is ready.

import {begun, moved, released} from "./goal_drag.js";
import {KINDS, emptyModel, take, trouble} from "./model.js";
import {Scene} from "./scene.js";
import {showSide, showTeams} from "./side.js";

const RETRY = 1000;   // [ms] until a refused stream is asked for again
const at = id => document.getElementById(id);
const model = emptyModel(), scene = new Scene(at("scene"));
let chosen = "", drag = null, sent = null, dirty = false, mapNumber = 0, refused = "";

const problem = () => refused || trouble(model, chosen, performance.now());

function show() {
  dirty = false;
  if (!model.spaces.includes(chosen)) chosen = model.spaces[0] ?? "";
  if (drag && problem()) drag = null;   // a goal is not sent to nobody
  scene.draw(model, chosen, drag);
  showSide(model, chosen, sent, problem());
  showTeams(model, chosen, choose);
}
function soon() {
  if (!dirty) { dirty = true; requestAnimationFrame(show); }
}
function choose(space) { chosen = space; drag = null; soon(); }

function fetchMap() {
  if (!model.map || model.map.number === mapNumber) return;
  mapNumber = model.map.number;
  const image = new Image();
  image.onload = () => { scene.map = image; soon(); };
  image.src = `map.png?${mapNumber}`;
}

function listen() {
  const events = new EventSource("events");
  for (const kind of KINDS) {
    events.addEventListener(kind, event => {
      refused = "";
      take(model, kind, JSON.parse(event.data), performance.now());
      fetchMap(); soon();
    });
  }
  events.onerror = async () => {
    soon();
    if (events.readyState !== EventSource.CLOSED) return;   // it tries again by itself
    const answer = await fetch("events", {signal: AbortSignal.timeout(RETRY)}).catch(() => null);
    if (answer && !answer.ok) refused = await answer.text();
    else answer?.body?.cancel();
    soon(); setTimeout(listen, RETRY);
  };
}

async function ask(what, body) {
  const headers = {"Content-Type": "application/json"};
  const answer = await fetch(what, {method: "POST", headers, body: JSON.stringify(body)});
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return answer.json();
}

async function sendGoal(goal) {
  const mine = sent = {space: chosen, stamp: ""};
  try {
    mine.stamp = (await ask("goal", {space: mine.space, ...goal})).stamp;
  } catch (error) {
    mine.failed = `the goal was not sent: ${error.message}`;
  }
  soon();
}

const canvas = at("scene");
canvas.onpointerdown = event => {
  if (event.button !== 0 || !event.isPrimary || problem()) return;
  const {metres, pixel} = scene.place(model, event);
  drag = begun(metres, pixel);
  canvas.setPointerCapture(event.pointerId);
  soon();
};
canvas.onpointermove = event => {
  if (!drag) return;
  const {metres, pixel} = scene.place(model, event);
  drag = moved(drag, metres, pixel);
  soon();
};
canvas.onpointerup = () => {
  const goal = problem() ? null : released(drag);
  drag = null;
  if (goal) sendGoal(goal);
  soon();
};
canvas.onpointercancel = () => { drag = null; soon(); };
addEventListener("keydown", event => { if (event.key === "Escape") { drag = null; soon(); } });
at("cancel").onclick = () => ask("cancel", {space: chosen}).catch(error => {
  sent = {space: chosen, stamp: "", failed: `not cancelled: ${error.message}`}; soon();
});
at("team").onchange = event => choose(event.target.value);
addEventListener("resize", soon);
setInterval(soon, 200);   // a silent server sends nothing that would say so
listen();
soon();
