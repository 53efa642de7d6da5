"""Section 2.3.4, Figures 2.10-2.17: the Pioneer on a trajectory, with (2.31)-(2.33) and without.

Case I: the robot alone. II: with its 3 kg box, which the controller does not know of. III: the
controller believes the wheels' friction to be 0.7, it is 0.5.

The robot starts beside the trajectory, and is on it before the first bend. Slip and error are those
of the bends, from ``settled`` on: at the start every controller without the constraint spins its
wheels, and that would hide what follows. From one bend into the next the turn rate that is asked
for jumps by 1.28 rad/s, which no traction can follow.
"""

import math
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from push_bringup.node_settings import changed, resolved
from push_bringup.systems import LOCKSTEP, nodes_of
from push_model.arrays import Array
from push_model.drives import TorqueDrive
from push_model.settings import SettingsError
from push_model.trajectory import Trajectory, along_curve
from push_msgs.action import FollowTrajectory
from push_msgs.msg import ControllerStatus, Poses
from push_ros.claims import own_domain
from push_ros.conversions import poses_from_ros, time_from_ros, trajectory_to_ros
from push_ros.pace_feed import pace_known
from push_ros.process import Spinner, prepare_environment
from push_ros.qos import STATUS, STREAM
from push_scenario.scenario import Scenario, load_scenario
from push_study.discovery import Discovery, unmatched
from push_study.job import digest
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty

SCENARIOS = ("wheel-slip",)
"""Where none are named."""
OPTIONS = {"uncertainty": "mild"}

CASES = {1: "I: alone", 2: "II: 3 kg box", 3: "III: mu 0.7 believed"}
OVERRATED = 0.7
"""Friction of the wheels that is believed in case III."""
START = np.array([0.0, -3.0, 0.0])
"""Where the trajectory begins."""
START_STRAIGHT, BENDS, END_BEND, END_STRAIGHT = (
    (3.2, 0.0),
    ((1.7, 0.8), (0.8, -0.8)),
    (1.0, 0.8),
    (0.8, 0.0),
)
"""Length [m] and curvature [1/m] of the way's portions; the bends come several times. The box stays
at the bumper up to a curvature of contact friction / (distance of its centre ahead of the axle)
= 0.3 / 0.375 m = 0.8 / m."""
PAIRS = 3
"""Times that the bends come."""
SPEED, ACCELERATION = 0.8, 0.8
_EARLIER = 0.5
"""[s] before the first bend from which on slip and error count."""
_LIMIT = 60.0  # [s] of sim time
_SPACING = 0.01  # [m]


@dataclass(frozen=True)
class SlipTask:
    """One run. case: 1, 2, 3; constraint: (2.31)-(2.33); digest: of the scenario's text; pairs: of
    bends."""

    scenario: str
    seed: int
    out: str
    case: int
    constraint: bool
    uncertainty: str = "mild"
    digest: str = ""
    pairs: int = PAIRS

    @property
    def trace_file(self) -> Path:
        """Where the run leaves its trace."""
        kind = "with" if self.constraint else "without"
        return Path(self.out) / f"trace-{self.case}-{kind}-{self.seed}.npz"


def trajectory(drive: TorqueDrive, pairs: int = PAIRS) -> Trajectory:
    """Straight and round portions from ``START``, rest to rest."""
    portions = (START_STRAIGHT, *BENDS * pairs, END_BEND, END_STRAIGHT)
    points, headings, curvatures = [START[:2]], [float(START[2])], [portions[0][1]]
    for length, curvature in portions:
        for _ in range(round(length / _SPACING)):
            heading = headings[-1] + _SPACING * curvature
            middle = 0.5 * (headings[-1] + heading)
            step = _SPACING * np.array([np.cos(middle), np.sin(middle)])
            points.append(points[-1] + step)
            headings.append(heading)
            curvatures.append(curvature)
    way = np.array(points), np.array(headings), np.array(curvatures)
    return along_curve(*way, drive, SPEED, ACCELERATION)


