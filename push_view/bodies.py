"""The bodies of a scenario as they are drawn: many bodies of few types."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_scenario.scenario import Scenario

ROBOT, OBJECT = "#2a62c9", "#d0751c"


@dataclass(frozen=True)
class BodyType:
    """outline: ``(n, 2)`` [m] in the frame of the poses; robot: false for an object."""

    outline: Array
    robot: bool

    @property
    def color(self) -> str:
        """Of robots or of objects."""
        return ROBOT if self.robot else OBJECT


@dataclass(frozen=True)
class Bodies:
    """All bodies: robots first, then objects.

    types: those that look different; type_of: ``(n,)`` index of the type of each body.
    """

    names: tuple[str, ...]
    types: tuple[BodyType, ...]
    type_of: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.names)

    def type(self, name: str) -> BodyType:
        """What a body looks like; raises ValueError when it is unknown."""
        return self.types[int(self.type_of[self.names.index(name)])]

    def as_json(self) -> dict[str, Any]:
        """Names, index of the type of each, and the types with outlines [m]."""
        return {
            "names": self.names,
            "type": self.type_of.tolist(),
            "types": [
                {
                    "outline": np.round(t.outline, 5).tolist(),
                    "color": t.color,
                    "robot": t.robot,
                }
                for t in self.types
            ],
        }


def bodies_of(scenario: Scenario) -> Bodies:
    """The bodies of a scenario; those with equal outlines share a type."""
    types: list[BodyType] = []
    index_of: dict[tuple[bool, bytes], int] = {}
    index_of_spec: dict[int, int] = {}  # bodies of one type often share their spec
    names: list[str] = []
    type_of: list[int] = []
    for robot, specs in ((True, scenario.robots), (False, scenario.objects)):
        for name, (spec, _) in specs.items():
            if id(spec) not in index_of_spec:
                outline = spec.outline
                key = (robot, outline.tobytes())
                if key not in index_of:
                    index_of[key] = len(types)
                    types.append(BodyType(outline, robot))
                index_of_spec[id(spec)] = index_of[key]
            names.append(name)
            type_of.append(index_of_spec[id(spec)])
    return Bodies(tuple(names), tuple(types), np.array(type_of, dtype=np.intp))
