"""Whether a push is known to slip before it does, and what comes of it: pushes with unknown
friction, centre of mass and latency, in the graph in lockstep.

A probing push of each draw gives the intervals of the estimator. A job with the same draw follows,
three times:

- ``untold``: planned and driven with the values of the files.
- ``answered``: the same, but the belief, also that of the latency, arrives when the plan is made.
  A push ends before it is expected to slip, and a new plan is made.
- ``told``: the belief is there before the goal, so that all plans are made with it.

Up to the alarm, the jobs ``untold`` and ``answered`` follow the same plan. The alarm of the one is
therefore compared with the slip of the other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.belief import Interval
from push_msgs.msg import Belief, JobState, Report
from push_ros.claims import own_domain
from push_ros.conversions import time_from_ros
from push_ros.names import Names
from push_ros.qos import BELIEF, STATUS
from push_ros.report_conversions import belief_to_ros
from push_scenario.scenario import Scenario
from push_study import probing
from push_study.experiments.calibration import CalibrationTask, drawn_worlds, one_of_each
from push_study.graph_run import LockstepRun
from push_study.job import SUCCESS_ORIENTATION, SUCCESS_POSITION, digest
from push_study.observer import Trace, final_errors
from push_study.pool import Row
from push_study.study import StudyOptions

SCENARIOS = ("line",)
"""Where none are named. The robot starts in contact with the object."""
OPTIONS = {"uncertainty": "mild", "world": "planar"}

ARMS = ("untold", "answered", "told")
SLIPPED, BEGUN = 0.002, 0.0005
"""[m] along the bumper from which on an object has slipped in a push; and of the last moment at
which it had not yet begun to."""
AHEAD = 0.2
"""[s] by which an alarm comes before the slip that it announces, at least."""
_AHEAD_OF = ([0.9, 0.3, 0.5], [1.5, 0.8, 1.4])  # [m, m, rad] goals from the start, drawn evenly
_ALARM = "slip expected in"  # name of the figure in the report
_AFTER_PLAN = (JobState.POSITIONING, JobState.APPROACH, JobState.PUSHING)
_LIMIT = 120.0  # [s] of sim time of a job
_SETTLED = 10  # frames of 10 ms after which bumper and object touch


@dataclass(frozen=True)
class CertificateTask:
    """A probing push and three jobs of one draw. digest: of the scenario's text."""

    scenario: str
    seed: int
    out: str
    uncertainty: str = "mild"
    world: str = "planar"
    digest: str = ""

    @property
    def trace_file(self) -> Path:
        """Where jobs with an alarm before a slip leave their course."""
        return Path(self.out) / f"trace-{Path(self.scenario).stem}-{self.seed}.npz"

    @property
    def draw(self) -> CalibrationTask:
        """What is drawn, as of the study ``calibration``."""
        return CalibrationTask(
            self.scenario, self.seed, "", "probing", self.uncertainty, self.world, self.digest
        )


def tasks(options: StudyOptions) -> list[CertificateTask]:
    """A draw for each trial."""
    made = []
    for name in options.scenarios:
        world = options.world or OPTIONS["world"]
        common = options.uncertainty, world, digest(one_of_each(name))
        made += [
            CertificateTask(name, seed, str(options.out), *common)
            for seed in range(options.seed, options.seed + options.trials)
        ]
    return made


def probed(task: CertificateTask) -> tuple[dict[str, Interval], float]:
    """What the estimator believes after a probing push, and the true latency [s]."""
    believed, world, _ = drawn_worlds(task.draw)
    ((_, (_, start)),) = believed.objects.items()
    with own_domain(), LockstepRun(believed, world=world, quiet=True, system=probing.NAME) as run:
        (node,) = (n for n in run.nodes if n.get_name() == "estimator")
        run.start()
        team = next(iter(run.teams.values()))
        team.send_goal(start + np.array([1.25, 0.0, 0.0]))
        enough = 0.98 * task.draw.way
        run.spin_until(lambda: node.estimates.push.way >= enough or team.ended, _LIMIT)
        return node.estimates.believed(), run.bridge.applied_latency[0]


def slips(trace: Trace) -> list[tuple[float, float]]:
    """When objects slipped in pushes: [s] when it began, and [m] how far, from the ground truth."""
    found = []
    bounds = [s[0] for s in trace.states] + [trace.time[-1] + 1.0]
    stamps = np.array(trace.time)
    for (begin, state, *_), end in zip(trace.states, bounds[1:], strict=True):
        first, last = np.searchsorted(stamps, [begin, end])
        if state != "PUSHING" or last - first < 2 * _SETTLED:
            continue
        seen = range(first, last)
        places = np.array([se2.between(trace.robot[k], trace.object[k]) for k in seen])
        aside = np.abs(places[:, 1] - places[_SETTLED, 1])
        aside[:_SETTLED] = 0.0
        if aside.max() > SLIPPED:
            begun = np.flatnonzero(aside[: int(aside.argmax())] < BEGUN)[-1]
            found.append((float(stamps[first + begun]), float(aside.max())))
    return found


