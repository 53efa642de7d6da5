"""What is believed of objects, contacts, robots and the pose stream, each value with its interval.

A ``Belief`` is one value that is handed to every planner, controller, optimizer and law at each
call. It says where friction, mass, centre of mass, outline and latency come from: the scenario's
files, a person, or an estimator. Whatever depends on one of them reads it here.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_model.drives import SpeedDrive, TorqueDrive
from push_model.settings import SettingsError
from push_model.shape_specs import PolygonShape
from push_model.specs import ObjectSpec, RobotSpec

POSES = ""
"""The body that quantities of the pose stream belong to."""


class BeliefError(ValueError):
    """Raised for a belief that cannot be: not finite, out of range, or of an unknown body."""


@dataclass(frozen=True)
class Quantity:
    """A quantity that may be believed: its unit, its range, and the kind of body that has it."""

    unit: str
    low: float
    high: float
    kind: str  # "object", "robot" or "poses"
    what: str


QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "mass": Quantity("kg", 1e-3, 500.0, "object", "mass of the object"),
        "floor_friction": Quantity("", 0.01, 2.0, "object", "friction between object and floor"),
        "contact_friction": Quantity("", 0.0, 2.0, "object", "friction between robot and object"),
        "com_x": Quantity("m", -100.0, 100.0, "object", "centre of mass, x in the object's frame"),
        "com_y": Quantity("m", -100.0, 100.0, "object", "centre of mass, y in the object's frame"),
        "wheel_friction": Quantity("", 0.0, 3.0, "robot", "friction between wheels and floor"),
        "latency": Quantity("s", 0.0, 1.0, "poses", "age of a pose when it arrives"),
    }
)
"""By name; the order is that of tables."""


@dataclass(frozen=True)
class Interval:
    """A value and the interval that holds it.

    Raises
    ------
    BeliefError: a number is not finite, or the value lies outside its interval.
    """

    value: float
    low: float
    high: float

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) for v in (self.value, self.low, self.high)):
            raise BeliefError(f"{self} is not finite")
        if not self.low <= self.value <= self.high:
            raise BeliefError(
                f"the value {self.value:g} lies outside [{self.low:g}, {self.high:g}]"
            )

    @classmethod
    def exact(cls, value: float) -> "Interval":
        """A value that is taken as it is."""
        return cls(float(value), float(value), float(value))

    @property
    def width(self) -> float:
        """From the lower to the upper end."""
        return self.high - self.low


@dataclass(frozen=True)
class Belief:
    """objects, robots: by name, as the files describe them. values: intervals by body and quantity,
    where somebody says more than the files. outlines: ``(n, 2)`` [m] by object, in its frame.

    Two beliefs are equal when every value is; methods compare them to notice a change.
    """

    objects: Mapping[str, ObjectSpec] = field(default_factory=dict)
    robots: Mapping[str, RobotSpec] = field(default_factory=dict)
    values: Mapping[tuple[str, str], Interval] = field(default_factory=dict)
    outlines: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    _made: dict[str, ObjectSpec] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    def interval(self, body: str, quantity: str) -> Interval:
        """What is believed of a quantity; the files' value as an exact one where nobody says more.

        Raises
        ------
        BeliefError: there is no such body or quantity.
        """
        found = self.values.get((body, quantity))
        return found if found is not None else Interval.exact(self._from_files(body, quantity))

    @property
    def latency(self) -> Interval:
        """[s] age of a pose when it arrives."""
        return self.interval(POSES, "latency")

    def object(self, name: str) -> ObjectSpec:
        """An object with the values that are believed.

        Raises
        ------
        BeliefError: there is no such object. SettingsError: the values do not fit together.
        """
        if name not in self.objects:
            raise _unknown("object", name, self.objects)
        if name not in self._made:  # it is asked for at every step
            self._made[name] = self._object(name)
        return self._made[name]

    def _object(self, name: str) -> ObjectSpec:
        spec, found = self.objects[name], self._of(name)
        changes: dict[str, Any] = {
            k: found[k].value for k in ("mass", "floor_friction", "contact_friction") if k in found
        }
        if "com_x" in found or "com_y" in found:
            x, y = (self.interval(name, k).value for k in ("com_x", "com_y"))
            changes["com"] = (x, y)
        if name in self.outlines:
            changes["shape"] = PolygonShape(vertices=self.outlines[name], frame="given")
        return replace(spec, **changes) if changes else spec

    def robot(self, name: str) -> RobotSpec:
        """A robot with the values that are believed.

        Raises
        ------
        BeliefError: there is no such robot.
        """
        if name not in self.robots:
            raise BeliefError(f"unknown robot '{name}'")
        spec, found = self.robots[name], self._of(name)
        if "wheel_friction" in found and isinstance(spec.drive, SpeedDrive | TorqueDrive):
            drive = replace(spec.drive, wheel_friction=found["wheel_friction"].value)
            return replace(spec, drive=drive)
        return spec

    def updated(
        self,
        values: Mapping[tuple[str, str], Interval],
        outlines: Mapping[str, Array] | None = None,
    ) -> "Belief":
        """This belief with some values replaced.

        Raises
        ------
        BeliefError: an unknown body or quantity, a value out of range, or an outline that is none.
        """
        for (body, quantity), interval in values.items():
            self._from_files(body, quantity)  # it is known
            q = QUANTITIES[quantity]
            if interval.low < q.low or interval.high > q.high:
                raise BeliefError(
                    f"{quantity} of '{body}': [{interval.low:g}, {interval.high:g}] {q.unit} lies "
                    f"outside [{q.low:g}, {q.high:g}]"
                )
        corners = {}
        for body, outline in (outlines or {}).items():
            table = np.asarray(outline, dtype=np.float64)
            if body not in self.objects:
                raise _unknown("object", body, self.objects)
            if table.ndim != 2 or len(table) < 3 or not np.isfinite(table).all():
                raise BeliefError(f"the outline of '{body}' is not three or more finite corners")
            corners[body] = tuple((float(x), float(y)) for x, y in table)
        made = replace(
            self, values={**self.values, **values}, outlines={**self.outlines, **corners}
        )
        try:
            for body in dict.fromkeys([*(b for b, _ in values), *corners]):
                if body in self.objects:
                    _ = made.object(body).geometry
        except (SettingsError, ValueError) as error:
            raise BeliefError(f"'{body}': {error}") from None
        return made

    def rows(self) -> list[tuple[str, str, Interval, str]]:
        """Body, quantity, interval and unit of all that is believed, for tables and pictures."""
        bodies = {"poses": [POSES], "object": list(self.objects), "robot": list(self.robots)}
        found = []
        for name, q in QUANTITIES.items():
            for body in bodies[q.kind]:
                if q.kind != "robot" or (body, name) in self.values:
                    found.append((body, name, self.interval(body, name), q.unit))
        return found

    def _of(self, body: str) -> dict[str, Interval]:
        return {q: v for (b, q), v in self.values.items() if b == body}

    def _from_files(self, body: str, quantity: str) -> float:
        q = QUANTITIES.get(quantity)
        if q is None:
            known = ", ".join(QUANTITIES)
            raise BeliefError(f"unknown quantity '{quantity}'; expected one of: {known}")
        if q.kind == "poses":
            if body != POSES:
                raise BeliefError(f"{quantity} is of the pose stream, not of '{body}'")
            return 0.0
        if q.kind == "robot":
            if body not in self.robots:
                raise _unknown("robot", body, self.robots)
            return float(getattr(self.robots[body].drive, quantity, 0.0))
        if body not in self.objects:
            raise _unknown("object", body, self.objects)
        spec = self.objects[body]
        if quantity in ("com_x", "com_y"):
            return spec.com[quantity == "com_y"]
        return float(getattr(spec, quantity))


def _unknown(kind: str, name: str, known: Mapping[str, object]) -> BeliefError:
    return BeliefError(f"unknown {kind} '{name}'; the scenario has: {', '.join(known) or 'none'}")
