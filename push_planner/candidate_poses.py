"""Object poses between which pushes are tried, in order along the guide path."""

import math
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.kinematics import unicycle_step
from push_planner.guide_path import GuidePath, waypoints
from push_planner.scene import PushScene

_SAME_ANGLE = 0.05  # [rad]
_BENDS = (0.0, -0.9, 0.9)  # of the trusted curvature, in runs
_FINE_BENDS = (0.0, -0.45, 0.45, -0.95, 0.95)  # of manoeuvres
_SHORT = (0.04, 0.08, 0.15, 0.25, 0.4, 0.6, 0.9)  # [m] of the first push of a manoeuvre
_SECOND = (0.1, 0.25, 0.5)  # [m] of the second
_WIDEST = 1.0  # [m] beside Gamma at most, where poses are scattered


@dataclass(frozen=True)
class Candidates:
    """poses ``(n, 3)`` of the object; way ``(n,)`` [m] along Gamma, to tell what is far apart."""

    poses: Array
    way: Array

    def __add__(self, other: "Candidates") -> "Candidates":
        return Candidates(
            np.vstack([self.poses, other.poses]), np.concatenate([self.way, other.way])
        )

    def free(self, scene: PushScene) -> "Candidates":
        """Those at which the object keeps the safety distance."""
        good = scene.object_clearances(self.poses) >= scene.settings.safety_distance
        return Candidates(self.poses[good], self.way[good])


NOTHING = Candidates(np.zeros((0, 3)), np.zeros(0))
"""No poses."""


def along_guide(
    scene: PushScene, guide: GuidePath, start: Array, goal: Array, most: int
) -> Candidates:
    """Poses beside waypoints on Gamma, ``most`` of them at most: a side faces along it, or so."""
    settings = scene.settings
    spacing = max(settings.waypoint_spacing, guide.length / (most + 1))
    points, headings, at = waypoints(guide, spacing)
    poses: list[tuple[float, float, float]] = []
    way: list[float] = []
    for point, heading, here in zip(points[1:-1], headings[1:-1], at[1:-1], strict=True):
        angles: list[float] = [float(start[2]), float(goal[2])]
        for offset in settings.heading_offsets:
            for side in scene.sides:
                angles.append(float(se2.wrap(heading + offset + side.contact.heading)))
        distinct: list[float] = []
        for angle in angles:
            if all(abs(se2.wrap(angle - other)) > _SAME_ANGLE for other in distinct):
                distinct.append(angle)
        aside = np.array([-math.sin(heading), math.cos(heading)])
        for offset in settings.lateral_offsets:
            x, y = point + offset * aside
            poses.extend((x, y, angle) for angle in distinct)
            way.extend(here for _ in distinct)
    return Candidates(np.array(poses).reshape(-1, 3), np.array(way, dtype=np.float64))


def runs(
    scene: PushScene,
    pose: Array,
    direction: float,
    way: float,
    lengths: tuple[float, ...],
    bends: tuple[float, ...] = _BENDS,
) -> Candidates:
    """Ends of pushes out of a pose (direction 1), or starts of pushes into it (-1).

    On each side, of each length [m], and bent by these parts of the trusted curvature.
    """
    poses = []
    for side in scene.sides:
        contact = side.robot_pose(pose)
        for bend in bends:
            limit = side.trusted.maximum if bend > 0.0 else side.trusted.minimum
            curvature = abs(bend) * limit
            for length in lengths:
                step = direction * length
                robot = unicycle_step(contact, step, step * curvature, 1.0)
                poses.append(se2.compose(robot, side.grasp))
    return Candidates(np.array(poses).reshape(-1, 3), np.full(len(poses), way))


def manoeuvres(
    scene: PushScene,
    pose: Array,
    direction: float,
    way: float,
    count: int,
    random: np.random.Generator,
) -> Candidates:
    """Ends of short pushes out of a pose (direction 1), or starts of pushes into it (-1), and
    ``count`` that are two pushes off: for a pose from which there are few ways."""
    first = runs(scene, pose, direction, way, _SHORT, _FINE_BENDS).free(scene)
    result = first
    if len(first.poses):
        parts = [runs(scene, p, direction, way, _SECOND).poses for p in first.poses]
        poses = np.vstack(parts)
        chosen = poses[random.permutation(len(poses))[:count]]
        result += Candidates(chosen, np.full(len(chosen), way))
    return result


def scattered(
    scene: PushScene, guide: GuidePath, count: int, random: np.random.Generator
) -> Candidates:
    """Poses of any orientation, anywhere near Gamma: as far off as a push needs to turn."""
    points, _, at = waypoints(guide, scene.settings.waypoint_spacing)
    bends = [max(s.trusted.maximum, -s.trusted.minimum) for s in scene.sides]
    reach = min(_WIDEST, 1.0 / max(bends))
    chosen = random.integers(0, len(points), count)
    places = points[chosen] + random.uniform(-reach, reach, (count, 2))
    angles = random.uniform(-math.pi, math.pi, count)
    return Candidates(np.column_stack([places, angles]), at[chosen])


def nearby(poses: Array, count: int, size: float, random: np.random.Generator) -> Candidates:
    """Each of the poses ``(n, 3)`` and ``count`` others about it: so far [m] off, and turned by as
    much as moves a side of 0.2 m so far."""
    noise = random.normal(0.0, 1.0, (len(poses), count, 3)) * np.array([size, size, 5.0 * size])
    noise[:, 0] = 0.0
    around = (poses[:, None] + noise).reshape(-1, 3)
    return Candidates(around, np.repeat(np.arange(float(len(poses))), count))
