"""The leaderboard as one HTML page and one CSV."""

import csv
import html
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from push_study.leaderboard.contests import CONTESTS, STALLED
from push_study.leaderboard.standings import Cell
from push_view.html_page import page, table

HEADS = (
    "rank",
    "method",
    "told",
    "reached",
    "share, 95 % interval",
    "Λ, mean",
    "Λ, 95 % interval",
    "time [s]",
    "path / straight",
    "robot's path [m]",
    "clearance [mm]",
    "CPU [s]",
    "leads",
    "source",
)
COLUMNS = (
    *("contest", "rank", "method", "outline", "robots", "control", "trials", "successes"),
    *("share_low", "share_high", "lambda", "lambda_low", "lambda_high", "time_s", "path_ratio"),
    *("robot_path_m", "cpu_s", "clearance_m", "leads", "ranked", "why_not", "source"),
)


def write(cells: Sequence[Cell], about: Mapping[str, Any], out: Path) -> None:
    """Write ``leaderboard.html`` and ``leaderboard.csv``. about: of the study, for the head."""
    with (out / "leaderboard.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(_line(c) for c in cells)
    title = "Leaderboard of planar pushing"
    facts = " · ".join(f"{k} {v}" for k, v in about.items() if v not in ("", None))
    parts = [f"<h1>{title}</h1>", f"<p class='soft'>{html.escape(facts)}</p>", _HOW]
    for name in dict.fromkeys(c.contest for c in cells):
        mine = [c for c in cells if c.contest == name]
        known = CONTESTS.get(name)
        what = "" if known is None else known.what[:1].upper() + known.what[1:] + "."
        parts += [f"<h2>{html.escape(name)}</h2>", f"<p class='soft'>{html.escape(what)}</p>"]
        parts.append(table(HEADS, [_row(c) for c in mine], "sortable"))
    parts.append(_reproductions(cells))
    text = page(title, "\n".join(parts), _SORT, {})
    (out / "leaderboard.html").write_text(text, encoding="utf-8")


_HOW = f"""<p>All methods run in the same graph in lockstep, with the same rooms, starts, goals,
noise, latency, drawn frictions and tolerances; a seed gives every method the same problem. Ranks
are only among methods that are told the same. A method of other authors is ranked only if our
reconstruction of it reaches the figure of its own paper. Λ is the time until the object is there,
over the time of a robot at full speed on the straight line. CPU time of planning beyond the time
until the next frame is added to it. Λ is the mean over the matches that reach the goal. In the
contests <code>env…</code> and <code>plates-…</code>, a match in which the object or a robot
touches an obstacle does not count as reached. In the contests <code>open-…</code>, a job fails if
the object has come no closer to its goal for {STALLED:.0f} s. Clearance is the least distance of
the object from obstacles over all matches that reach the goal. <em>Leads</em> names the ranked
methods of the same information that are worse beyond chance: their interval of the share lies below
that of the method; or these intervals overlap, they reach no more goals than the method, and their
Λ is larger at the goals that both reach (99 % interval of the mean difference, seed by seed, of at
least five goals). CPU is that of the whole match, the simulation included.
Two runs with equal seeds differ only in CPU times, and by these in the planning that Λ and time
contain.</p>"""

_SORT = """"use strict";
for (const head of document.querySelectorAll("table.sortable th")) {
  head.addEventListener("click", () => {
    const body = head.closest("table").tBodies[0], at = head.cellIndex;
    const key = (row) => row.cells[at].textContent;
    const rows = [...body.rows].sort((a, b) => {
      const [x, y] = [parseFloat(key(a)), parseFloat(key(b))];
      return Number.isNaN(x) || Number.isNaN(y) ? key(a).localeCompare(key(b)) : x - y;
    });
    body.append(...rows);
  });
}
"""


def _row(c: Cell) -> list[Any]:
    return [
        c.rank or "–",
        c.entry.name,
        c.entry.told.text,
        f"{c.successes} of {c.trials}",
        f"{c.share[0]:.2f} to {c.share[1]:.2f}",
        _number(c.lambda_, 2),
        _span(c.lambda_interval),
        _number(c.seconds, 1),
        _number(c.path, 2),
        _number(c.robot_path, 2),
        _number(1e3 * c.clearance, 1),
        _number(c.cpu, 1),
        ", ".join(c.leads) or "–",
        c.entry.source + (f" ({c.entry.why_not})" if c.entry.why_not else ""),
    ]


def _line(c: Cell) -> list[Any]:
    told = c.entry.told
    return [
        *(c.contest, c.rank or "", c.entry.name, told.outline, told.robots, told.control),
        *(c.trials, c.successes, c.share[0], c.share[1], _csv(c.lambda_)),
        *map(_csv, (*c.lambda_interval, c.seconds, c.path, c.robot_path, c.cpu, c.clearance)),
        *(";".join(c.leads), c.entry.ranked, c.entry.why_not, c.entry.source),
    ]


def _reproductions(cells: Sequence[Cell]) -> str:
    rebuilt = {c.entry.name: c.entry for c in cells if c.entry.reconstructed}
    rows = []
    for entry in rebuilt.values():
        r = entry.reproduction
        told = ("–", "–", "no", "–") if r is None else (r.paper, r.ours, _yes(r.holds), r.test)
        rows.append((entry.name, entry.source, *told))
    if not rows:
        return ""
    heads = ("method", "paper", "its figure", "ours in its setting", "reached", "measured by")
    return f"<h2>Do the reconstructions reproduce their papers?</h2>{table(heads, rows)}"


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


def _span(span: tuple[float, float]) -> str:
    return f"{span[0]:.2f} to {span[1]:.2f}" if all(map(math.isfinite, span)) else "–"


def _csv(value: float) -> float | str:
    return value if math.isfinite(value) else ""
