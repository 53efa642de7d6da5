"""One robot of a decentralised swarm. No ROS, no clock.

The robot measures its own pose and the object's. It receives the states of neighbours within a
radius; messages may be lost. It runs the same job and law as the node of a centralised swarm, on
the robots that it knows of, and carries out its own command alone. A law that needs the mean of all
robots gets an estimate by average consensus: flow updating (Jesus, Baquero and Almeida 2009). Lost
messages do not bias it, because neighbours keep account of the flow between them and every message
carries all of it.
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
    """Communication of a decentralised swarm."""

    decentralised: bool = bounded(
        False,
        doc="Whether each robot has an agent node of its own; if false, the swarm node "
        "commands all robots.",
    )
    radius: float = bounded(
        0.8,
        low=0.05,
        high=100.0,
        doc="Communication radius: messages of robots farther away are ignored (m)",
    )
    lost: float = bounded(
        0.0,
        low=0.0,
        high=0.99,
        doc="Fraction of messages that is dropped on purpose, at random (dimensionless)",
    )
    seed: int = bounded(
        0,
        low=0,
        high=2**31 - 1,
        doc="Seed of the random numbers that decide which messages are dropped for tests.",
    )
    forget: float = bounded(
        0.5,
        low=0.02,
        high=60.0,
        doc="Time without a message after which a neighbour is forgotten (s)",
    )
    silence: float = bounded(
        1.0,
        low=0.05,
        high=60.0,
        doc="Time without a message with the target after which the robot stops (s)",
    )


@dataclass(frozen=True)
class AgentState:
    """What a robot broadcasts at a time [s]: its pose ``(3,)``, its estimate of the mean ``(2,)``
    [m] of all robots, and the flow ``(2,)`` [m] of it to each neighbour."""

    name: str
    time: float
    pose: Array
    mean: Array
    flows: Mapping[str, Array]


class Agent:
    """One robot. job: of the robots that it knows of; mean: ``(2,)`` [m], its estimate of the mean
    position of all robots."""

    def __init__(self, name: str, job: SwarmJob, settings: AgentSettings) -> None:
        self.name, self.job, self.settings = name, job, settings
        self.mean: Array | None = None
        self._heard: dict[str, AgentState] = {}
        self._before: Array | None = None
        self._flows: dict[str, Array] = {}
        self._fresh: set[str] = set()  # heard since the last tick
        self._random = np.random.default_rng([settings.seed, *name.encode()])

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Names of the robots that it received a message of lately."""
        return tuple(self._heard)

    def pursue(self, target: Array | None) -> None:
        """Take a target ``(3,)``, or none; called at every tick, because the object may have left
        it."""
        if target is None:
            self.job.end(JobError.NONE, "no target")
        elif not self.job.busy:
            self.job.begin([target])
        elif (aim := self.job.target) is None or not np.array_equal(aim, target, equal_nan=True):
            # Compared with the job's own, which a belief of the centre of mass shifts meanwhile.
            self.job.retarget(target)

    def forget(self) -> None:
        """Forget all neighbours and the target: the clock has been set back."""
        self.pursue(None)
        self._heard, self._flows, self._fresh = {}, {}, set()
        self.mean = self._before = None

    def hear(self, message: AgentState) -> None:
        """Take the message of a robot; that of one beyond the radius is ignored."""
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
        """Twist v [m/s], omega [rad/s] and the state to be broadcast. item ``(3,)`` of the object's
        centre of
        mass; pose ``(3,)`` of the robot; others ``(k, 3)`` x, y, radius [m] of what else stands."""
        late = now - self.settings.forget
        self._heard = {n: w for n, w in sorted(self._heard.items()) if w.time >= late}
        self._agree(pose)
        robots = {self.name: pose, **{n: w.pose for n, w in self._heard.items()}}
        twists = self.job.step(now, item, robots, others, self.mean)
        assert self.mean is not None
        return twists[self.name], AgentState(self.name, now, pose, self.mean, dict(self._flows))

    def _agree(self, pose: Array) -> None:
        """A step of flow updating: a robot's estimate is its own position less its outgoing flows,
        and flows are changed so that neighbours have equal estimates."""
        zero = np.zeros(2)
        flows = {n: self._flows.get(n, zero) for n in self._heard}
        for name in self._fresh & set(flows):
            flows[name] = -self._heard[name].flows.get(self.name, zero)
        own = pose[:2] - sum(flows.values(), zero)
        means = {n: w.mean for n, w in self._heard.items()}
        self.mean = mean = (own + sum(means.values(), zero)) / (1 + len(means))
        self._flows = {n: f + mean - means[n] for n, f in flows.items()}
        self._before, self._fresh = pose.copy(), set()
