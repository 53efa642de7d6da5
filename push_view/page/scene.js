// Draws a model on a canvas: map, plans, trails, bodies, goals. If there are many bodies, those that
// look alike are drawn once, as a picture that is then copied to each of them.

import {poseOf} from "./model.js";

const GOAL = "#c22f3d", PLAN = "#777777";
const TEAMS = ["#2a62c9", "#7b3fb3", "#1c8a7a", "#b3436f", "#5b6f1d", "#3d7ea6", "#8a5a2b", "#4b4f9c"];
const MANY = 100;   // bodies from which on they are pictures
const EMPTY = [-1.5, 1.5, -1, 1];

export const teamColor = number => TEAMS[number % TEAMS.length];

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

export class Scene {
  constructor(canvas) { this.canvas = canvas; this.pen = canvas.getContext("2d"); this.map = null; this.pictures = new Map(); }

  frame(model) { return fitted(model.map?.extent, this.canvas.width, this.canvas.height); }

  // Position of a pointer event, in metres and in CSS pixels.
  place(model, event) {
    const box = this.canvas.getBoundingClientRect(), ratio = this.canvas.width / box.width;
    const pixel = {x: event.clientX - box.left, y: event.clientY - box.top};
    return {pixel, metres: toMetres(this.frame(model), pixel.x * ratio, pixel.y * ratio)};
  }

  draw(model, chosen, drag) {
    const box = this.canvas.getBoundingClientRect(), ratio = this.ratio = devicePixelRatio;
    const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio);
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, {width, height});
    const f = this.frame(model), pen = this.pen;
    pen.clearRect(0, 0, width, height);
    if (this.map && model.map) {
      pen.imageSmoothingEnabled = false;
      pen.drawImage(this.map, ...toPixels(f, f.x0, f.y1), f.scale * (f.x1 - f.x0), f.scale * (f.y1 - f.y0));
    }
    for (const space of model.spaces) {
      const path = model.teams.get(space)?.path;
      if (path) this.line(f, path.x.map((x, i) => [x, path.y[i]]), PLAN, space === chosen ? 1.5 : 0.8, [6, 5]);
    }
    if (!model.bodies) return;
    const colors = this.colors(model);
    for (const [i, trail] of model.trails) this.line(f, trail, colors[i] + "90", 1.5);
    for (const space of model.spaces) {
      const state = model.teams.get(space)?.state;
      if (state?.goal) this.object(f, model, state.object, state.goal, space === chosen ? 2 : 1, false);
    }
    for (const space of model.spaces) this.layers(f, model.teams.get(space)?.shapes ?? []);
    this.bodies(f, model, colors);
    const item = model.teams.get(chosen)?.state?.object;
    if (drag && item) this.object(f, model, item, [drag.place.x, drag.place.y, drag.theta], 2, drag.long);
    if (drag) this.arrow(f, drag);
  }

  // What methods report: polylines, polygons, discs and arrows; points in millimetres.
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
    pen.globalAlpha = 0.6; pen.fillStyle = colour;
    for (const [x, y] of points) {
      pen.beginPath();
      pen.arc(...toPixels(f, x, y), Math.max(2 * this.ratio, radius * f.scale), 0, 2 * Math.PI);
      pen.fill();
    }
    pen.globalAlpha = 1;
  }

  pointed(f, tail, head, colour) {
    const a = Math.atan2(head[1] - tail[1], head[0] - tail[0]), l = 7 * this.ratio / f.scale;
    const barb = turn => [head[0] - l * Math.cos(a + turn), head[1] - l * Math.sin(a + turn)];
    this.line(f, [tail, head], colour, 2);
    this.line(f, [barb(0.4), head, barb(-0.4)], colour, 2);
  }

  // Colour by body: its type's, or its team's where there are several teams.
  colors(model) {
    const {type, types} = model.bodies, result = type.map(t => types[t].color);
    if (model.spaces.length > 1) {
      model.spaces.forEach((space, n) => {
        for (const i of model.teams.get(space)?.members ?? []) result[i] = teamColor(n);
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
