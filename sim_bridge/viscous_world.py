"""The planar world with another floor: it resists objects by a force that grows with their speed.

No Coulomb friction acts under an object, so whoever pushes it moves it, if only slowly. Contacts,
robots and walls are those of the planar world. Simulations in which objects creep can be compared
with ours in this world (docs/rivals.md, Gibbs field).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from push_model.arrays import Array
from push_model.occupancy import MapSpec
from push_model.settings import bounded, settings
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from sim_bridge.planar.constraints import OBJECT
from sim_bridge.planar_world import PlanarSettings, PlanarWorld
from sim_bridge.worlds import Objects, Robots, WorldKind, steps_of

_NO_FRICTION = 1e-6  # part of the floor's friction that is left, because its law divides by it


@settings
class ViscousSettings(PlanarSettings):
    """Step and solver of the planar world, and the drag of the floor."""

    drag: float = bounded(
        300.0,
        low=1e-3,
        high=1e5,
        doc="Force of the floor on a sliding object over its speed (N s/m). The drag acts evenly "
        "over the mass of the object, so that the floor also resists turns.",
    )


class ViscousWorld(PlanarWorld):
    """A running simulation. The drag is solved implicitly: no step is too long for it."""

    def __init__(
        self,
        environment: EnvironmentSpec | MapSpec,
        robots: Mapping[str, tuple[RobotSpec, Array]],
        objects: Mapping[str, tuple[ObjectSpec, Array]],
        physics: ViscousSettings | None = None,
    ) -> None:
        """Build the world; the arguments are those of ``PlanarWorld``."""
        physics = physics or ViscousSettings()
        super().__init__(environment, robots, objects, physics)
        b = self._bodies
        self._dragged = np.flatnonzero(b.kind == OBJECT)
        # m (v' - v) = p - drag dt v' is the step of a mass m + drag dt that moves at m / (m + drag
        # dt) v before; p is the impulse of all contacts.
        slower = 1.0 / (1.0 + physics.drag * physics.time_step * b.inverse[self._dragged, :1])
        b.inverse[self._dragged] *= slower
        b.floor[self._dragged] *= _NO_FRICTION
        self._slower = slower

    def step(self, count: int = 1, contacts: bool = True) -> None:
        """Advance by physics steps; contacts of every step are added up until they are read."""
        for _ in range(count):
            self._bodies.velocity[self._dragged] *= self._slower
            super().step(1, contacts)


def _make(
    environment: EnvironmentSpec | MapSpec,
    robots: Robots,
    objects: Objects,
    physics: ViscousSettings,
    tick: float,
) -> ViscousWorld:
    step = tick / steps_of(tick, physics.time_step)
    return ViscousWorld(environment, robots, objects, replace(physics, time_step=step))


KIND = WorldKind(ViscousSettings, _make)
