"""How a robot on torques stops without slipping: the answer where there is no solution to follow.

Two simpler answers are unsafe. Zero torques leave it coasting for metres, and with its centre of
mass behind the axle a coasting robot turns ever tighter. A standing command locks the wheels: they
skid, and sliding wheels hold no heading.
"""

import numpy as np

from push_model.arrays import Array
from push_model.torque_robot import NO_LOAD, Load, TorqueRobot

REST_SPEED, REST_TURN = 0.03, 0.15
"""[m/s], [rad/s] below which a robot may be told to stand: locked wheels slip by a millimetre."""

_SHORTEST = 0.05  # [s] in which it stops at least
_PARTS = np.linspace(1.0, 0.0, 33)


def at_rest(v: float, omega: float) -> bool:
    """Whether wheels may be locked at a speed [m/s] and a turn rate [rad/s]."""
    return abs(v) < REST_SPEED and abs(omega) < REST_TURN


def braking_torques(
    robot: TorqueRobot,
    v: float,
    omega: float,
    friction: float,
    most: float,
    load: Load = NO_LOAD,
    share: float = 1.0,
) -> tuple[float, float]:
    """Right and left [Nm] that stop a robot soonest on its present arc, wheels rolling.

    Speed and turn rate decay in proportion. Where no deceleration keeps both wheels within their
    friction, the one is taken that exceeds it least. most: [Nm] greatest torque of a wheel.
    """
    best, margin = (0.0, 0.0), -np.inf
    for part in _PARTS:
        rate = -float(part) / _SHORTEST
        torques = robot.torques(v, omega, rate * v, rate * omega, load)
        if np.abs(torques).max() > most:
            continue
        right, left = float(torques[0]), float(torques[1])
        least = float(_margins(robot, v, omega, right, left, friction, load, share).min())
        if least >= 0.0:
            return right, left
        if least > margin:
            best, margin = (right, left), least
    return best


def _margins(
    robot: TorqueRobot,
    v: float,
    omega: float,
    right: float,
    left: float,
    friction: float,
    load: Load,
    share: float,
) -> Array:
    """Of both wheels' friction [N], and of the loads that must not be negative."""
    slip = robot.slip_margins(v, omega, right, left, friction, load, share)
    return np.append(slip, robot.loads(v, omega, right, left, load))
