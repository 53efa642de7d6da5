// Draws a model on a canvas: map, plans, trails, bodies, goals. If there are many bodies, those that
// look alike are drawn once, as a picture that is then copied to each of them.

import {WHOLE, panned, seen, zoomed} from "./camera.js";
import {poseOf} from "./model.js";

const GOAL = "#c22f3d";
const MANY = 100;    // bodies from which on they are pictures
const NAMED = 60;    // bodies up to which each is named
const EMPTY = [-1.5, 1.5, -1, 1];
const FORMER = 0.3;  // opacity of what belongs to a job that has ended

export const teamColor = (model, number) => {
  const palette = model.bodies?.palette ?? ["#0072b2"];
  return palette[number % palette.length];
};

// Conversion of metres to pixels of the canvas, into which the map is fitted.
export function fitted(extent, width, height) {
  const [x0, x1, y0, y1] = extent ?? EMPTY;
  const scale = 0.96 * Math.min(width / (x1 - x0), height / (y1 - y0));
  return {scale, x0, x1, y0, y1, ox: width / 2 - scale * (x0 + x1) / 2, oy: height / 2 + scale * (y0 + y1) / 2};
}
export const toPixels = (f, x, y) => [f.ox + f.scale * x, f.oy - f.scale * y];
export const toMetres = (f, u, v) => ({x: (u - f.ox) / f.scale, y: (f.oy - v) / f.scale});

// As many vertices as are visible when the outline is drawn with a scale [pixels/m].
export function thinned(outline, scale) {
  const reach = scale * Math.max(...outline.map(p => Math.hypot(...p)));
  const most = Math.max(8, Math.ceil(4 * Math.sqrt(reach)) * 2);
  const step = Math.ceil(outline.length / most);
  return step < 2 || outline.length <= 12 ? outline : outline.filter((_, i) => i % step === 0);
}

const ended = team => team?.state?.state === "IDLE" && !team.state.plan_ready;

// What can be shown or hidden: name and colour of each layer of a model, for the legend.
export function layersOf(model, chosen) {
  const layers = new Map([["obstacles", "#6e6e6e"], ["names", ""], ["trails", ""], ["goals", GOAL]]);
  for (const space of model.spaces) {
    const team = model.teams.get(space);
    if (team?.plan.ways.length) layers.set("ways of robots", "");
    if (team?.plan.pushes.length) layers.set("plan", "");
    for (const {layer, colour} of team?.shapes ?? []) layers.set(layer, colour);
  }
  return layers;
}

export class Scene {
  constructor(canvas) {
    this.canvas = canvas; this.pen = canvas.getContext("2d"); this.map = null; this.pictures = new Map();
    this.camera = WHOLE; this.follow = false; this.hidden = new Set(); this.ghost = null; this.ink = "#1d2129";
  }

  frame(model) {
    const {width, height} = this.canvas;
    return seen(fitted(model.map?.extent, width, height), this.camera, width, height);
  }

  // Position of a pointer event, in metres and in CSS pixels.
  place(model, event) {
    const box = this.canvas.getBoundingClientRect(), ratio = this.canvas.width / box.width;
    const pixel = {x: event.clientX - box.left, y: event.clientY - box.top};
    return {pixel, metres: toMetres(this.frame(model), pixel.x * ratio, pixel.y * ratio)};
  }

  // pixel: CSS pixels; null: the middle of the canvas.
  zoom(model, factor, pixel) {
    const {width, height} = this.canvas, r = this.ratio ?? 1;
    const [u, v] = pixel ? [pixel.x * r, pixel.y * r] : [width / 2, height / 2];
    this.camera = zoomed(this.camera, this.frame(model), factor, u, v, width, height);
  }
  pan(model, dx, dy) {
    const {width, height} = this.canvas, r = this.ratio ?? 1;
    this.camera = panned(this.camera, this.frame(model), dx * r, dy * r, width, height);
    this.follow = false;
  }
  whole() { this.camera = WHOLE; this.follow = false; }

  shown(layer) { return !this.hidden.has(layer); }

