// The state of the page, updated by the events of the server, or by a recording.

export const LONGEST_SILENCE = 800;   // [ms] without an event after which the server counts as gone
const TRAIL_STEP = 0.004, TRAIL_LENGTH = 3000, TRAILED = 60;   // [m], points, bodies
const LENGTH = 1e-4, ANGLE = 1e-3;    // units of poses: [m], [rad]
const JUMP = 0.2;                     // [m] between two poses, of a body that was put somewhere else
const OWN = ["position error", "orientation error"];   // of the object from its goal
const SPACING = 0.1, KEPT = 6000;     // [s] between errors that are kept; points of a series

export const emptyModel = () => ({
  bodies: null, index: new Map(), poses: null, time: null, lost: new Set(), trails: new Map(),
  map: null, spaces: [], teams: new Map(), suite: null, heard: -Infinity, belief: [],
});

export const newTeam = () => ({
  state: null, robots: [], log: [], plan: {pushes: [], ways: []}, rows: [], shapes: [], members: new Set(),
  series: new Map(),
});

const teamOf = (model, space) => {
  if (!model.teams.has(space)) model.teams.set(space, newTeam());
  return model.teams.get(space);
};

const EPOCH = 1e8;   // [s] a longer time is that of a lab's clock, since 1970
const two = value => String(value).padStart(2, "0");

// A time [s] as text: seconds of a simulation, or the time of day in a lab.
export function timeText(t, digits = 1) {
  if (t < EPOCH) return `${t.toFixed(digits)} s`;
  const date = new Date(1e3 * t), seconds = (date.getSeconds() + date.getMilliseconds() / 1e3).toFixed(1);
  return `${two(date.getHours())}:${two(date.getMinutes())}:${seconds.padStart(4, "0")}`;
}

// A number on an axis, with as many digits as tell it from its neighbours.
export const tickText = v => v >= EPOCH ? timeText(v).slice(0, 8) : String(Number(v.toPrecision(6)));

export const turn = a => Math.abs(Math.atan2(Math.sin(a), Math.cos(a)));

// Distance [m] and angle [rad] of a team's object from its goal; null without either.
export function errorOf(model, team) {
  const state = team?.state, pose = poseOf(model, model.index.get(state?.object)), goal = state?.goal;
  return pose && goal ? [Math.hypot(pose.x - goal[0], pose.y - goal[1]), turn(pose.theta - goal[2])] : null;
}

// Add a value to a series of a team.
function record(team, name, unit, limit, t, value) {
  if (!team.series.has(name)) team.series.set(name, {unit, limit, t: [], v: []});
  const series = team.series.get(name);
  if (series.t.length && t <= series.t.at(-1)) return;
  series.t.push(t); series.v.push(value);
  if (series.t.length > KEPT) {   // half as many, over the same time
    series.t = series.t.filter((_, i) => i % 2); series.v = series.v.filter((_, i) => i % 2);
  }
}

function takePoses(model, data) {
  if (data.revision !== model.bodies?.revision) return;
  if (model.time !== null && data.t < model.time - 0.5) {   // the world was reset
    model.trails.clear();
    for (const team of model.teams.values()) team.series.clear();
  }
  model.poses = data; model.time = data.t; model.lost = new Set(data.lost);
  for (const team of model.teams.values()) {
    const error = errorOf(model, team), last = team.series.get("position error")?.t.at(-1) ?? -Infinity;
    if (!error || data.t - last < SPACING) continue;
    record(team, "position error", "m", undefined, data.t, error[0]);
    record(team, "orientation error", "rad", undefined, data.t, error[1]);
  }
  if (model.bodies.names.length > TRAILED) return;
  for (let i = 0; i < data.x.length; i++) {
    const pose = poseOf(model, i);
    if (!pose) continue;
    if (!model.trails.has(i)) model.trails.set(i, []);
    const trail = model.trails.get(i), last = trail.at(-1);
    const way = last ? Math.hypot(last[0] - pose.x, last[1] - pose.y) : Infinity;
    if (last && way > JUMP) trail.length = 0;
    if (way > TRAIL_STEP) trail.push([pose.x, pose.y]);
    if (trail.length > TRAIL_LENGTH) trail.splice(0, TRAIL_LENGTH / 3);
  }
}

