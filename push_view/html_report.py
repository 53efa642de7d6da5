"""A report of a bag in HTML: moving map, charts, results, timing, faults."""

import html
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from push_record.contents import BagContents, Job
from push_record.faults import Fault, faults_of
from push_record.planned import merged
from push_view.html_page import Markup, frame, page, player, table
from push_view.playback import contents_json

_VALUES = 240_000  # numbers of poses in a file


def write_html(
    bag: Path, contents: BagContents, errors: Mapping[str, tuple[float, float]], out: Path
) -> None:
    """Write the report.

    Parameters
    ----------
    errors: by the team's namespace, final position [m] and orientation [rad] error. out: the file.
    """
    faults = faults_of(bag, contents)
    parts = [
        _head(contents),
        frame(),
        "<h2>Results</h2>",
        _results(contents, errors),
        "<h2>Timing</h2>",
        _timing(contents),
        "<h2>Faults</h2>",
        _faults(faults),
        "<h2>Scenario</h2>",
        "<details><summary>All settings, as the nodes knew them</summary>"
        f"<pre>{html.escape(contents.scenario.text)}</pre></details>",
    ]
    title = f"{contents.scenario.name} – planar-push"
    data = [contents_json(contents, contents.scenario.name, _VALUES)]
    out.write_text(page(title, "\n".join(parts), player(), data), encoding="utf-8")


def _head(contents: BagContents) -> str:
    meta = contents.metadata
    duration = float(contents.time[-1] - contents.time[0]) if len(contents.time) else 0.0
    words = [
        f"{duration:.1f} s, poses as measured"
        if contents.measured
        else f"{duration:.1f} s of simulation"
        if duration
        else "no poses",
        f"seed {meta.get('seed', '?')}",
        f"revision {meta.get('revision', '?')}",
    ]
    words += [f"{key} {meta[key]}" for key in ("system", "pace", "experiment") if key in meta]
    line = html.escape(" · ".join(words))
    return f'<h1>{html.escape(contents.scenario.name)}</h1><p class="soft">{line}</p>'


def _results(contents: BagContents, errors: Mapping[str, tuple[float, float]]) -> str:
    rows = []
    for space, job in contents.jobs.items():
        position, orientation = errors.get(space, (math.nan, math.nan))
        last = job.states[-1] if job.states else None
        end = "no state" if last is None else f"{last.reason} (code {last.code})"
        if job.unfinished:
            end = f"the recording ends in the state {job.unfinished}"
        names = [s.name for s in job.states]
        pairs = zip(["", *names], names, strict=False)
        pushes = sum(now == "PUSHING" != before for before, now in pairs)
        crew = ", ".join(job.robots) if len(job.robots) <= 5 else f"{len(job.robots)} robots"
        plan = merged(job.plans)
        cost, gap = (math.nan, math.nan) if plan is None or not plan.cost else (plan.cost, plan.gap)
        error = 1e3 * position, orientation
        rows.append((space, job.system, crew, job.object, *error, pushes, cost, 100.0 * gap, end))
    heads = (
        *("team", "system", "robots", "object", "error at the end [mm]", "[rad]", "pushes"),
        *("plan cost [s]", "above the best at most [%]", "end"),
    )
    hits = contents.collisions
    touched = table(
        ("between robots", "robots with walls", "objects with walls", "between objects"),
        [
            (
                hits.between_robots,
                hits.robots_with_walls,
                hits.objects_with_walls,
                hits.between_objects,
            )
        ],
    )
    return f"{table(heads, rows)}<p>Collisions:</p>{touched}"


def timings(contents: BagContents) -> list[tuple[str, int, float, float, float]]:
    """Name, count, and median, 99th percentile and maximum [ms] of all that was measured."""
    series: dict[str, Any] = {}
    for robot, columns in contents.status.items():
        solved = columns["solve_time"]
        series[f"{robot}: solve, CPU"] = solved[solved > 0.0]
    for job in contents.jobs.values():
        for topic, told in job.reports.items():
            steps = np.array(told.solve_times)
            series[f"{topic}: step, CPU"] = steps[steps > 0.0]
        series[f"{job.space}push_plan: plan, wall time"] = [t for t in job.plan_times if t > 0.0]
    found = []
    for name, values in series.items():
        if len(values):
            ms = 1e3 * np.asarray(values)
            median, late = (float(v) for v in np.percentile(ms, (50.0, 99.0)))
            found.append((name, len(ms), median, late, float(ms.max())))
    return found


def _timing(contents: BagContents) -> str:
    rows = timings(contents)
    if not rows:
        return "<p>Nothing was measured.</p>"
    return table(("what", "count", "median [ms]", "p99 [ms]", "maximum [ms]"), rows)


def _faults(faults: Sequence[Fault]) -> str:
    if not faults:
        return "<p>None: no refusal, no failed job, no fallback, no collision, no warning.</p>"
    return table(("time [s]", "kind", "where", "what"), _fault_rows(faults), "faults")


def _fault_rows(faults: Iterable[Fault]) -> Iterable[tuple[Any, ...]]:
    for fault in faults:
        known = math.isfinite(fault.time)
        time = f'<a href="#frame" data-time="{fault.time:.3f}">{fault.time:.2f}</a>'
        yield Markup(time) if known else "–", fault.kind, fault.where, fault.text


def with_job(contents: BagContents) -> list[Job]:
    """The jobs of a bag. If no goal was recorded, and no task without one, the goal is that of the
    scenario."""
    jobs = list(contents.jobs.values())
    if not jobs:
        item = next(iter(contents.scenario.objects), "")
        jobs = [Job("/", robots=tuple(contents.scenario.robots), object=item)]
    if len(jobs) == 1 and jobs[0].goal is None and not any(s.job for s in jobs[0].states):
        jobs[0].goal = contents.scenario.goal
    return jobs
