"""One robot of a swarm that decides for itself: no ROS, no clock.

It knows where it is itself, where the object is, and what neighbours within a radius say, where
messages may be lost. It runs the same job and law as a whole swarm's node does, about those that it
knows of, and does what that says for itself. Where a law takes the mean of all robots, that comes
by consensus: flow updating (Jesus, Baquero and Almeida 2009), which messages that are lost do not
bias: neighbours keep count of what each has handed to the other, and every message has all of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.settings import bounded, settings
from swarm_push.swarm_job import SwarmJob


@settings
class AgentSettings:
    """What robots that decide for themselves know of each other."""

    decentralised: bool = bounded(False, doc="one node a robot instead of one for all")
    radius: float = bounded(0.8, low=0.05, high=100.0, doc="[m] from which neighbours are heard")
    lost: float = bounded(0.0, low=0.0, high=0.99, doc="part of messages that get lost, on purpose")
    seed: int = bounded(0, low=0, high=2**31 - 1, doc="of which ones")
    forget: float = bounded(0.5, low=0.02, high=60.0, doc="[s] until a silent one is forgotten")
    silence: float = bounded(1.0, low=0.05, high=60.0, doc="[s] without targets: robots stand")


@dataclass(frozen=True)
class AgentState:
    """What a robot says at a time [s]: its pose ``(3,)``, what it takes for the mean ``(2,)`` [m]
    of all, and what ``(2,)`` [m] of it it has handed to each that it hears."""

    name: str
    time: float
    pose: Array
    mean: Array
    flows: Mapping[str, Array]


class Agent:
    """One robot. job: of the swarm that it knows of; target ``(3,)`` that it has, if any; mean
    ``(2,)`` [m] of all, as it takes it."""

    def __init__(self, name: str, job: SwarmJob, settings: AgentSettings) -> None:
        self.name, self.job, self.settings = name, job, settings
        self.target: Array | None = None
        self.mean: Array | None = None
        self._heard: dict[str, AgentState] = {}
        self._before: Array | None = None
        self._flows: dict[str, Array] = {}
        self._fresh: set[str] = set()  # heard since the last tick
        self._random = np.random.default_rng([settings.seed, *name.encode()])

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Whom it heard lately."""
        return tuple(self._heard)

    def pursue(self, target: Array | None) -> None:
        """A target ``(3,)``, or none. Told so at every tick, for the object may have left it."""
        before, self.target = self.target, target
        if target is None:
            self.job.end(JobError.NONE, "no target")
        elif not self.job.busy:
            self.job.begin([target])
        elif before is None or not np.array_equal(before, target, equal_nan=True):
            self.job.retarget(target)

    def hear(self, message: AgentState) -> None:
        """Take what a robot says; from farther off than the radius nothing is heard."""
        if message.name == self.name or self._random.random() < self.settings.lost:
            return
        here = self._before
        if here is None or np.hypot(*(message.pose - here)[:2]) > self.settings.radius:
            self._heard.pop(message.name, None)
            self._fresh.discard(message.name)
        else:
            self._heard[message.name] = message
            self._fresh.add(message.name)

    def step(
        self, now: float, item: Array, pose: Array, others: Array
    ) -> tuple[tuple[float, float], AgentState]:
        """Twist v [m/s], omega [rad/s] and what it says. item ``(3,)`` of the object's centre of
        mass; pose ``(3,)`` of the robot; others ``(k, 3)`` x, y, radius [m] of what else stands."""
        late = now - self.settings.forget
        self._heard = {n: w for n, w in sorted(self._heard.items()) if w.time >= late}
        self._agree(pose)
        robots = {self.name: pose, **{n: w.pose for n, w in self._heard.items()}}
        twists = self.job.step(now, item, robots, others, self.mean)
        assert self.mean is not None
        return twists[self.name], AgentState(self.name, now, pose, self.mean, dict(self._flows))

    def _agree(self, pose: Array) -> None:
        """On the mean: what a robot has of it is its own place less what it handed on, and all that
        hear each other hand on so much that they have the same."""
        zero = np.zeros(2)
        flows = {n: self._flows.get(n, zero) for n in self._heard}
        for name in self._fresh & set(flows):
            flows[name] = -self._heard[name].flows.get(self.name, zero)
        own = pose[:2] - sum(flows.values(), zero)
        means = {n: w.mean for n, w in self._heard.items()}
        self.mean = mean = (own + sum(means.values(), zero)) / (1 + len(means))
        self._flows = {n: f + mean - means[n] for n, f in flows.items()}
        self._before, self._fresh = pose.copy(), set()
