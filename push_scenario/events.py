"""Events that happen to the bodies of a scenario while it runs, chosen by ``kind``."""

from collections.abc import Set
from dataclasses import field
from typing import Literal

from push_model.settings import SettingsError, bounded, settings
from push_scenario.poses import PoseValue

_LATEST = 1e6  # [s]


@settings
class Displace:
    """An object or a robot is moved instantly and left at rest. It stops in front of anything that
    is in its way."""

    kind: Literal["displace"] = field(default="displace", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="Simulation time of the event (s)")
    body: str = bounded(doc="Name of an object or a robot")
    by: PoseValue = bounded(
        doc="Displacement dx, dy, dtheta [m, m, rad] along the axes of the world frame"
    )


@settings
class Place:
    """An object or a robot is put somewhere instantly, at rest, unless something is there."""

    kind: Literal["place"] = field(default="place", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="Simulation time of the event (s)")
    body: str = bounded(doc="Name of an object or a robot")
    pose: PoseValue = bounded(doc="Pose x, y, theta [m, m, rad] in the world frame")


@settings
class Kill:
    """A robot ignores all commands from now on and does not move."""

    kind: Literal["kill"] = field(default="kill", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="Simulation time of the event (s)")
    robot: str = bounded(doc="Name of the robot")


@settings
class Remove:
    """A robot is removed from the world and from motion capture."""

    kind: Literal["remove"] = field(default="remove", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="Simulation time of the event (s)")
    robot: str = bounded(doc="Name of the robot")


@settings
class DropPoses:
    """Motion capture does not see some bodies for a while."""

    kind: Literal["drop_poses"] = field(default="drop_poses", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="Simulation time of the event (s)")
    bodies: tuple[str, ...] = bounded(doc="Names of objects and robots")
    duration: float = bounded(
        low=0.0, high=_LATEST, doc="Duration for which the bodies are not seen (s)"
    )


Event = Displace | Place | Kill | Remove | DropPoses


def check_names(events: tuple[Event, ...], robots: Set[str], objects: Set[str], where: str) -> None:
    """Raise SettingsError for an event that names an unknown body."""
    names: tuple[str, ...]
    for i, event in enumerate(events):
        if isinstance(event, Kill | Remove):
            names, known, key = (event.robot,), robots, "robot"
        elif isinstance(event, DropPoses):
            names, known, key = event.bodies, robots | objects, "bodies"
        else:
            names, known, key = (event.body,), robots | objects, "body"
        for name in names:
            if name not in known:
                raise SettingsError(
                    f"{where}[{i}].{key}: unknown '{name}'; expected one of: "
                    + ", ".join(sorted(known))
                )
