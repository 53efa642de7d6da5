"""The motions between pushes (section 2.5): stand-off, approach, retreat, and what to keep off.

All poses ``(3,)`` [m, m, rad] and circles ``(n, 3)`` x, y, least distance of the axle midpoint [m]
in the world frame.
"""

from collections.abc import Callable

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid
from push_model.outlines import overlap
from push_model.push_segment import PushSegment
from push_model.trajectory import Trajectory, line
from push_supervisor.settings import SupervisorSettings

_STEPS = 6  # places along a retreat that are looked at
_LEAST = 1e-3  # [m] of a retreat that has no room at all
_SLACK = 5e-3  # [m] by which circles for an outline may ask for too much
_TURN_ACCELERATION = 0.2  # [m/s^2] of a push on a corner
_GIVE = 1e-3  # [m] that a retreat may come nearer to the object, as far as poses can be told


def standoff(segment: PushSegment, item: Array) -> Array:
    """Where the robot waits before it touches the side, the object being at ``item``."""
    before_contact = se2.between(segment.robot_start, segment.standoff)
    return se2.compose(segment.contact(item), before_contact)


def approach(
    segment: PushSegment, robot: Array, item: Array, settings: SupervisorSettings
) -> Trajectory:
    """Straight on until contact, on the line through the contact pose; braking towards it."""
    begin, ahead = _on_the_line(segment, robot, item)
    s = settings
    return line(begin, ahead, s.approach_speed, s.acceleration, braking=s.contact_braking)


def turn(segment: PushSegment, robot: Array, item: Array, speed: float) -> Trajectory:
    """Straight on from contact with a corner, at up to a speed [m/s], as far as the push leads."""
    begin, ahead = _on_the_line(segment, robot, item)
    return line(begin, ahead + segment.length, speed, _TURN_ACCELERATION)


def _on_the_line(segment: PushSegment, robot: Array, item: Array) -> tuple[Array, float]:
    """Pose ``(3,)`` beside the robot on the line through the contact pose, and [m] from there to
    contact."""
    contact = segment.contact(item)
    ahead = float(se2.between(robot, contact)[0])
    return se2.compose(contact, np.array([-ahead, 0.0, 0.0])), ahead


def retreat(
    robot: Array,
    gap: Callable[[Array], float],
    walls: Array,
    settings: SupervisorSettings,
    depth: float = 0.0,
) -> Trajectory:
    """Straight back, or ahead where the object is behind; as far as walls leave room.

    Parameters
    ----------
    gap: [m] between the robot at a pose and the object.
    walls: circles; those that hold the robot now are only not to be driven into any further.
    depth: [m] further than ``detach_distance``, out of a recess of the object.
    """
    way = settings.detach_distance + depth
    steps = np.linspace(0.0, way, int(np.ceil(_STEPS * way / settings.detach_distance)) + 1)
    nearest = gap(robot)

    def reach(sign: float) -> tuple[float, float]:
        """[m] free that way, and the gap gained there."""
        poses = np.tile(robot, (len(steps), 1))
        poses[:, 0] += sign * steps * np.cos(robot[2])
        poses[:, 1] += sign * steps * np.sin(robot[2])
        away = np.hypot(walls[:, 0] - poses[:, :1], walls[:, 1] - poses[:, 1:2]) - walls[:, 2]
        room = away.min(axis=1, initial=np.inf)
        gaps = np.array([gap(pose) for pose in poses])
        free = (room >= min(0.0, room[0]) - 1e-9) & (gaps >= nearest - _GIVE)
        last = len(steps) - 1 if free.all() else int(np.argmin(free)) - 1
        return float(steps[last]), float(gaps[last]) - nearest

    back, ahead = reach(-1.0), reach(1.0)
    sign, way = (1.0, ahead[0]) if ahead[1] > back[1] + _GIVE else (-1.0, back[0])
    return line(robot, sign * max(way, _LEAST), settings.approach_speed, settings.acceleration)


def recess(robot: Array, outline: Array, hull: Array, far: float) -> float:
    """[m] that a robot backs until its outline is clear of an object's convex hull.

    Zero for a robot beside a convex object: at most it touches.

    Parameters
    ----------
    robot: in the frame of the object. outline, hull: ``(n, 2)`` of the robot in its own frame, of
        the object in its. far: [m] at which it is given up.
    """
    if not overlap(se2.transform(robot, outline), hull):
        return 0.0
    low, high = 0.0, far
    while high - low > _GIVE:
        middle = 0.5 * (low + high)
        there = se2.compose(robot, np.array([-middle, 0.0, 0.0]))
        if overlap(se2.transform(there, outline), hull):
            low = middle
        else:
            high = middle
    return high


def outline_circles(outline: Array, radius: float) -> Array:
    """Circles about points along an outline that a disc of this radius [m] is to stay clear of.

    Outside all of them the disc does not touch the outline; they ask for up to ``_SLACK`` more
    room than that, which keeps them few.

    Parameters
    ----------
    outline: ``(n, 2)`` [m], closed, in any frame; the circles are in the same.
    """
    wide = radius + _SLACK
    apart = 2.0 * np.sqrt(wide**2 - radius**2)
    points = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        parts = max(1, int(np.ceil(np.hypot(*(b - a)) / apart)))
        points.append(a + np.linspace(0.0, 1.0, parts, endpoint=False)[:, None] * (b - a))
    at = np.vstack(points)
    return np.column_stack([at, np.full(len(at), wide)])


def wall_circles(grid: OccupancyGrid, body_radius: float, margin: float) -> Array:
    """Circles that stand for the walls of a map, for a robot of this radius [m].

    They lie about a radius apart, so that no robot slips through between them, on the centres of
    occupied cells: half a cell more than the distance that is to be kept from a wall's face.
    """
    points = grid.boundary_points(max(grid.resolution, body_radius))
    least = body_radius + margin + 0.5 * grid.resolution
    return np.column_stack([points, np.full(len(points), least)])


def near(circles: Array, trajectory: Trajectory, reach: float) -> Array:
    """Those of the circles that come within reach [m] of a trajectory."""
    path = trajectory.pose[::5, :2]
    apart: Array = np.hypot(
        circles[:, None, 0] - path[None, :, 0], circles[:, None, 1] - path[None, :, 1]
    ).min(axis=1)
    close: Array = circles[apart < reach + circles[:, 2]]
    return close


def widened(circles: Array, trajectory: Trajectory, by: float, stray: float) -> Array:
    """The circles, wider by so much [m], but ``stray`` [m] off the trajectory where that is less.

    None becomes narrower.
    """
    path = trajectory.pose[:, :2]
    apart = np.hypot(
        circles[:, None, 0] - path[None, :, 0], circles[:, None, 1] - path[None, :, 1]
    ).min(axis=1, initial=np.inf)
    wide = circles.copy()
    wide[:, 2] = np.maximum(circles[:, 2], np.minimum(circles[:, 2] + by, apart - stray))
    return wide


def spared(circles: Array, trajectory: Trajectory) -> Array:
    """The circles, no wider than both ends of the trajectory allow.

    A motion cannot do without its ends: where one lies nearer to a wall than is wanted elsewhere,
    what the end has is kept.
    """
    kept = circles.copy()
    for end in trajectory.pose[[0, -1], :2]:
        kept[:, 2] = np.minimum(kept[:, 2], np.hypot(*(circles[:, :2] - end).T))
    return kept


def displacement(segment: PushSegment, item: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] of the object to where the push is to begin."""
    local = se2.between(segment.object_start, item)
    return float(np.hypot(local[0], local[1])), abs(float(local[2]))