  draw(model, chosen, drag) {
    const box = this.canvas.getBoundingClientRect(), ratio = this.ratio = devicePixelRatio;
    const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio);
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, {width, height});
    const style = getComputedStyle(this.canvas);
    this.ink = style.color; this.paper = style.backgroundColor;
    const item = model.teams.get(chosen)?.state?.object;
    const middle = this.follow && poseOf(model, model.index.get(item));
    if (middle) this.camera = {...this.camera, x: middle.x, y: middle.y};
    const f = this.frame(model), pen = this.pen;
    pen.clearRect(0, 0, width, height);
    if (this.shown("obstacles")) this.obstacles(f, model);
    if (!model.bodies) return;
    for (const space of model.spaces) this.plan(f, model, model.teams.get(space), space === chosen);
    const colors = this.colors(model);
    if (this.shown("trails")) for (const [i, trail] of model.trails) this.line(f, trail, colors[i] + "90", 1.5);
    for (const space of this.shown("goals") ? model.spaces : []) {
      const team = model.teams.get(space), state = team?.state;
      pen.globalAlpha = ended(team) ? FORMER : 1;
      if (state?.goal) this.object(f, model, state.object, state.goal, space === chosen ? 2 : 1, false);
      pen.globalAlpha = 1;
    }
    for (const space of model.spaces) {
      const team = model.teams.get(space);
      pen.globalAlpha = ended(team) ? FORMER : 1;
      this.layers(f, (team?.shapes ?? []).filter(s => this.shown(s.layer)));
      pen.globalAlpha = 1;
    }
    this.bodies(f, model, colors);
    if (this.shown("names")) this.names(f, model);
    if (this.ghost) this.object(f, model, this.ghost.name, this.ghost.pose, 2, true);
    if (drag && item) this.object(f, model, item, [drag.place.x, drag.place.y, drag.theta], 2, drag.long);
    if (drag) this.arrow(f, drag);
    this.ruler(f);
  }

  obstacles(f, model) {
    const pen = this.pen, known = model.bodies?.obstacles;
    if (!known) {
      if (!this.map || !model.map) return;
      pen.imageSmoothingEnabled = false;
      pen.drawImage(this.map, ...toPixels(f, f.x0, f.y1), f.scale * (f.x1 - f.x0), f.scale * (f.y1 - f.y0));
      return;
    }
    const [w, h] = known.size, wall = "#6e6e6e";
    this.line(f, [[-w / 2, -h / 2], [w / 2, -h / 2], [w / 2, h / 2], [-w / 2, h / 2], [-w / 2, -h / 2]], wall, 3);
    pen.fillStyle = wall;
    for (const {points, centre, radius} of known.shapes) {
      pen.beginPath();
      if (centre) pen.arc(...toPixels(f, ...centre), radius * f.scale, 0, 2 * Math.PI);
      else points.forEach((p, i) => pen[i ? "lineTo" : "moveTo"](...toPixels(f, ...p)));
      pen.fill();
    }
  }

  // Pushes with their names where they begin, the one under way wide; ways of robots dotted.
  plan(f, model, team, chosen) {
    if (!team) return;
    const {pushes, ways} = team.plan, former = ended(team) && !team.state.plan_ready;
    this.pen.globalAlpha = former ? FORMER : 1;
    if (this.shown("plan")) pushes.forEach((push, i) => {
      const now = chosen && !former && team.state?.step[0] === i + 1;
      this.line(f, push.points, push.colour, now ? 3.5 : 1.6, [7, 4]);
      if (pushes.length <= 12) this.label(f, push.name, push.points[push.points.length >> 1], push.colour, 10);
    });
    if (this.shown("ways of robots") && !former) for (const {robot, points} of ways) {
      this.line(f, points, model.bodies.colours[model.index.get(robot)] ?? this.ink, 1.2, [2, 3]);
    }
    this.pen.globalAlpha = 1;
  }

  label(f, text, [x, y], colour, up = 0) {
    const pen = this.pen, [u, v] = toPixels(f, x, y), r = this.ratio;
    pen.font = `${11 * r}px system-ui, sans-serif`; pen.textAlign = "center";
    pen.lineWidth = 3 * r; pen.strokeStyle = this.paper; pen.lineJoin = "round";
    pen.strokeText(text, u, v - up * r); pen.fillStyle = colour; pen.fillText(text, u, v - up * r);
  }

  names(f, model) {
    if (model.bodies.names.length > NAMED) return;
    model.bodies.names.forEach((name, i) => {
      const pose = poseOf(model, i);
      if (!pose) return;
      const outline = model.bodies.types[model.bodies.type[i]].outline;
      const reach = f.scale * Math.max(...outline.map(p => Math.hypot(...p))) / this.ratio;
      this.label(f, name, [pose.x, pose.y], this.ink, model.bodies.types[model.bodies.type[i]].robot ? -reach - 12 : reach + 5);
    });
  }

  // A bar of a round length in the corner.
  ruler(f) {
    const r = this.ratio, most = 140 * r / f.scale, power = 10 ** Math.floor(Math.log10(most));
    const length = [5, 2, 1].map(k => k * power).find(l => l <= most) ?? power;
    const x = this.canvas.width - 16 * r, y = this.canvas.height - 14 * r, pen = this.pen;
    pen.beginPath(); pen.moveTo(x - length * f.scale, y); pen.lineTo(x, y);
    pen.strokeStyle = this.ink; pen.lineWidth = 2 * r; pen.stroke();
    const text = length >= 1 ? `${length} m` : length >= 0.01 ? `${Math.round(100 * length)} cm` : `${Math.round(1e3 * length)} mm`;
    pen.font = `${11 * r}px system-ui, sans-serif`; pen.textAlign = "right"; pen.fillStyle = this.ink;
    pen.fillText(text, x, y - 5 * r);
  }

  // Shapes of reports: polylines, polygons, discs and arrows; points in millimetres.
  layers(f, shapes) {
    for (const {kind, colour, radius, points} of shapes) {
      const metres = points.map(([x, y]) => [x / 1e3, y / 1e3]);
      if (kind === 2) this.discs(f, metres, colour, radius);
      else if (kind === 3) for (let i = 0; i + 1 < metres.length; i += 2) this.pointed(f, metres[i], metres[i + 1], colour);
      else this.line(f, kind === 1 && metres.length ? [...metres, metres[0]] : metres, colour, 1);
    }
  }

  discs(f, points, colour, radius) {
    const pen = this.pen;
    const alpha = pen.globalAlpha;
    pen.globalAlpha = 0.6 * alpha; pen.fillStyle = colour;
    for (const [x, y] of points) {
      pen.beginPath();
      pen.arc(...toPixels(f, x, y), Math.max(2 * this.ratio, radius * f.scale), 0, 2 * Math.PI);
      pen.fill();
    }
    pen.globalAlpha = alpha;
  }

  pointed(f, tail, head, colour) {
    const a = Math.atan2(head[1] - tail[1], head[0] - tail[0]), l = 7 * this.ratio / f.scale;
    const barb = turn => [head[0] - l * Math.cos(a + turn), head[1] - l * Math.sin(a + turn)];
    this.line(f, [tail, head], colour, 2);
    this.line(f, [barb(0.4), head, barb(-0.4)], colour, 2);
  }

  // Colour by body: its own, or that of its team if there are several teams.
  colors(model) {
    const result = [...model.bodies.colours];
    if (model.spaces.length > 1) {
      model.spaces.forEach((space, n) => {
        for (const i of model.teams.get(space)?.members ?? []) result[i] = teamColor(model, n);
      });
    }
    return result;
  }

  bodies(f, model, colors) {
    const groups = new Map(), many = model.bodies.names.length >= MANY;
    for (let i = 0; i < model.bodies.names.length; i++) {
      const key = `${model.bodies.type[i]} ${colors[i]} ${model.lost.has(i)}`;
      if (!groups.has(key)) groups.set(key, []);
      groups.get(key).push(i);
    }
    for (const members of groups.values()) {
      const i = members[0], lost = model.lost.has(i);
      const outline = model.bodies.types[model.bodies.type[i]].outline;
      const poses = members.map(m => poseOf(model, m)).filter(p => p);
      this.pen.globalAlpha = lost ? 0.4 : 1;
      if (many) this.put(f, this.picture(f, outline, colors[i], [model.bodies.revision, model.bodies.type[i]]), poses);
      else this.shapes(this.pen, f, outline, poses, colors[i]);
      this.pen.globalAlpha = 1;
    }
  }

  // An outline with heading 0, in the middle of its own canvas.
  picture(f, outline, color, of) {
    const key = `${of} ${color} ${f.scale} ${this.ratio}`;
    if (!this.pictures.has(key)) {
      if (this.pictures.size > 64) this.pictures.clear();
      const reach = f.scale * Math.max(...outline.map(p => Math.hypot(...p))) + 2 * this.ratio;
      const made = document.createElement("canvas");
      made.width = made.height = 2 * Math.ceil(reach);
      const middle = {scale: f.scale, ox: made.width / 2, oy: made.width / 2};
      this.shapes(made.getContext("2d"), middle, outline, [{x: 0, y: 0, theta: 0}], color);
      this.pictures.set(key, made);
    }
    return this.pictures.get(key);
  }

  put(f, picture, poses) {
    const pen = this.pen, half = picture.width / 2;
    pen.imageSmoothingEnabled = true;
    for (const pose of poses) {
      const c = Math.cos(pose.theta), s = Math.sin(pose.theta), [x, y] = toPixels(f, pose.x, pose.y);
      pen.setTransform(c, -s, s, c, x, y);
      pen.drawImage(picture, -half, -half);
    }
    pen.resetTransform();
  }

  shapes(pen, f, outline, poses, color) {
    const points = thinned(outline, f.scale), alpha = pen.globalAlpha;
    const reach = 0.6 * Math.max(...outline.map(p => Math.hypot(...p)));
    const small = reach * f.scale < 6 * this.ratio;
    pen.beginPath();
    for (const pose of poses) {
      const c = f.scale * Math.cos(pose.theta), s = f.scale * Math.sin(pose.theta);
      const [x, y] = toPixels(f, pose.x, pose.y);
      points.forEach(([u, v], i) => pen[i ? "lineTo" : "moveTo"](x + c * u - s * v, y - s * u - c * v));
      pen.closePath();
    }
    pen.globalAlpha = 0.35 * alpha; pen.fillStyle = color; pen.fill(); pen.globalAlpha = alpha;
    for (const pose of poses) {   // headings
      const [x, y] = toPixels(f, pose.x, pose.y);
      pen.moveTo(x, y);
      pen.lineTo(x + f.scale * reach * Math.cos(pose.theta), y - f.scale * reach * Math.sin(pose.theta));
    }
    pen.strokeStyle = color; pen.lineWidth = (small ? 1 : 2) * this.ratio; pen.setLineDash([]); pen.stroke();
  }

  object(f, model, name, [x, y, theta], width, filled) {
    const i = model.index.get(name);
    if (i === undefined) return;
    const outline = model.bodies.types[model.bodies.type[i]].outline, c = Math.cos(theta), s = Math.sin(theta);
    const points = outline.map(([u, v]) => [x + c * u - s * v, y + s * u + c * v]);
    this.line(f, [...points, points[0]], GOAL, width);
    if (filled) { this.pen.globalAlpha = 0.25; this.pen.fillStyle = GOAL; this.pen.fill(); this.pen.globalAlpha = 1; }
    const reach = 0.6 * Math.max(...outline.map(p => Math.hypot(...p)));
    this.line(f, [[x, y], [x + c * reach, y + s * reach]], GOAL, width);
  }

  arrow(f, drag) {
    const {x, y} = drag.place, reach = 60 * this.ratio / f.scale;
    const tip = [x + reach * Math.cos(drag.theta), y + reach * Math.sin(drag.theta)];
    if (drag.long) this.line(f, [[x, y], tip], GOAL, 2);
    else this.line(f, [[x, y], [x + 0.01, y]], GOAL, 6);
  }

  line(f, points, style, width, dash = []) {
    if (points.length < 2) return;
    const pen = this.pen;
    pen.beginPath();
    points.forEach((p, i) => pen[i ? "lineTo" : "moveTo"](...toPixels(f, p[0], p[1])));
    pen.strokeStyle = style; pen.lineWidth = width * this.ratio;
    pen.setLineDash(dash.map(d => d * this.ratio)); pen.stroke(); pen.setLineDash([]);
  }
}