const takers = {
  suite: (model, data) => { model.suite = data; },
  map: (model, data) => { model.map = data; },
  poses: takePoses,
  belief: (model, data) => { model.belief = data.rows; },
  bodies: (model, data) => {
    if (data.revision !== model.bodies?.revision) for (const team of model.teams.values()) team.series.clear();
    model.bodies = data; model.poses = null; model.time = null; model.trails.clear();
    model.index = new Map(data.names.map((name, i) => [name, i]));
    for (const team of model.teams.values()) takeMembers(model, team);
  },
  teams: (model, data) => {
    model.spaces = data.spaces;
    for (const space of model.teams.keys()) if (!data.spaces.includes(space)) model.teams.delete(space);
  },
  team: (model, data) => {
    const team = teamOf(model, data.space);
    if (team.state && team.state.job !== data.job) {
      for (const i of [...team.members, model.index.get(data.object)]) model.trails.delete(i);
    }
    team.state = data;
  },
  members: (model, data) => {
    const team = teamOf(model, data.space);
    team.robots = data.robots; takeMembers(model, team);
  },
  log: (model, data) => { teamOf(model, data.space).log = data.entries; },
  plan: (model, data) => { teamOf(model, data.space).plan = data; },
  panel: (model, data) => {
    const team = teamOf(model, data.space);
    Object.assign(team, {rows: data.rows, shapes: data.shapes});
    if (model.time === null || !busy(team)) return;
    let method = "";
    for (const {name, text, unit, limit, value} of data.rows) {
      if (name === "method") method = text;
      const label = OWN.includes(name) ? `${name} (${method})` : name;   // its own error is another figure
      if (value !== undefined) record(team, label, unit, limit, model.time, value);
    }
  },
};

function takeMembers(model, team) {
  team.members = new Set(team.robots.map(r => model.index.get(r)).filter(i => i !== undefined));
}

export const KINDS = Object.keys(takers);

// now: [ms] of a monotonic clock
export function take(model, kind, data, now) {
  model.heard = now;
  takers[kind](model, data);
}

export const busy = team => Boolean(team?.state) && team.state.state !== "IDLE";

export function poseOf(model, i) {
  const p = model.poses;
  if (i === undefined || !p || p.x[i] == null) return null;
  return {x: p.x[i] * LENGTH, y: p.y[i] * LENGTH, theta: p.a[i] * ANGLE};
}

// Index of the body at a place [m], robots before objects; undefined where there is none.
export function bodyAt(model, {x, y}) {
  const hits = (model.bodies?.names ?? []).map((_, i) => i).filter(i => {
    const pose = poseOf(model, i);
    return pose && inside(model.bodies.types[model.bodies.type[i]].outline, pose, x, y);
  });
  return hits[0];
}

function inside(outline, pose, x, y) {
  const c = Math.cos(pose.theta), s = Math.sin(pose.theta);
  const u = c * (x - pose.x) + s * (y - pose.y), v = -s * (x - pose.x) + c * (y - pose.y);
  let odd = false;
  outline.forEach(([ax, ay], i) => {
    const [bx, by] = outline[(i + 1) % outline.length];
    if (ay > v !== by > v && u < ax + (v - ay) * (bx - ax) / (by - ay)) odd = !odd;
  });
  return odd;
}

// Why a team accepts no goal now; empty if it does. A paused suite accepts goals.
export function trouble(model, space, now) {
  if (model.heard === -Infinity) return "connecting to the viewer";
  if (now - model.heard > LONGEST_SILENCE) return "the viewer does not respond any more";
  if (!model.suite) return "connecting to the viewer";
  if (model.suite.trouble) return model.suite.trouble;
  if (!space) return "no node accepts goals yet";
  return model.suite.teams[space] ?? "no node accepts goals yet";
}

// The answer to a goal that this page sent, found by its stamp: {kind, text}, or null.
export function answerTo(sent, team) {
  if (!sent?.stamp && sent?.text) return {kind: "taken", text: sent.text};
  if (!sent || !team?.state) return sent ? {kind: "waiting", text: "the goal is sent"} : null;
  const state = team.state;
  if (state.refusals > 0 && state.refused_stamp === sent.stamp) {
    return {kind: "refused", text: `the goal was refused: ${state.refusal}`};
  }
  if (state.stamp === sent.stamp && state.state === "IDLE" && state.code) return {kind: "refused", text: state.reason};
  if (state.stamp === sent.stamp) {
    return {kind: "taken", text: state.plan_ready ? "the plan waits for Execute" : "the goal is accepted"};
  }
  return {kind: "waiting", text: "the goal is sent"};
}
