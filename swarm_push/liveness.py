"""Liveness check: which robots of a swarm do not carry out their commands. No ROS, no clock.

A robot that does not move as commanded is a suspect, not dead: it may press against an object that
does not yield, stand in a jam, or touch something that is not where it is believed to be. A suspect
is commanded test motions, one after the other, and is declared dead only if it carries out none.
A robot on wheels is commanded to turn in place, both ways, because a healthy robot can turn among
any neighbours that do not press on it; then to drive away from what touches it. A robot that moves
in any direction is commanded away from what touches it, then to turn in place, then in the other
directions. If the first test motion fails, robots in contact with the suspect stop pressing until
its test is over. Robots that move in any direction have little torque and hold their places against
a load: those that press on the suspect, also through others, then draw back from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from push_estimation.actuation_monitor import ActuationMonitor
from push_model import se2
from push_model.arrays import Array, Rows
from push_model.settings import bounded, settings
from swarm_push.contacts import Contacts

_RATE, _TIME = 2.5, 1.0  # [rad/s], [s] of a turn in place
_TURNED = 0.5  # [rad] of it that show that a robot is alive
_SPEED, _DRIVE = 0.06, 0.5  # [m/s], [s] of a drive
_MOVED = 6e-3  # [m] of it, along the command, that show that a robot is alive
_EASE = 0.03  # [m/s] at which robots draw back from one that is tested
_LEAVE = 0.7  # [s] for which a robot that has passed leaves the jam


@settings
class LivenessSettings:
    """When a robot is tested, and when a dead one is tested again."""

    dead: float = bounded(
        2.0,
        low=0.1,
        high=60.0,
        doc="Time without the commanded motion after which a robot that nothing touches is tested, "
        "and declared dead if it fails (s)",
    )
    dead_way: float = bounded(
        0.1,
        low=1e-3,
        high=10.0,
        doc="Distance that a robot must be commanded to move within the time limit before it "
        "is judged dead or alive (m)",
    )
    jammed: float = bounded(
        6.0,
        low=0.1,
        high=600.0,
        doc="Time without the commanded motion after which a robot in contact with something is "
        "tested, and declared dead if it fails (s)",
    )
    again: float = bounded(
        30.0,
        low=1.0,
        high=1e6,
        doc="Time after which a robot that was declared dead is tested again (s)",
    )


@dataclass(frozen=True)
class _Motion:
    """A test motion: for so long [s], a twist v [m/s], omega [rad/s], or a velocity ``(2,)`` [m/s]
    in the world frame where ``fixed``, with a turn [rad/s]."""

    time: float
    twist: tuple[float, float]
    fixed: bool
    turn: float = 0.0

    def done(self, start: Array, pose: Array) -> bool:
        """Whether a robot carried it out that was at one pose ``(3,)`` and is at another."""
        first, second = self.twist
        if self.turn or (not self.fixed and second):
            return abs(se2.wrap(float(pose[2] - start[2]))) >= _TURNED
        way = np.array([first, second]) if self.fixed else first * _ahead(float(start[2]))
        return float((pose - start)[:2] @ way) >= _MOVED * float(np.hypot(*way))


@dataclass
class _Test:
    """The test of one robot: motions still to try, the one under way, its start time [s] and pose.
    leaving: whether it has passed and is on its way out of the jam."""

    motions: list[_Motion]
    since: float
    start: Array
    first: bool = True
    leaving: bool = False

    def __post_init__(self) -> None:
        self.away = self.motions[0].twist  # the way out of the jam, as far as is known

    def judge(self, now: float, pose: Array, leave: _Motion | None) -> bool | None:
        """Whether the robot is alive, once that is known; until then the test goes on."""
        if now - self.since < self.motions[0].time:
            return None
        if self.leaving:
            return True
        if self.motions[0].done(self.start, pose):
            if leave is None:
                return True
            self.leaving, self.motions = True, [leave]
        else:
            self.motions, self.first = self.motions[1:], False
            if not self.motions:
                return False
        self.since, self.start = now, np.array(pose)
        return None


class LivenessCheck:
    """The liveness check of all robots of a swarm, by name."""

    def __init__(self, settings: LivenessSettings, wheels: bool) -> None:
        """wheels: whether the robots have two wheels; else they move in any direction."""
        self.settings, self._wheels = settings, wheels
        self.revive()

    def revive(self) -> None:
        """Take all robots for alive again."""
        self.dead: dict[str, float] = {}
        """Who is dead, and since when [s]."""
        self._tests: dict[str, _Test] = {}
        self._retests: dict[str, _Test] = {}  # of the dead
        self._proven: dict[str, float] = {}  # when [s] a suspect was last found to be alive
        self._roster: dict[str, int] = {}  # every robot ever seen, and its place in what follows
        self._poses = np.zeros((0, 3))  # where each was last seen
        self._loose = self._stuck = ActuationMonitor(0, 1.0, 1.0)

    @property
    def turns(self) -> dict[str, float]:
        """Turn rates [rad/s] of robots that move in any direction and are told to turn in place."""
        tests = {**self._tests, **self._retests}
        return {n: t.motions[0].turn for n, t in tests.items() if t.motions[0].turn}

    def step(
        self, now: float, names: tuple[str, ...], poses: Array, twists: Array, contacts: Contacts
    ) -> Array:
        """Commands of the robots, those changed that are tested.

        Parameters
        ----------
        now: [s]. names: of the robots, none of them dead; poses ``(n, 3)``, world frame.
        twists: ``(n, 2)`` v [m/s], omega [rad/s] of robots on wheels, or ``(n, 3)`` with velocities
            in the world frame.
        """
        places = self._places(names, poses)
        if self._tests:
            self._tests = {n: t for n, t in self._tests.items() if n in names}
        twists = self._test(now, names, poses, twists, contacts)
        # A suspect that proved alive was held up by something that is not known to be there.
        held = contacts.touched
        recent = {n for n, t in self._proven.items() if now - t < self.settings.again}
        if recent:
            held = held | np.array([n in recent for n in names], dtype=np.bool_)
        free, whole = np.zeros((2, len(self._roster), twists.shape[1]))
        free[places], whole[places] = np.where(held[:, None], 0.0, twists), twists
        suspects = {*self._loose.step(now, self._poses, free)}
        suspects |= {*self._stuck.step(now, self._poses, whole)}
        for i in np.flatnonzero(np.isin(places, list(suspects))) if suspects else ():
            if names[i] not in self._tests:
                away, touched = contacts.away(int(i)), bool(contacts.touched[i])
                motions = self._motions(poses[i], away, touched)
                self._tests[names[i]] = _Test(motions, now, np.array(poses[i]))
        return twists

    def try_again(self, now: float, robots: Mapping[str, Array]) -> dict[str, tuple[float, float]]:
        """Commands of those of robots, poses ``(3,)`` by name, that have been dead for long and are
        tested again. Who has gone out of sight is forgotten."""
        for name in [n for n, since in self.dead.items() if now - since > self.settings.again]:
            if name not in robots:
                del self.dead[name]
                self._retests.pop(name, None)
                continue
            pose = robots[name]
            if name not in self._retests:
                motions = self._motions(pose, np.zeros(2), False)
                self._retests[name] = _Test(motions, now, np.array(pose))
            alive = self._retests[name].judge(now, pose, None)
            if alive is None:
                continue
            del self._retests[name], self.dead[name]
            if not alive:
                self.dead[name] = now
        return {n: t.motions[0].twist for n, t in self._retests.items()}

    def _motions(self, pose: Array, away: Array, touched: bool) -> list[_Motion]:
        """Test motions of a robot at a pose, away ``(2,)`` being free as far as is known."""
        if not self._wheels:
            x, y = away if away.any() else (1.0, 0.0)
            ways = ((x, y), (-y, x), (y, -x), (-x, -y))
            drives = [
                _Motion(_DRIVE, (_SPEED * float(a), _SPEED * float(b)), True) for a, b in ways
            ]
            return [drives[0], _Motion(_DRIVE, (0.0, 0.0), True, _RATE), *drives[1:]]
        turns = [_Motion(_TIME, (0.0, _RATE), False), _Motion(_TIME, (0.0, -_RATE), False)]
        if not touched:
            return turns
        backward = bool(away @ _ahead(float(pose[2])) < 0.0)
        return [*turns, _Motion(_DRIVE, (-_SPEED if backward else _SPEED, 0.0), False)]

    def _test(
        self,
        now: float,
        names: tuple[str, ...],
        poses: Array,
        twists: Array,
        contacts: Contacts,
    ) -> Array:
        """Continue the tests, and judge those that have ended."""
        if not self._tests:
            return twists
        twists, over = twists.copy(), []
        for i, name in enumerate(names):
            test = self._tests.get(name)
            if test is None:
                continue
            leave = _Motion(_LEAVE, (_SPEED, 0.0), False)
            if not self._wheels:
                way = test.motions[0].twist if not test.motions[0].turn else test.away
                leave = _Motion(_LEAVE, way, True)
            alive = test.judge(now, poses[i], leave)
            if alive is not None:
                over.append(name)
                if alive:
                    self._proven[name] = now
                else:
                    self.dead[name] = now
                continue
            twists[i] = 0.0
            twists[i, :2] = test.motions[0].twist
            if not self._wheels:
                twists[i, 2] = test.motions[0].turn
            if not test.first and not test.leaving:
                for j in contacts.neighbours(i) if self._wheels else contacts.jam(i):
                    if names[j] not in self._tests:
                        twists[j] = 0.0
                        if not self._wheels:
                            twists[j, :2] = _EASE * _away(poses[i], poses[j])
        for name in over:  # a robot that has proved alive has all its time again
            del self._tests[name]
            self._loose.restart(self._roster[name])
            self._stuck.restart(self._roster[name])
        return twists

    def _places(self, names: tuple[str, ...], poses: Array) -> Rows:
        """Places ``(n,)`` of robots in the roster, which nobody leaves: who is out of sight or dead
        is taken to stand where it was, and the others are watched on."""
        new = [n for n in names if n not in self._roster]
        if new:
            for name in new:
                self._roster[name] = len(self._roster)
            self._poses = np.vstack([self._poses, np.zeros((len(new), 3))])
            s, count = self.settings, len(self._roster)
            self._loose = ActuationMonitor(count, s.dead, s.dead_way)
            self._stuck = ActuationMonitor(count, s.jammed, s.dead_way)
        places = np.array([self._roster[n] for n in names], dtype=np.intp)
        self._poses[places] = poses
        return places


def _away(here: Array, there: Array) -> Array:
    """``(2,)`` unit vector from one pose to another; zero where they coincide."""
    way = (there - here)[:2]
    unit: Array = way / max(float(np.hypot(*way)), 1e-9)
    return unit


def _ahead(heading: float) -> Array:
    return np.array([np.cos(heading), np.sin(heading)])
