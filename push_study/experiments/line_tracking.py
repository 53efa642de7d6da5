"""Section 2.4.6, Figures 2.20-2.21: a straight line from an offset, with (2.53) and without it.

Each with the printed gains and with ours, because the gains decide how much the constraint matters:
a controller that steers gently stays within the stable curvatures of its own accord.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from rclpy.action import ActionClient

from push_model import se2
from push_model.arrays import Array
from push_model.settings import SettingsError
from push_model.trajectory import Trajectory, line
from push_mpc.contact_force_mpc import PRINTED_GAINS
from push_msgs.action import FollowTrajectory
from push_planner import push_sides
from push_ros.claims import own_domain
from push_ros.conversions import pose_to_ros, trajectory_to_ros
from push_scenario.scenario import Scenario, load_scenario
from push_study.graph_run import LockstepRun
from push_study.job import digest
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty

SCENARIOS = ("line",)
"""Where none are named."""
OPTIONS = {"uncertainty": "mild"}

OFFSETS = (0.1, 0.2, 0.4, 0.5)
"""[m] phi of section 2.4.6."""


@dataclass(frozen=True)
class Variant:
    """controller: its name; constraint: whether it has (2.53) or (2.57); tracked: what it steers,
    as ``TrackerSettings.tracked``; gains: settings of the controller. thesis: [mm] as printed."""

    controller: str
    constraint: bool
    tracked: str
    gains: Mapping[str, Any] = field(default_factory=dict)
    thesis: str = "-"


VARIANTS = {
    "(2.53), printed gains": Variant("contact_force", True, "robot", PRINTED_GAINS, "< 10"),
    "none, printed gains": Variant("contact_force", False, "robot", PRINTED_GAINS, "> 50"),
    "(2.53), our gains": Variant("contact_force", True, "robot"),
    "none, our gains": Variant("contact_force", False, "robot"),
    "(2.57)": Variant("ltv", True, "object"),
}
"""By the constraint and the gains: the thesis's controller, and ours."""

LENGTH, SPEED, ACCELERATION = 4.0, 0.07, 0.05
_COLUMN = 24  # letters of a table's column
_FINAL = 0.1  # of a run, at its end, over which the error is averaged
_BOUND = 0.01  # [m] of that average
_LIMIT = 200.0  # [s] of sim time

# Nothing is given up: a run without the constraint shows where the object ends.
_PATIENT = {
    "off_course": 5.0,
    "contact_gap": 1.0,
    "contact_aside": 1.0,
    "contact_turn": 3.2,
    "blocked_time": 600.0,
}


@dataclass(frozen=True)
class LineTask:
    """One run. offset_m [m] phi; variant: key of ``VARIANTS``; digest: of the scenario's text;
    length [m] of the line."""

    scenario: str
    seed: int
    out: str
    offset_m: float
    variant: str
    uncertainty: str = "mild"
    digest: str = ""
    length: float = LENGTH

    @property
    def trace_file(self) -> Path:
        """Where the run leaves its trace."""
        number = list(VARIANTS).index(self.variant)
        name = f"{Path(self.scenario).stem}-{self.offset_m:g}-{number}-{self.seed}"
        return Path(self.out) / f"trace-{name}.npz"


def tasks(options: StudyOptions) -> list[LineTask]:
    """Every offset with every variant, as often as there are trials."""
    made = []
    for name in options.scenarios:
        scenario = load_scenario(name)
        if scenario.object()[1].geometry.sides == ():
            raise SettingsError(f"scenario '{name}': the object has no side to push on")
        text = digest(scenario)
        made += [
            LineTask(name, seed, str(options.out), phi, variant, options.uncertainty, text)
            for phi in OFFSETS
            for variant in VARIANTS
            for seed in range(options.seed, options.seed + options.trials)
        ]
    return made


def aside(scenario: Scenario, offset: float) -> Scenario:
    """The scenario with everything ``offset`` [m] to the left of where it is."""
    move = np.array([0.0, offset, 0.0])
    return replace(
        scenario,
        robots={n: (spec, start + move) for n, (spec, start) in scenario.robots.items()},
        objects={n: (spec, start + move) for n, (spec, start) in scenario.objects.items()},
    )


def trial(task: LineTask) -> Row:
    """Push along the line once."""
    with own_domain():
        return _track(task)


def world_of(task: LineTask) -> tuple[Scenario, Scenario, Row]:
    """What the controller believes, with its settings; the world; what was drawn for it."""
    variant = VARIANTS[task.variant]
    scenario = aside(load_scenario(task.scenario), task.offset_m)
    believed, world, drawn = uncertainty(task.uncertainty).draw(scenario, task.seed)
    believed = believed.settings(
        "controller",
        controller=variant.controller,
        tracker__tracked=variant.tracked,
        **{f"tracker__{k}": v for k, v in _PATIENT.items()},
        **{f"mpc__{k}": v for k, v in variant.gains.items()},
    )
    if variant.controller == "contact_force":
        believed = believed.settings("controller", mpc__constraint=variant.constraint)
    return believed, world, drawn


