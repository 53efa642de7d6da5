"""Whether the pushes that are still to do can be done: other bodies on the way, drift to walls."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array
from push_model.outlines import distance, inside
from push_model.push_segment import PushSegment
from push_supervisor.events import MotionFailed, WayBlocked
from push_supervisor.machine import Machine
from push_supervisor.state import State
from push_supervisor.surroundings import Surroundings

_KEEP = 0.005  # [m] between a body and robot or object, less than plans keep
_GIVE = 0.002  # [m] that a gap must shrink by: a body beside the object is not on its way
_NEAR = 0.2  # [m] of push before the body is reached, within which there is no time to lose
_LOOKS = 2, 10  # in a row, in which a body that is near, or far, stands on the way
_WATCHED = (State.PUSHING, State.POSITIONING, State.APPROACH)


@dataclass(frozen=True)
class Obstruction:
    """ahead: [m] of push until the body is met. number: of the push, from 1. at: ``(2,)`` [m] the
    middle of the body."""

    ahead: float
    number: int
    at: Array


def obstruction(
    segments: Sequence[PushSegment], outlines: tuple[Array, Array], bodies: Array, item: Array
) -> Obstruction | None:
    """The first place at which a body stands on the way of pushes.

    Parameters
    ----------
    segments: pushes; of the first, only what lies ahead of the object matters.
    outlines: ``(n, 2)`` [m] of the robot and of the object in their frames.
    bodies: ``(n, 3)`` [m] x, y, radius.
    item: ``(3,)`` pose of the object now.
    """
    done = 0.0
    for number, segment in enumerate(segments, 1):
        robot, pushed = segment.trajectory.pose, segment.object_poses
        first = int(np.argmin(np.hypot(*(pushed[:, :2] - item[:2]).T))) if number == 1 else 0
        robot, pushed = robot[first:], pushed[first:]
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pushed[:, :2], axis=0).T))])
        met, at = math.inf, None
        for x, y, radius in bodies:
            for outline, poses in zip(outlines, (robot, pushed), strict=True):
                where = _first_met(outline, poses, np.array([x, y]), radius)
                if where is not None and way[where] < met:
                    met, at = float(way[where]), np.array([x, y])
        if at is not None:
            return Obstruction(done + met, number, at)
        done += float(way[-1])
    return None


def _first_met(outline: Array, poses: Array, middle: Array, radius: float) -> int | None:
    """Number of the first pose ``(3,)`` at which an outline comes too close to a disc."""
    reach = float(np.hypot(*outline.T).max()) + radius + _KEEP
    near = np.hypot(*(poses[:, :2] - middle).T) < reach
    if not near[1:].any():
        return None
    near[0] = True
    chosen = np.flatnonzero(near)
    c, s = np.cos(poses[chosen, 2]), np.sin(poses[chosen, 2])
    dx, dy = (middle - poses[chosen, :2]).T
    seen = np.column_stack([c * dx + s * dy, c * dy - s * dx])
    gaps = np.where(inside(outline, seen), -1.0, 1.0) * distance(outline, seen) - radius
    met = chosen[(gaps < _KEEP) & (gaps < gaps[0] - _GIVE)]
    return int(met[0]) if len(met) else None


class BlockedWay:
    """Looks every 0.1 s, and tells what lasts. A body that passes far ahead is left to pass."""

    def __init__(self, machine: Machine) -> None:
        self._machine, self._count = machine, 0

    def look(
        self, near: Surroundings, robot: Array | None, item: Array | None, bodies: Array
    ) -> WayBlocked | MotionFailed | None:
        """What ends the plan now, if anything does: others on its way, or the push itself.

        Parameters
        ----------
        robot, item: poses ``(3,)``; None where it is not seen.
        bodies: ``(n, 3)`` [m] x, y, radius of others.
        """
        machine = self._machine
        pushing = machine.state is State.PUSHING
        if pushing and robot is not None and item is not None:
            drift = near.drift(machine.segment, robot, item)
            if drift:
                return MotionFailed(drift)
        found = None
        watched = machine.state in _WATCHED or machine.plan_ready
        if watched and machine.remaining and item is not None and len(bodies):
            found = obstruction(machine.remaining, near.outlines, bodies, item)
        if found is None:
            self._count = 0
            return None
        self._count += 1
        if self._count < _LOOKS[0 if pushing and found.ahead < _NEAR else 1]:
            return None
        self._count = 0
        where = f"({found.at[0]:.2f}, {found.at[1]:.2f})"
        return WayBlocked(f"a body at {where} stands on the way of push {found.number}")
