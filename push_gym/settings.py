"""What an environment is made of: bodies, room, tolerances, actions and rewards."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Literal, TypeVar

from push_model.settings import SettingsError, bounded, from_mapping, settings
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.files import read_named

SYSTEMS = ("single", "group", "swarm")
T = TypeVar("T", RobotSpec, ObjectSpec, EnvironmentSpec)


@settings
class EnvSettings:
    """Everything that ``gymnasium.make("PlanarPush/…-v0", …)`` takes."""

    robot: Any = bounded(
        "epuck_ring", doc="Type of all robots: a name in config/robots, a path, or its fields."
    )
    robots: int = bounded(3, low=1, high=200, doc="Number of robots.")
    object: Any = bounded(
        "plate_square", doc="Type of the object: a name in config/objects, a path, or its fields."
    )
    room: Any = bounded(
        (2.4, 2.0),
        doc="Width and height (m) of an empty room about the origin, a name in "
        "config/environments, a path, or the fields of an environment.",
    )
    action: Literal["wheels", "twist", "push"] = bounded(
        "twist",
        doc="Level of the actions: speeds of the wheels, twists of the robots, or whole pushes "
        "by the suite's own method.",
    )
    reward: Literal["dense", "sparse"] = bounded(
        "dense",
        doc="Reward of a step. With dense, minus the distance from the goal (m), where a turn of "
        "1 rad counts as the object's radius of gyration; with sparse, -1, and 0 at the goal.",
    )
    period: float = bounded(
        0.1, low=0.01, high=1.0, doc="Time between two actions (s); not for pushes."
    )
    time_step: float = bounded(5e-3, low=1e-4, high=2e-2, doc="Longest physics step (s).")
    horizon: float = bounded(
        60.0, low=0.1, high=1e5, doc="Simulated time after which an episode is truncated (s)."
    )
    position_tolerance: float = bounded(
        0.02, low=1e-4, high=10.0, doc="Distance at which the goal counts as reached (m)."
    )
    orientation_tolerance: float | None = bounded(
        0.1,
        low=1e-3,
        high=3.15,
        doc="Heading error at which the goal counts as reached (rad); none: any heading.",
    )

    @property
    def robot_spec(self) -> RobotSpec:
        """Of all robots; raises SettingsError."""
        return _spec(RobotSpec, "robots", self.robot, "robot")

    @property
    def object_spec(self) -> ObjectSpec:
        """Of the object; raises SettingsError."""
        return _spec(ObjectSpec, "objects", self.object, "object")

    @property
    def environment(self) -> EnvironmentSpec:
        """The room; raises SettingsError."""
        if isinstance(self.room, tuple | list):
            return from_mapping(EnvironmentSpec, {"size": self.room, "resolution": 0.02}, "room")
        return _spec(EnvironmentSpec, "environments", self.room, "room")


DEFAULTS: dict[str, EnvSettings] = {
    "single": EnvSettings(robot="epuck", robots=1, object="box9", room=(2.0, 1.6), horizon=90.0),
    "group": EnvSettings(horizon=120.0),
    "swarm": EnvSettings(
        robots=12,
        object="swarm_square",
        room=(4.0, 3.0),
        horizon=300.0,
        position_tolerance=0.1,
        orientation_tolerance=None,
    ),
}
"""By system."""


def env_settings(system: str, values: Mapping[str, Any]) -> EnvSettings:
    """A system's settings, with the values that somebody gives.

    Raises
    ------
    SettingsError: an unknown name, a wrong type, a value out of range, a period for the level
        "push", whose actions last as long as they need.
    """
    if system not in DEFAULTS:
        raise SettingsError(f"system '{system}': expected one of {', '.join(SYSTEMS)}")
    known = [f.name for f in fields(EnvSettings)]
    for name in values:
        if name not in known:
            raise SettingsError(f"unknown setting '{name}'; known: {', '.join(known)}")
    made = replace(DEFAULTS[system], **values)
    if made.action == "push" and "period" in values:
        raise SettingsError(
            "period: an action of the level 'push' lasts until the push has ended; leave it out"
        )
    return made


def changed_object(item: ObjectSpec, told: Any) -> ObjectSpec:
    """Another object: a name, a path, or fields which replace those of ``item``."""
    if not isinstance(told, Mapping):
        return _spec(ObjectSpec, "objects", told, "object")
    own = {f.name: getattr(item, f.name) for f in fields(item)}
    return from_mapping(ObjectSpec, {**own, **told}, "object")


def _spec(cls: type[T], kind: str, told: Any, where: str) -> T:
    if isinstance(told, cls):
        return told
    values, source, _ = read_named(kind, told, where, None)
    if not isinstance(values, Mapping):
        raise SettingsError(f"{source}: expected a name or a mapping, got {values!r}")
    return from_mapping(cls, values, source)