def settled() -> float:
    """[s] of the trajectory from which on slip and error count: just before its first bend."""
    return START_STRAIGHT[0] / SPEED + 0.5 * SPEED / ACCELERATION - _EARLIER


def tasks(options: StudyOptions) -> list[SlipTask]:
    """Every case with and without the constraint, as often as there are trials.

    A seed draws where the robot starts: beside the beginning, as in case study I.
    """
    made = []
    for name in options.scenarios:
        scenario = load_scenario(name)
        if not isinstance(scenario.robot()[1].drive, TorqueDrive):
            raise SettingsError(f"scenario '{name}': the robot is not driven by wheel torques")
        text = digest(scenario)
        made += [
            SlipTask(name, seed, str(options.out), case, constraint, options.uncertainty, text)
            for case in CASES
            for seed in range(options.seed, options.seed + options.trials)
            for constraint in (True, False)
        ]
    return made


def world_of(task: SlipTask) -> tuple[Scenario, Scenario, Trajectory, Row]:
    """What the controller believes, the world, the way, and what was drawn for the world."""
    scenario = load_scenario(task.scenario)
    name, robot = scenario.robot()
    drive = robot.drive
    assert isinstance(drive, TorqueDrive)
    random = np.random.default_rng(task.seed)
    away = random.uniform([-0.35, -0.25, -0.3], [-0.15, 0.25, 0.3])
    if task.case == 2:  # the box stands before the robot, where the way begins
        away = np.array([random.uniform(-0.3, -0.2), 0.0, 0.0])
    scenario = replace(scenario, robots={name: (robot, START + away)})
    ahead = robot.flat_bumper.distance + 0.13
    items = {
        n: (spec, START + [ahead, 0.0, 0.0] if task.case == 2 else START + [-2.0, -0.6, 0.0])
        for n, (spec, _) in scenario.objects.items()
    }
    scenario = replace(scenario, objects=items)
    believed, world, drawn = uncertainty(task.uncertainty).draw(scenario, task.seed)
    delay = believed.parameters["controller"]["tracker"]["pose_delay"]
    friction = OVERRATED if task.case == 3 else drive.wheel_friction
    believed = believed.settings(
        "torque_controller",
        nmpc__friction=friction,
        nmpc__constraint=task.constraint,
        tracker__pose_delay=delay,
    )
    world = replace(world, parameters=believed.parameters)
    return believed, world, trajectory(drive, task.pairs), drawn


class Watcher(Node):
    """Ground truth, wheels and solve times of a robot, and who sends it on its way."""

    def __init__(self, robot: str) -> None:
        super().__init__("watcher")
        self.robot = robot
        self.poses: dict[float, Array] = {}
        self.wheels: dict[float, Array] = {}
        self.solves: list[float] = []
        self.create_subscription(Poses, "/ground_truth/poses", self._on_truth, STREAM)
        self.create_subscription(JointState, f"/{robot}/joint_states", self._on_wheels, STREAM)
        status = f"/{robot}/controller/status"
        self.create_subscription(ControllerStatus, status, self._on_status, STATUS)
        self.client = ActionClient(self, FollowTrajectory, f"/{robot}/follow_trajectory")

    def _on_truth(self, message: Poses) -> None:
        seen, _ = poses_from_ros(message, (self.robot,))
        if self.robot in seen:
            self.poses[time_from_ros(message.header.stamp)] = seen[self.robot]

    def _on_wheels(self, message: JointState) -> None:
        self.wheels[time_from_ros(message.header.stamp)] = np.array(message.velocity)

    def _on_status(self, message: ControllerStatus) -> None:
        if message.solve_time > 0.0:
            self.solves.append(float(message.solve_time))

    def table(self) -> tuple[Array, Array, Array]:
        """Times ``(n,)``, poses ``(n, 3)``, wheel speeds ``(n, 2)`` [rad/s] (left, right)."""
        stamps = sorted(set(self.poses) & set(self.wheels))
        poses = np.array([self.poses[t] for t in stamps])
        return np.array(stamps), poses, np.array([self.wheels[t] for t in stamps])


