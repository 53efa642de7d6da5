"""Robots that each track their own way, synchronised, with the LTV-MPC: as section 3.1.6 does it.

A robot's way is that of its place about the object, were the object to go along its trajectory
exactly. Nobody looks at the object on the way: what is off at the beginning stays off.
"""

import numpy as np

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.object_trajectory import ObjectTrajectory
from push_model import se2
from push_model.arrays import Array
from push_model.screws import point_velocities
from push_model.specs import ObjectSpec, RobotSpec
from push_mpc.controller import Reference
from push_mpc.ltv_mpc import LtvMpc
from push_mpc.settings import MpcSettings

_RESTING = 1e-9  # [m/s] below which a place's velocity has no direction
_PATIENCE = 5  # programmes in a row that may have no solution


class SynchronisedTrackers:
    """One LTV-MPC for each robot at ``ways (n,)`` [m] along an outline, and one clock for all."""

    def __init__(
        self,
        item: ObjectSpec,
        robot: RobotSpec,
        ways: Array,
        trajectory: ObjectTrajectory,
        settings: MpcSettings | None = None,
    ) -> None:
        """trajectory: of the object's centre of mass."""
        self._mpc = settings or MpcSettings(max_obstacles=0)
        self.duration = trajectory.duration
        places = ContactOutline(item.geometry).at(ways).centres(robot.footprint_radius)
        self._time = trajectory.time
        self._ways = [_way(trajectory, place) for place in places]
        self._trackers = [LtvMpc(self._mpc, robot.differential) for _ in places]
        self._commands = np.zeros((len(places), 2))
        self._failed = np.zeros(len(places), dtype=int)

    @property
    def lost(self) -> bool:
        """Whether a robot cannot be controlled any more."""
        return bool((self._failed >= _PATIENCE).any())

    def step(self, time: float, tick: float, robots: Array) -> Array:
        """Twists ``(n, 2)`` v [m/s], omega [rad/s] at a time [s] of the trajectory; robots ``(n,
        3)`` poses."""
        at = np.array([time + k * self._mpc.step for k in range(self._mpc.horizon + 1)])
        for i, (way, mpc, robot) in enumerate(zip(self._ways, self._trackers, robots, strict=True)):
            reference = _sample(self._time, way, at)
            v, omega = self._commands[i]
            x, y, theta = reference.pose[0]
            local = se2.between(np.array([x, y, se2.wrap(float(theta))]), robot)
            error = np.array([*local, v - reference.twist[0, 0], omega - reference.twist[0, 2]])
            answer = mpc.solve(error, reference, None, np.zeros((0, 3)))
            self._failed[i] = 0 if answer.solved else self._failed[i] + 1
            a, epsilon = answer.acceleration
            self._commands[i] = mpc.drive.saturate(
                float(v + tick * a), float(omega + tick * epsilon)
            )
        return self._commands.copy()


def _way(trajectory: ObjectTrajectory, place: Array) -> Array:
    """``(n, 5)`` x, y, heading [rad] along the way, v, omega of a point fixed to the object."""
    poses = trajectory.pose
    points = np.array([se2.transform(pose, place) for pose in poses])
    local = np.array([point_velocities(twist, place[None])[0] for twist in trajectory.body_twists])
    speed = np.hypot(*local.T)
    moving = np.flatnonzero(speed > _RESTING)
    direction = np.arctan2(local[moving, 1], local[moving, 0]) + poses[moving, 2]
    heading = np.interp(trajectory.time, trajectory.time[moving], np.unwrap(direction))
    turn = np.gradient(heading, trajectory.time)
    return np.column_stack([points, heading, speed, turn])


def _sample(time: Array, way: Array, at: Array) -> Reference:
    """Of a way, at times ``(p + 1,)``; at rest beyond its end."""
    x, y, heading, v, omega = (np.interp(at, time, column) for column in way.T)
    going = at <= time[-1]
    zero = np.zeros(len(at))
    return Reference(
        np.column_stack([x, y, heading]), np.column_stack([v * going, zero, omega * going])
    )
