"""Whether the intervals of the estimator hold: pushes with unknown friction, centre of mass and
latency, in the graph in lockstep.

Two kinds of pushes, with equal draws. An ordinary one is planned and tracked by the nodes of the
system ``single``. A probing one weaves so that the object slides along the bumper.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_model import se2
from push_model.belief import Interval
from push_model.settings import SettingsError
from push_ros.claims import own_domain
from push_scenario.scenario import Scenario, load_scenario
from push_study import probing
from push_study.graph_run import LockstepRun
from push_study.job import digest
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty

SCENARIOS = ("line",)
"""Where none are named. The robot starts in contact with the object."""
OPTIONS = {"uncertainty": "mild", "world": "planar"}

KINDS = ("ordinary", "probing")
FRICTION, COM, LATENCY, JITTER = (0.08, 0.5), 0.015, (0.02, 0.1), 0.005
"""What is drawn, and the prior that the estimator is told: friction; [m] of the centre of mass from
the centroid; [s] mean and half width of the latency of a trial."""
BELIEVED_LATENCY = 0.06
"""[s] that the controller makes good before it is told."""
QUANTITIES = ("contact_friction", "com_x", "com_y", "latency")
WAY = 1.0
"""[m] of push after which the intervals are judged."""
_GOAL = (1.25, 0.25, 0.4)  # [m, m, rad] of the box from its start: a push of 1.3 m
_LIMIT = 120.0  # [s] of sim time
_SHARE = 0.93  # of the intervals that should hold
_NARROW = 1.0 / 3.0  # of the prior's width


@dataclass(frozen=True)
class CalibrationTask:
    """One push. kind: of ``KINDS``. digest: of the scenario's text. way: [m]."""

    scenario: str
    seed: int
    out: str
    kind: str
    uncertainty: str = "mild"
    world: str = "planar"
    digest: str = ""
    way: float = WAY

    @property
    def trace_file(self) -> Path:
        """Where the push leaves its intervals over its way."""
        return Path(self.out) / f"trace-{Path(self.scenario).stem}-{self.kind}-{self.seed}.npz"


def one_of_each(name: str) -> Scenario:
    """A scenario with one robot and one object; raises SettingsError for another one."""
    scenario = load_scenario(name)
    if len(scenario.robots) != 1 or len(scenario.objects) != 1:
        raise SettingsError(f"scenario '{name}' needs one robot and one object")
    return scenario


def tasks(options: StudyOptions) -> list[CalibrationTask]:
    """An ordinary and a probing push with equal draws, as often as there are trials."""
    made = []
    for name in options.scenarios:
        text = digest(one_of_each(name))
        made += [
            CalibrationTask(
                name,
                seed,
                str(options.out),
                kind,
                options.uncertainty,
                options.world or OPTIONS["world"],
                text,
            )
            for seed in range(options.seed, options.seed + options.trials)
            for kind in KINDS
        ]
    return made


def drawn_worlds(task: CalibrationTask) -> tuple[Scenario, Scenario, Row]:
    """What is believed, the world, and the drawn values."""
    low, high = LATENCY
    doubt = replace(
        uncertainty(task.uncertainty),
        latency=LATENCY,
        latency_jitter=JITTER,
        believed_latency=BELIEVED_LATENCY,
        contact_friction=FRICTION,
        com=COM,
    )
    scenario = load_scenario(task.scenario)
    ((name, (item, start)),) = scenario.objects.items()
    # Any side of the box is pushed.
    turn = np.random.default_rng([task.seed, 5]).integers(4) * np.pi / 2.0
    start = np.array([start[0], start[1], se2.wrap(float(start[2]) + turn)])
    scenario = replace(scenario, objects={name: (item, start)})
    scenario = scenario.settings("bridge", world=task.world).settings(
        "estimator",
        enabled=True,
        push__friction_low=FRICTION[0],
        push__friction_high=FRICTION[1],
        push__com_radius=COM,
        latency__low=low,
        latency__high=high,
    )
    if task.kind == "probing":
        scenario = scenario.settings(probing.NAME, way=task.way)
    return doubt.draw(scenario, task.seed)


