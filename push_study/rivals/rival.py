"""What every rival sees and says."""

from dataclasses import dataclass
from typing import Protocol

from push_model.arrays import Array
from push_model.specs import ObjectSpec


@dataclass(frozen=True)
class Arena:
    """Where a rival works.

    size: [m] of a room about the origin. item: the object. radius [m], speed [m/s]: of the robots.
    target ``(2,)`` [m]. seed: of what it draws.
    """

    size: tuple[float, float]
    item: ObjectSpec
    radius: float
    speed: float
    target: Array
    seed: int


class Rival(Protocol):
    """Moves robots that go in any direction."""

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """``(n, 2)`` [m/s]. time: [s]; pose ``(3,)`` of the object's centre of mass; robots
        ``(n, 3)``: poses."""
        ...
