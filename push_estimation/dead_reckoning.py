"""Where a body is now: its measured pose is late, or missing in a frame; its commands are known.

Times count back from now. A frame shows the world as it was ``delay`` ago. A pose that is ``age``
older than its frame was measured delay + age ago. A command is in force from its tick until the
next one.
"""

from collections import deque
from collections.abc import Callable

import numpy as np

from push_model.arrays import Array
from push_model.kinematics import unicycle_step
from push_model.screws import screw_poses

_SHORTEST = 1e-9  # [s]: shorter intervals are rounding errors


class DeadReckoning:
    """Carries the poses of one body forward along the commands that it was given.

    delay: [s] from the measurement of a frame to the command that answers it. Before the first
    command on record the body stood still.
    """

    def __init__(self, delay: float, motion: Callable[..., Array] = unicycle_step) -> None:
        """motion: pose ``(3,)`` after a command, ``motion(pose, *command, dt)``; by default that of
        a unicycle, whose command is v [m/s], omega [rad/s]."""
        self.delay = delay
        self._motion = motion
        self._commands: deque[tuple[float, tuple[float, ...]]] = deque()  # dt, command
        self._span = 0.0

    def clear(self) -> None:
        """The body has been standing still."""
        self._commands.clear()
        self._span = 0.0

    def record(self, dt: float, *command: float) -> None:
        """The command that was in force for the last dt [s]."""
        self._commands.append((dt, command))
        self._span += dt

    def at_frame(self, pose: Array, age: float) -> Array:
        """Pose ``(3,)`` at the time of the frame, from one measured ``age`` [s] before it."""
        return self._carry(pose, self.delay + age, self.delay)

    def now(self, pose: Array) -> Array:
        """Pose ``(3,)`` now, from that at the time of the frame."""
        return self._carry(pose, self.delay, 0.0)

    def forget(self, age: float) -> None:
        """Drop commands from before the last measurement, ``age`` [s] before the present frame."""
        needed = self.delay + age - _SHORTEST
        while self._commands and self._span - self._commands[0][0] >= needed:
            self._span -= self._commands.popleft()[0]
        if not self._commands:
            self._span = 0.0

    def _carry(self, pose: Array, begin: float, end: float) -> Array:
        """From ``begin`` [s] ago to ``end`` [s] ago."""
        if begin - end <= 0.0:
            return pose
        back = self._span  # how long ago this command came into force
        for dt, command in self._commands:
            step = min(back, begin) - max(back - dt, end)
            if step > _SHORTEST:
                pose = self._motion(pose, *command, step)
            back -= dt
        return pose


def twist_step(pose: Array, vx: float, vy: float, omega: float, dt: float) -> Array:
    """Pose ``(3,)`` of a body after a constant twist [m/s, m/s, rad/s] in its own frame for dt [s],
    the heading continuous."""
    moved: Array = screw_poses(pose, dt * np.array([vx, vy, omega]), np.ones(1))[0]
    return moved
