"""How fast the robot drives along the corners of a way: curves, turns in place, ahead or astern.

A way of straight legs is safe, but a robot that stops at each corner and turns there is slow. Here
the robot drives through a corner along cubic curves from corner to corner. A curve leaves its
leg towards the outer side of the bend, away from the obstacle around which the way leads. Each
curve is checked against the same distances as the legs. Where it does not keep them, the robot
drives the straight leg and turns in place at its ends.

Poses ``(3,)`` [m, m, rad] of the axle midpoint and points ``(n, 2)`` [m], world frame.
"""

import itertools
import math
from collections.abc import Callable

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_model.trajectory import Trajectory, along_curve, concatenate, rotation
from push_planner.settings import PlannerSettings

Keeps = Callable[[Array, float], bool]
"""Whether a chain of chords ``(n, 2)`` [m] keeps the distances, and a margin [m] more."""
Room = Callable[[Array], float]
"""[m] least distance of the robot's outline to obstacles over poses ``(n, 3)``."""

_SHARP = 1.4  # [rad] corners that turn more are turned at in place
_SPACING = 0.005  # [m] of points on a curve
_TURN = 0.1  # [rad] between them, about
_POINTS = 8  # on a curve, at least
_SHORT = 2e-3  # [m] legs that are not worth a motion
_STILL = 1e-3  # [rad] turns likewise
_ALIKE = 1e-3  # [m] that one motion may come nearer to obstacles than another that is slower


