"""Dead reckoning: the present pose of a robot from a late or missing measurement and its commands.

Times count back from now. A frame shows the world as it was ``delay`` ago. A pose that is ``age``
older than its frame was measured delay + age ago. A command is in force from its tick until the
next one.
"""

from collections import deque

from push_model.arrays import Array
from push_model.kinematics import unicycle_step

_SHORTEST = 1e-9  # [s]: shorter intervals are rounding errors


class DeadReckoning:
    """Predicts poses of a unicycle forward along its commands.

    delay: [s] from the measurement of a frame to the command that answers it. Before the first
    recorded command the robot is assumed at rest.
    """

    def __init__(self, delay: float) -> None:
        self.delay = delay
        self._commands: deque[tuple[float, float, float]] = deque()  # dt, v, omega; oldest first
        self._span = 0.0

    def clear(self) -> None:
        """Assume that the robot has been at rest."""
        self._commands.clear()
        self._span = 0.0

    def record(self, dt: float, v: float, omega: float) -> None:
        """Add the command that was in force for the last dt [s]."""
        self._commands.append((dt, v, omega))
        self._span += dt

    def at_frame(self, robot: Array, age: float) -> Array:
        """Pose ``(3,)`` at the time of the frame, from one measured ``age`` [s] before it."""
        return self._carry(robot, self.delay + age, self.delay)

    def now(self, robot: Array) -> Array:
        """Pose ``(3,)`` now, from that at the time of the frame."""
        return self._carry(robot, self.delay, 0.0)

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
        back = self._span  # time since this command came into force
        for dt, v, omega in self._commands:
            step = min(back, begin) - max(back - dt, end)
            if step > _SHORTEST:
                pose = unicycle_step(pose, v, omega, step)
            back -= dt
        return pose
