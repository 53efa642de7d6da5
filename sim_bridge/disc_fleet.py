"""Robots that move in any direction: discs whose traction is bounded, all served by arrays.

Each is a sphere as wide as its ring, with its centre at the ring's height: it touches at that
height and at one point. It does not touch the floor, and is kept upright and at its height. What
stands for its wheels is a velocity servo of bounded force, so that a jam is pushed with that force
and no more.
"""

from collections.abc import Mapping

import numpy as np
import pybullet as pb

from push_model.arrays import Array, Rows
from push_model.drives import HolonomicDrive
from push_model.limit_surface import GRAVITY
from push_model.specs import RobotSpec
from sim_bridge.collision_groups import DISC, set_group

_UPRIGHT = 1e3
"""Moment of inertia against tilting, over the one about the vertical."""
_RISE = 0.05
"""Part of an error in height that is made good in one step."""
_LOAD_FILTER = 0.2
"""Part by which the estimate of the load follows one step's."""


class DiscFleet:
    """Every holonomic robot of one PyBullet world; arrays have a row each."""

    def __init__(
        self,
        client: int,
        robots: Mapping[str, tuple[RobotSpec, HolonomicDrive, Array]],
        time_step: float,
        robot_surface: float = 1.0,
    ) -> None:
        """robots: name to type, drive and start ``(3,)``; time_step: [s]; robot_surface: see
        ``robot_surface``."""
        self._surface = robot_surface
        self._client, self._dt = client, time_step
        self.names = tuple(robots)
        specs = [spec for spec, _, _ in robots.values()]
        drives = [drive for _, drive, _ in robots.values()]
        self._height = np.array([s.bumper_z for s in specs])
        self._mass = np.array([s.mass for s in specs])
        self._max_speed = np.array([d.max_speed for d in drives])
        self._max_turn = np.array([d.max_turn_rate for d in drives])
        self._max_force = np.array([d.max_force for d in drives])
        radius = np.array([s.footprint_radius for s in specs])
        inertia = 0.5 * self._mass * radius**2
        for i, s in enumerate(specs):
            inertia[i] = inertia[i] if s.inertia is None else s.inertia
        # A disc on its rim: the force that it can push with, at two thirds of its radius.
        self._max_spin = self._max_force * radius * 2.0 / 3.0 / inertia  # [rad/s^2]
        shapes = {
            r: pb.createCollisionShape(pb.GEOM_SPHERE, radius=r, physicsClientId=client)
            for r in sorted({float(r) for r in radius})
        }
        starts = [[*start[:2].tolist(), s.bumper_z] for s, _, start in robots.values()]
        self.bodies = [
            self._make(shapes[float(r)], float(m), float(i), start)
            for r, m, i, start in zip(radius, self._mass, inertia, starts, strict=True)
        ]
        n = len(self.bodies)
        self._target = np.zeros((n, 3))
        self._in_own_frame = np.ones(n, dtype=bool)
        self._heading, self._rise = np.zeros(n), np.zeros(n)
        self._before, self._given, self._load = (np.zeros((n, 3)) for _ in range(3))
        for i, (_, _, start) in enumerate(robots.values()):
            self.place(i, start)

    def _make(self, shape: int, mass: float, inertia: float, start: list[float]) -> int:
        """Create a disc at its start: discs in one place would all be compared with each other."""
        client = self._client
        body: int = pb.createMultiBody(mass, shape, basePosition=start, physicsClientId=client)
        pb.changeDynamics(body, -1, lateralFriction=self._surface, physicsClientId=client)
        pb.changeDynamics(
            body,
            -1,
            linearDamping=0.0,
            angularDamping=0.0,
            restitution=0.0,
            rollingFriction=0.0,
            spinningFriction=0.0,
            localInertiaDiagonal=[_UPRIGHT * inertia, _UPRIGHT * inertia, inertia],
            activationState=pb.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=client,
        )
        set_group(client, body, -1, DISC)
        return body

    def place(self, index: int, pose: Array) -> None:
        """Put a robot at a pose ``(3,)``, at rest."""
        x, y, theta = (float(v) for v in pose)
        pb.resetBasePositionAndOrientation(
            self.bodies[index],
            [x, y, float(self._height[index])],
            pb.getQuaternionFromEuler([0.0, 0.0, theta]),
            physicsClientId=self._client,
        )
        pb.resetBaseVelocity(self.bodies[index], [0, 0, 0], [0, 0, 0], physicsClientId=self._client)
        for array in (self._target, self._before, self._given, self._load):
            array[index] = 0.0

    def command(self, rows: Rows, twists: Array, fixed_frame: bool) -> None:
        """Set the twists ``(k, 3)`` of some rows, scaled down to what each can do."""
        need = np.maximum(
            np.hypot(twists[:, 0], twists[:, 1]) / self._max_speed[rows],
            np.abs(twists[:, 2]) / self._max_turn[rows],
        )
        self._target[rows] = twists / np.maximum(need, 1.0)[:, None]
        self._in_own_frame[rows] = not fixed_frame

    def begin(self, positions: Array, headings: Array) -> None:
        """Where the discs are now: positions ``(n, 3)`` [m], headings ``(n,)`` [rad]."""
        self._heading = headings.copy()
        self._rise = self._height - positions[:, 2]

    def before_step(self) -> None:
        """Give each disc the velocity that a step's traction makes of its own.

        The force is the one that would reach the target in one step without a load, plus the load
        that was felt, bounded. The load is what the last step's change of velocity lacks.
        """
        client, dt = self._client, self._dt
        raw = [pb.getBaseVelocity(b, physicsClientId=client) for b in self.bodies]
        v = np.array([(u[0], u[1], w[2]) for u, w in raw])
        felt = v - self._before - self._given
        self._load += _LOAD_FILTER * (felt - self._load)
        wanted = self._target
        if self._in_own_frame.any():
            turn = np.where(self._in_own_frame, self._heading, 0.0)
            c, s = np.cos(turn), np.sin(turn)
            wanted = wanted.copy()
            wanted[:, 0] = c * self._target[:, 0] - s * self._target[:, 1]
            wanted[:, 1] = s * self._target[:, 0] + c * self._target[:, 1]
        change = wanted - v - self._load
        most = self._max_force / self._mass * dt
        size = np.hypot(change[:, 0], change[:, 1])
        change[:, :2] *= np.minimum(1.0, most / np.maximum(size, 1e-12))[:, None]
        spin = self._max_spin * dt
        change[:, 2] = np.clip(change[:, 2], -spin, spin)
        self._before, self._given = v, change
        self._heading = self._heading + dt * v[:, 2]
        up = GRAVITY * dt + _RISE * self._rise / dt
        self._rise = (1.0 - _RISE) * self._rise
        new = v + change
        for body, (x, y, w), z in zip(self.bodies, new.tolist(), up.tolist(), strict=True):
            pb.resetBaseVelocity(body, (x, y, z), (0.0, 0.0, w), physicsClientId=client)