def trial(task: CalibrationTask) -> Row:
    """One push; whether each interval holds, and how wide it is."""
    believed, world, drawn = drawn_worlds(task)
    system = "single" if task.kind == "ordinary" else probing.NAME
    ((name, (_, start)),) = believed.objects.items()
    goal = start + np.array(_GOAL)
    with own_domain(), LockstepRun(believed, world=world, quiet=True, system=system) as run:
        (node,) = (n for n in run.nodes if n.get_name() == "estimator")
        found: dict[str, Interval] = {}
        ways, course = list[float](), list[list[float]]()

        def enough() -> bool:
            push = node.estimates.push
            if push.way != (ways[-1] if ways else -1.0):
                now = node.estimates.intervals()
                ways.append(push.way)
                course.append([v for q in QUANTITIES for v in (now[q].low, now[q].high)])
            if not found and push.way >= 0.98 * task.way:
                found.update(node.estimates.intervals())
            return bool(found)

        run.start()
        team = next(iter(run.teams.values()))
        team.send_goal(goal)
        run.spin_until(lambda: enough() or team.ended, _LIMIT)
        estimates = node.estimates
        found = found or estimates.intervals()
        latency, _ = run.bridge.applied_latency
        state = team.observer.state
    truth = {
        "contact_friction": drawn[f"{name}_contact_friction"],
        "com_x": drawn[f"{name}_com_x_m"],
        "com_y": drawn[f"{name}_com_y_m"],
        "latency": latency,
    }
    if task.out:
        true = np.array([truth[q] for q in QUANTITIES])
        np.savez(task.trace_file, way=np.array(ways), ends=np.array(course), truth=true)
    priors, push = estimates.priors(), estimates.push
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "kind": task.kind,
        "way_m": push.way,
        "windows": push.windows,
        "strange": push.strange + estimates.latency.strange,
        "widened": push.widened + estimates.latency.widened,
        **drawn,
    }
    for quantity, true in truth.items():
        i = found[quantity]
        row[f"{quantity}_holds"] = bool(i.low <= true <= i.high)
        row[f"{quantity}_ratio"] = i.width / priors[quantity].width
        row[f"{quantity}_low"], row[f"{quantity}_high"] = i.low, i.high
        row[f"{quantity}_true"] = float(true)
    row["success"] = push.way >= 0.9 * task.way
    if not row["success"]:
        why = "" if state is None else str(state.reason)
        row["reason"] = f"only {push.way:.2f} m of push: {why}"
    return row


def statistics(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Share of intervals that hold and median width, by kind of push and quantity."""
    found: dict[str, Any] = {}
    for kind in KINDS:
        mine = [r for r in rows if r.get("kind") == kind and "latency_ratio" in r]
        for q in QUANTITIES:
            if mine:
                held = float(np.mean([r[f"{q}_holds"] for r in mine]))
                width = float(np.median([r[f"{q}_ratio"] for r in mine]))
                found[f"{kind}_{q}_held"], found[f"{kind}_{q}_width"] = held, width
    return found


def conclude(options: StudyOptions, tasks: Sequence[CalibrationTask], rows: list[Row]) -> None:
    """The table of calibration."""
    found = statistics(rows)
    for kind in KINDS:
        count = sum(r.get("kind") == kind for r in rows)
        short = sum(r.get("kind") == kind and not r["success"] for r in rows)
        print(f"\n{count} {kind} pushes, {short} of them shorter than {0.9 * WAY:.1f} m")
        print(f"{'quantity':20}{'held':>8}{'width':>8}   (asked: >= 0.93 and <= 0.33)")
        for q in QUANTITIES:
            if f"{kind}_{q}_held" in found:
                held, width = found[f"{kind}_{q}_held"], found[f"{kind}_{q}_width"]
                good = held >= _SHARE and width <= _NARROW
                print(f"{q:20}{held:8.3f}{width:8.3f}   {'ok' if good else ''}")
    _picture(options.out / "calibration.png", tasks)


_DRAWN = {
    "contact_friction": ("contact friction", 1.0),
    "com_x": ("centre of mass, x [mm]", 1e3),
    "com_y": ("centre of mass, y [mm]", 1e3),
    "latency": ("latency [ms]", 1e3),
}


def _picture(file: Path, tasks: Sequence[CalibrationTask]) -> None:
    """The intervals of the first draw over the way of the push."""
    figure, axes = plt.subplots(1, len(QUANTITIES), figsize=(13, 3.2))
    for number, kind in enumerate(KINDS):
        files = [t.trace_file for t in tasks if t.kind == kind and t.trace_file.is_file()]
        if not files:
            continue
        trace = np.load(files[0])
        for column, (axis, q) in enumerate(zip(axes, QUANTITIES, strict=True)):
            title, scale = _DRAWN[q]
            low, high = (
                scale * trace["ends"][:, 2 * column],
                scale * trace["ends"][:, 2 * column + 1],
            )
            axis.fill_between(
                trace["way"], low, high, step="post", alpha=0.35, color=f"C{number}", label=kind
            )
            axis.axhline(scale * trace["truth"][column], color="k", lw=1.0, ls="--")
            axis.set_title(title, fontsize=9)
            axis.set_xlabel("way of the push [m]", fontsize=8)
    axes[0].legend(fontsize=8)
    figure.savefig(file, dpi=120, bbox_inches="tight")
    plt.close(figure)
