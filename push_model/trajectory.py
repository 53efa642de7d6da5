"""Time-parametrised references for a robot's axle midpoint."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive

_SHORTEST = 1e-3  # [s] of a part
_SAME = 1e-6  # [s] between samples, at least


@dataclass(frozen=True)
class Trajectory:
    """Samples of a reference.

    time: ``(n,)`` [s], from 0, strictly increasing, n >= 2.
    pose: ``(n, 3)`` [m, m, rad], world frame; the heading is continuous, not wrapped.
    twist: ``(n, 2)`` [m/s, rad/s].
    """

    time: Array
    pose: Array
    twist: Array

    def __post_init__(self) -> None:
        n = len(self.time)
        if n < 2 or self.pose.shape != (n, 3) or self.twist.shape != (n, 2):
            raise ValueError("a trajectory needs at least two samples of equal number")
        if not all(np.isfinite(a).all() for a in (self.time, self.pose, self.twist)):
            raise ValueError("a trajectory must be finite")
        if self.time[0] != 0.0 or not (np.diff(self.time) > 0.0).all():
            raise ValueError("a trajectory's time must start at 0 and increase strictly")

    @cached_property
    def _table(self) -> Array:
        return np.hstack([self.pose, self.twist])

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.time[-1])

    @cached_property
    def travelled(self) -> Array:
        """``(n,)`` [m] of path of the axle midpoint up to each sample."""
        steps = np.hypot(*np.diff(self.pose[:, :2], axis=0).T)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def length(self) -> float:
        """[m] of path of the axle midpoint."""
        return float(self.travelled[-1])

    def between(self, begin: float, end: float) -> "Trajectory":
        """The part between two times [s], at the speeds of the whole; at least ``_SHORTEST``."""
        begin = min(max(begin, 0.0), self.duration - _SHORTEST)
        end = min(max(end, begin + _SHORTEST), self.duration)
        inner = self.time[(self.time > begin + _SAME) & (self.time < end - _SAME)]
        time = np.concatenate([[begin], inner, [end]])
        return Trajectory(time - begin, *self.sample(time))

    def sample(self, t: NDArray[np.floating[Any]]) -> tuple[Array, Array]:
        """Poses ``(m, 3)`` and twists ``(m, 2)`` at times ``(m,)``; at rest beyond the ends."""
        index = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, len(self.time) - 2)
        begin = self.time[index]
        w = np.clip((t - begin) / (self.time[index + 1] - begin), 0.0, 1.0)[:, None]
        table = self._table
        first = table[index]
        row = first + w * (table[index + 1] - first)
        pose, twist = row[:, :3], row[:, 3:]
        twist[(t < 0.0) | (t > self.duration)] = 0.0
        return pose, twist


def ramp(
    distance: float, top: float, acceleration: float, step: float, braking: float | None = None
) -> tuple[Array, Array]:
    """A rest-to-rest motion with trapezoidal speed over a distance [m].

    top, acceleration, braking: limits [m/s], [m/s^2] (or angles instead of lengths); braking is as
    acceleration if None. step: [s] between samples at most. Returns time [s] and distance [m]
    ``(n, 2)``, and speed [m/s] ``(n,)``.
    """
    braking = acceleration if braking is None else braking
    peak = min(top, math.sqrt(2.0 * distance / (1.0 / acceleration + 1.0 / braking)))
    rise, fall = peak / acceleration, peak / braking
    cruise = max(0.0, distance / peak - 0.5 * (rise + fall))
    total = rise + cruise + fall
    t = np.linspace(0.0, total, max(9, math.ceil(total / step) + 1))
    back = total - t
    way = np.where(
        t < rise,
        0.5 * acceleration * t**2,
        np.where(
            back < fall,
            distance - 0.5 * braking * back**2,
            0.5 * peak * rise + peak * (t - rise),
        ),
    )
    speed = np.clip(np.minimum(t * acceleration, back * braking), 0.0, peak)
    return np.column_stack([t, way]), speed


def line(
    start: Array,
    distance: float,
    speed: float,
    acceleration: float,
    step: float = 0.05,
    braking: float | None = None,
) -> Trajectory:
    """Straight ahead from a pose ``(3,)``; backwards for a negative distance [m]. Limits as of
    ``ramp``."""
    way, rate = ramp(max(abs(distance), 1e-6), speed, acceleration, step, braking)
    sign = math.copysign(1.0, distance)
    pose = np.column_stack(
        [
            start[0] + sign * way[:, 1] * math.cos(start[2]),
            start[1] + sign * way[:, 1] * math.sin(start[2]),
            np.full(len(way), start[2]),
        ]
    )
    return Trajectory(way[:, 0], pose, np.column_stack([sign * rate, np.zeros(len(rate))]))


def rotation(
    start: Array, angle: float, turn_rate: float, acceleration: float, step: float = 0.05
) -> Trajectory:
    """A turn in place from a pose ``(3,)`` by an angle [rad]."""
    way, rate = ramp(max(abs(angle), 1e-6), turn_rate, acceleration, step)
    sign = math.copysign(1.0, angle)
    pose = np.column_stack(
        [np.full(len(way), start[0]), np.full(len(way), start[1]), start[2] + sign * way[:, 1]]
    )
    return Trajectory(way[:, 0], pose, np.column_stack([np.zeros(len(rate)), sign * rate]))


def along_curve(
    points: Array,
    heading: Array,
    curvature: Array,
    drive: DifferentialDrive,
    speed: float,
    acceleration: float,
    reserve: float = 0.0,
    turn_acceleration: float = math.inf,
) -> Trajectory:
    """Rest to rest along a smooth curve, as fast as the wheels and the limits allow.

    Parameters
    ----------
    points: ``(n, 2)`` [m] of the curve.
    heading: ``(n,)`` [rad] tangent.
    curvature: ``(n,)`` [1/m].
    drive: whose wheel speed bounds |v| (1 + half_track |kappa|).
    speed, acceleration: [m/s], [m/s^2] of the axle midpoint.
    reserve: fraction of the wheel speed that is left to a controller.
    turn_acceleration: [rad/s^2] that a change of the speed on a bend may cause.
    """
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    if way[-1] <= 0.0:
        raise ValueError("a curve needs a length")
    fastest = (1.0 - reserve) * drive.max_speed
    top = np.minimum(speed, fastest / (1.0 + drive.half_track * np.abs(curvature)))
    bend = np.maximum(np.abs(curvature[1:]), np.abs(curvature[:-1]))
    rate = np.minimum(acceleration, turn_acceleration / np.maximum(bend, 1e-9))
    gain = 2.0 * rate * np.diff(way)  # of v^2 from sample to sample, at most
    v = top.copy()
    v[0] = v[-1] = 0.0
    for i in range(1, len(v)):
        v[i] = min(v[i], math.sqrt(v[i - 1] ** 2 + gain[i - 1]))
    for i in range(len(v) - 2, -1, -1):
        v[i] = min(v[i], math.sqrt(v[i + 1] ** 2 + gain[i]))
    pace = np.maximum(0.5 * (v[1:] + v[:-1]), 1e-6)
    time = np.concatenate([[0.0], np.cumsum(np.maximum(np.diff(way), 1e-9) / pace)])
    pose = np.column_stack([points, np.unwrap(heading)])
    return Trajectory(time, pose, np.column_stack([v, v * curvature]))


def concatenate(parts: Sequence[Trajectory]) -> Trajectory:
    """One trajectory after another; each begins in the pose in which the previous one ends."""
    time, pose, twist = [parts[0].time], [parts[0].pose], [parts[0].twist]
    for part in parts[1:]:
        turns = round((pose[-1][-1, 2] - part.pose[0, 2]) / (2.0 * math.pi))
        time.append(part.time[1:] + time[-1][-1])
        pose.append(part.pose[1:] + np.array([0.0, 0.0, 2.0 * math.pi * turns]))
        twist.append(part.twist[1:])
    return Trajectory(np.concatenate(time), np.vstack(pose), np.vstack(twist))
