// The live page: events in, requests out. It redraws changed parts when the screen is ready.

import {Charts} from "./charts.js";
import {setUp} from "./frame.js";
import {begun, moved, released} from "./goal_drag.js";
import {KINDS, bodyAt, emptyModel, poseOf, take, trouble} from "./model.js";
import {Pointer} from "./pointer.js";
import {Scene} from "./scene.js";
import {ask, get, listen} from "./server.js";
import {showBelief, showSide, showTeams} from "./side.js";

const CHARTS = 500;   // [ms] between two drawings of the charts
const fingers = matchMedia("(pointer: coarse)").matches;   // there is no mouse
const at = id => document.getElementById(id);
const model = emptyModel(), scene = new Scene(at("scene"));
let chosen = "", drag = null, sent = null, dirty = false, mapNumber = 0, refused = "";
let cursor = null, charted = -Infinity, held = null, frame = null;

const problem = () => refused || trouble(model, chosen, performance.now());
const charts = new Charts(at("charts"), jump);
const offered = name => Boolean(model.suite?.offered?.includes(name));
const tool = () => document.querySelector("input[name=tool]:checked").value;

function soon() {
  if (!dirty) { dirty = true; requestAnimationFrame(show); }
}
function choose(space) { chosen = space; drag = null; charted = -Infinity; soon(); }
function jump(t) { cursor = cursor === t ? null : t; charted = -Infinity; soon(); }

function show() {
  dirty = false;
  if (!model.spaces.includes(chosen)) chosen = model.spaces[0] ?? "";
  const why = problem(), team = model.teams.get(chosen);
  if (drag && why) drag = null;   // a goal is not sent to nobody
  scene.draw(model, chosen, drag);
  frame.legend(chosen);
  showSide(model, chosen, sent, why, jump);
  showTeams(model, chosen, choose);
  showBelief(model);
  showControls(why);
  const now = performance.now();
  if (now - charted < CHARTS) return;
  charted = now;
  charts.show(team ? [["", team.series]] : [], team?.log ?? [], cursor);
}

function showControls(why) {
  at("pause").textContent = model.suite?.paused ? "Go on" : "Pause";
  for (const [id, name] of [["pause", "pause"], ["reset", "reset"]]) at(id).disabled = !offered(name);
  for (const [name, service] of [["move", "displace"], ["kill", "kill"]]) {
    const input = document.querySelector(`input[name=tool][value=${name}]`);
    input.disabled = !offered(service);
    if (input.disabled && input.checked) document.querySelector("input[name=tool][value=goal]").checked = true;
  }
  for (const button of document.querySelectorAll("#typed button")) {
    button.disabled = button.value === "put" ? !offered("displace") : Boolean(why);
  }
  const hints = {goal: "press at the goal and drag in the direction that the object should face; "
      + (fingers ? "a second finger cancels" : "Escape cancels"),
    move: "drag a body to another place", kill: `${fingers ? "touch" : "click"} a robot: it obeys no more, until a reset`,
    pan: `drag to move the map, ${fingers ? "two fingers zoom" : "turn the wheel to zoom"}`};
  at("hint").textContent = why && tool() === "goal" ? "no goal can be sent now" : hints[tool()];
}

function fetchMap() {
  if (!model.map || model.map.number === mapNumber) return;
  mapNumber = model.map.number;
  const image = new Image();
  image.onload = () => { scene.map = image; soon(); };
  image.src = `map.png?${mapNumber}`;
}

// Send a request, and show the answer.
async function request(what, body) {
  const mine = sent = {space: chosen, stamp: "", text: "sent"};
  try {
    mine.text = (await ask(what, body)).text;
  } catch (error) {
    mine.failed = error.message;
  }
  soon();
}

