// A bag as a model at any time. Times are seconds since the first frame of the bag.

import {emptyModel, newTeam} from "./model.js";

const STEP = 40, TRAILED = 60;   // [0.1 mm] between points of a trail, bodies with one

// Index of the last element that is at most t; -1 if there is none.
export function lastBefore(times, t) {
  let low = 0, high = times.length;
  while (low < high) { const middle = (low + high) >> 1; if (times[middle] <= t) low = middle + 1; else high = middle; }
  return low - 1;
}

export class Recording {
  constructor(data) {
    const first = data.t[0] ?? 0, since = t => Math.max(0, t - first);
    this.begin = first; this.name = data.name; this.metadata = data.metadata; this.trouble = data.trouble;
    this.t = data.t.map(since);
    this.duration = this.t.at(-1) ?? 0;
    this.poses = data.poses;
    this.trails = data.bodies.names.length > TRAILED ? [] : data.poses.map(([x, y]) => trail(x, y));
    this.teams = data.teams.map(team => ({...team,
      states: team.states.map(s => ({...s, t: since(s.t)})),
      plans: team.plans.map(p => ({...p, t: since(p.t)})),
      moments: team.moments.map(list => list.map(m => ({...m, t: since(m.t)}))),
      series: new Map(Object.entries(team.series).map(([name, s]) => [name, {...s, t: s.t.map(since)}]))}));
    this.model = emptyModel();
    Object.assign(this.model, {bodies: data.bodies, index: new Map(data.bodies.names.map((n, i) => [n, i])),
      map: {extent: data.extent}, spaces: this.teams.map(t => t.space)});
    this.seek(0);
  }

  // The model at a time.
  seek(t) {
    const model = this.model, k = Math.max(0, lastBefore(this.t, t));
    model.time = this.t[k] ?? 0;
    model.poses = {t: model.time, x: this.poses.map(p => p[0][k]), y: this.poses.map(p => p[1][k]), a: this.poses.map(p => p[2][k])};
    model.lost = new Set();
    this.trails.forEach(({frames, points}, i) => model.trails.set(i, points.slice(0, lastBefore(frames, k) + 1)));
    for (const recorded of this.teams) {
      if (!model.teams.has(recorded.space)) {
        const team = newTeam();
        team.robots = recorded.robots; team.series = recorded.series;
        team.members = new Set(recorded.robots.map(r => model.index.get(r)).filter(i => i !== undefined));
        model.teams.set(recorded.space, team);
      }
      fill(model.teams.get(recorded.space), recorded, t);
    }
    return model;
  }

  // The next or the previous frame from a time: direction 1 or -1.
  step(t, direction) {
    const k = lastBefore(this.t, t) + direction;
    return this.t[Math.min(Math.max(k, 0), this.t.length - 1)] ?? 0;
  }
}

function fill(team, recorded, t) {
  const state = recorded.states[lastBefore(recorded.states.map(s => s.t), t)];
  team.state = state ? {system: recorded.system, object: recorded.object, refusals: 0, ...state} : null;
  team.plan = recorded.plans[lastBefore(recorded.plans.map(p => p.t), t)] ?? {pushes: [], ways: []};
  const now = recorded.moments.map(list => list[lastBefore(list.map(m => m.t), t)]).filter(m => m);
  team.rows = now.flatMap(m => m.rows); team.shapes = now.flatMap(m => m.shapes);
  team.log = recorded.states.filter(s => s.t <= t).map(s => [s.t, s.state, s.reason]);
}

// Points [m] of a way that are some distance apart, and the frames that they are of.
function trail(x, y) {
  const frames = [], points = [];
  let u = Infinity, v = Infinity;
  for (let k = 0; k < x.length; k++) {
    if (x[k] === null || Math.hypot(x[k] - u, y[k] - v) < STEP) continue;
    u = x[k]; v = y[k]; frames.push(k); points.push([u * 1e-4, v * 1e-4]);
  }
  return {frames, points};
}
