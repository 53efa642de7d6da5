"""A robot with two wheels driven by torques: its motion (2.13), and what its wheels press and pull.

Signs are explicit: the body's centre of mass lies ``ahead`` of the axle, behind it where negative.
The printed (2.13) has it behind, and so has (2.27) with the caster. Moments are taken about the
axle's line on the floor, so that the traction has no lever; (2.27)-(2.28) as printed take them
about the axle and leave out the moment of the traction.

What the robot pushes acts on it as a load ``(drag, moment)``: a force [N] against its heading, at
the height of its bumper, and a moment [Nm] about the vertical axis. The thesis leaves it out.
"""

import math
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array
from push_model.drives import TorqueDrive
from push_model.limit_surface import GRAVITY
from push_model.specs import RobotSpec

BODY_HEIGHT = -0.005
"""[m] of the body's centre of mass above the axle."""

Load = tuple[float, float]
"""Drag [N] and moment [Nm] of what is pushed."""

NO_LOAD: Load = (0.0, 0.0)


@dataclass(frozen=True)
class TorqueRobot:
    """Masses and levers. Torques (right, left) as u of (2.14).

    radius, half_track [m]: r, l. body_mass [kg]: m_c; wheel_mass [kg] of one. ahead [m]: -d.
    height [m] of the body's centre of mass above the floor. turning [kg m^2]: of all about the axle
    midpoint, wheels not rolling. rolling [kg m^2]: I_w. caster [m]: x of what carries the rest.
    met [m]: height of the bumper above the floor, where the drag acts.
    """

    radius: float
    half_track: float
    body_mass: float
    wheel_mass: float
    ahead: float
    height: float
    turning: float
    rolling: float
    caster: float
    met: float

    @staticmethod
    def of(spec: RobotSpec) -> "TorqueRobot":
        """Of a robot type.

        Raises
        ------
        ValueError: its wheels are not driven by torques, or it has not one caster behind or ahead.
        """
        drive = spec.drive
        if not isinstance(drive, TorqueDrive):
            raise ValueError("its wheels are not driven by torques")
        if len(spec.casters or ()) != 1:
            raise ValueError("the loads of its wheels are known with one caster only")
        body = spec.mass - 2.0 * drive.wheel_mass
        own = body * spec.body_radius**2 / 2.0 if spec.inertia is None else spec.inertia
        across = drive.wheel_mass * drive.wheel_radius**2 / 4.0
        wheels = 2.0 * (across + drive.wheel_mass * drive.half_track**2)
        assert spec.casters is not None
        return TorqueRobot(
            drive.wheel_radius,
            drive.half_track,
            body,
            drive.wheel_mass,
            spec.com_ahead,
            drive.wheel_radius + BODY_HEIGHT,
            own + body * spec.com_ahead**2 + wheels,
            drive.wheel_inertia,
            float(spec.casters[0]),
            spec.bumper_z,
        )

    @property
    def mass(self) -> float:
        """[kg] m_r."""
        return self.body_mass + 2.0 * self.wheel_mass

    @property
    def along(self) -> float:
        """[kg] that torques accelerate along the heading, turning wheels included."""
        return self.mass + 2.0 * self.rolling / self.radius**2

    @property
    def about(self) -> float:
        """[kg m^2] that torques turn about the axle midpoint, turning wheels included."""
        return self.turning + 2.0 * self.half_track**2 / self.radius**2 * self.rolling

    def accelerations(
        self, v: float, omega: float, right: float, left: float, load: Load = NO_LOAD
    ) -> Array:
        """(2.13): ``(2,)`` [m/s^2, rad/s^2] of the axle midpoint along the heading, and about z."""
        r, lever = self.radius, self.half_track
        pull = (right + left) / r + self.body_mass * self.ahead * omega**2 - load[0]
        turn = lever / r * (right - left) - self.body_mass * self.ahead * v * omega
        turn += load[1]
        return np.array([pull / self.along, turn / self.about])

    def torques(self, v: float, omega: float, a: float, eps: float, load: Load = NO_LOAD) -> Array:
        """``(2,)`` [Nm] right and left that give accelerations [m/s^2, rad/s^2], by (2.13)."""
        lag = self.body_mass * self.ahead
        both = self.radius * (self.along * a - lag * omega**2 + load[0])
        apart = self.radius / self.half_track * (self.about * eps + lag * v * omega - load[1])
        return np.array([0.5 * (both + apart), 0.5 * (both - apart)])

    def tractions(
        self, v: float, omega: float, right: float, left: float, load: Load = NO_LOAD
    ) -> Array:
        """``(3,)`` [N]: the floor on the right and the left wheel along the heading, and on both
        together to the left; (2.23)-(2.25) with omega' ahead + v omega, which (2.24) half leaves
        out."""
        a, eps = self.accelerations(v, omega, right, left, load)
        spin = self.rolling / self.radius
        forward = [
            (torque - spin * (a + sign * self.half_track * eps)) / self.radius
            for torque, sign in ((right, 1.0), (left, -1.0))
        ]
        return np.array([*forward, self.mass * v * omega + self.body_mass * self.ahead * eps])

    def loads(
        self, v: float, omega: float, right: float, left: float, load: Load = NO_LOAD
    ) -> Array:
        """``(3,)`` [N]: right wheel, left wheel, caster on the floor, (2.26)-(2.28)."""
        a, eps = self.accelerations(v, omega, right, left, load)
        along, across = a - self.ahead * omega**2, v * omega + self.ahead * eps
        rolling = 2.0 * (self.wheel_mass * self.radius + self.rolling / self.radius)
        held = self.body_mass * (self.ahead * GRAVITY - self.height * along) - rolling * a
        caster = (held - self.met * load[0]) / self.caster
        tilt = self.body_mass * self.height * across
        tilt += 2.0 * self.wheel_mass * self.radius * v * omega
        both, apart = self.mass * GRAVITY - caster, tilt / self.half_track
        return np.array([0.5 * (both + apart), 0.5 * (both - apart), caster])

    def slip_margins(
        self,
        v: float,
        omega: float,
        right: float,
        left: float,
        friction: float,
        load: Load = NO_LOAD,
        share: float = 1.0,
    ) -> Array:
        """``(2,)`` [N]: mu N less the traction of the right and the left wheel, (2.31)-(2.32).

        That is the friction cone (2.20)-(2.21) of the contact of a wheel, as (2.22) asks for.

        share: of the sideways traction of both that either is taken to bear. How they divide it is
        not known: (2.29)-(2.30) take all of it for each, which no division exceeds; with a half
        it is borne evenly.
        """
        f_right, f_left, aside = self.tractions(v, omega, right, left, load)
        aside *= share
        n_right, n_left, _ = self.loads(v, omega, right, left, load)
        return np.array(
            [
                friction * n_right - math.hypot(f_right, aside),
                friction * n_left - math.hypot(f_left, aside),
            ]
        )