async function sendGoal(goal, preview = at("preview").checked) {
  const mine = sent = {space: chosen, stamp: ""};
  at("x").value = goal.x.toFixed(3); at("y").value = goal.y.toFixed(3); at("theta").value = goal.theta.toFixed(3);
  try {
    mine.stamp = (await ask("goal", {space: mine.space, ...goal, preview})).stamp;
  } catch (error) {
    mine.failed = `the goal was not sent: ${error.message}`;
  }
  soon();
}

const tools = {
  goal: {
    down(metres, pixel) { if (problem()) return false; drag = begun(metres, pixel); },
    move(metres, pixel) { if (drag) drag = moved(drag, metres, pixel); },
    up() {
      const goal = problem() ? null : released(drag);
      drag = null;
      if (goal) sendGoal(goal);
    },
    cancel() { drag = null; },
  },
  move: {
    down(metres) {
      const i = bodyAt(model, metres), pose = poseOf(model, i);
      if (!pose) { sent = {space: chosen, stamp: "", failed: "there is no body at this place"}; return; }
      held = {name: model.bodies.names[i], from: metres, pose};
    },
    move(metres) {
      if (!held) return;
      const {pose, from, name} = held;
      scene.ghost = {name, pose: [pose.x + metres.x - from.x, pose.y + metres.y - from.y, pose.theta]};
    },
    up() {
      if (scene.ghost) {
        const {name, pose: [x, y, theta]} = scene.ghost;
        request("displace", {name, x, y, theta});
      }
      held = scene.ghost = null;
    },
    cancel() { held = scene.ghost = null; },
  },
  kill: {
    down() {}, move() {}, cancel() {},
    up(metres) {
      const i = bodyAt(model, metres);
      if (i !== undefined && model.bodies.types[model.bodies.type[i]].robot) request("kill", {robot: model.bodies.names[i]});
      else sent = {space: chosen, stamp: "", failed: "there is no robot at this place"};
      soon();
    },
  },
};

async function offerStart() {
  const options = await get("options").catch(() => null);
  at("world").hidden = !options?.systems.length;
  if (!options?.systems.length) return;
  for (const [id, values] of [["system", options.systems], ["scenario", options.scenarios]]) {
    at(id).replaceChildren(...values.map(value => new Option(value, value)));
  }
  const choose = () => { at("scenario").value = options.examples[at("system").value] ?? options.scenarios[0]; };
  at("system").onchange = choose; choose();
  at("start").onclick = () => request("start", {system: at("system").value, scenario: at("scenario").value});
  at("stop").onclick = () => request("stop");
}

export function begin() {
  const pointer = new Pointer(at("scene"), scene, {tools, tool, model: () => model, soon, hover: m => frame.hover(m)});
  frame = setUp([scene], () => model, soon);
  addEventListener("keydown", event => { if (event.key === "Escape") { pointer.cancel(); soon(); } });
  at("cancel").onclick = () => request("cancel", {space: chosen});
  at("execute").onclick = () => request("execute", {space: chosen});
  at("pause").onclick = () => request("pause", {paused: !model.suite?.paused});
  at("reset").onclick = () => request("reset");
  at("team").onchange = event => choose(event.target.value);
  for (const input of document.querySelectorAll("input[name=tool]")) input.onchange = soon;
  at("typed").onsubmit = event => {
    event.preventDefault();
    const [x, y, theta] = ["x", "y", "theta"].map(id => Number(at(id).value));
    if (event.submitter?.value !== "put") { sendGoal({x, y, theta}); return; }
    const name = model.teams.get(chosen)?.state?.object ?? model.bodies?.names.at(-1);
    request("displace", {name, x, y, theta});
  };
  offerStart();
  listen(KINDS, (kind, data) => {
    if (kind === "bodies" && model.bodies && data.revision !== model.bodies.revision) sent = null;   // another suite
    take(model, kind, data, performance.now()); fetchMap(); soon();
  }, text => { refused = text; soon(); });
  setInterval(soon, 200);   // a silent server sends nothing that would say so
  soon();
}
