// The text and numbers beside the map.

import {answerTo, poseOf} from "./model.js";
import {teamColor} from "./scene.js";

const at = id => document.getElementById(id);
const SHOWN = {};   // text that stands there already, by element

function element(tag, text, style = "") {
  const made = document.createElement(tag);
  made.textContent = text; made.className = style;
  return made;
}

// Replace the contents of an element only if they changed, so that menus and selections persist.
function fill(id, key, make) {
  const text = JSON.stringify(key);
  if (SHOWN[id] === text) return;
  SHOWN[id] = text;
  at(id).replaceChildren(...make());
}

export const teamName = space => space.split("/").filter(Boolean).at(-1) ?? "all";

const turn = a => Math.abs(Math.atan2(Math.sin(a), Math.cos(a)));

function numbers(model, team) {
  const state = team?.state, pose = poseOf(model, model.index.get(state?.object)), goal = state?.goal;
  const gap = pose && goal ? `${(1e3 * Math.hypot(pose.x - goal[0], pose.y - goal[1])).toFixed(1)} mm, ` +
    `${turn(pose.theta - goal[2]).toFixed(3)} rad` : "–";
  const rows = [["time", model.time === null ? "–" : `${model.time.toFixed(1)} s`]];
  if (model.bodies) {
    const robots = model.bodies.type.filter(t => model.bodies.types[t].robot).length, all = model.bodies.names.length;
    rows.push(["robots, objects", `${robots}, ${all - robots}`]);
  }
  if (model.lost.size) rows.push(["not seen", `${model.lost.size}`]);
  rows.push(["to the goal", gap]);
  if (state?.step[1]) rows.push(["step", `${state.step[0]} of ${state.step[1]}`]);
  if (state?.replans) rows.push(["new plans", `${state.replans}`]);
  return [...rows, ...(team?.rows ?? [])];
}

// Everything but the map; trouble: why no goal is accepted, or empty.
export function showSide(model, chosen, sent, trouble) {
  const team = model.teams.get(chosen), state = team?.state;
  const paused = !trouble && model.suite?.paused;
  at("trouble").hidden = !trouble && !paused;
  at("trouble").className = paused ? "paused" : "";
  at("trouble").textContent = trouble || (paused ? "the suite is paused" : "");
  at("scene").className = trouble ? "gone" : "";
  at("hint").textContent = trouble ? "no goal can be sent now"
    : "press at the goal and drag in the direction that the object should face; Escape cancels";
  at("state").textContent = state?.state ?? (trouble ? "no job" : "waiting");
  at("state").className = state?.code ? "failed" : state?.state === "PUSHING" ? "pushing" : "";
  at("reason").textContent = state?.reason ?? "";
  const answer = sent?.failed ? {kind: "refused", text: sent.failed}
    : answerTo(sent, model.teams.get(sent?.space));
  at("answer").textContent = answer?.text ?? "";
  at("answer").className = answer?.kind ?? "";
  at("cancel").disabled = Boolean(trouble) || !state || state.state === "IDLE";
  const rows = numbers(model, team);
  fill("numbers", rows, () => rows.flatMap(([k, v]) => [element("dt", k), element("dd", v)]));
  const log = team?.log ?? [];
  fill("log", log, () => log.toReversed().map(([t, name, reason]) => {
    const row = document.createElement("div"), text = document.createElement("p");
    text.append(element("b", `${name.toLowerCase()} `), reason);
    row.append(element("span", `${t.toFixed(1)} s`), text);
    return row;
  }));
}

export function showTeams(model, chosen, choose) {
  const many = model.spaces.length > 1;
  at("choice").hidden = at("teams").hidden = !many;
  if (!many) return;
  fill("team", [model.spaces, chosen], () => model.spaces.map(space => {
    const option = element("option", teamName(space));
    option.value = space; option.selected = space === chosen;
    return option;
  }));
  const lines = model.spaces.map(space => {
    const state = model.teams.get(space)?.state;
    return [teamName(space), model.suite?.teams[space] ? "gone" : state?.state.toLowerCase() ?? "–"];
  });
  fill("teams", [lines, chosen], () => lines.map(([name, state], n) => {
    const row = element("div", "", model.spaces[n] === chosen ? "chosen" : ""), dot = element("span", "", "dot");
    dot.style.background = teamColor(n);
    row.append(dot, element("span", name), element("span", state));
    row.onclick = () => choose(model.spaces[n]);
    return row;
  }));
}
