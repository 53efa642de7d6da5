"""Worlds by name: ``bridge.world: pybullet`` is ``KIND`` of the module ``pybullet_world``."""

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from push_model.arrays import Array
from push_model.occupancy import MapSpec
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from sim_bridge.world import World

Robots = Mapping[str, tuple[RobotSpec, Array]]
Objects = Mapping[str, tuple[ObjectSpec, Array]]


@dataclass(frozen=True)
class WorldKind:
    """A kind of world.

    settings: class of its settings, ``bridge.physics`` of a scenario.
    make: builds one from environment, robots, objects (name to type and start pose ``(3,)``),
        settings and the control tick [s], which is a whole number of its physics steps.
    """

    settings: type[Any]
    make: Callable[[EnvironmentSpec | MapSpec, Robots, Objects, Any, float], World]


def world_names() -> list[str]:
    """Names of the worlds that there are."""
    return sorted(p.stem.removesuffix("_world") for p in Path(__file__).parent.glob("*_world.py"))


def world_kind(name: str) -> WorldKind:
    """The kind of world of a name.

    Raises
    ------
    SettingsError: there is none.
    """
    if name not in world_names():
        raise SettingsError(
            f"bridge.world: unknown world '{name}'; expected one of: {', '.join(world_names())}"
        )
    kind: WorldKind = importlib.import_module(f"sim_bridge.{name}_world").KIND
    return kind


def steps_of(tick: float, longest: float) -> int:
    """Physics steps of a control tick [s] when none may be longer than that [s]."""
    return max(1, math.ceil(tick / longest - 1e-9))
