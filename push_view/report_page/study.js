"use strict";
// A study: each measure with all its trials, and tables that can be sorted.

const data = JSON.parse(document.getElementById("data").textContent);
const SVG = "http://www.w3.org/2000/svg";
const WIDE = 520, RIGHT = 18, TOP = 8, BOTTOM = 22;

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

// A colour as it can be read on a dark ground: mixed with white there.
const dark = () => matchMedia("(prefers-color-scheme: dark)").matches;
const shade = (colour) => {
  if (!dark() || !/^#[0-9a-f]{6}$/i.test(colour)) return colour;
  const parts = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
  return "#" + parts.map((v) => Math.round(v + 0.35 * (255 - v)).toString(16).padStart(2, "0")).join("");
};


function strip(measure) {
  const names = Object.keys(measure.groups), row = 24, left = 130;
  const high = TOP + row * names.length + BOTTOM;
  const values = names.flatMap((name) => measure.groups[name].map((pair) => pair[0]));
  let [low, top] = [Math.min(...values), Math.max(...values)];
  if (low > 0 && low < 0.5 * top) low = 0;
  if (top - low < 1e-9) { top += 0.5 * Math.abs(top) || 1; low -= 0.5 * Math.abs(low) || 1; }
  const x = (v) => left + (WIDE - left - RIGHT) * (v - low) / (top - low);
  const figure = document.createElement("figure"), caption = document.createElement("figcaption");
  caption.textContent = measure.name;
  const svg = element("svg", { viewBox: `0 0 ${WIDE} ${high}`, role: "img", "aria-label": measure.name });
  for (const v of ticks(low, top, 5)) {
    element("line", { x1: x(v), x2: x(v), y1: TOP, y2: high - BOTTOM, stroke: "var(--line)" }, svg);
    element("text", { x: x(v), y: high - 6, "text-anchor": "middle" }, svg, short(v));
  }
  names.forEach((name, k) => {
    const pairs = measure.groups[name], y = TOP + row * (k + 0.5), colour = shade(data.palette[k % data.palette.length]);
    const mean = pairs.reduce((sum, pair) => sum + pair[0], 0) / pairs.length;
    const spread = Math.sqrt(pairs.reduce((sum, pair) => sum + (pair[0] - mean) ** 2, 0) / pairs.length);
    const a = x(Math.max(low, mean - spread)), b = x(Math.min(top, mean + spread));
    element("rect", { x: a, y: y - 9, width: Math.max(0, b - a), height: 18, fill: colour, opacity: 0.2 }, svg);
    element("line", { x1: x(mean), x2: x(mean), y1: y - 9, y2: y + 9, stroke: colour, "stroke-width": 2.5 }, svg);
    element("text", { x: left - 6, y: y + 4, "text-anchor": "end" }, svg, name.slice(0, 20));
    pairs.forEach(([value, good], i) => {
      const dot = element("circle", { cx: x(value), cy: y + 7 * Math.sin(2.4 * i), r: 2.6, stroke: colour,
                                      fill: good ? colour : "none" }, svg);
      element("title", {}, dot, `${name}: ${short(value)}${good ? "" : " (failed)"}`);
    });
  });
  figure.append(caption, svg);
  return figure;
}

document.getElementById("charts").append(...data.measures.map(strip));

for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.querySelectorAll("th")];
  heads.forEach((head, column) => head.addEventListener("click", () => {
    const down = head.getAttribute("aria-sort") === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const value = (row) => {
      const cell = row.cells[column];
      return cell.dataset.value === undefined ? cell.textContent : Number(cell.dataset.value);
    };
    const rows = [...table.tBodies[0].rows].sort((one, two) => {
      const a = value(one), b = value(two);
      const order = typeof a === "number" && typeof b === "number" ? a - b
        : String(a).localeCompare(String(b), undefined, { numeric: true });
      return down ? -order : order;
    });
    table.tBodies[0].append(...rows);
  }));
}
const trials = [...document.querySelectorAll("table.sortable")].pop();
const success = trials ? [...trials.querySelectorAll("th")].findIndex((h) => h.textContent === "success") : -1;
if (success >= 0) {
  for (const row of trials.tBodies[0].rows) {
    if (row.cells[success].textContent === "no") row.classList.add("failed");
  }
}
