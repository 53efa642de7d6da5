"""Input of a tracker, and its output in each tick."""

import math
from dataclasses import dataclass
from enum import IntEnum

from push_model.arrays import Array
from push_model.stable_push import CurvatureLimits
from push_model.trajectory import Trajectory
from push_mpc.controller import MpcResult
from push_mpc.line_contact import LineContact


class TrackError(IntEnum):
    """Why a trajectory ended early; the codes of the FollowTrajectory action."""

    NONE = 0
    INVALID_GOAL = 201
    POSES_STALE = 202
    STUCK = 203
    CONTACT_LOST = 204
    OFF_COURSE = 205
    SOLVER_FAILED = 206
    TIMEOUT = 207
    SLIP_EXPECTED = 211


@dataclass(frozen=True)
class Push:
    """Data of a push in addition to its trajectory.

    grasp: ``(3,)`` nominal pose of the object in the robot frame; limits: stable curvatures for it;
    line: where the bumper touches it; None if unknown or not a line. uncertain: whether intervals
    of friction and centre of mass are believed; certified: curvatures that are stable for all of
    them, None if there are none.
    """

    grasp: Array
    limits: CurvatureLimits
    line: LineContact | None = None
    uncertain: bool = False
    certified: CurvatureLimits | None = None


@dataclass(frozen=True)
class Task:
    """A trajectory to follow. circles: ``(m, 3)`` x, y, least distance of the axle midpoint [m]."""

    trajectory: Trajectory
    push: Push | None
    circles: Array
    position_tolerance: float
    orientation_tolerance: float


@dataclass(frozen=True)
class Tick:
    """Outcome of one tick: command, and whether the task has ended, and how.

    stick_margin: [rad/s] see ``push_model.stick_certificate``; nan where no interval is believed,
    or the robot stands. slip_in: [s] after which the object may slip on the path ahead;
    nan if it is not. alarm: the same in words, empty if it is not.
    """

    v: float
    omega: float
    finished: bool
    code: TrackError
    message: str
    error: Array
    progress: float
    position_error: float
    orientation_error: float
    solve: MpcResult | None
    curvature_margin: float
    obstacle_margin: float
    object_offset: float
    stick_margin: float = math.nan
    slip_in: float = math.nan
    alarm: str = ""
