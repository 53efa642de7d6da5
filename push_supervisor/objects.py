"""The objects that a robot may push: which there are, and what stands around each of them."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import yaml

from push_model.arrays import Array
from push_model.belief import Belief
from push_model.jobs import GoalRefused, JobError
from push_model.occupancy import OccupancyGrid
from push_scenario.scenario import Scenario
from push_supervisor.settings import SupervisorSettings
from push_supervisor.surroundings import Surroundings


class Objects:
    """Those of a scenario that belong to no other team. names: of all of them."""

    def __init__(
        self,
        scenario: Scenario,
        robot: str,
        item: str,
        settings: Callable[[], SupervisorSettings],
    ) -> None:
        """item: the object of the robot's own team. settings: those of now."""
        self._all, self._settings = tuple(scenario.objects), settings
        foreign = {t.object for t in scenario.teams.values()} - {item}
        self.names = tuple(n for n in scenario.objects if n not in foreign)
        self._robot, self._radii = robot, scenario.radii
        self._world: tuple[Mapping[str, Any], ...] | None = None  # types of robots, of objects

    def around(
        self,
        item: str,
        belief: Belief,
        grid: OccupancyGrid | None = None,
    ) -> Surroundings:
        """What stands around a job with an object; other objects stand in the way."""
        others = {k: r for k, r in self._radii.items() if k not in (self._robot, item)}
        specs = belief.robot(self._robot), belief.object(item)
        near = Surroundings(*specs, others, self._settings())
        if grid is not None:
            near.take_map(grid)
        return near

    def touched(
        self,
        robot: Array,
        own: str,
        pose: Callable[[str], Array | None],
        near: Callable[[str], Surroundings],
    ) -> tuple[str, Surroundings, Array] | None:
        """The object that the robot may be touching: the name, what stands around it, its pose.

        own: the object of the job, which comes first. pose, near: of an object by name; of all in
        the scenario, because a robot backs off from any.
        """
        for name in dict.fromkeys((own, *self._all)):
            item = pose(name)
            if item is None:
                continue
            reach = self._radii[name] + self._radii[self._robot] + self._settings().detach_distance
            if np.hypot(*(item - robot)[:2]) < reach and (around := near(name)).touching(
                robot, item
            ):
                return name, around, item
        return None

    def check(self, item: str) -> None:
        """Raise GoalRefused unless robot and object are in the world, as far as is known."""
        for name, body in zip((self._robot, item), self._there(item), strict=True):
            if self._world is not None and body is None:
                text = f"no body '{name}' in the world; use a name of the scenario"
                raise GoalRefused(JobError.UNKNOWN_OBJECT, text)

    def take_world(self, text: str, item: str) -> str:
        """Another world, as a scenario; why a job with an object ends now, empty if it does not.

        Raises
        ------
        ValueError: the text is not a scenario.
        """
        try:
            values = yaml.safe_load(text)
            bodies = values.get("robots") or {}, values.get("objects") or {}
            world = tuple({n: body["type"] for n, body in kind.items()} for kind in bodies)
        except (yaml.YAMLError, AttributeError, KeyError, TypeError) as error:
            raise ValueError(f"the message is not a scenario: {error}") from None
        known, before = self._world is not None, self._there(item)
        self._world = world
        there = self._there(item)
        if not known or before == there:
            return ""
        gone = [n for n, b in zip((self._robot, item), there, strict=True) if b is None]
        what = f"without {' and '.join(gone)}" if gone else "with another robot or object"
        return f"another scenario was loaded, {what}"

    def _there(self, item: str) -> tuple[Any, Any]:
        """The types of the robot and of an object in the world, None where there is none."""
        robots, items = self._world or ({}, {})
        return robots.get(self._robot), items.get(item)
