"""Topics that are recorded and played: of the world, of each robot, of each team."""

from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header, String
from visualization_msgs.msg import MarkerArray

from push_msgs.msg import (
    Belief,
    Contacts,
    ControllerStatus,
    GroupPlan,
    JobState,
    Poses,
    PushPlan,
    Report,
    ServiceCall,
    Velocities,
    WheelTorques,
)
from push_ros.names import Names, inside, space
from push_ros.qos import BELIEF, CLOCK, COMMAND, LATCHED, STATUS, STREAM
from push_ros.services import CALLS
from push_scenario.scenario import Scenario
from tf2_msgs.msg import TFMessage


@dataclass(frozen=True)
class Topic:
    """message: class. qos: of its publisher, used by subscribers too."""

    message: Any
    qos: Any

    @property
    def latched(self) -> bool:
        """Whether a late subscriber gets the last message."""
        return self.qos is LATCHED or self.qos is BELIEF

    @property
    def type_name(self) -> str:
        """E.g. ``push_msgs/msg/Poses``."""
        return f"{self.message.__module__.split('.')[0]}/msg/{self.message.__name__}"


WORLD = {
    "clock": Topic(Clock, CLOCK),
    "poses": Topic(Poses, STREAM),
    "ground_truth/poses": Topic(Poses, STREAM),
    "contacts": Topic(Contacts, STREAM),
    "map": Topic(OccupancyGrid, LATCHED),
    "scenario": Topic(String, LATCHED),
    "paused": Topic(Bool, LATCHED),
    "belief": Topic(Belief, BELIEF),
    CALLS: Topic(ServiceCall, STATUS),
    "cmd_vels": Topic(Velocities, COMMAND),
    "tf": Topic(TFMessage, STATUS),
    "visualization": Topic(MarkerArray, STATUS),
    "diagnostics": Topic(DiagnosticArray, STATUS),
}
"""In the namespace of the world."""

TEAM = {
    "goal_pose": Topic(PoseStamped, COMMAND),
    "goal_poses": Topic(Poses, COMMAND),
    "rearrangement": Topic(JobState, LATCHED),
    "push_plan": Topic(PushPlan, LATCHED),
    "push_path": Topic(PathMessage, LATCHED),
    "group_plan": Topic(GroupPlan, LATCHED),
    "report": Topic(Report, STATUS),
    "job_state": Topic(JobState, LATCHED),
    "status_text": Topic(String, LATCHED),
    CALLS: Topic(ServiceCall, STATUS),
}
"""In the namespace of each team."""

GOALS = ("goal_pose", "goal_poses")
"""Those on which people send goals; a playback does not publish them."""

ROBOT = {
    "cmd_vel": Topic(TwistStamped, COMMAND),
    "heartbeat": Topic(Header, STREAM),
    "controller/status": Topic(ControllerStatus, STATUS),
    "report": Topic(Report, STATUS),
}
"""In the namespace of each robot."""

TORQUE_ROBOT = {
    "wheel_torques": Topic(WheelTorques, COMMAND),
    "joint_states": Topic(JointState, STREAM),
}
"""Additional topics of each robot whose wheels are driven by torque."""

MANY = 50
"""Number of robots from which on they are commanded by ``cmd_vels``. Topics of single robots are
then not recorded, because a few subscriptions per robot would cost too much."""

SHOWN = ("clock", "poses", "map", "scenario", "paused", "belief", "tf", "visualization")
"""Topics of the world that a playback publishes. Commands and ground truth are left out."""


def team_names(scenario: Scenario, namespace: str = "") -> dict[str, Names]:
    """The names of the teams; one unnamed team if the scenario has none."""
    world = space(namespace)
    teams = list(scenario.teams) or [""]
    return {t: Names(world, space(inside(namespace, t)) if t else world) for t in teams}


def recorded_topics(scenario: Scenario, namespace: str = "") -> dict[str, Topic]:
    """Full name of every topic that is recorded. namespace: the world's."""
    teams = team_names(scenario, namespace)
    names = next(iter(teams.values()))
    topics = {names.world(t): topic for t, topic in WORLD.items()}
    for team in teams.values():
        topics.update({team.team(t): topic for t, topic in TEAM.items()})
    for robot, (spec, _) in scenario.robots.items() if len(scenario.robots) < MANY else ():
        own = dict(ROBOT)
        if spec.drive.kind == "torque":
            own.update(TORQUE_ROBOT)
        topics.update({names.robot(robot, t): topic for t, topic in own.items()})
    return topics


def shown_topics(scenario: Scenario, namespace: str = "") -> dict[str, Topic]:
    """Full name of every topic that a playback publishes."""
    teams = team_names(scenario, namespace)
    names = next(iter(teams.values()))
    topics = {names.world(t): WORLD[t] for t in SHOWN}
    for team in teams.values():
        topics.update({team.team(t): topic for t, topic in TEAM.items() if t not in GOALS})
    for robot in scenario.robots if len(scenario.robots) < MANY else ():
        for own in ("controller/status", "report"):
            topics[names.robot(robot, own)] = ROBOT[own]
    return topics
