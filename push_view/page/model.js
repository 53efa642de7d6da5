// The state of the page, updated by the events of the server.

export const LONGEST_SILENCE = 800;   // [ms] without an event after which the server counts as gone
const TRAIL_STEP = 0.004, TRAIL_LENGTH = 3000, TRAILED = 60;   // [m], points, bodies
const LENGTH = 1e-4, ANGLE = 1e-3;    // units of poses: [m], [rad]

export const emptyModel = () => ({
  bodies: null, index: new Map(), poses: null, time: null, lost: new Set(), trails: new Map(),
  map: null, spaces: [], teams: new Map(), suite: null, heard: -Infinity,
});

export const newTeam = () => ({
  state: null, robots: [], log: [], path: null, rows: [], shapes: [], members: new Set(), job: null,
});

const teamOf = (model, space) => {
  if (!model.teams.has(space)) model.teams.set(space, newTeam());
  return model.teams.get(space);
};

function takePoses(model, data) {
  if (data.revision !== model.bodies?.revision) return;
  if (model.time !== null && data.t < model.time - 0.5) model.trails.clear();
  model.poses = data; model.time = data.t; model.lost = new Set(data.lost);
  if (model.bodies.names.length > TRAILED) return;
  for (let i = 0; i < data.x.length; i++) {
    const pose = poseOf(model, i);
    if (!pose) continue;
    if (!model.trails.has(i)) model.trails.set(i, []);
    const trail = model.trails.get(i), last = trail.at(-1);
    if (!last || Math.hypot(last[0] - pose.x, last[1] - pose.y) > TRAIL_STEP) trail.push([pose.x, pose.y]);
    if (trail.length > TRAIL_LENGTH) trail.splice(0, TRAIL_LENGTH / 3);
  }
}

const takers = {
  suite: (model, data) => { model.suite = data; },
  map: (model, data) => { model.map = data; },
  poses: takePoses,
  bodies: (model, data) => {
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
  path: (model, data) => { teamOf(model, data.space).path = data; },
  panel: (model, data) => { Object.assign(teamOf(model, data.space), {rows: data.rows, shapes: data.shapes}); },
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

export function poseOf(model, i) {
  const p = model.poses;
  if (i === undefined || !p || p.x[i] == null) return null;
  return {x: p.x[i] * LENGTH, y: p.y[i] * LENGTH, theta: p.a[i] * ANGLE};
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
  if (!sent || !team?.state) return sent ? {kind: "waiting", text: "the goal is sent"} : null;
  const state = team.state;
  if (state.refusals > 0 && state.refused_stamp === sent.stamp) {
    return {kind: "refused", text: `the goal was refused: ${state.refusal}`};
  }
  if (state.stamp === sent.stamp) return {kind: "taken", text: "the goal is accepted"};
  return {kind: "waiting", text: "the goal is sent"};
}
