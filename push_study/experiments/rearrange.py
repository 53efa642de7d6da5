"""One robot, several boxes, a goal for each: the scenes of ReloPush and of its generator."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node

from push_model import se2
from push_model.arrays import Array
from push_msgs.msg import Contacts, JobState, Poses
from push_planner.rearranger_node import ASIDE, GOALS, STATE, RearrangerNode
from push_ros.claims import own_domain
from push_ros.conversions import poses_from_ros, time_to_ros
from push_ros.names import Names
from push_ros.process import heard
from push_ros.qos import COMMAND, LATCHED, STREAM
from push_ros.validation import FRAME
from push_scenario.scenario import Scenario
from push_study.graph_run import LockstepRun
from push_study.pool import Row
from push_study.relopush.scenes import SCENES, scenario_of
from push_study.statistics import wilson
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty

SCENARIOS = tuple(SCENES)
"""Where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "pybullet"}
POSITION, ORIENTATION = 0.005, 0.05
"""[m], [rad] within which every box must end."""
_LIMIT = 1500.0  # [s] of simulated time


@dataclass(frozen=True)
class RearrangeTask:
    """One trial. scenario: a scene, see ``push_study.relopush.scenes``."""

    scenario: str
    seed: int
    uncertainty: str
    world: str


class Watch(Node):
    """Sends the goals, and sees from ground truth how the boxes end and what they touch.

    poses: ``(3,)`` by name. ways: [m] that each body has moved, by name. state: newest of the
    rearranger. moves, aside: that it has begun.
    collisions: pairs of bodies that touched in a tick, but for the robot with a box.
    """

    def __init__(self, names: Names, robot: str) -> None:
        super().__init__("rearrange_watch")
        self._robot = robot
        self.poses: dict[str, Array] = {}
        self.ways: defaultdict[str, float] = defaultdict(float)
        self.state: JobState | None = None
        self.moves = self.aside = self.collisions = 0
        self._publisher = self.create_publisher(Poses, names.team(GOALS), COMMAND)
        truth, contacts = (names.world(t) for t in ("ground_truth/poses", "contacts"))
        self.create_subscription(Poses, truth, self._on_truth, STREAM)
        self.create_subscription(Contacts, contacts, self._on_contacts, STREAM)
        self.create_subscription(JobState, names.team(STATE), self._on_state, LATCHED)

    @property
    def ready(self) -> bool:
        """Whether the goals would be heard."""
        return self.state is not None and heard(self, self._publisher, state=STATE)

    def send(self, goals: Mapping[str, Array], now: float) -> None:
        """Publish goals ``(3,)`` by name."""
        message = Poses(names=list(goals))
        message.header.frame_id, message.header.stamp = FRAME, time_to_ros(now)
        message.x, message.y, message.theta = np.array(list(goals.values())).T.tolist()
        self._publisher.publish(message)

    @property
    def ended(self) -> bool:
        """Whether the job has ended, or the goals were refused."""
        s = self.state
        return s is not None and (s.refusals > 0 or (s.job > 0 and s.state == JobState.IDLE))

    def _on_truth(self, message: Poses) -> None:
        found = poses_from_ros(message)[0]
        for name, pose in found.items():
            self.ways[name] += float(np.hypot(*(pose - self.poses.get(name, pose))[:2]))
        self.poses.update(found)

    def _on_contacts(self, message: Contacts) -> None:
        for pair in map(set, zip(message.body_a, message.body_b, strict=True)):
            self.collisions += not (self._robot in pair and pair <= self.poses.keys())

    def _on_state(self, message: JobState) -> None:
        self.state = message
        if message.state == JobState.PUSHING:
            self.moves += 1
            self.aside += message.reason.endswith(ASIDE)


def tasks(options: StudyOptions) -> list[RearrangeTask]:
    """Every scene, as often as there are trials. Raises SettingsError for unknown scenes."""
    made = [
        RearrangeTask(name, seed, options.uncertainty, options.world or OPTIONS["world"])
        for name in options.scenarios
        for seed in range(options.seed, options.seed + options.trials)
    ]
    for task in made:
        scenario_of(task.scenario, task.seed)
    return made


