"""Where a body of a running world can be put without overlapping a wall or another body."""

from collections.abc import Iterable, Mapping

from push_model import se2
from push_model.arrays import Array
from push_scenario.room import Footprint, Room, object_footprint, robot_footprint
from push_scenario.scenario import Scenario

TOUCH = 5e-4
"""[m] overlap that counts as touching; bodies that press on each other overlap slightly."""
_STEP = 1e-3  # [m] between poses of a path that are checked
_TURN = 0.01  # [rad] between poses of a path that are checked


class Footing:
    """The free space between the bodies of a scenario.

    ``poses`` are always those of the bodies that are present, by name: ``(3,)``.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._room = Room(scenario.environment)
        self._robots = {n: spec for n, (spec, _) in scenario.robots.items()}
        self._objects = {n: spec for n, (spec, _) in scenario.objects.items()}

    def trouble(self, name: str, pose: Array, poses: Mapping[str, Array]) -> str | None:
        """Why a body cannot be at a pose ``(3,)``, e.g. "in epuck1"; None if it can."""
        return self._trouble(self._footprint(name, pose), self._others(name, poses))

    def along(self, name: str, by: Array, poses: Mapping[str, Array]) -> tuple[Array, str | None]:
        """How far a displaced body gets, and what stops it.

        by: ``(3,)`` [m, m, rad] along the world's axes. It may leave bodies that it overlaps.
        """
        start = poses[name]
        steps = max(1, int(max(abs(by[0]), abs(by[1])) / _STEP), int(abs(by[2]) / _TURN))
        here = self._footprint(name, start)
        others = [
            other
            for other in self._others(name, poses)
            if not (here.meets(other, TOUCH) and by[:2] @ (here.centre - other.centre) > 0.0)
        ]
        reached, trouble = start, None
        for k in range(1, steps + 1):
            pose = start + (k / steps) * by
            trouble = self._trouble(self._footprint(name, pose), others)
            if trouble is not None:
                break
            reached = se2.pose(pose[0], pose[1], se2.wrap(float(pose[2])))
        return reached, trouble

    def _others(self, name: str, poses: Mapping[str, Array]) -> list[Footprint]:
        return [self._footprint(n, p) for n, p in poses.items() if n != name]

    def _footprint(self, name: str, pose: Array) -> Footprint:
        if name in self._robots:
            return robot_footprint(name, self._robots[name], pose)
        return object_footprint(name, self._objects[name], pose)

    def _trouble(self, body: Footprint, others: Iterable[Footprint]) -> str | None:
        for other in others:
            if body.meets(other, TOUCH):
                return f"in {other.name}"
        return self._room.trouble(body, TOUCH)
