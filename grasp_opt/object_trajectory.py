"""Trajectories of an object: poses and twists in time, and the shapes of chapter 3's tasks."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array
from push_model.screws import screw_poses
from push_model.trajectory import ramp

_FINE = 2000  # samples of a curve by which its length is measured
_STEP = 0.02  # [s]
_STILL = 1e-9  # [m], [rad]


@dataclass(frozen=True)
class ObjectTrajectory:
    """Samples of where an object's centre of mass is to be, from rest to rest.

    time ``(n,)`` [s] from 0; pose ``(n, 3)`` [m, m, rad], the heading continuous; twist ``(n, 3)``
    [m/s, m/s, rad/s], both along the world's axes.
    """

    time: Array
    pose: Array
    twist: Array

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.time[-1])

    @property
    def length(self) -> float:
        """[m] of the way of the centre of mass."""
        return float(np.hypot(*np.diff(self.pose[:, :2], axis=0).T).sum())

    @property
    def still(self) -> bool:
        """Whether it does not move the object at all."""
        return bool(np.ptp(self.pose, axis=0).max() <= _STILL)

    @property
    def body_twists(self) -> Array:
        """``(n, 3)`` twists in the object's frame."""
        c, s = np.cos(self.pose[:, 2]), np.sin(self.pose[:, 2])
        x, y, omega = self.twist.T
        return np.column_stack([c * x + s * y, -s * x + c * y, omega])

    @property
    def first_twist(self) -> Array:
        """``(3,)`` in the object's frame, as it begins to move."""
        twists = self.body_twists
        first: Array = twists[int(np.argmax(np.linalg.norm(twists, axis=1) > 0.0))]
        return first

    def between(self, begin: float, end: float) -> "ObjectTrajectory":
        """The part from one time [s] to another, its time from 0."""
        inner = self.time[(self.time > begin + 1e-9) & (self.time < end - 1e-9)]
        time = np.concatenate([[begin], inner, [end]])
        pose = np.array([self.sample(t) for t in time])
        twist = np.array([self.twist_at(t) for t in time])
        return ObjectTrajectory(time - begin, pose, twist)

    def about(self, point: Array) -> "ObjectTrajectory":
        """The same motion of the object, told of another of its points ``(2,)`` [m], object
        frame."""
        c, s = np.cos(self.pose[:, 2]), np.sin(self.pose[:, 2])
        arm = np.column_stack([c * point[0] - s * point[1], s * point[0] + c * point[1]])
        pose, twist = self.pose.copy(), self.twist.copy()
        pose[:, :2] += arm
        twist[:, :2] += twist[:, 2:] * np.column_stack([-arm[:, 1], arm[:, 0]])
        return ObjectTrajectory(self.time, pose, twist)

    def sample(self, t: float) -> Array:
        """Pose ``(3,)`` at a time [s]; at rest beyond the ends."""
        return np.array([np.interp(t, self.time, column) for column in self.pose.T])

    def twist_at(self, t: float) -> Array:
        """Twist ``(3,)`` at a time [s]; at rest beyond the ends."""
        if not 0.0 <= t <= self.duration:
            return np.zeros(3)
        return np.array([np.interp(t, self.time, column) for column in self.twist.T])


def sampled(time: Array, pose: Array) -> ObjectTrajectory:
    """Through given poses ``(n, 3)``, headings continuous, at times ``(n,)`` [s] from 0.

    Raises
    ------
    ValueError: times do not ascend from 0, or there are fewer than three.
    """
    if len(time) < 3 or time[0] != 0.0 or (np.diff(time) <= 0.0).any():
        raise ValueError("three times or more are needed, which ascend from 0")
    return ObjectTrajectory(time, pose, np.gradient(pose, time, axis=0))


def along(
    curve: Callable[[Array], Array], end: float, speed: float, acceleration: float
) -> ObjectTrajectory:
    """Along ``curve``, which maps a parameter ``(k,)`` from 0 to ``end`` to poses ``(k, 3)``.

    speed, acceleration: [m/s], [m/s^2] of the centre of mass.
    """
    u = np.linspace(0.0, end, _FINE)
    fine = curve(u)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(fine[:, :2], axis=0).T))])
    total = float(way[-1])
    sampled, rate = ramp(total, speed, acceleration, _STEP)
    time, s = sampled.T
    at = np.interp(np.clip(s, 0.0, total), way, u)
    step = 1e-4 * end
    slope = (curve(at + step) - curve(at - step)) / (2.0 * step)
    slope /= np.hypot(*slope[:, :2].T)[:, None]  # by the way
    pose = curve(at)
    return ObjectTrajectory(time, pose, slope * rate[:, None])


def polynomial(
    coefficients: Sequence[float],
    length: float,
    speed: float,
    acceleration: float,
    heading: float = 0.0,
) -> ObjectTrajectory:
    """y = sum c_k x^(k + 2) for x from 0 to length [m]; the heading [rad] is against the way."""

    def curve(x: Array) -> Array:
        y = sum(c * x ** (k + 2) for k, c in enumerate(coefficients))
        slope = sum((k + 2) * c * x ** (k + 1) for k, c in enumerate(coefficients))
        return np.column_stack([x, y + 0.0 * x, np.arctan(slope + 0.0 * x) + heading])

    return along(curve, length, speed, acceleration)


def sinusoid(
    amplitude: float,
    wavelength: float,
    length: float,
    speed: float,
    acceleration: float,
    heading: float = 0.0,
) -> ObjectTrajectory:
    """y = amplitude sin(2 pi x / wavelength) [m], the heading [rad] constant."""

    def curve(x: Array) -> Array:
        y = amplitude * np.sin(2.0 * math.pi * x / wavelength)
        return np.column_stack([x, y, np.full_like(x, heading)])

    return along(curve, length, speed, acceleration)


def screw(
    start: Array, motion: Array, speed: float, acceleration: float, reach: float
) -> ObjectTrajectory:
    """From a pose ``(3,)`` with one twist in the object's frame, from rest to rest.

    motion ``(3,)`` [m, m, rad]: the twist times how long it acts.

    reach: [m] from the centre of mass of what moves at most at ``speed`` [m/s].
    """
    total = float(np.hypot(motion[0], motion[1]) + abs(motion[2]) * reach)
    sampled, rate = ramp(total, speed, acceleration, _STEP)
    time, way = sampled.T
    pose = screw_poses(start, motion, np.clip(way / total, 0.0, 1.0))
    c, s, (vx, vy, omega) = np.cos(pose[:, 2]), np.sin(pose[:, 2]), motion / total
    twist = np.column_stack([c * vx - s * vy, s * vx + c * vy, np.full(len(c), omega)])
    return ObjectTrajectory(time, pose, twist * rate[:, None])


def study_trajectories(
    speed: float = 0.1, acceleration: float = 0.1
) -> dict[str, ObjectTrajectory]:
    """Six tasks as in 3.1.4, of Fig. 3.4a: three polynomials, three sinusoids. Sizes are ours."""
    return {
        "polynomial-1": polynomial((0.25,), 1.0, speed, acceleration),
        "polynomial-2": polynomial((-0.5,), 0.9, speed, acceleration),
        "polynomial-3": polynomial((0.8, -0.7), 1.0, speed, acceleration),
        "sinusoid-1": sinusoid(0.04, 1.0, 1.0, speed, acceleration),
        "sinusoid-2": sinusoid(0.08, 1.0, 1.0, speed, acceleration),
        "sinusoid-3": sinusoid(-0.06, 0.7, 1.0, speed, acceleration),
    }
