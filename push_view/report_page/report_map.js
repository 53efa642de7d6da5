"use strict";
// The map of a report: walls, plans, trails, bodies and shapes at one time.

const theme = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// A colour as it can be read on the ground of the page: on a dark one it is mixed with white.
const dark = () => matchMedia("(prefers-color-scheme: dark)").matches;
const shade = (colour) => {
  if (!dark() || !/^#[0-9a-f]{6}$/i.test(colour)) return colour;
  const parts = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
  if (Math.min(...parts) > 150) return colour;
  return "#" + parts.map((v) => Math.round(v + 0.35 * (255 - v)).toString(16).padStart(2, "0")).join("");
};

class RunMap {
  constructor(canvas, data) {
    this.canvas = canvas;
    this.data = data;
    this.frame = 0;
  }

  // Last index of sorted times that is not after a time; -1 before the first.
  static at(times, time) {
    let low = -1, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= time + 1e-9) low = middle; else high = middle - 1;
    }
    return low;
  }

  draw(time) {
    const { canvas, data } = this;
    const box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(box.width * ratio);
    canvas.height = Math.round(box.height * ratio);
    const [x0, x1, y0, y1] = data.map.extent;
    const scale = Math.min(canvas.width / (x1 - x0), canvas.height / (y1 - y0));
    const left = (canvas.width - scale * (x1 - x0)) / 2, low = (canvas.height - scale * (y1 - y0)) / 2;
    const pen = this.pen = canvas.getContext("2d");
    this.place = (x, y) => [left + scale * (x - x0), canvas.height - low - scale * (y - y0)];
    this.scale = scale;
    this.ratio = ratio;
    pen.lineJoin = "round";
    this.walls();
    const frame = Math.max(0, RunMap.at(data.times, time));
    this.jobs(time);
    if (!data.times.length) return;
    this.trails(frame);
    this.bodies(frame);
    this.shapes(time);
  }

  path(points, closed) {
    this.pen.beginPath();
    points.forEach((p, k) => {
      const [x, y] = this.place(p[0], p[1]);
      if (k) this.pen.lineTo(x, y); else this.pen.moveTo(x, y);
    });
    if (closed) this.pen.closePath();
  }

  disc(x, y, radius) {
    const [px, py] = this.place(x, y);
    this.pen.beginPath();
    this.pen.arc(px, py, Math.max(1, radius * this.scale), 0, 2 * Math.PI);
  }

  walls() {
    const { pen, data } = this;
    pen.fillStyle = pen.strokeStyle = theme("--wall");
    pen.lineWidth = 1.5 * this.ratio;
    if (data.map.room) {
      const [a, b, c, d] = data.map.room;
      this.path([[a, c], [b, c], [b, d], [a, d]], true);
      pen.stroke();
    }
    for (const polygon of data.map.polygons) { this.path(polygon, true); pen.fill(); }
    for (const [x, y, r] of data.map.circles) { this.disc(x, y, r); pen.fill(); }
  }

  jobs(time) {
    const { pen, data } = this;
    for (const job of data.jobs) {
      pen.setLineDash([6 * this.ratio, 4 * this.ratio]);
      pen.strokeStyle = theme("--plan");
      pen.lineWidth = this.ratio;
      for (const way of job.plan) { this.path(way); pen.stroke(); }
      pen.setLineDash([]);
      const goal = job.goals.filter((g) => g.time <= time + 1e-9).pop() || job.goals[0];
      const body = data.bodies.find((b) => b.name === job.object);
      if (!goal || !body) continue;
      pen.strokeStyle = theme("--goal");
      pen.lineWidth = 2 * this.ratio;
      const [x, y, a] = goal.pose;
      this.path(RunMap.outline(body, x, y, a === null ? 0 : a), true);
      pen.stroke();
    }
  }

  static outline(body, x, y, a) {
    const c = Math.cos(a), s = Math.sin(a);
    return body.outline.map(([u, v]) => [x + c * u - s * v, y + s * u + c * v]);
  }

  trails(frame) {
    const { pen, data } = this;
    const few = data.bodies.length <= 60;
    pen.lineWidth = (few ? 1.5 : 0.5) * this.ratio;
    data.bodies.forEach((body, k) => {
      if (!few && body.robot) return;
      const [xs, ys] = data.poses[k];
      pen.strokeStyle = shade(body.colour);
      pen.beginPath();
      let down = false;
      for (let i = 0; i <= frame; i += 1) {
        if (xs[i] === null) { down = false; continue; }
        const [x, y] = this.place(xs[i] * 1e-4, ys[i] * 1e-4);
        if (down) pen.lineTo(x, y); else pen.moveTo(x, y);
        down = true;
      }
      pen.stroke();
    });
  }

  bodies(frame) {
    const { pen, data } = this;
    const order = [...data.bodies.keys()].sort((a, b) => data.bodies[a].robot - data.bodies[b].robot);
    for (const k of order) {
      const [xs, ys, as] = data.poses[k];
      if (xs[frame] === null) continue;
      const body = data.bodies[k], x = xs[frame] * 1e-4, y = ys[frame] * 1e-4, a = as[frame] * 1e-3;
      this.path(RunMap.outline(body, x, y, a), true);
      pen.fillStyle = shade(body.colour) + "99";
      pen.strokeStyle = shade(body.colour);
      pen.lineWidth = 1.2 * this.ratio;
      pen.fill();
      pen.stroke();
      if (!body.robot || data.bodies.length > 60) continue;
      const reach = Math.max(...body.outline.map(([u]) => u));
      this.path([[x, y], [x + reach * Math.cos(a), y + reach * Math.sin(a)]]);
      pen.strokeStyle = theme("--ink");
      pen.stroke();
    }
  }

  shapes(time) {
    const { pen, data } = this;
    const k = RunMap.at(data.moments.map((m) => m.time), time);
    if (k < 0 || time - data.moments[k].time > 4) return;
    for (const shape of data.moments[k].shapes) {
      pen.strokeStyle = pen.fillStyle = shade(shape.colour);
      pen.lineWidth = 1.2 * this.ratio;
      if (shape.kind === 3) {
        for (let i = 0; i + 1 < shape.points.length; i += 2) this.arrow(shape.points[i], shape.points[i + 1]);
      } else if (shape.kind === 2) {
        pen.globalAlpha = 0.5;
        for (const [x, y] of shape.points) { this.disc(x, y, shape.radius); pen.fill(); }
        pen.globalAlpha = 1;
      } else {
        this.path(shape.points, shape.kind === 1);
        pen.stroke();
      }
    }
  }

  arrow(tail, head) {
    const [x0, y0] = this.place(...tail), [x1, y1] = this.place(...head), pen = this.pen;
    const along = Math.atan2(y1 - y0, x1 - x0), size = Math.min(7 * this.ratio, Math.hypot(x1 - x0, y1 - y0));
    pen.beginPath();
    pen.moveTo(x0, y0);
    pen.lineTo(x1, y1);
    for (const turn of [2.7, -2.7]) {
      pen.moveTo(x1, y1);
      pen.lineTo(x1 + size * Math.cos(along + turn), y1 + size * Math.sin(along + turn));
    }
    pen.stroke();
  }
}
