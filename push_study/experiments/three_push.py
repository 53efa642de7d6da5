"""Section 2.4.6, Figure 2.22: the complete manipulation in three pushes, with (2.53) and without.

The room is so low that the object cannot be turned by pi in fewer pushes. Between two of them the
robot steps back, drives round the object and approaches another side, as in the thesis. A plan of
ours asks for no more than is stable, and its pushes begin within a millimetre of it: the constraint
would have nothing to decide. So the last push begins with an offset, like the lines of the first
case study: robot and object are put aside together, still in contact. What slides in an earlier
push is made good when the robot approaches the next side; what slides in the last one is an error
at the goal. With (2.53) and without it the controller steers the robot and hopes for the
object, as the thesis does; with (2.57) it steers the object.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_mpc.contact_force_mpc import PRINTED_GAINS
from push_ros.claims import own_domain
from push_scenario.events import Displace
from push_scenario.scenario import Scenario, load_scenario
from push_study.graph_run import LockstepRun
from push_study.job import check_goal, digest, run_job
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty
from push_supervisor.state import State
from push_view.bodies import bodies_of

SCENARIOS = ("three-push",)
"""Where none are named."""
OPTIONS = {"uncertainty": "mild"}

_FORCES: dict[str, Any] = {"controller": "contact_force", "tracker__tracked": "robot"}
_PRINTED: dict[str, Any] = {f"mpc__{name}": value for name, value in PRINTED_GAINS.items()}

VARIANTS: dict[str, dict[str, Any]] = {
    "(2.53), printed gains": _FORCES | _PRINTED,
    "none, printed gains": _FORCES | _PRINTED | {"mpc__constraint": False},
    "(2.53), our gains": _FORCES,
    "none, our gains": _FORCES | {"mpc__constraint": False},
    "(2.57)": {"controller": "ltv"},
}
"""Settings of the controller."""
OFFSET = 0.06
"""[m] by which robot and object are put aside; within what a controller calls off course."""
_AFTER = 0.5  # [s] of the last push until then
_MOVES, _LASTS = 2e-3, 10  # [m] in 0.1 s, for so many of them: the object is pushed
_PATIENCE = 300.0  # [s] of simulation time
THESIS = (0.04, np.deg2rad(1.8))
"""[m], [rad] final error, as printed, with (2.53)."""


@dataclass(frozen=True)
class ThreePushTask:
    """One run. variant: key of ``VARIANTS``; digest: of the scenario's text."""

    scenario: str
    seed: int
    out: str
    variant: str
    uncertainty: str = "mild"
    digest: str = ""

    @property
    def trace_file(self) -> Path:
        """Where the run leaves its trace."""
        number = list(VARIANTS).index(self.variant)
        return Path(self.out) / f"trace-{Path(self.scenario).stem}-{number}-{self.seed}.npz"


def tasks(options: StudyOptions) -> list[ThreePushTask]:
    """Every variant, as often as there are trials."""
    made = []
    for name in options.scenarios:
        scenario = load_scenario(name)
        check_goal(scenario)
        text = digest(scenario)
        made += [
            ThreePushTask(name, seed, str(options.out), variant, options.uncertainty, text)
            for variant in VARIANTS
            for seed in range(options.seed, options.seed + options.trials)
        ]
    return made


class Offset:
    """Puts robot and object aside, together, when the last push of a plan has begun; once.

    by ``(2,)``: [m] of what was done, in the world's frame; None as long as nothing was.
    """

    def __init__(self, scenario: Scenario, size: float) -> None:
        self.by: Array | None = None
        self._robot, self._item = scenario.robot()[0], scenario.object()[0]
        self._size = size

    def __call__(self, run: LockstepRun) -> None:
        """Wait for the moment, and do it."""
        machine, team = run.supervisor.machine, next(iter(run.teams.values()))

        def last() -> bool:
            pushing = machine.state is State.PUSHING and bool(machine.segments)
            return pushing and machine.index == len(machine.segments) - 1

        run.spin_until(lambda: last() or team.ended, _PATIENCE)
        if not last():
            return
        begin = run.bridge.time
        run.spin_until(lambda: run.bridge.time >= begin + _AFTER, _PATIENCE)
        robot = run.bridge.world.poses()[self._robot]
        left = np.array([-np.sin(robot[2]), np.cos(robot[2])])
        inward = left if robot[1] * left[1] < 0.0 else -left  # towards the middle of the room
        self.by = self._size * inward
        for body in (self._item, self._robot):
            way = (float(self.by[0]), float(self.by[1]), 0.0)
            run.bridge.disturb(Displace(at=run.bridge.time, body=body, by=way))


def slid(robot: Array, item: Array) -> float:
    """[m] that an object has moved along the bumper in a push, the most of all pushes.

    robot, item: poses ``(n, 3)``, ten a second. A push is a time in which the object moves.
    """
    aside = np.array([se2.between(r, o)[1] for r, o in zip(robot, item, strict=True)])
    moving = np.hypot(*np.diff(item[:, :2], axis=0).T) > _MOVES
    most, begin = 0.0, -1
    for k, moves in enumerate([*moving, False]):
        if moves and begin < 0:
            begin = k
        elif not moves and begin >= 0:
            if k - begin >= _LASTS:
                most = max(most, float(np.ptp(aside[begin : k + 1])))
            begin = -1
    return most


