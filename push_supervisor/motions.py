"""The motions between pushes (section 2.5): stand-off, approach, retreat, and what to keep off.

All poses ``(3,)`` [m, m, rad] and circles ``(n, 3)`` x, y, least distance of the axle midpoint [m]
in the world frame.
"""

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid
from push_model.push_segment import PushSegment
from push_model.trajectory import Trajectory, line
from push_supervisor.machine import SupervisorSettings

_OBSTACLE_SPACING = 0.04  # [m] between the round obstacles that stand for a wall
_REACH = 0.4  # [m] beside a trajectory within which obstacles are handed to the controller


def standoff(segment: PushSegment, item: Array) -> Array:
    """Where the robot waits before it touches the side, the object being at ``item``."""
    before_contact = se2.between(segment.robot_start, segment.standoff)
    return se2.compose(segment.contact(item), before_contact)


def approach(
    segment: PushSegment, robot: Array, item: Array, settings: SupervisorSettings
) -> Trajectory:
    """Straight on until contact, on the line through the contact pose."""
    contact = segment.contact(item)
    ahead = float(se2.between(robot, contact)[0])
    begin = se2.compose(contact, np.array([-ahead, 0.0, 0.0]))
    return line(begin, ahead, settings.approach_speed, settings.acceleration)


def retreat(robot: Array, settings: SupervisorSettings) -> Trajectory:
    """Straight back."""
    return line(robot, -settings.detach_distance, settings.approach_speed, settings.acceleration)


def wall_circles(grid: OccupancyGrid, body_radius: float, margin: float) -> Array:
    """Circles that stand for the walls of a map, for a robot of this radius [m]."""
    points = grid.boundary_points(_OBSTACLE_SPACING)
    return np.column_stack([points, np.full(len(points), body_radius + margin)])


def near(circles: Array, trajectory: Trajectory) -> Array:
    """Those of the circles that a motion along the trajectory can come close to."""
    path = trajectory.pose[::5, :2]
    gap: Array = np.hypot(
        circles[:, None, 0] - path[None, :, 0], circles[:, None, 1] - path[None, :, 1]
    ).min(axis=1)
    close: Array = circles[gap < _REACH + circles[:, 2]]
    return close


def displacement(segment: PushSegment, item: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] of the object to where the push is to begin."""
    local = se2.between(segment.object_start, item)
    return float(np.hypot(local[0], local[1])), abs(float(local[2]))