class _Curves:
    """The legs of a way, each with the direction [rad] in which the path begins and ends on it.

    ways: of the legs. through: whether the path passes a corner without a stop; of the first and
    the last corner: whether it is tangent to the robot's direction there.
    """

    def __init__(self, corners: Array, first: float, last: float, curved: tuple[bool, bool]):
        """first, last: [rad] direction of motion in which the robot stands at the ends."""
        self.corners = corners
        legs = np.diff(corners, axis=0)
        self.length = np.hypot(*legs.T)
        self.angle = np.arctan2(legs[:, 1], legs[:, 0])
        self.tips = first, last
        bends = np.array([se2.wrap(float(b)) for b in np.diff(self.angle)])
        before = self.length[:-1] / (self.length[:-1] + self.length[1:])
        self._tangent = np.concatenate([[first], self.angle[:-1] + before * bends, [last]])
        ends = [se2.wrap(first - self.angle[0]), se2.wrap(last - self.angle[-1])]
        self.through = np.abs(np.concatenate([ends[:1], bends, ends[1:]])) < _SHARP
        self.through[[0, -1]] &= curved

    def directions(self, leg: int) -> tuple[float, float]:
        """[rad] of the path at the two ends of a leg."""
        ahead = float(self.angle[leg])
        first, last = (
            float(self._tangent[k]) if self.through[k] else ahead for k in (leg, leg + 1)
        )
        return first, last

    def sample(self, leg: int) -> tuple[Array, Array, Array]:
        """Points ``(n, 2)``, directions ``(n,)`` [rad] and curvatures ``(n,)`` [1/m] of a leg."""
        length, ends = self.length[leg], self.directions(leg)
        turn = sum(abs(se2.wrap(end - float(self.angle[leg]))) for end in ends)
        count = max(_POINTS, math.ceil(length / _SPACING), math.ceil(2.0 * turn / _TURN)) + 1
        s = np.linspace(0.0, 1.0, count)[:, None]
        chord = self.corners[leg + 1] - self.corners[leg]
        out, into = (length * np.array([math.cos(a), math.sin(a)]) for a in ends)
        points = (
            self.corners[leg]
            + s**2 * (3.0 - 2.0 * s) * chord
            + s * (s - 1.0) ** 2 * out
            + s**2 * (s - 1.0) * into
        )
        d = 6.0 * s * (1.0 - s) * chord + (s - 1.0) * (3.0 * s - 1.0) * out
        d += s * (3.0 * s - 2.0) * into
        dd = (6.0 - 12.0 * s) * chord + (6.0 * s - 4.0) * out + (6.0 * s - 2.0) * into
        speed = np.maximum(np.hypot(*d.T), 1e-9)
        curvature = (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / speed**3
        return points, np.arctan2(d[:, 1], d[:, 0]), curvature

    def straighten(self, keeps: Keeps) -> None:
        """Stop at the corners of every curve that does not keep its distances."""
        while True:
            legs = range(len(self.length))
            failed = [leg for leg in legs if not self._keeps(leg, keeps)]
            if not failed:
                return
            for leg in failed:
                self.through[leg : leg + 2] = False

    def _keeps(self, leg: int, keeps: Keeps) -> bool:
        if not self.through[leg : leg + 2].any():
            return True  # the straight leg, which is known to keep them
        points, _, curvature = self.sample(leg)
        bend = float(np.abs(curvature).max())
        chord = float(np.hypot(*np.diff(points, axis=0).T).max())
        return keeps(points, bend * chord**2 / 8.0)

    def pieces(self) -> list[tuple[Array, Array, Array]]:
        """The path from stop to stop: points, directions and curvatures as of ``sample``."""
        result: list[list[tuple[Array, Array, Array]]] = [[]]
        for leg in range(len(self.length)):
            points, directions, curvature = self.sample(leg)
            if result[-1]:
                points, directions, curvature = points[1:], directions[1:], curvature[1:]
            result[-1].append((points, directions, curvature))
            if leg + 1 < len(self.length) and not self.through[leg + 1]:
                result.append([])
        return [
            (
                np.vstack([p for p, _, _ in piece]),
                np.unwrap(np.concatenate([a for _, a, _ in piece])),
                np.concatenate([k for _, _, k in piece]),
            )
            for piece in result
        ]


def fastest_drive(
    corners: Array,
    start: Array,
    goal: Array,
    keeps: Keeps,
    drive: DifferentialDrive,
    settings: PlannerSettings,
    room: Room | None = None,
) -> Trajectory:
    """The fastest motion along a way: ahead or astern, with curved ends or turns in place there.

    Parameters
    ----------
    corners: ``(n, 2)`` of the way, from the start to the goal; its straight legs are free.
    start, goal: ``(3,)`` poses.
    keeps: the check of curves.
    room: given where an end of the way is nearer to an obstacle than the safety distance. There a
        bumper that turns may come much nearer than the disc around the robot tells, so that only
        motions are considered which keep the safety distance, or as much of it as any does.
    """
    corners = _without_short_legs(corners)
    if len(corners) < 2:
        return _Motion(start, drive, settings).end(goal)
    ways = []
    for astern, *curved in itertools.product((False, True), repeat=3):
        back = math.pi if astern else 0.0
        curves = _Curves(
            corners, float(start[2]) + back, float(goal[2]) + back, (curved[0], curved[1])
        )
        curves.straighten(keeps)
        motion = _Motion(start, drive, settings)
        for piece in curves.pieces():
            motion.along(*piece, astern)
        ways.append(motion.end(goal))
    if room is not None:
        kept = [min(room(way.pose), settings.safety_distance) for way in ways]
        wanted = max(kept) - _ALIKE
        ways = [way for way, has in zip(ways, kept, strict=True) if has >= wanted]
    return min(ways, key=lambda way: way.duration)


def _without_short_legs(corners: Array) -> Array:
    kept = [corners[0]]
    for corner in corners[1:-1]:
        if np.hypot(*(corner - kept[-1])) >= _SHORT:
            kept.append(corner)
    while len(kept) > 1 and np.hypot(*(corners[-1] - kept[-1])) < _SHORT:
        kept.pop()
    if np.hypot(*(corners[-1] - kept[-1])) >= _SHORT:
        kept.append(corners[-1])
    return np.array(kept)


class _Motion:
    """Motions from stop to stop, one after another."""

    def __init__(self, start: Array, drive: DifferentialDrive, settings: PlannerSettings) -> None:
        self._parts: list[Trajectory] = []
        self._pose = np.array(start)
        self._drive, self._settings = drive, settings
        # The wheels of a wide robot speed up no more in a turn than on a straight line.
        widest = settings.move_acceleration / drive.half_track
        self._turning = min(settings.turn_acceleration, widest)  # [rad/s^2]

    def _turn(self, heading: float) -> None:
        s, angle = self._settings, se2.wrap(heading - float(self._pose[2]))
        rate = min(s.turn_rate, (1.0 - s.wheel_reserve) * self._drive.max_turn_rate)
        if abs(angle) > _STILL:
            self._parts.append(rotation(self._pose, angle, rate, self._turning))
        self._pose = self._pose + np.array([0.0, 0.0, angle])

    def along(self, points: Array, direction: Array, curvature: Array, astern: bool) -> None:
        """Turn to the beginning of a curve, and drive along it."""
        s, back = self._settings, math.pi if astern else 0.0
        self._turn(float(direction[0]) - back)
        ahead = along_curve(
            points,
            direction,
            curvature,
            self._drive,
            s.move_speed,
            s.move_acceleration,
            s.wheel_reserve,
            self._turning,
        )
        pose = ahead.pose + np.array([0.0, 0.0, float(self._pose[2]) - ahead.pose[0, 2]])
        twist = ahead.twist * np.array([-1.0 if astern else 1.0, 1.0])
        self._parts.append(Trajectory(ahead.time, pose, twist))
        self._pose = np.array(pose[-1])

    def end(self, goal: Array) -> Trajectory:
        """Turn to the heading of the goal; the whole motion."""
        self._turn(float(goal[2]))
        if not self._parts:
            s = self._settings
            self._parts.append(rotation(self._pose, 1e-4, s.turn_rate, self._turning))
        return concatenate(self._parts)
