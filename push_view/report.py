"""A report from a bag: paths of all bodies, and a panel for each team."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.backends.backend_pdf import PdfPages

from push_model import se2
from push_record.contents import BagContents, Job, load
from push_view.animation import write_animation
from push_view.drawing import draw_trajectory
from push_view.html_report import with_job, write_html
from push_view.palette import INK
from push_view.report_panel import draw_report

PRODUCTS = ("trajectory.png", "animation.gif", "report.pdf", "report.html")
"""Files of a report."""

_PAGE = (8.27, 11.69)  # [in] A4
_MOMENTS = 1.0  # [s] between two reports whose shapes are shown
_ROWS = 24  # teams in the list on the first page


@dataclass(frozen=True)
class FinalError:
    """Final errors of a team's object: position [m], orientation [rad]; nan without a goal or an
    object."""

    position: float
    orientation: float

    def __str__(self) -> str:
        if np.isnan(self.position):
            return "no goal"
        return f"{1e3 * self.position:.1f} mm, {self.orientation:.3f} rad"


def final_error(contents: BagContents, job: Job) -> FinalError:
    """Of the object of a team, from the last goal of its job."""
    poses = contents.poses.get(job.object)
    if job.goal is None or poses is None:
        return FinalError(float("nan"), float("nan"))
    last = poses[np.isfinite(poses).all(axis=1)][-1]
    local = se2.between(job.goal, last)
    return FinalError(float(np.hypot(local[0], local[1])), abs(float(local[2])))


def write_report(bag: Path, out: Path, animate: bool = True) -> dict[str, float]:
    """Write trajectory.png, report.pdf, report.html and animation.gif; returns the final errors.

    ``finished`` is 0 if the recording ends in mid-job.
    With several teams, ``position_error_m`` is that of the team farthest from its goal, and
    ``orientation_error_rad`` that of the team turned most.

    Raises
    ------
    ValueError: the bag holds no scenario.
    """
    contents = load(bag, _MOMENTS)
    jobs = with_job(contents)
    contents.jobs = {job.space: job for job in jobs}
    errors = {job.space: final_error(contents, job) for job in jobs}
    out.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(9, 6))
    draw_trajectory(axes, contents)
    axes.set_title(_title(contents, jobs, errors), color=INK)
    figure.savefig(out / "trajectory.png", dpi=130, bbox_inches="tight")
    plt.close(figure)
    with PdfPages(out / "report.pdf") as pdf:
        if len(jobs) == 1:
            _team_page(pdf, contents, jobs[0], _heading(contents, jobs, errors))
        else:
            _first_page(pdf, contents, jobs, errors)
            for job in jobs:
                _team_page(pdf, contents, job, f"{job.space}   {_line(job, errors[job.space])}")
    pairs = {space: (error.position, error.orientation) for space, error in errors.items()}
    write_html(bag, contents, pairs, out / "report.html")
    if animate and len(contents.time):
        write_animation(contents, out / "animation.gif")
    positions = [e.position for e in errors.values() if not np.isnan(e.position)]
    angles = [e.orientation for e in errors.values() if not np.isnan(e.orientation)]
    return {
        "position_error_m": max(positions, default=float("nan")),
        "orientation_error_rad": max(angles, default=float("nan")),
        "finished": float(not any(job.unfinished for job in jobs)),
    }


def _title(contents: BagContents, jobs: list[Job], errors: dict[str, FinalError]) -> str:
    name = contents.scenario.name
    if len(jobs) == 1:
        ends = f" when the recording ends in {jobs[0].unfinished}" if jobs[0].unfinished else ""
        return f"{name}: {errors[jobs[0].space]} from the goal{ends}"
    return f"{name}: {len(jobs)} teams, {len(contents.poses)} bodies"


def _heading(contents: BagContents, jobs: list[Job], errors: dict[str, FinalError]) -> str:
    meta, hits = contents.metadata, contents.collisions
    duration = float(contents.time[-1] - contents.time[0]) if len(contents.time) else 0.0
    error = f"final error {errors[jobs[0].space]}; " if len(jobs) == 1 else ""
    if len(jobs) == 1 and jobs[0].unfinished:
        error = (
            f"the recording ends in the state {jobs[0].unfinished}, {errors[jobs[0].space]} off; "
        )
    collisions = (
        f"collisions: {hits.between_robots} between robots, {hits.robots_with_walls} of robots and "
        f"{hits.objects_with_walls} of objects with walls, {hits.between_objects} between objects"
    )
    clock = "s sim time"
    if contents.measured:
        collisions, clock = "collisions: not known", "s, poses as measured by motion capture"
    return (
        f"{contents.scenario.name}   seed {meta.get('seed', '?')}   "
        f"revision {meta.get('revision', '?')}\n{error}{duration:.1f} {clock}\n{collisions}"
    )


def _line(job: Job, error: FinalError) -> str:
    last = job.states[-1] if job.states else None
    end = "no state" if last is None else f"{last.name.lower()}, code {last.code}"
    if job.unfinished:
        end = f"the recording ends in the state {job.unfinished}"
    crew = ", ".join(job.robots) if len(job.robots) <= 5 else f"{len(job.robots)} robots"
    return f"{job.system} ({crew}) with {job.object or 'no object'}: {error}; {end}"


def _first_page(
    pdf: Any, contents: BagContents, jobs: list[Job], errors: dict[str, FinalError]
) -> None:
    page = plt.figure(figsize=_PAGE)
    layout = page.add_gridspec(2, 1, height_ratios=[1.3, 1.0], hspace=0.25)
    draw_trajectory(page.add_subplot(layout[0]), contents)
    words = page.add_subplot(layout[1])
    words.axis("off")
    lines = [f"{job.space}   {_line(job, errors[job.space])}" for job in jobs[:_ROWS]]
    if len(jobs) > _ROWS:
        lines.append(f"and {len(jobs) - _ROWS} more")
    words.text(0.0, 1.0, "\n".join(lines), va="top", fontsize=7, transform=words.transAxes)
    page.suptitle(_heading(contents, jobs, errors), fontsize=9)
    pdf.savefig(page)
    plt.close(page)


def _team_page(pdf: Any, contents: BagContents, job: Job, heading: str) -> None:
    """The map with the team's plan and goal, and its reports below."""
    page = plt.figure(figsize=_PAGE)
    layout = page.add_gridspec(2, 1, height_ratios=[1.0, 1.35], hspace=0.28)
    draw_trajectory(page.add_subplot(layout[0]), contents, [job])
    draw_report(page, layout[1], contents, job)
    page.suptitle(heading, fontsize=9)
    pdf.savefig(page)
    plt.close(page)
