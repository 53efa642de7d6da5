"""The protocol of a method: an algorithm that moves one object with the robots of a team.

A method imports no ROS and reads no clock. Its only inputs are the arguments of its calls. The
group, the swarm with any law, the one robot and the rivals of the studies are methods.
``push_ros/method_node.py`` runs a method as a node, and a study runs that node in lockstep. A
notebook calls the method itself::

    method = SPEC.make(arena)
    method.begin(Task((goal,)), belief)
    while method.status.phase != JobPhase.IDLE:
        told = method.step(world.seen(), belief)
        world.step(told.commands)
"""

import math
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from typing import Any, Protocol

import numpy as np

from push_job.report import Report, Status
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.jobs import JobError
from push_model.occupancy import OccupancyGrid
from push_model.outside import from_outside
from push_model.settings import SettingsError, from_mapping
from push_model.specs import ObjectSpec, RobotSpec

ENTRY_POINTS = "planar_push.methods"
"""The group of entry points by which installed packages name their methods."""


Command = tuple[float, float] | tuple[float, float, float]
"""Of one robot, see ``Told``."""


@dataclass(frozen=True)
class Task:
    """Bring the object to one target after another, or along a trajectory.

    targets: poses ``(3,)`` of the object's frame [m, m, rad], a heading of nan where any will do.
    times: [s] at which a trajectory passes the targets; empty for targets that only have an order.
    """

    targets: tuple[Array, ...]
    times: tuple[float, ...] = ()

    @property
    def goal(self) -> Array:
        """Where the object ends ``(3,)``."""
        return self.targets[-1]


@dataclass(frozen=True)
class Seen:
    """What motion capture says.

    time: [s] stamp of the frame. object: pose ``(3,)`` of its frame. robots: poses ``(3,)`` by
    name, of those of the team that are seen. obstacles ``(k, 3)``: x, y, radius [m] of other
    bodies. now: [s] when the frame arrived; ``time`` where that is not known. ages: [s] by name,
    of poses that are not of this frame but of an earlier one; 0 where nothing is said.
    """

    time: float
    object: Array
    robots: Mapping[str, Array]
    obstacles: Array = field(default_factory=lambda: np.zeros((0, 3)))
    now: float = math.nan
    ages: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Told:
    """What a method says in a step.

    commands: by robot; v [m/s] and omega [rad/s] of robots on wheels; vx, vy [m/s] in the fixed
    frame and, where they are to turn, omega [rad/s] of the others. A robot without one stands.
    planning: [s] CPU time that planning took in this step. Where it exceeds the time between two
    frames, studies add the excess to the time of the task.
    """

    commands: Mapping[str, Command] = field(default_factory=dict)
    planning: float = 0.0


@dataclass(frozen=True)
class Certificate:
    """A task that can be done, as far as is believed.

    robots: how many it takes at least. margin: of what limits it, as a fraction; nan where the
    method computes none. seconds: about how long it takes; nan likewise.
    """

    robots: int = 1
    margin: float = math.nan
    seconds: float = math.nan


@dataclass(frozen=True)
class Refusal:
    """A task that cannot be done: a code, and a sentence with the reason."""

    code: JobError
    reason: str


class SlicedMethod(Protocol):
    """A method that takes long to assess a task, and can be interrupted meanwhile; optional."""

    def assess_in_slices(
        self, task: Task, belief: Belief, seen: Seen | None
    ) -> Generator[int, None, Certificate | Refusal]:
        """``assess`` in slices of some milliseconds. Yields what each has cost, in microseconds of
        an idle machine, roughly; returns what ``assess`` does."""
        ...


class Method(Protocol):
    """Moves one object with the robots of a team, one task at a time."""

    @property
    def status(self) -> Status:
        """How the task stands."""
        ...

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """Whether a task can be done; seen: the present state, where it is known."""
        ...

    def begin(self, task: Task, belief: Belief) -> None:
        """Take a task; none is under way."""
        ...

    def step(self, seen: Seen, belief: Belief) -> Told:
        """One frame of the pose stream."""
        ...

    def report(self, seen: Seen) -> Report | None:
        """What the last step came from, to look at; None where there is nothing to show."""
        ...

    def end(self, code: JobError, reason: str) -> None:
        """End the task under way."""
        ...

    def revive(self) -> None:
        """Forget which robots failed: the world was reset, or somebody repaired them."""
        ...

    def release(self) -> frozenset[str]:
        """Robots that may be given to other tasks now."""
        ...

    def errors(self, seen: Seen) -> tuple[float, float]:
        """[m], [rad] from the target that is pursued."""
        ...

    def facts(self) -> Mapping[str, Any]:
        """For diagnostics: names and values."""
        ...


@dataclass(frozen=True)
class Arena:
    """What a method is made for: the map, the team's robots, the object, its settings by section.

    partners: what the method may ask of other nodes, see its own file; None where it has to do
    everything itself.
    """

    grid: OccupancyGrid
    robots: Mapping[str, RobotSpec]
    object: str
    item: ObjectSpec
    settings: Mapping[str, Any] = field(default_factory=dict)
    partners: Any = None

    def section(self, name: str, cls: type[Any]) -> Any:
        """The settings of a section; their defaults where none are given."""
        found = self.settings.get(name)
        return cls() if found is None else found

    @property
    def robot(self) -> RobotSpec:
        """The type of the team's robots."""
        return next(iter(self.robots.values()))


class Unsuited(Exception):
    """Raised by ``MethodSpec.make`` when the method cannot work on a map; says why."""


def any_team(robots: Mapping[str, RobotSpec], item: ObjectSpec) -> None:
    """Takes every team."""


@dataclass(frozen=True)
class MethodSpec:
    """A method by name: the one row that adds it to the suite.

    make: a method for an arena; raises Unsuited. sections: classes of its settings by section, ""
    for its own level. check: raises SettingsError for a team that the method cannot drive, given
    its robots' types by name and the object. example: a scenario to start it with. open_team:
    whether robots may join and leave in the middle of a task, so that a node may take in robots
    that the scenario does not name.
    """

    name: str
    make: Callable[[Arena], Method]
    sections: Mapping[str, type[Any]] = field(default_factory=dict)
    check: Callable[[Mapping[str, RobotSpec], ObjectSpec], None] = any_team
    example: str = "swarm-square"
    open_team: bool = False

    def settings(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Settings objects by section, from nested values as a scenario has them.

        Raises
        ------
        SettingsError: an unknown key, a wrong type, a value out of range.
        """
        own = dict(values)
        made = {
            name: from_mapping(cls, own.pop(name, None), f"{self.name}.{name}")
            for name, cls in self.sections.items()
            if name
        }
        if "" in self.sections:
            made[""] = from_mapping(self.sections[""], own, self.name)
        elif own:
            raise SettingsError(f"{self.name}: unknown key '{next(iter(own))}'")
        return made


def method_spec(name: str) -> MethodSpec | None:
    """A method by the name of its entry point, or by ``module:ATTRIBUTE``; None where there is
    none.

    Raises
    ------
    SettingsError: the module cannot be imported, or the attribute is no method.
    """
    if ":" in name:
        found = from_outside(name, "method")
    else:
        entry = next((e for e in entry_points(group=ENTRY_POINTS) if e.name == name), None)
        if entry is None:
            return None
        found = entry.load()
    if not isinstance(found, MethodSpec):
        raise SettingsError(f"method '{name}': {found!r} is not a MethodSpec")
    return found


def method_names() -> tuple[str, ...]:
    """Names of all installed methods."""
    return tuple(sorted({e.name for e in entry_points(group=ENTRY_POINTS)}))
