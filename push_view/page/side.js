// The text and numbers beside the map.

import {answerTo, busy, errorOf, timeText} from "./model.js";
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

function numbers(model, team) {
  const state = team?.state, error = errorOf(model, team);
  const gap = error ? `${(1e3 * error[0]).toFixed(1)} mm, ${error[1].toFixed(3)} rad` : "–";
  const rows = [["time", model.time === null ? "–" : timeText(model.time)]];
  if (model.bodies) {
    const robots = model.bodies.type.filter(t => model.bodies.types[t].robot).length, all = model.bodies.names.length;
    rows.push(["robots, objects", `${robots}, ${all - robots}`]);
  }
  if (model.lost.size) rows.push(["not seen", `${model.lost.size}`]);
  rows.push(["to the goal", gap]);
  if (state?.step[1]) rows.push(["step", `${state.step[0]} of ${state.step[1]}`]);
  const {cost, gap: above} = team?.plan ?? {};
  if (cost !== undefined) {
    const old = busy(team) || state?.plan_ready ? "" : "former";
    rows.push(["cost of the plan", `${cost.toFixed(1)} s`, old], ["above the best", `at most ${Math.ceil(100 * above)} %`, old]);
  }
  if (state?.replans) rows.push(["new plans", `${state.replans}`]);
  const told = (team?.rows ?? []).map(r => [r.name, r.text, outside(r) ? "bad" : ""]);
  if (told.length && state?.job && !busy(team)) rows.push([state?.plan_ready ? "before this plan:" : "of the job that has ended:", "", "former"]);
  return [...rows, ...told.map(([k, v, c]) => [k, v, busy(team) ? c : "former"])];
}

// Whether a value is on the far side of its limit. Margins have lower limits, errors have upper ones.
const outside = ({name, value, limit}) => value !== undefined && limit !== undefined &&
  (/margin|clearance/.test(name) ? value < limit : value > limit);

const short = v => String(Number(v.toPrecision(3)));

export function showBelief(model) {
  const rows = model.belief.map(b => {
    const range = b.low === b.high ? "" : ` [${short(b.low)}, ${short(b.high)}]`;
    return [`${b.body} ${b.quantity.replaceAll("_", " ")}`, `${short(b.value)}${range} ${b.unit}`, b.source];
  });
  at("belief").hidden = !rows.length;
  fill("beliefs", rows, () => rows.flatMap(([k, v, source]) => {
    const value = element("dd", v, source === "scenario" ? "" : "said");
    value.title = `source: ${source}`;
    return [element("dt", k), value];
  }));
}

// Everything but the map; trouble: why no goal is accepted, or empty.
export function showSide(model, chosen, sent, trouble, jump) {
  const team = model.teams.get(chosen), state = team?.state;
  const paused = !trouble && model.suite?.paused;
  at("trouble").hidden = !trouble && !paused;
  at("trouble").className = paused ? "paused" : "";
  at("trouble").textContent = trouble || (paused ? "the suite is paused" : "");
  at("scene").className = trouble ? "gone" : "";
  at("state").textContent = state?.state ?? (trouble ? "no job" : "waiting");
  at("state").className = state?.code ? "failed" : state?.state === "PUSHING" ? "pushing" : "";
  at("reason").textContent = state?.reason ?? "";
  const answer = sent?.failed ? {kind: "refused", text: sent.failed}
    : answerTo(sent, model.teams.get(sent?.space));
  at("answer").textContent = answer?.text ?? "";
  at("answer").className = answer?.kind ?? "";
  at("cancel").disabled = Boolean(trouble) || !state || state.state === "IDLE" && !state.plan_ready;
  at("execute").hidden = !state?.plan_ready;
  const rows = numbers(model, team);
  fill("numbers", rows, () => rows.flatMap(([k, v, c]) => [element("dt", k, c), element("dd", v, c)]));
  const log = team?.log ?? [];
  fill("log", log, () => log.toReversed().map(([t, name, reason]) => {
    const row = document.createElement("button"), text = document.createElement("p");
    text.append(element("b", `${name.toLowerCase()} `), reason);
    row.append(element("span", timeText(t)), text);
    row.title = "show this moment in the charts"; row.onclick = () => jump(t);
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
    dot.style.background = teamColor(model, n);
    row.append(dot, element("span", name), element("span", state));
    row.onclick = () => choose(model.spaces[n]);
    return row;
  }));
}
