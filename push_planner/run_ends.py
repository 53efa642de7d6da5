"""Where runs between two poses of the object begin and end, for searches and for lower bounds.

Successive pushes on the same side are called a run.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from push_model import se2
from push_model.arrays import Array
from push_planner.guide_path import origin_floor
from push_planner.least_way import LeastWays, least_ways
from push_planner.scene import PushScene


@dataclass(frozen=True)
class RunEnds:
    """The sides at a start and at a goal, and the way of the centre of mass between them.

    start, goal: ``(3,)`` [m, m, rad] poses of the object's centre of mass, world frame. contacts:
    ``(sides, 3)`` poses of the robot in contact, in the frame of the object. starts, goals:
    ``(sides, 3)`` the same in the world, at the start and at the goal. leaves, arrives:
    ``(sides,)`` whether the robot has room there. radii: ``(sides, 2)`` [m] smallest turning radii
    to the left and to the right. fastest: ``(sides,)`` how far the centre moves at most while the
    robot drives 1 m. nearest: [m] distance of object and robot to obstacles at any pose. least:
    [m] that of the centre. gone, left: its least ways from the start and to the goal.
    """

    start: Array
    goal: Array
    contacts: Array
    starts: Array
    goals: Array
    leaves: NDArray[np.bool_]
    arrives: NDArray[np.bool_]
    radii: Array
    fastest: Array
    nearest: float
    least: float
    gone: LeastWays
    left: LeastWays

    @staticmethod
    def of(scene: PushScene, start: Array, goal: Array) -> "RunEnds":
        """start, goal: ``(3,)`` [m, m, rad] poses of the object's centre of mass, world frame."""
        sides, keeps = scene.sides, scene.leaving(start)
        starts, goals = (np.array([s.robot_pose(pose) for s in sides]) for pose in (start, goal))
        limits = np.array([[s.trusted.maximum, s.trusted.minimum] for s in sides])
        x, y = np.array([s.grasp[:2] for s in sides]).T[:, :, None]
        floor = origin_floor(scene.shape)
        nearest = min(keeps, scene.settings.safety_distance)
        least = floor + nearest if floor > 0.0 else 0.0
        return RunEnds(
            start,
            goal,
            np.array([se2.inverse(s.grasp) for s in sides]),
            starts,
            goals,
            np.array([scene.has_room(p, s, keeps) for p, s in zip(starts, sides, strict=True)]),
            np.array([scene.has_room(p, s) for p, s in zip(goals, sides, strict=True)]),
            1.0 / np.abs(limits),
            np.maximum(np.hypot(1.0 - limits * y, limits * x).max(axis=1), 1.0),
            nearest,
            least,
            least_ways(scene.field, start, least),
            least_ways(scene.field, goal, least),
        )
