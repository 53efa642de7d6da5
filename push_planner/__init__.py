"""Two-layer planning of pushes (sections 2.2.1-2.2.3), and of the robot's way between them."""

from push_model.distance_field import DistanceField
from push_planner.among_bodies import TooHeavy, plan_among_bodies
from push_planner.bodies import with_bodies
from push_planner.planner import PushPlanner
from push_planner.preemptive import plan_after_preemptive_push, preemptive_pushes
from push_planner.push_curve import PushCurve, shortest_push_curve
from push_planner.push_plan import (
    SLICE,
    PlanError,
    PlanningFailed,
    PlanStatistics,
    Progress,
    PushPlan,
)
from push_planner.push_reference import check_under_way, going_on, joined
from push_planner.robot_path import NoRobotPath, RobotPathError, plan_robot_path
from push_planner.scene import PushScene, PushSide, push_sides
from push_planner.settings import PlannerSettings
from push_planner.warm_up import warm_up

__all__ = [
    "SLICE",
    "DistanceField",
    "NoRobotPath",
    "PlanError",
    "PlanStatistics",
    "PlannerSettings",
    "PlanningFailed",
    "Progress",
    "PushCurve",
    "PushPlan",
    "PushPlanner",
    "PushScene",
    "PushSide",
    "RobotPathError",
    "TooHeavy",
    "check_under_way",
    "going_on",
    "joined",
    "plan_after_preemptive_push",
    "plan_among_bodies",
    "plan_robot_path",
    "preemptive_pushes",
    "push_sides",
    "shortest_push_curve",
    "warm_up",
    "with_bodies",
]