def slips(time: Array, poses: Array, wheels: Array, drive: TorqueDrive) -> Array:
    """``(n, 2)`` [m/s]: surface speed of each wheel less that of its axle along the heading."""
    turn = np.gradient(np.unwrap(poses[:, 2]), time)
    x, y = np.gradient(poses[:, 0], time), np.gradient(poses[:, 1], time)
    v = np.cos(poses[:, 2]) * x + np.sin(poses[:, 2]) * y
    axle = v[:, None] + turn[:, None] * drive.half_track * np.array([-1.0, 1.0])
    result: Array = wheels * drive.wheel_radius - axle
    return result


def trial(task: SlipTask) -> Row:
    """Follow the trajectory once."""
    with own_domain():
        return _follow(task)


def _follow(task: SlipTask) -> Row:
    believed, world, way, drawn = world_of(task)
    believed, world = (
        resolved(changed(s.settings("bridge", lockstep=True), LOCKSTEP, only_missing=True))
        for s in (believed, world)
    )
    name, robot = world.robot()
    assert isinstance(robot.drive, TorqueDrive)
    prepare_environment()
    with ExitStack() as stack:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        watcher = Watcher(name)
        nodes = [
            spec.make(world if spec.kind == "bridge" else believed)
            for spec in nodes_of("torque", believed)
        ]
        bridge: Any = nodes[0]
        spinner = Spinner([*nodes, watcher])
        stack.callback(spinner.close)
        everyone = [*nodes, watcher]
        discovery = Discovery(watcher, spinner)

        def parts() -> tuple[bool, ...]:
            known = all(pace_known(node) for node in everyone)
            return len(bridge.commanded()) == 1, bool(bridge.heard_by(1)), known

        discovery.wait(
            lambda: (*parts(), *unmatched(everyone)),
            lambda: all(parts()) and not unmatched(everyone),
        )
        discovery.settle()
        bridge.start()
        goal = FollowTrajectory.Goal(trajectory=trajectory_to_ros(way))
        sent = watcher.client.send_goal_async(goal)
        spinner.until(sent.done, 20.0)
        begin, answer = bridge.time, sent.result().get_result_async()
        spinner.until(lambda: answer.done() or bridge.time > begin + _LIMIT, math.inf)
        result = answer.result().result if answer.done() else None
    time, poses, wheels = watcher.table()
    after = (time >= begin) & (time <= begin + way.duration)
    time, poses, wheels = time[after] - begin, poses[after], wheels[after]
    slip = slips(time, poses, wheels, robot.drive)
    aim, _ = way.sample(time)
    errors = np.hypot(*(poses[:, :2] - aim[:, :2]).T)
    Path(task.out).mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        task.trace_file, time=time, robot=poses, slip=slip, error=errors, aim=aim[:, :2]
    )
    late = time >= settled()
    if not late.any():
        raise RuntimeError("the run ended before the first bend")
    why = "no end within the time limit" if result is None else result.error_msg or "done"
    slipped, off = _rms(slip[late]), _rms(errors[late])
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "success": result is not None and result.error_code == 0,
        "reason": f"case {task.case} {'with' if task.constraint else 'without'}: slip "
        f"{slipped:.4f} m/s rms, error {1e3 * off:.0f} mm rms after {settled():.1f} s; {why}",
        "case": task.case,
        "constraint": task.constraint,
        "settled_from_s": settled(),
        "slip_rms_m_s": slipped,
        "slip_max_m_s": float(np.abs(slip[late]).max()),
        "error_rms_m": off,
        "error_max_m": float(errors[late].max()),
        "start_slip_rms_m_s": _rms(slip[~late]),
        "final_error_m": float(errors[-1]),
        "solve_p99_ms": 1e3 * float(np.quantile(watcher.solves or [np.nan], 0.99)),
        **drawn,
    }


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


