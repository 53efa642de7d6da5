"""Which robots of a swarm do as they are told. No ROS, no clock.

Who stands although nothing is at it is dead soon. One that is held up by others may be in a jam: if
it has wheels it is told to turn on the spot, which it can among any neighbours, and is dead if it
does not; else it goes a little way off as it then heads, for jams do not dissolve by themselves.
"""

from collections.abc import Mapping

import numpy as np

from push_estimation.actuation_monitor import ActuationMonitor
from push_model import se2
from push_model.arrays import Array, Mask

_RATE, _TIME = 2.5, 1.0  # [rad/s], [s] of a turn on the spot
_SPEED, _AWAY = 0.06, 0.7  # [m/s], [s] away from the jam then
_TURNED = 0.5  # [rad] that shows that a robot lives


class LivenessCheck:
    """Robots by name."""

    def __init__(self, dead: float, way: float, jammed: float, again: float, wheels: bool) -> None:
        """dead, jammed: [s] that a robot may not do as told, alone and where something is at it;
        way: [m] that it should have gone in that time; again: [s] until the dead are tried
        again."""
        self._patience, self._way, self._jammed, self._again = dead, way, jammed, again
        self._wheels = wheels
        self.revive()

    def revive(self) -> None:
        """Believe in all robots again."""
        self.dead: dict[str, float] = {}
        """Who is dead, and since when [s]."""
        self._turning: dict[str, tuple[float, float]] = {}  # since when [s], from which heading
        self._trying: dict[str, tuple[float, float]] = {}  # likewise, of the dead
        self._names: tuple[str, ...] = ()
        self._alone = self._held = ActuationMonitor(0, 1.0, 1.0)

    def step(
        self, now: float, names: tuple[str, ...], poses: Array, twists: Array, touched: Mask
    ) -> Array:
        """Twists of robots at poses ``(n, 3)``, those that are put to the test changed. twists
        ``(n, 2)`` v [m/s], omega [rad/s], or ``(n, 3)`` with velocities in the fixed frame; touched
        ``(n,)``: which something is at."""
        if names != self._names:
            self._names = names
            self._turning = {n: t for n, t in self._turning.items() if n in names}
            self._watch(len(names))
        twists = self._test(now, poses, twists)
        loose = self._alone.step(now, poses, np.where(touched[:, None], 0.0, twists))
        stuck = self._held.step(now, poses, twists)
        for i in loose if self._wheels else {*loose, *stuck}:
            self.dead[names[i]] = now
        for i in stuck if self._wheels else ():
            self._turning.setdefault(names[i], (now, float(poses[i, 2])))
        return twists

    def try_again(self, now: float, robots: Mapping[str, Array]) -> dict[str, tuple[float, float]]:
        """Twists of those of robots, poses ``(3,)`` by name, that have been dead for long: they are
        dead until they turn; those that go in any direction are believed again."""
        for name in [n for n, since in self.dead.items() if now - since > self._again]:
            if not self._wheels or name not in robots:
                del self.dead[name]
                self._trying.pop(name, None)
                continue
            since, heading = self._trying.setdefault(name, (now, float(robots[name][2])))
            if abs(se2.wrap(float(robots[name][2]) - heading)) >= _TURNED:
                del self.dead[name], self._trying[name]
            elif now - since > _TIME:
                self.dead[name] = now
                del self._trying[name]
        return dict.fromkeys(self._trying, (0.0, _RATE))

    def _watch(self, count: int) -> None:
        self._alone = ActuationMonitor(count, self._patience, self._way)
        self._held = ActuationMonitor(count, self._jammed, self._way)

    def _test(self, now: float, poses: Array, twists: Array) -> Array:
        """Turn whoever is in a jam, and judge it afterwards."""
        if not self._turning:
            return twists
        twists = twists.copy()
        over = []
        for i, name in enumerate(self._names):
            if name not in self._turning:
                continue
            since, heading = self._turning[name]
            if now - since < _TIME:
                twists[i] = 0.0, _RATE
                continue
            if abs(se2.wrap(float(poses[i, 2]) - heading)) < _TURNED:
                self.dead[name] = now
            elif now - since < _TIME + _AWAY:
                twists[i] = _SPEED, 0.0
                continue
            over.append(name)
        for name in over:
            del self._turning[name]
        if over:  # who has shown that it lives has all its time again
            self._watch(len(self._names))
        return twists