def trial(task: RearrangeTask) -> Row:
    """Bring all boxes to their goals."""
    scenario = scenario_of(task.scenario, task.seed).settings("bridge", world=task.world)
    believed, world, drawn = uncertainty(task.uncertainty).draw(scenario, task.seed)
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "boxes": len(scenario.arrangement),
        **run_rearrangement(believed, world),
        **drawn,
    }


def run_rearrangement(
    believed: Scenario, world: Scenario | None = None, record: Path | None = None
) -> Row:
    """The arrangement of a scenario, in lockstep: how it ended, from ground truth.

    world: what is simulated, where that is something else. record: folder of a bag.
    """
    watches: list[Watch] = []

    def watch() -> list[Node]:
        watches.append(Watch(Names("/", "/"), believed.robot()[0]))
        return list(watches)

    with (
        own_domain(),
        LockstepRun(believed, watch, world, quiet=True, system="rearrange", record=record) as run,
    ):
        run.start()
        seen = watches[0]
        began = run.bridge.time
        seen.send(believed.arrangement, began)
        run.spin_until(lambda: seen.ended, _LIMIT)
        took = run.bridge.time - began
        planning = next(n.planning for n in run.nodes if isinstance(n, RearrangerNode))
    state, off = seen.state, _errors(seen.poses, believed.arrangement)
    assert state is not None
    reason = state.refusal if state.refusals else state.reason
    done = seen.ended and not state.refusals and state.error_code == 0
    near = float(off[:, 0].max()) <= POSITION and float(off[:, 1].max()) <= ORIENTATION
    if not seen.ended:
        reason = f"no end within {_LIMIT:g} s: {reason}"
    elif done and not near:
        reason = f"{1e3 * off[:, 0].max():.1f} mm, {off[:, 1].max():.3f} rad off"
    return {
        "success": bool(done and near and seen.collisions == 0),
        "reason": reason,
        "position_error_m": float(off[:, 0].max()),
        "orientation_error_rad": float(off[:, 1].max()),
        "mean_position_error_m": float(off[:, 0].mean()),
        "moves": seen.moves,
        "moved_aside": seen.aside,
        "replans": int(state.replans),
        "collisions": seen.collisions,
        "duration_s": took,
        "way_m": sum(seen.ways[name] for name in believed.arrangement),
        "path_m": seen.ways[believed.robot()[0]],
        "planning_cpu_s": planning,
    }


def _errors(poses: Mapping[str, Array], goals: Mapping[str, Array]) -> Array:
    """``(n, 2)`` [m], [rad] distance and angle of each object from its goal."""
    offs = [se2.between(goal, poses[name]) for name, goal in goals.items()]
    return np.array([[np.hypot(o[0], o[1]), abs(o[2])] for o in offs])


def statistics(rows: Sequence[Row]) -> Mapping[str, Any]:
    """Share of trials in which every box reached its goal, with Wilson's interval."""
    good = sum(bool(r["success"]) for r in rows)
    return {"executed": good, "of": len(rows), "wilson": list(wilson(good, len(rows)))}


def conclude(options: StudyOptions, tasks: Sequence[RearrangeTask], rows: list[Row]) -> None:
    """A line for each scene."""
    print(
        "\nscene        executed  position [mm]: mean, worst  moves  aside  planning [s]  time [s]"
        "  boxes [m]  robot [m]"
    )
    for name in options.scenarios:
        count = sum(r.get("scenario") == name for r in rows)
        mine = [r for r in rows if r.get("scenario") == name and "boxes" in r]
        good = [r for r in mine if r["success"]]
        if not mine:
            if count:
                print(f"{name:12}   0/{count:<3}")
            continue
        mean = {
            k: float(np.mean([float(r[k]) for r in mine]))
            for k in (
                "mean_position_error_m",
                "moves",
                "moved_aside",
                "duration_s",
                "way_m",
                "path_m",
            )
        }
        worst = max(float(r["position_error_m"]) for r in mine)
        plan = float(np.median([float(r["planning_cpu_s"]) for r in mine]))
        print(
            f"{name:12} {len(good):3}/{count:<3}   {1e3 * mean['mean_position_error_m']:8.2f}, "
            f"{1e3 * worst:.2f}            {mean['moves']:5.1f}  {mean['moved_aside']:5.1f}  "
            f"{plan:6.2f}  {mean['duration_s']:8.0f}  {mean['way_m']:9.2f}  {mean['path_m']:9.2f}"
        )
