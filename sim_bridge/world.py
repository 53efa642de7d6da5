"""What the bridge drives: a world of robots and objects, PyBullet's or another."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, overload

import numpy as np

from push_model.arrays import Array, Mask


@dataclass(frozen=True)
class Contact:
    """A contact between two named bodies, averaged over physics steps.

    position: ``(3,)`` [m], mean over the points of contact weighted by their loads.
    normal: ``(3,)`` unit, of the sum of the normal forces, from b to a.
    force: ``(3,)`` [N] on a, friction included.
    duty: fraction of the steps in which the two touched.
    All in the world frame.
    """

    body_a: str
    body_b: str
    position: Array
    normal: Array
    force: Array
    duty: float


class BodyContacts(Sequence[Contact]):
    """Contacts as columns that can also be read one by one.

    body_a, body_b: ``(n,)`` names. position [m], normal, force [N]: ``(n, 3)``, world frame. duty:
    ``(n,)``. What they are is told in Contact.
    """

    __slots__ = ("body_a", "body_b", "duty", "force", "normal", "position")

    def __init__(
        self,
        body_a: Sequence[str],
        body_b: Sequence[str],
        position: Array,
        normal: Array,
        force: Array,
        duty: Array,
    ) -> None:
        self.body_a, self.body_b = list(body_a), list(body_b)
        self.position, self.normal, self.force, self.duty = position, normal, force, duty

    @classmethod
    def of(cls, contacts: Sequence[Contact]) -> "BodyContacts":
        """The columns of contacts."""
        vectors = [
            np.array([getattr(c, name) for c in contacts], dtype=np.float64).reshape(-1, 3)
            for name in ("position", "normal", "force")
        ]
        return cls(
            [c.body_a for c in contacts],
            [c.body_b for c in contacts],
            *(vectors[0], vectors[1], vectors[2]),
            np.array([c.duty for c in contacts], dtype=np.float64),
        )

    def __len__(self) -> int:
        return len(self.body_a)

    @overload
    def __getitem__(self, row: int) -> Contact: ...

    @overload
    def __getitem__(self, row: slice) -> list[Contact]: ...

    def __getitem__(self, row: int | slice) -> Contact | list[Contact]:
        if isinstance(row, slice):
            return [self[k] for k in range(*row.indices(len(self)))]
        return Contact(
            self.body_a[row],
            self.body_b[row],
            self.position[row],
            self.normal[row],
            self.force[row],
            float(self.duty[row]),
        )


@dataclass(frozen=True)
class WheelState:
    """Of the left and the right wheel ``(2,)``: angles [rad], speeds [rad/s], torques [Nm]."""

    angle: Array
    speed: Array
    torque: Array


class BodyPoses(Mapping[str, Array]):
    """Poses as arrays that can also be asked by name.

    names: of the bodies.
    table: ``(n, 3)`` [m, m, rad], world frame, a row a name.
    """

    __slots__ = ("_rows", "names", "table")

    def __init__(self, names: tuple[str, ...], table: Array) -> None:
        self.names, self.table = names, table
        self._rows: dict[str, int] | None = None

    def __getitem__(self, name: str) -> Array:
        if self._rows is None:
            self._rows = {n: i for i, n in enumerate(self.names)}
        row: Array = self.table[self._rows[name]]
        return row

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def only(self, keep: Mask) -> "BodyPoses":
        """The bodies that a mask ``(n,)`` selects."""
        if keep.all():
            return self
        chosen = np.flatnonzero(keep)
        return BodyPoses(tuple(self.names[i] for i in chosen), self.table[chosen])


class World(Protocol):
    """A running simulation. Robots are named before objects. Close it when it is done with.

    Poses are of the axle midpoint of a robot and of the geometric frame of an object.
    """

    @property
    def time_step(self) -> float:
        """[s] of a physics step."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Bodies that are there: robots, then objects."""
        ...

    def step(self, count: int = 1, contacts: bool = True) -> None:
        """Advance by physics steps; contacts of every step are added up until they are read."""
        ...

    def poses(self) -> BodyPoses:
        """Ground truth of every body that is there."""
        ...

    def velocity(self, name: str) -> Array:
        """Ground truth twist ``(3,)`` of a body's centre of mass, world frame."""
        ...

    def set_velocity(self, name: str, twist: Array) -> None:
        """Overwrite the twist ``(3,)`` of a body's centre of mass; to test the physics itself."""
        ...

    def command(self, robot: str, v: float, omega: float) -> None:
        """Set a robot's twist [m/s, rad/s] in its own frame; it holds until the next command.

        Raises
        ------
        ValueError: not finite.
        """
        ...

    def command_all(self, robots: Sequence[str], twists: Array, fixed_frame: bool = False) -> None:
        """Set the twists ``(n, 3)`` of several robots, in their own frames or in the world's.

        Only robots that move in any direction heed the second column, and the world's frame.
        """
        ...

    def command_torques(self, robot: str, left: float, right: float) -> None:
        """Set the torques [Nm] of a robot's wheels; they hold until the next command.

        Raises
        ------
        ValueError: not finite, or the robot's wheels are not driven by torque.
        """
        ...

    def wheel_state(self, robot: str) -> WheelState | None:
        """State of a robot's wheels; None if it has none."""
        ...

    def read_contacts(self) -> BodyContacts:
        """Contacts since the last reading, averaged over its steps. The floor is left out."""
        ...

    def place(self, name: str, pose: Array) -> None:
        """Put a body somewhere else, at rest: a disturbance."""
        ...

    def kill(self, robot: str) -> None:
        """Stop a robot. From now on it ignores all commands."""
        ...

    def remove(self, name: str) -> None:
        """Take a body out of the world."""
        ...

    def reset(self) -> None:
        """Put every body back to its start, at rest; also those killed and removed."""
        ...

    def close(self) -> None:
        """End it; safe to call twice."""
        ...
