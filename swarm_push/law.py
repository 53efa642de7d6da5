"""The interface of a swarm law: what it gets at a tick, and what it returns.

A law gets the poses of the object and of the robots. It returns a velocity for each robot and the
density that the swarm covers. It is written for robots that move in any direction.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from push_model.arrays import Array
from push_model.specs import ObjectSpec
from swarm_push.density import Density


class SwarmPhase(Enum):
    """What a swarm is doing."""

    GATHER = "gather"
    GO_ROUND = "go round"
    PUSH = "push"
    REALIGN = "realign"


@dataclass(frozen=True)
class Scene:
    """The input of a law at one tick.

    time: [s]. pose ``(3,)`` of the object's centre of mass. robots ``(n, 2)`` [m]. target ``(3,)``:
    where the centre of mass is to be, its heading nan where any will do. others ``(k, 3)`` x, y,
    radius [m] of what stands about: robots that do not move, other bodies. mean ``(2,)`` [m] of all
    robots, where these are not all.
    """

    time: float
    pose: Array
    robots: Array
    target: Array
    others: Array
    mean: Array | None = None


@dataclass(frozen=True)
class SwarmStep:
    """velocities ``(n, 2)`` [m/s] of the robots; density that they cover; centroids ``(n, 2)`` [m]
    of their cells; phase of the swarm. inward ``(n, 2)`` unit, most ``(n,)`` [m/s]: directions in
    which robots may go no faster, for the object is there; inf where they may.
    """

    velocities: Array
    density: Density
    centroids: Array
    phase: SwarmPhase
    inward: Array
    most: Array


class SwarmLaw(Protocol):
    """Moves a swarm; may remember its last step."""

    def step(self, scene: Scene) -> SwarmStep:
        """One tick; there is at least one robot."""
        ...

    def reset(self) -> None:
        """Forget what was."""
        ...

    def believe(self, item: ObjectSpec) -> None:
        """Go on with what is believed of the object now, in the phase that is under way."""
        ...
