"""What robots are allowed to be told: commands are checked by arrays, and silence is noticed.

No ROS here, and no clock: stamps and times are passed in. A bridge, to a simulation or to real
robots, asks the gate before anything reaches a motor.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array, Mask, Rows

_TIME_TOLERANCE = 1e-6  # [s] stamps are in whole nanoseconds
_SHOWN = 3  # names in a sentence


@dataclass(frozen=True)
class Limits:
    """What is absurd for each of n robots, and how old a command may be.

    twist: ``(n, 3)`` [m/s, m/s, rad/s] greatest absolute values; a second column of 0 stands for a
        robot that cannot move sideways.
    torque: ``(n,)`` [Nm] of a wheel; 0 for a robot that takes none.
    age: [s] of the poses that a command answers, when it comes and as long as it drives.
    wall: [s] of wall time since the newest command while it drives; inf to go by stamps alone.
    """

    twist: Array
    torque: Array
    age: float
    wall: float


@dataclass(frozen=True)
class Admitted:
    """Commands that may be obeyed: rows ``(k,)`` of robots, values ``(k, m)``; and complaints."""

    rows: Rows
    values: Array
    refused: list[str]


class CommandGate:
    """Checks commands to named robots, and knows who drives on an old one."""

    def __init__(self, names: Sequence[str], limits: Limits) -> None:
        self.names = tuple(names)
        self.limits = limits
        self._row = {name: row for row, name in enumerate(self.names)}
        self._asked: tuple[list[str], Rows] = ([], np.zeros(0, dtype=np.intp))
        self._distinct = True  # whether those asked last are known, each named once
        self._holonomic = limits.twist[:, 1] > 0.0
        self.restart()

    def restart(self) -> None:
        """Forget all commands, after the clock has gone back."""
        n = len(self.names)
        self.driving = np.zeros(n, dtype=bool)
        """``(n,)`` whether the robot's last command was to move, and still holds."""
        self._answered = np.zeros(n)  # [s] stamp of the newest frame that a command answers
        self._last_wall = np.zeros(n)  # [s] when the last command came

    def rows(self, names: Sequence[str]) -> Rows:
        """``(k,)`` the rows of robots, -1 for those that are not known."""
        if names != self._asked[0]:
            row = self._row
            found = np.array([row.get(n, -1) for n in names], dtype=np.intp)
            self._asked = (list(names), found)
            self._distinct = bool((found >= 0).all()) and len(set(names)) == len(names)
        return self._asked[1]

    def admit(
        self,
        names: Sequence[str],
        twists: Array,
        stamp: float,
        now: float,
        wall: float,
        fixed_frame: bool = False,
    ) -> Admitted:
        """Check the twists ``(k, 3)`` [m/s, m/s, rad/s] of one message. One that answers an older
        frame than the robot's last command may only stop it.

        stamp: [s] of the poses that it answers; now: [s] on the same clock; wall: [s] monotonic.
        fixed_frame: the twists are given in the world's frame, not in each robot's.
        """
        rows, refused = self._known(names, stamp, now)
        if not rows.size:
            return Admitted(rows, np.zeros((0, 3)), refused)
        # the usual case first; a NaN is not within limits either
        within = (np.abs(twists) <= self.limits.twist[rows]).all()
        in_order = (stamp >= self._answered[rows]).all()
        if (
            self._distinct
            and within
            and in_order
            and (not fixed_frame or self._holonomic[rows].all())
        ):
            return self._take(rows, twists, None, stamp, wall, refused)
        good = rows >= 0
        if not self._distinct:
            refused += _complain("unknown or named twice", names, ~(good & _first(rows)))
            good &= _first(rows)
        if fixed_frame:
            turning = ~self._holonomic[rows] & good
            refused += _complain("moves along its own axis only; no fixed frame", names, turning)
            good &= ~turning
        numbers = np.isfinite(twists).all(axis=1)
        refused += _complain("not finite", names, good & ~numbers, twists)
        good &= numbers
        absurd = good & (np.abs(twists) > self.limits.twist[rows]).any(axis=1)
        refused += _complain("absurd", names, absurd, twists)
        good &= ~absurd
        good = self._in_order(names, rows, twists, good, stamp, refused)
        return self._take(rows, twists, good, stamp, wall, refused)

    def admit_torques(
        self, name: str, torques: Array, stamp: float, now: float, wall: float
    ) -> Admitted:
        """Check the torques ``(2,)`` [Nm] of one robot's wheels, left and right. They may answer an
        older frame than the last command: a controller brakes so when it refuses a frame."""
        rows, refused = self._known([name], stamp, now)
        values = np.asarray(torques, dtype=np.float64).reshape(1, 2)
        if not rows.size:
            return Admitted(rows, np.zeros((0, 2)), refused)
        good = rows >= 0
        refused += _complain("unknown", [name], ~good)
        numbers = np.isfinite(values).all(axis=1)
        refused += _complain("not finite", [name], good & ~numbers, values)
        good &= numbers
        absurd = good & (np.abs(values) > self.limits.torque[rows][:, None]).any(axis=1)
        refused += _complain("absurd", [name], absurd, values)
        return self._take(rows, values, good & ~absurd, stamp, wall, refused)

    def silent(self, now: float, wall: float) -> Rows:
        """``(k,)`` rows of robots that drive without a fresh command; they count as stopped."""
        late = now - self._answered > self.limits.age + _TIME_TOLERANCE
        late |= wall - self._last_wall > self.limits.wall
        late &= self.driving
        if not late.any():
            return np.zeros(0, dtype=np.intp)
        self.driving &= ~late
        return np.flatnonzero(late)

    def stop(self, rows: Rows) -> None:
        """Note that robots were stopped."""
        self.driving[rows] = False

    def _known(self, names: Sequence[str], stamp: float, now: float) -> tuple[Rows, list[str]]:
        """Rows of the names, none when the stamp is not a fresh one."""
        age = now - stamp
        fresh = stamp > 0.0 and -_TIME_TOLERANCE <= age <= self.limits.age + _TIME_TOLERANCE
        if not fresh:
            return np.zeros(0, dtype=np.intp), [
                f"stamp {stamp:.2f} s at {now:.2f} s is not a fresh one"
            ]
        return self.rows(names), []

    def _in_order(
        self,
        names: Sequence[str],
        rows: Rows,
        values: Array,
        good: Mask,
        stamp: float,
        refused: list[str],
    ) -> Mask:
        """Those of the good ones that answer no older frame than the last command, or stop."""
        late = good & (stamp < self._answered[rows]) & (values != 0.0).any(axis=1)
        refused += _complain("answers an older frame than the last command", names, late)
        in_order: Mask = good & ~late
        return in_order

    def _take(
        self,
        rows: Rows,
        values: Array,
        good: Mask | None,
        stamp: float,
        wall: float,
        refused: list[str],
    ) -> Admitted:
        if good is not None:
            rows, values = rows[good], values[good]
        self.driving[rows] = (values != 0.0).any(axis=1)
        self._answered[rows] = np.maximum(self._answered[rows], stamp)
        self._last_wall[rows] = wall
        return Admitted(rows, values, refused)


def _first(rows: Rows) -> Mask:
    """Whether each row is known and stands there for the first time."""
    result = np.zeros(len(rows), dtype=bool)
    result[np.unique(rows, return_index=True)[1]] = True
    return result & (rows >= 0)


def _complain(why: str, names: Sequence[str], bad: Mask, values: Array | None = None) -> list[str]:
    """One sentence for the bad ones, if there are any."""
    if not bad.any():
        return []
    where = np.flatnonzero(bad)
    shown = ", ".join(
        names[i] + ("" if values is None else f" {[float(f'{v:.3g}') for v in values[i]]}")
        for i in where[:_SHOWN]
    )
    more = f" and {len(where) - _SHOWN} more" if len(where) > _SHOWN else ""
    return [f"{why}: {shown}{more}"]
