"""What a bag holds, as time series: for reports, figures and tests."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_record.bag import read_bag, read_metadata
from push_record.topics import team_names
from push_ros.validation import planar_pose
from push_scenario.scenario import Scenario, scenario_from_text
from push_scenario.teams import Team

STATUS = (
    "time",
    "error_x",
    "error_y",
    "error_theta",
    "solve_time",
    "curvature_margin",
    "obstacle_margin",
    "object_offset_y",
)
"""Columns of a robot's status; fields of ``ControllerStatus``."""

_WORKING = (1, 2)  # modes of a controller that follows a trajectory


@dataclass
class TeamContents:
    """What a team did. states: (time [s], state, reason); plan: ways ``(n, 2)`` [m] of its pushes;
    goal ``(3,)``: the last one; status ``(n, 8)``: of its first robot, columns ``STATUS``."""

    team: Team
    states: list[tuple[float, str, str]] = field(default_factory=list)
    plan: list[Array] = field(default_factory=list)
    goal: Array | None = None
    status: Array = field(default_factory=lambda: np.zeros((0, len(STATUS))))


@dataclass
class BagContents:
    """Ground truth of a bag: time ``(n,)`` [s] and poses ``(n, 3)`` by body; and its teams.

    collisions: contacts of a body with what is none, e.g. a wall; one a message and pair.
    """

    scenario: Scenario
    metadata: dict[str, str]
    teams: dict[str, TeamContents]
    time: Array = field(default_factory=lambda: np.zeros(0))
    poses: dict[str, Array] = field(default_factory=dict)
    collisions: int = 0

    def team(self, name: str = "") -> TeamContents:
        """Of a team; of the first when no name is given."""
        return self.teams[name or next(iter(self.teams))]

    @property
    def status(self) -> Array:
        """Of the first team."""
        return self.team().status

    @property
    def states(self) -> list[tuple[float, str, str]]:
        """Of the first team."""
        return self.team().states

    @property
    def plan(self) -> list[Array]:
        """Of the first team."""
        return self.team().plan

    @property
    def goal(self) -> Array | None:
        """Of the first team."""
        return self.team().goal

    def final_error(self, team: str = "") -> tuple[float, float]:
        """Position [m] and orientation [rad] error of a team's object at the end; nan unknown."""
        contents = self.team(team)
        way = self.poses.get(contents.team.object, np.zeros((0, 3)))
        if contents.goal is None or not len(way):
            return float("nan"), float("nan")
        local = se2.between(contents.goal, way[-1])
        return float(np.hypot(local[0], local[1])), abs(float(local[2]))


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def bag_scenario(bag: Path) -> tuple[Scenario, dict[str, str]]:
    """The scenario in a bag, and all its metadata.

    Raises
    ------
    ValueError: the bag holds no scenario.
    """
    metadata = read_metadata(bag)
    if "scenario" not in metadata:
        raise ValueError(f"{bag}: no scenario in it; was it recorded by planar-push?")
    name = metadata.get("scenario_name", "scenario")
    return scenario_from_text(metadata["scenario"], name, str(bag)), metadata


def load_contents(bag: Path) -> BagContents:
    """Read a bag, of one world and all its teams, wherever in the graph they were.

    Raises
    ------
    ValueError: the bag holds no scenario.
    """
    scenario, metadata = bag_scenario(bag)
    names = team_names(scenario, metadata.get("namespace", ""))
    world = next(iter(names.values()))
    teams = {n: TeamContents(scenario.team(n)) for n in names}
    contents = BagContents(scenario, metadata, teams)
    bodies = set(scenario.robots) | set(scenario.objects)
    truth, touches = world.world("ground_truth/poses"), world.world("contacts")
    states = {n.team("job_state"): teams[t] for t, n in names.items()}
    plans = {n.team("push_plan"): teams[t] for t, n in names.items()}
    status = {
        world.robot(t.team.robots[0], "controller/status"): t
        for t in teams.values()
        if t.team.robots
    }
    rows: dict[str, list[list[float]]] = {topic: [] for topic in status}
    times: list[float] = []
    poses: dict[str, list[tuple[float, float, float]]] = {}
    for record in read_bag(bag, {truth, touches, *states, *plans, *status}):
        m, topic = record.message, record.topic
        if topic == truth:
            times.append(_seconds(m.header.stamp))
            for name, *pose in zip(m.names, m.x, m.y, m.theta, strict=True):
                poses.setdefault(name, []).append((pose[0], pose[1], pose[2]))
        elif topic in status:
            if m.mode in _WORKING:
                rows[topic].append(
                    [_seconds(m.header.stamp), *(float(getattr(m, k)) for k in STATUS[1:])]
                )
        elif topic in states:
            team = states[topic]
            team.states.append((_seconds(m.header.stamp), m.state_name, m.reason))
            if m.goal.header.frame_id:
                team.goal = planar_pose(m.goal.pose)
        elif topic in plans:
            plans[topic].plan = [
                np.column_stack([s.trajectory.x, s.trajectory.y]) for s in m.segments
            ]
        else:
            contents.collisions += sum(
                1
                for pair in map(set, zip(m.body_a, m.body_b, strict=True))
                if pair & bodies and not pair <= bodies
            )
    count = min([len(times), *(len(p) for p in poses.values())]) if poses else 0
    contents.time = np.array(times[:count])
    contents.poses = {k: np.array(v[:count]).reshape(-1, 3) for k, v in poses.items()}
    for topic, team in status.items():
        team.status = np.array(rows[topic]).reshape(-1, len(STATUS))
    for team in teams.values():
        if team.goal is None:
            team.goal = team.team.goal
    return contents