def _pushing(trace: Trace) -> float:
    """[s] that a job pushed."""
    ends = [s[0] for s in trace.states[1:]] + [trace.time[-1]]
    return sum(end - s[0] for s, end in zip(trace.states, ends, strict=True) if s[1] == "PUSHING")


def goal_of(task: CertificateTask, scenario: Scenario) -> Array:
    """``(3,)`` where the job ends: ahead of the robot, to one side, with another heading."""
    ((_, (_, start)),) = scenario.objects.items()
    ((_, (_, robot)),) = scenario.robots.items()
    random = np.random.default_rng([task.seed, 9])
    ahead = random.uniform(*_AHEAD_OF) * [1.0, random.choice([-1.0, 1.0]), 1.0]
    ahead[2] *= random.choice([-1.0, 1.0])  # towards the side, or back: one bend or two
    frame = np.array([start[0], start[1], robot[2]])
    place = se2.compose(frame, ahead)
    return np.array([place[0], place[1], se2.wrap(start[2] + ahead[2])])


def job(
    task: CertificateTask, arm: str, values: Mapping[tuple[str, str], Interval]
) -> tuple[Row, Trace]:
    """One job; what came of it. values: what is believed, of ``ARMS``."""
    believed, world, _ = drawn_worlds(task.draw)
    believed, world = (s.settings("estimator", enabled=False) for s in (believed, world))
    goal = goal_of(task, believed)
    (robot,) = believed.robots
    with own_domain(), LockstepRun(believed, world=world, quiet=True) as run:
        say = run.observer.create_publisher(Belief, Names("/", "/").world("belief"), BELIEF)
        alarms: list[float] = []

        def hear(message: Report) -> None:
            if _ALARM in message.figures:
                alarms.append(time_from_ros(message.header.stamp))

        topic = Names("/", "/").robot(robot, "report")
        run.observer.create_subscription(Report, topic, hear, STATUS)
        run.start()
        team = next(iter(run.teams.values()))

        def tell() -> None:
            say.publish(belief_to_ros("estimator", values))
            run.spin_until(lambda: False, 0.05)

        def planned() -> bool:
            state = team.observer.state
            return team.ended or (state is not None and int(state.state) in _AFTER_PLAN)

        if arm == "told":
            tell()
        run.spin_until(lambda: False, 0.1)
        goal_time = run.bridge.time
        team.send_goal(goal)
        if arm == "answered":
            run.spin_until(planned, _LIMIT)
            tell()
        run.spin_until(lambda: team.ended, _LIMIT)
        state, trace = team.observer.state, team.observer.trace
    assert state is not None
    position, orientation = final_errors(trace, goal)
    slipped = slips(trace)
    reached = team.ended and int(state.error_code) == 0
    row: Row = {
        "success": bool(
            reached and position <= SUCCESS_POSITION and orientation <= SUCCESS_ORIENTATION
        ),
        "error_m": position,
        "error_rad": orientation,
        "slipped": bool(slipped),
        "slip_m": max((far for _, far in slipped), default=0.0),
        "alarm": bool(alarms),
        "replans": int(state.replans),
        "push_s": _pushing(trace),
        "job_s": trace.time[-1] - goal_time,
        "lost": bool(not reached or trace.contact_losses > 0),
        "reason": "" if reached else str(state.reason),
    }
    if slipped:
        row["slip_at_s"] = slipped[0][0]
    if alarms:
        row["alarm_at_s"] = alarms[0]
    return row, trace


def trial(task: CertificateTask) -> Row:
    """A probing push, and a job for each of ``ARMS``."""
    found, latency = probed(task)
    believed, _, drawn = drawn_worlds(task.draw)
    (item,) = believed.objects
    values = {("" if q == "latency" else item, q): i for q, i in found.items()}
    friction = found["contact_friction"]
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        **drawn,
        "latency_mean_s": latency,
        "friction": friction.value,
        "friction_low": friction.low,
        "friction_high": friction.high,
    }
    traces = {}
    for arm in ARMS:
        came, traces[arm] = job(task, arm, values)
        row |= {f"{arm}_{key}": value for key, value in came.items()}
    if "untold_slip_at_s" in row and "answered_alarm_at_s" in row:
        row["ahead_s"] = row["untold_slip_at_s"] - row["answered_alarm_at_s"]
        if task.out:
            _leave(task.trace_file, traces, row)
    row["success"] = not row["answered_lost"]
    row["reason"] = row["answered_reason"]
    return row


