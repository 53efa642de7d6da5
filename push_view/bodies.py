"""The bodies of a scenario as they are drawn: many bodies of few types."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_scenario.scenario import Scenario
from push_view.palette import EACH, OBJECT, ROBOTS, robot_colour


@dataclass(frozen=True)
class BodyType:
    """outline: ``(n, 2)`` [m] in the frame of the poses; robot: false for an object."""

    outline: Array
    robot: bool


@dataclass(frozen=True)
class Bodies:
    """All bodies: robots first, then objects.

    types: those that look different; type_of: ``(n,)`` index of the type of each body. colours: of
    each body.
    """

    names: tuple[str, ...]
    types: tuple[BodyType, ...]
    type_of: NDArray[np.intp]
    colours: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.names)

    def type(self, name: str) -> BodyType:
        """What a body looks like; raises ValueError when it is unknown."""
        return self.types[int(self.type_of[self.names.index(name)])]

    def colour(self, name: str) -> str:
        """Of a body; raises ValueError when it is unknown."""
        return self.colours[self.names.index(name)]

    def as_json(self) -> dict[str, Any]:
        """Names, index of the type and colour of each, palette, and the types with outlines [m]."""
        return {
            "names": self.names,
            "type": self.type_of.tolist(),
            "colours": self.colours,
            "palette": ROBOTS,
            "types": [
                {"outline": np.round(t.outline, 5).tolist(), "robot": t.robot} for t in self.types
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
    few = len(scenario.robots) <= EACH
    colours = [robot_colour(i if few else 0) for i in range(len(scenario.robots))]
    colours += [OBJECT] * len(scenario.objects)
    index = np.array(type_of, dtype=np.intp)
    return Bodies(tuple(names), tuple(types), index, tuple(colours))
