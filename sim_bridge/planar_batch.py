"""Many planar worlds at once: the same bodies in each, in states of their own.

Each world moves as a ``PlanarWorld`` with the same target twists does, to the bit, whatever the
others do; what is saved is the way through Python, once a call instead of once a world.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from push_model.arrays import Array, Mask, Rows
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from sim_bridge.planar.batch import advance_all, of_world, stacked
from sim_bridge.planar.tables import grown, make_contacts, make_sums, make_tables
from sim_bridge.planar_world import PlanarSettings


class PlanarBatch:
    """``count`` worlds of the same robots, all of one type, and objects.

    Poses ``(count, bodies, 3)`` are of robots, then objects, in their frames as in ``PlanarWorld``.
    """

    def __init__(
        self,
        count: int,
        environment: EnvironmentSpec,
        robots: Sequence[RobotSpec],
        objects: Sequence[ObjectSpec],
        physics: PlanarSettings | None = None,
    ) -> None:
        """All bodies are at rest in the origin until they are placed.

        Raises
        ------
        ValueError: robots of several types.
        SettingsError: a robot is driven by torques.
        """
        if len(set(robots)) > 1:
            raise ValueError("a batch takes robots of one type")
        self.physics = physics or PlanarSettings()
        self.count, self._robots = count, len(robots)
        nowhere = np.zeros(3)
        made: Mapping[str, tuple[RobotSpec, Array]]
        made = {f"robot{i}": (robot, nowhere) for i, robot in enumerate(robots)}
        items = {f"object{i}": (item, nowhere) for i, item in enumerate(objects)}
        tables = make_tables(environment, made, items)
        self._bodies = stacked(tables.bodies, count)
        self._parts, self._near = stacked(tables.parts, count), stacked(tables.near, count)
        self._contacts = stacked(make_contacts(tables.room), count)
        self._sums = make_sums(1)  # not kept
        self._centres, self._largest = tables.centres, tables.largest
        self._off_centre = bool(self._centres.any())
        self._drive = robots[0].drive if robots else None

    @property
    def time_step(self) -> float:
        """[s] of a physics step."""
        return self.physics.time_step

    def place(self, worlds: Rows, poses: Array) -> None:
        """Put all bodies of some worlds at poses ``(k, bodies, 3)``, at rest.

        Raises
        ------
        ValueError: not finite.
        """
        if not np.isfinite(poses).all():
            raise ValueError("poses are not finite")
        b, mass = self._bodies, np.array(poses, dtype=np.float64)
        if self._off_centre:
            mass[..., :2] += self._turned(mass[..., 2])
        b.pose[worlds] = mass
        b.velocity[worlds] = b.target[worlds] = 0.0
        b.given[worlds] = 0.0
        self._contacts.number[worlds] = 0
        self._contacts.table[worlds] = -1

    def _turned(self, angles: Array) -> Array:
        """``(…, bodies, 2)`` [m] from frames to centres of mass."""
        c, s = np.cos(angles), np.sin(angles)
        x, y = self._centres.T
        return np.stack([c * x - s * y, s * x + c * y], axis=-1)

    def command(self, twists: Array) -> None:
        """Set the twists ``(count, robots, 3)`` [m/s, m/s, rad/s] of all robots, in their own
        frames, scaled to what their drives can do; robots on wheels do not heed the second column.

        Raises
        ------
        ValueError: not finite.
        """
        if not np.isfinite(twists).all():
            raise ValueError("commands are not finite")
        if self._drive is not None:
            self._bodies.target[:, : self._robots] = self._drive.saturate_all(twists)

    def step(self, steps: int = 1, still: Mask | None = None) -> None:
        """Advance by physics steps; worlds of the mask ``(count,)`` stand still."""
        s, done = self.physics, np.zeros(self.count, dtype=np.int64)
        if still is not None:
            done[still] = steps
        while True:
            full = advance_all(
                steps,
                s.time_step,
                s.solver_iterations,
                s.tolerance,
                self._bodies,
                self._parts,
                self._near,
                self._contacts,
                self._sums,
                self._largest,
                done,
            )
            if full < 0:
                return
            larger = [grown(of_world(self._contacts, w)) for w in range(self.count)]
            self._contacts = type(larger[0])(
                *(np.array(rows) for rows in zip(*larger, strict=True))
            )

    @property
    def poses(self) -> Array:
        """Ground truth ``(count, bodies, 3)``."""
        table: Array = self._bodies.pose.copy()
        if self._off_centre:
            table[..., :2] -= self._turned(table[..., 2])
        table[..., 2] -= 2.0 * math.pi * np.round(table[..., 2] / (2.0 * math.pi))
        return table

    @property
    def velocities(self) -> Array:
        """Ground truth twists ``(count, bodies, 3)`` of the centres of mass, world frame."""
        twists: Array = self._bodies.velocity.copy()
        return twists