def statistics(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Alarms before slips, false alarms an hour of pushing, and what became of the objects."""
    done = [r for r in rows if "told_slipped" in r]
    slipped = [r for r in done if r["untold_slipped"]]
    calm = [r for r in done if not r["untold_slipped"]]
    found: dict[str, Any] = {"draws": len(done), "slipped": len(slipped)}
    if slipped:
        ahead = [r.get("ahead_s", -np.inf) for r in slipped]
        found["in_time"] = sum(s >= AHEAD for s in ahead)
        found["ahead_median_s"] = float(np.median(ahead))
        found["answered_lost_of_slipped"] = sum(bool(r["answered_lost"]) for r in slipped)
    found["false_alarms"] = sum(bool(r["answered_alarm"]) for r in calm)
    found["calm_h"] = sum(r["untold_push_s"] for r in calm) / 3600.0
    told = [r for r in done if not r["told_slipped"]]
    found["told_false_alarms"] = sum(bool(r["told_alarm"]) for r in told)
    found["told_h"] = sum(r["told_push_s"] for r in told) / 3600.0
    for arm in ARMS:
        found[f"{arm}_slips"] = sum(bool(r[f"{arm}_slipped"]) for r in done)
        found[f"{arm}_losses"] = sum(bool(r[f"{arm}_lost"]) for r in done)
        found[f"{arm}_reached"] = sum(bool(r[f"{arm}_success"]) for r in done)
        if done:
            errors = [1e3 * r[f"{arm}_error_m"] for r in done]
            found[f"{arm}_mean_error_mm"] = float(np.mean(errors))
            found[f"{arm}_mean_job_s"] = float(np.mean([r[f"{arm}_job_s"] for r in done]))
    return found


def conclude(options: StudyOptions, tasks: Sequence[CertificateTask], rows: list[Row]) -> None:
    """The tables of alarms and of jobs, and a picture of an alarm."""
    f = statistics(rows)
    print(f"\n{f['slipped']} of {f['draws']} objects slip when nothing is done")
    if f["slipped"]:
        print(
            f"alarm at least {AHEAD} s before: {f['in_time']} of {f['slipped']}, median "
            f"{f['ahead_median_s']:.2f} s"
        )
    print(f"alarms in pushes that do not slip: {f['false_alarms']} in {f['calm_h']:.2f} h")
    print(f"the same, planned with the belief: {f['told_false_alarms']} in {f['told_h']:.2f} h")
    print(f"{'':10}{'slipped':>9}{'lost':>6}{'reached':>9}{'error [mm]':>12}{'job [s]':>9}")
    for arm in ARMS:
        if f["draws"]:
            print(
                f"{arm:10}{f[f'{arm}_slips']:9}{f[f'{arm}_losses']:6}{f[f'{arm}_reached']:9}"
                f"{f[f'{arm}_mean_error_mm']:12.2f}{f[f'{arm}_mean_job_s']:9.1f}"
            )
    _picture(options.out / "certificate.png", tasks)


def _leave(file: Path, traces: Mapping[str, Trace], row: Row) -> None:
    curves: dict[str, Any] = {}
    for arm in ("untold", "answered"):
        trace = traces[arm]
        stamps, count = np.array(trace.time), min(len(trace.robot), len(trace.object))
        pairs = zip(trace.robot[:count], trace.object[:count], strict=True)
        aside = np.array([se2.between(r, o)[1] for r, o in pairs])
        changes, names = np.array([s[0] for s in trace.states]), [s[1] for s in trace.states]
        state = np.clip(np.searchsorted(changes, stamps[:count]) - 1, 0, None)
        aside[[names[k] != "PUSHING" for k in state]] = np.nan
        curves |= {f"{arm}_time": stamps[:count], f"{arm}_aside": aside}
    moments = {"alarm": row["answered_alarm_at_s"], "slip": row["untold_slip_at_s"]}
    np.savez(file, **curves, **moments, far=row["untold_slip_m"])


def _picture(file: Path, tasks: Sequence[CertificateTask]) -> None:
    """Where the object was on the bumper in the draw with the farthest slip that was foreseen."""
    found = [np.load(t.trace_file) for t in tasks if t.trace_file.is_file()]
    if not found:
        return
    trace = max(found, key=lambda f: float(f["far"]))
    figure, axis = plt.subplots(figsize=(8, 2.8))
    for arm, colour, label in (
        ("untold", "C1", "push, if nothing is done"),
        ("answered", "C0", "pushes, if the alarm is answered"),
    ):
        axis.plot(trace[f"{arm}_time"], 1e3 * trace[f"{arm}_aside"], color=colour, label=label)
    axis.axvline(trace["alarm"], color="C3", ls="--", lw=1.2, label="alarm")
    axis.axvline(trace["slip"], color="k", ls=":", lw=1.2, label="slip begins if nothing is done")
    axis.set_ylabel("object along the bumper [mm]", fontsize=8)
    axis.set_xlabel("time [s]", fontsize=8)
    axis.legend(fontsize=8)
    figure.savefig(file, dpi=120, bbox_inches="tight")
    plt.close(figure)
