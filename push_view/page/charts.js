// Charts of what a team reports, over the time of the simulation: a chart for each unit.

import {tickText} from "./model.js";

const HEIGHT = 150, MOST = 8, LINES = 6, GAP = 1.0;   // [px], charts, lines of a chart, [s] without a line
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#b8860b"];
const SCALES = {m: ["mm", 1e3], s: ["ms", 1e3]};

// Charts of several series: Map of title to [{name, unit, limit, t, v}]. series: [label, Map] pairs.
export function grouped(all) {
  const charts = new Map();
  for (const [label, series] of all) {
    for (const [name, {unit, limit, t, v}] of series) {
      const own = name === "position error" || name === "orientation error";
      const title = own ? name : unit === "s" ? "times" : unit ? `in ${unit}` : "without unit";
      if (!charts.has(title)) charts.set(title, []);
      charts.get(title).push({name: own ? label || name : label ? `${label}: ${name}` : name, unit, limit, t, v});
    }
  }
  const order = [...charts.keys()].sort((a, b) => rank(a) - rank(b));
  return new Map(order.slice(0, MOST).map(title => [title, charts.get(title).slice(0, LINES)]));
}
const rank = title => ["position error", "orientation error"].indexOf(title) + 1 || (title === "times" ? 9 : 5);

// Columns of a chart: times of all lines, then the values of each; a gap where one has none.
export function columns(lines) {
  const times = [...new Set(lines.flatMap(l => l.t))].sort((a, b) => a - b);
  const place = new Map(times.map((t, i) => [t, i]));
  return [times, ...lines.map(({t, v, unit}) => {
    const factor = SCALES[unit]?.[1] ?? 1, column = Array(times.length).fill(undefined);
    t.forEach((time, i) => {
      column[place.get(time)] = factor * v[i];
      if (i && time - t[i - 1] > GAP) column[place.get(time) - 1] ??= null;   // no line over a gap
    });
    return column;
  })];
}

// Range of the vertical axis. uPlot would give a line that is zero throughout the range 0 to 100.
export const span = (low, high) => low === null || low === undefined ? [0, 1]
  : low === 0 && high === 0 ? [-0.1, 0.1] : uPlot.rangeNum(low, high, 0.1, true);

export class Charts {
  // onTime: called with a time [s] that was clicked
  constructor(host, onTime) { this.host = host; this.onTime = onTime; this.plots = new Map(); this.marks = []; this.cursor = null; }

  // all: [label, series] pairs; marks: [time, text] of states; cursor: [s], or null
  show(all, marks, cursor) {
    this.marks = marks; this.cursor = cursor;
    const charts = grouped(all), ink = getComputedStyle(this.host).color;
    const times = [...charts.values()].flat().flatMap(l => l.t.length ? [l.t[0], l.t.at(-1)] : []);
    const first = Math.min(...times), last = Math.max(...times);
    this.range = last > first ? [first, last] : null;   // the same in all charts; uPlot needs a width
    for (const title of this.plots.keys()) if (!charts.has(title)) this.drop(title);
    for (const [title, lines] of charts) {
      const key = [ink, ...lines.map(l => l.name)].join("|"), old = this.plots.get(title);
      if (old?.key !== key) { this.drop(title); this.make(title, lines, key, ink); }
      this.plots.get(title).plot.setData(columns(lines));
    }
  }

  // Only the cursor has moved.
  move(cursor) {
    if (cursor === this.cursor) return;
    this.cursor = cursor;
    for (const {plot} of this.plots.values()) plot.redraw(false, false);
  }

  drop(title) {
    const old = this.plots.get(title);
    if (!old) return;
    old.plot.destroy(); old.box.remove(); this.plots.delete(title);
  }

  make(title, lines, key, ink) {
    const box = document.createElement("div"), unit = SCALES[lines[0].unit]?.[0] ?? lines[0].unit;
    box.className = "chart";
    this.host.append(box);
    const grid = {stroke: "#8884", width: 1};
    const axis = {stroke: ink, grid, ticks: grid, font: "11px system-ui", size: 46, values: (_, ticks) => ticks.map(v => v === null ? "" : tickText(v))};
    const options = {
      title: title.startsWith("in ") ? `in ${unit}` : unit ? `${title} [${unit}]` : title, width: 300, height: HEIGHT,
      scales: {x: {time: false, range: (_, low, high) => this.range ?? (high > low ? [low, high] : [(low ?? 0) - 0.5, (low ?? 0) + 0.5])}, y: {range: (_, low, high) => span(low, high)}}, axes: [{...axis, size: 24}, axis], cursor: {sync: {key: "charts"}, drag: {setScale: false}},
      series: [{label: "s", value: (_, v) => v?.toFixed(2) ?? "–"}, ...lines.map(({name}, i) => ({
        label: name, stroke: COLOURS[i % COLOURS.length], width: 1.5, dash: i > 2 ? [6, 3] : [], points: {show: false},
        value: (_, v) => v === null || v === undefined ? "–" : Number(v.toPrecision(4))}))],
      hooks: {draw: [plot => this.lines(plot, lines)]},
    };
    const plot = new uPlot(options, [[], ...lines.map(() => [])], box);
    new ResizeObserver(() => plot.setSize({width: Math.max(200, box.clientWidth - 10), height: HEIGHT})).observe(box);
    plot.over.onclick = event => this.onTime(plot.posToVal(event.offsetX, "x"));
    this.plots.set(title, {plot, box, key});
  }

  // The moments of states, the cursor, and limits of figures.
  lines(plot, lines) {
    const pen = plot.ctx, {left, top, width, height} = plot.bbox;
    const vertical = (t, style, wide, dash) => {
      const x = plot.valToPos(t, "x", true);
      if (!(x >= left && x <= left + width)) return;
      pen.beginPath(); pen.moveTo(x, top); pen.lineTo(x, top + height);
      pen.strokeStyle = style; pen.lineWidth = wide; pen.setLineDash(dash); pen.stroke(); pen.setLineDash([]);
    };
    pen.save();
    for (const [t] of this.marks) vertical(t, "#8889", 1, [3, 3]);
    if (this.cursor !== null) vertical(this.cursor, "#c22f3d", 2, []);
    lines.forEach(({limit, unit}, i) => {
      if (limit === undefined) return;
      const y = plot.valToPos(limit * (SCALES[unit]?.[1] ?? 1), "y", true);
      if (!(y >= top && y <= top + height)) return;
      pen.beginPath(); pen.moveTo(left, y); pen.lineTo(left + width, y);
      pen.strokeStyle = COLOURS[i % COLOURS.length]; pen.lineWidth = 1; pen.setLineDash([2, 4]); pen.stroke(); pen.setLineDash([]);
    });
    pen.restore();
  }
}