def statistics(rows: list[Row]) -> dict[str, Any]:
    """By case: means with the constraint and without it, the part of the slip that it takes away,
    and the ratio of the errors, of the means and as the median over the seeds."""
    found: dict[str, Any] = {}
    done = [r for r in rows if "slip_rms_m_s" in r]
    for case in CASES:
        on, off = (
            {r["seed"]: r for r in done if r.get("case") == case and r.get("constraint") is held}
            for held in (True, False)
        )
        pairs = [(on[seed], off[seed]) for seed in sorted(set(on) & set(off))]
        if not pairs:
            continue
        slip, error = (
            np.array([[r[name] for r in pair] for pair in pairs])
            for name in ("slip_rms_m_s", "error_rms_m")
        )
        (slipped, without), (off_with, off_without) = slip.mean(axis=0), error.mean(axis=0)
        found[f"case_{case}"] = {
            "pairs": len(pairs),
            "slip_with_m_s": float(slipped),
            "slip_without_m_s": float(without),
            "slip_removed": float(1.0 - slipped / without),
            "error_with_m": float(off_with),
            "error_without_m": float(off_without),
            "error_ratio": float(off_with / off_without),
            "error_ratio_median": float(np.median(error[:, 0] / error[:, 1])),
        }
    return found


def conclude(options: StudyOptions, tasks: Sequence[SlipTask], rows: list[Row]) -> None:
    """What the constraint saves in each case, and the plots."""
    print(f"\nfrom {settled():.1f} s on, before the first bend; uncertainty: {options.uncertainty}")
    head = f"{'':22s}{'slip rms [m/s]':^22s}{'':12s}{'position error rms [m]':^25s}"
    names = f"{'with':>9s}{'without':>13s}{'removed':>12s}{'with':>12s}{'without':>13s}"
    print(head, f"{'':22s}{names}{'ratio':>9s}{'median ratio':>15s}", sep="\n")
    found = statistics(rows)
    for case, name in CASES.items():
        if (mine := found.get(f"case_{case}")) is None:
            continue
        print(
            f"{name:22s}{mine['slip_with_m_s']:9.4f}{mine['slip_without_m_s']:13.4f}"
            f"{100 * mine['slip_removed']:10.1f} %{mine['error_with_m']:12.4f}"
            f"{mine['error_without_m']:13.4f}{mine['error_ratio']:9.2f}"
            f"{mine['error_ratio_median']:15.2f}"
        )
    late = [r["solve_p99_ms"] for r in rows if r.get("constraint") and "solve_p99_ms" in r]
    if late:
        print(f"a solve with the constraint: {max(late):.2f} ms p99 (CPU), worst run")
    _plot(tasks, options.out)


def _plot(tasks: Sequence[SlipTask], out: Path) -> None:
    """Figures 2.10-2.17: ways, errors and slips of each case, first seed."""
    figure, axes = plt.subplots(len(CASES), 3, figsize=(14, 9), squeeze=False, layout="constrained")
    for row, (case, name) in zip(axes, CASES.items(), strict=True):
        for constraint, colour in ((False, "#c22f3d"), (True, "#2a62c9")):
            chosen = [t for t in tasks if (t.case, t.constraint) == (case, constraint)]
            if chosen and chosen[0].trace_file.is_file():
                trace = np.load(chosen[0].trace_file)
                label = "with" if constraint else "without"
                row[0].plot(*trace["aim"].T, color="#777777", lw=0.6)
                row[0].plot(*trace["robot"][:, :2].T, color=colour, lw=1.0, label=label)
                row[1].plot(trace["time"], trace["error"], color=colour, lw=0.8)
                row[2].plot(trace["time"], trace["slip"], color=colour, lw=0.6)
        for axis in row[1:]:
            axis.axvline(settled(), color="#777777", lw=0.6, ls=":")
        row[0].set_aspect("equal")
        row[0].set_ylabel(name)
        row[1].set_ylabel("position error [m]")
        row[2].set_ylabel("slip of the wheels [m/s]")
        if row[0].get_legend_handles_labels()[0]:
            row[0].legend(fontsize=7)
    axes[-1][0].set_xlabel("x, y [m]")
    for column in (1, 2):
        axes[-1][column].set_xlabel("time [s]")
    figure.savefig(out / "wheel-slip.png", dpi=130, bbox_inches="tight")
    plt.close(figure)