def _track(task: LineTask) -> Row:
    variant = VARIANTS[task.variant]
    believed, world, drawn = world_of(task)
    way = line(
        next(iter(load_scenario(task.scenario).robots.values()))[1],
        task.length,
        SPEED,
        ACCELERATION,
    )
    with LockstepRun(believed, world=world, quiet=True) as run:
        robot = believed.robot()[0]
        client = ActionClient(run.observer, FollowTrajectory, f"/{robot}/follow_trajectory")
        run.start()
        result = _follow(run, believed, way, client)
        trace = run.observer.trace
    ways, item = np.array(trace.robot), np.array(trace.object)
    final = item[-max(1, round(_FINAL * len(item))) :]
    error = float(np.abs(final[:, 1]).mean())
    in_robot = np.array([se2.between(r, o)[1] for r, o in zip(ways, item, strict=False)])
    Path(task.out).mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        task.trace_file,
        time=np.array(trace.time[::10]),
        robot=ways[::10],
        object=item[::10],
        aside=in_robot[::10],
    )
    ended = result is not None and result.error_code == 0
    good = not variant.constraint or (ended and error <= _BOUND)
    why = "no end within the time limit" if result is None else result.error_msg or "done"
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "success": bool(good),
        "reason": f"phi {task.offset_m:g} m {task.variant}: {1e3 * error:.1f} mm; {why}",
        "offset_m": task.offset_m,
        "variant": task.variant,
        "final_error_m": error,
        "aside_max_m": float(np.abs(in_robot).max()),
        "solve_time_ms": 1e3 * float(np.median(trace.solve_times or [np.nan])),
        "solve_time_p99_ms": 1e3 * float(np.quantile(trace.solve_times or [np.nan], 0.99)),
        **drawn,
    }


def _follow(run: LockstepRun, scenario: Scenario, way: Trajectory, client: ActionClient) -> Any:
    """The controller's result of a push along a trajectory; None where it does not end."""
    _, robot = scenario.robot()
    item, spec = scenario.object()
    side = push_sides(robot, spec, 1.0)[0]
    goal = FollowTrajectory.Goal(
        mode=FollowTrajectory.Goal.PUSH,
        object=item,
        trajectory=trajectory_to_ros(way),
        contact=pose_to_ros(side.grasp),
        curvature_min=side.nominal.minimum,
        curvature_max=side.nominal.maximum,
    )
    sent = client.send_goal_async(goal)
    run.spin_until(sent.done, 5.0)
    if not sent.done() or not sent.result().accepted:
        raise RuntimeError("the controller has rejected the trajectory")
    answer = sent.result().get_result_async()
    ended = run.spin_until(answer.done, _LIMIT)
    return answer.result().result if ended else None


def statistics(rows: list[Row]) -> dict[str, Any]:
    """By variant: mean and worst final error for each offset, and the times of a solve."""
    found: dict[str, Any] = {}
    for variant in VARIANTS:
        mine = [r for r in rows if r.get("variant") == variant and "final_error_m" in r]
        if not mine:
            continue
        cell: dict[str, Any] = {
            "solve_median_ms": float(np.median([r["solve_time_ms"] for r in mine])),
            "solve_p99_ms": float(max(r["solve_time_p99_ms"] for r in mine)),
        }
        for phi in OFFSETS:
            errors = [r["final_error_m"] for r in mine if r.get("offset_m") == phi]
            if errors:
                cell[f"final_error_mean_m_{phi:g}"] = float(np.mean(errors))
                cell[f"final_error_worst_m_{phi:g}"] = float(np.max(errors))
        found[variant] = cell
    return found


def conclude(options: StudyOptions, tasks: Sequence[LineTask], rows: list[Row]) -> None:
    """The table of final errors beside the thesis's, and the plots."""
    found = statistics(rows)
    print("\nfinal average position error of the object [mm], mean (max) of the trials")
    print("phi [m]     " + "".join(f"{v:>{_COLUMN}s}" for v in VARIANTS))
    for phi in OFFSETS:
        cells = []
        for variant in VARIANTS:
            mean, worst = (
                1e3 * found.get(variant, {}).get(f"final_error_{name}_m_{phi:g}", np.nan)
                for name in ("mean", "worst")
            )
            cells.append("-" if np.isnan(mean) else f"{mean:.2f} ({worst:.2f})")
        print(f"{phi:<12g}" + "".join(f"{c:>{_COLUMN}s}" for c in cells))
    print("thesis      " + "".join(f"{v.thesis:>{_COLUMN}s}" for v in VARIANTS.values()))
    for variant, cell in found.items():
        print(
            f"a solve {variant}: {cell['solve_median_ms']:.3f} ms median, "
            f"{cell['solve_p99_ms']:.3f} ms p99"
        )
    _plot(tasks, options.out)


def _plot(tasks: Sequence[LineTask], out: Path) -> None:
    """Figures 2.20 (ways) and 2.21 (object in the robot frame), one row an offset."""
    figure, axes = plt.subplots(len(OFFSETS), 2, figsize=(11, 9), squeeze=False)
    for row, phi in zip(axes, OFFSETS, strict=True):
        for number, variant in enumerate(VARIANTS):
            chosen = [t for t in tasks if t.offset_m == phi and t.variant == variant]
            for task in chosen:
                if task.trace_file.is_file():
                    _draw(row, np.load(task.trace_file), f"C{number}", variant)
                    break
        row[0].axhline(0.0, color="#d8b400", lw=1.0)
        row[0].set_ylabel(f"phi = {phi:g} m\ny [m]")
        row[1].set_ylabel("object aside [mm]")
    axes[0][0].legend(fontsize=7)
    axes[-1][0].set_xlabel("x [m] (solid: object, thin: robot)")
    axes[-1][1].set_xlabel("time [s]")
    figure.savefig(out / "line-tracking.png", dpi=130, bbox_inches="tight")
    plt.close(figure)


def _draw(row: Any, trace: Any, colour: str, label: str) -> None:
    robot: Array = trace["robot"]
    item: Array = trace["object"]
    row[0].plot(item[:, 0], item[:, 1], color=colour, lw=1.4, label=label)
    row[0].plot(robot[:, 0], robot[:, 1], color=colour, lw=0.5)
    row[1].plot(trace["time"], 1e3 * trace["aside"], color=colour, lw=1.0)
