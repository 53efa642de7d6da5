"""What happens to a scenario's bodies while it runs, told by ``kind``."""

from collections.abc import Set
from dataclasses import field
from typing import Literal

from push_model.settings import SettingsError, bounded, settings
from push_scenario.poses import PoseValue

_LATEST = 1e6  # [s]


@settings
class Displace:
    """An object or a robot is moved from where it is, at once and to rest, as far as nothing is in
    its way: no hand pushes a body into another one."""

    kind: Literal["displace"] = field(default="displace", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="[s] of simulation time")
    body: str = bounded(doc="an object or a robot")
    by: PoseValue = bounded(doc="dx, dy, dtheta [m, m, rad] along the world's axes")


@settings
class Place:
    """An object or a robot is put somewhere, at once and to rest, unless something is there."""

    kind: Literal["place"] = field(default="place", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="[s] of simulation time")
    body: str = bounded(doc="an object or a robot")
    pose: PoseValue = bounded(doc="x, y, theta [m, m, rad], world frame")


@settings
class Kill:
    """A robot obeys no command any more and stands where it is."""

    kind: Literal["kill"] = field(default="kill", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="[s] of simulation time")
    robot: str = bounded(doc="which")


@settings
class Remove:
    """A robot is taken out of the world; motion capture does not see it any more."""

    kind: Literal["remove"] = field(default="remove", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="[s] of simulation time")
    robot: str = bounded(doc="which")


@settings
class DropPoses:
    """Motion capture does not see some bodies for a while."""

    kind: Literal["drop_poses"] = field(default="drop_poses", kw_only=True)
    at: float = bounded(low=0.0, high=_LATEST, doc="[s] of simulation time")
    bodies: tuple[str, ...] = bounded(doc="objects and robots")
    duration: float = bounded(low=0.0, high=_LATEST, doc="[s]")


Event = Displace | Place | Kill | Remove | DropPoses


def check_names(events: tuple[Event, ...], robots: Set[str], objects: Set[str], where: str) -> None:
    """Raise SettingsError for an event of a body that is not there."""
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