def trial(task: ThreePushTask) -> Row:
    """Bring the object to the goal once."""
    with own_domain():
        level = uncertainty(task.uncertainty)
        believed, world, drawn = level.draw(load_scenario(task.scenario), task.seed)
        believed = believed.settings("controller", **VARIANTS[task.variant])
        offset = Offset(world, OFFSET)
        measures, trace = run_job(believed, world, meanwhile=offset)
    Path(task.out).mkdir(parents=True, exist_ok=True)
    robot, item = np.array(trace.robot[::10]), np.array(trace.object[::10])
    np.savez_compressed(task.trace_file, time=np.array(trace.time[::10]), robot=robot, object=item)
    measures["reason"] = f"{task.variant}: {measures['reason']}"
    if offset.by is None:
        measures |= {"success": False, "reason": f"no offset; {measures['reason']}"}
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "variant": task.variant,
        **measures,
        "slid_m": slid(robot, item),
        "offset_m": 0.0 if offset.by is None else float(np.hypot(*offset.by)),
        "solve_time_ms": 1e3 * float(np.median(trace.solve_times or [np.nan])),
        **drawn,
    }


def statistics(rows: list[Row]) -> dict[str, Any]:
    """By variant: how many succeeded, how many of them without a new plan, errors, pushes, and how
    far the object slid along the bumper at most."""
    found: dict[str, Any] = {}
    for variant in VARIANTS:
        mine = [r for r in rows if r.get("variant") == variant]
        if not mine:
            continue
        found[variant] = {
            "trials": len(mine),
            "successes": sum(bool(r["success"]) for r in mine),
            "as_planned": sum(bool(r["success"]) and r["replans"] == 0 for r in mine),
        }
        done = [r for r in mine if "position_error_m" in r]
        if not done:
            continue
        p, o = (
            np.array([r[name] for r in done])
            for name in ("position_error_m", "orientation_error_rad")
        )
        found[variant] |= {
            "position_mean_m": float(p.mean()),
            "position_worst_m": float(p.max()),
            "orientation_mean_rad": float(o.mean()),
            "orientation_worst_rad": float(o.max()),
            "pushes_mean": float(np.mean([r["pushes"] for r in done])),
            "slid_worst_m": float(max(r["slid_m"] for r in done)),
        }
    return found


def conclude(options: StudyOptions, tasks: Sequence[ThreePushTask], rows: list[Row]) -> None:
    """The final errors beside the thesis's, and the ways."""
    print("\n                       success  as planned  position [mm]  orientation [deg]", end="")
    print("  pushes  slid [mm]")
    for variant, mine in statistics(rows).items():
        n, degrees = mine["trials"], np.rad2deg
        head = f"{variant:22s} {mine['successes']:3d}/{n:<3d} {mine['as_planned']:6d}/{n:<3d} "
        if "position_mean_m" not in mine:
            print(head)
            continue
        print(
            f"{head}{1e3 * mine['position_mean_m']:7.2f} {1e3 * mine['position_worst_m']:6.2f} "
            f"{degrees(mine['orientation_mean_rad']):10.3f} "
            f"{degrees(mine['orientation_worst_rad']):7.3f} {mine['pushes_mean']:7.1f} "
            f"{1e3 * mine['slid_worst_m']:10.1f}"
        )
    print(f"thesis {1e3 * THESIS[0]:41.0f} {np.rad2deg(THESIS[1]):17.1f} {3:15d}")
    _plot(tasks, options.out)


def _plot(tasks: Sequence[ThreePushTask], out: Path) -> None:
    figure, axes = plt.subplots(
        len(VARIANTS), 1, figsize=(8, 11), squeeze=False, layout="constrained", sharex=True
    )
    for row, variant in zip(axes[:, 0], VARIANTS, strict=True):
        for task in (t for t in tasks if t.variant == variant and t.trace_file.is_file()):
            scenario = load_scenario(task.scenario)
            trace = np.load(task.trace_file)
            outline = bodies_of(scenario).type(next(iter(scenario.objects))).outline
            row.plot(trace["object"][:, 0], trace["object"][:, 1], color="#c22f3d", lw=1.0)
            row.plot(trace["robot"][:, 0], trace["robot"][:, 1], color="#2a62c9", lw=0.5)
            for pose in (trace["object"][0], trace["object"][-1]):
                row.fill(*se2.transform(pose, outline).T, fill=False, lw=0.8)
            if scenario.goal is not None:
                goal = se2.transform(scenario.goal, outline)
                row.fill(*goal.T, fill=False, lw=1.4, color="#d8b400")
        row.set_aspect("equal")
        row.set_title(f"{variant} (red: object, blue: robot)", fontsize=8)
    axes[-1, 0].set_xlabel("x [m]")
    figure.savefig(out / "three-push.png", dpi=110)
    plt.close(figure)
