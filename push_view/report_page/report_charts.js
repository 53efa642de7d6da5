"use strict";
// Charts over time as SVG, with a cursor at the time of the map.

const SVG = "http://www.w3.org/2000/svg";
const WIDE = 520, HIGH = 170, LEFT = 46, RIGHT = 18, TOP = 8, BOTTOM = 22;

const element = (name, values = {}, parent = null, text = "") => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(values)) made.setAttribute(key, value);
  if (text) made.textContent = text;
  if (parent) parent.append(made);
  return made;
};

// Round steps of which about `count` fit between two numbers.
const ticks = (low, high, count) => {
  const raw = (high - low) / count || 1, power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((s) => s * power >= raw - 1e-12);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) found.push(k * step);
  return found;
};

const short = (value) => {
  if (value === null || value === undefined) return "–";
  const size = Math.abs(value);
  if (size >= 1e5 || (size > 0 && size < 1e-3)) return value.toExponential(1);
  return String(+value.toPrecision(4));
};

class Chart {
  constructor(spec, span, bands, go) {
    this.spec = spec;
    this.span = span;
    const values = spec.lines.flatMap((line) => line.v.filter((v) => v !== null));
    let low = Math.min(...values), high = Math.max(...values);
    if (low > 0 && low < 0.5 * high) low = 0;
    if (high - low < 1e-9) { high += 0.5 * Math.abs(high) || 1; low -= 0.5 * Math.abs(low) || 1; }
    this.x = (t) => LEFT + (WIDE - LEFT - RIGHT) * (t - span[0]) / (span[1] - span[0] || 1);
    this.y = (v) => TOP + (HIGH - TOP - BOTTOM) * (high - v) / (high - low);
    this.figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    caption.textContent = spec.unit ? `${spec.title} [${spec.unit}]` : spec.title;
    this.key = document.createElement("div");
    this.key.className = "key";
    const svg = element("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, role: "img", "aria-label": caption.textContent });
    for (const [a, b, name] of bands) {
      const band = element("rect", { x: this.x(a), y: TOP, width: Math.max(0, this.x(b) - this.x(a)),
                                     height: HIGH - TOP - BOTTOM, fill: "var(--band)" }, svg);
      element("title", {}, band, name);
    }
    for (const v of ticks(low, high, 4)) {
      element("line", { x1: LEFT, x2: WIDE - RIGHT, y1: this.y(v), y2: this.y(v), stroke: "var(--line)" }, svg);
      element("text", { x: LEFT - 5, y: this.y(v) + 4, "text-anchor": "end" }, svg, short(v));
    }
    for (const t of ticks(span[0], span[1], 6)) {
      element("text", { x: this.x(t), y: HIGH - 6, "text-anchor": "middle" }, svg, `${short(t)} s`);
    }
    for (const line of spec.lines) this.line(svg, line, low, high);
    this.cursor = element("line", { y1: TOP, y2: HIGH - BOTTOM, stroke: "var(--ink)", "stroke-width": 1 }, svg);
    svg.addEventListener("pointerdown", (event) => {
      const box = svg.getBoundingClientRect();
      const part = ((event.clientX - box.left) * WIDE / box.width - LEFT) / (WIDE - LEFT - RIGHT);
      go(span[0] + Math.min(1, Math.max(0, part)) * (span[1] - span[0]));
    });
    this.figure.append(caption, svg, this.key);
  }

  line(svg, line, low, high) {
    let path = "", down = false;
    line.t.forEach((t, k) => {
      if (line.v[k] === null) { down = false; return; }
      path += `${down ? "L" : "M"}${this.x(t).toFixed(1)} ${this.y(line.v[k]).toFixed(1)}`;
      down = true;
    });
    element("path", { d: path, fill: "none", stroke: shade(line.colour), "stroke-width": 1.4 }, svg);
    if (line.limit !== null && line.limit >= low && line.limit <= high) {
      element("line", { x1: LEFT, x2: WIDE - RIGHT, y1: this.y(line.limit), y2: this.y(line.limit),
                        stroke: shade(line.colour), "stroke-dasharray": "3 4" }, svg);
    }
  }

  show(time) {
    const x = this.x(Math.min(this.span[1], Math.max(this.span[0], time)));
    this.cursor.setAttribute("x1", x);
    this.cursor.setAttribute("x2", x);
    this.key.replaceChildren(...this.spec.lines.map((line) => {
      const k = RunMap.at(line.t, time), made = document.createElement("span");
      const mark = document.createElement("i"), value = document.createElement("b");
      mark.style.background = shade(line.colour);
      value.textContent = ` ${short(k < 0 ? null : line.v[k])}`;
      made.append(mark, line.name, value);
      return made;
    }));
  }
}
