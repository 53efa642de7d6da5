"""Levels of actions: numbers between -1 and 1 become twists of the robots."""

import math

import numpy as np

from push_gym.settings import EnvSettings
from push_model.arrays import Array
from push_model.settings import SettingsError
from push_model.specs import RobotSpec

PUSH_SIZE = 3
"""Numbers of an action of the level "push"."""


def action_size(settings: EnvSettings, robot: RobotSpec) -> int:
    """Numbers of an action, for all robots together.

    Raises
    ------
    SettingsError: "wheels", and the robots have none.
    """
    if settings.action == "push":
        return PUSH_SIZE
    return settings.robots * robot_action_size(settings.action, robot)


def robot_action_size(level: str, robot: RobotSpec) -> int:
    """Numbers of an action of one robot."""
    wheels = robot.kinematics is not None
    if level == "wheels" and not wheels:
        raise SettingsError("action 'wheels': the robots have none; use 'twist'")
    return 2 if wheels else 3


def checked(actions: object, shape: tuple[int, ...], what: str) -> Array:
    """Actions as numbers of a shape ``(…, k)``; an equal number of them in another shape will do.

    Raises
    ------
    ValueError: another number of them, or one that is not finite.
    """
    told = np.asarray(actions, dtype=np.float64)
    if told.size != math.prod(shape):
        raise ValueError(f"action: expected {math.prod(shape)} numbers ({what}), got {told.size}")
    if not np.isfinite(told).all():
        raise ValueError(f"action: expected finite numbers, got {told.tolist()}")
    return told.reshape(shape)


def twists(level: str, robot: RobotSpec, actions: Array) -> Array:
    """Twists ``(…, robots, 3)`` [m/s, m/s, rad/s], robot frame, of actions ``(…, robots, k)``.

    Parameters
    ----------
    level: "wheels": left and right wheel, of their greatest speed. "twist": forward speed and turn
        rate, of the robot's greatest; forward, left and turn rate of robots without wheels.
    """
    told = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0)
    result = np.zeros((*told.shape[:-1], 3))
    if level == "wheels":
        drive = robot.differential
        wheels: Array = drive.max_wheel_speed * told
        result[..., 0], result[..., 2] = drive.twist(wheels[..., 0], wheels[..., 1])
        return result
    result[..., 0] = robot.max_speed * told[..., 0]
    if robot.kinematics is None:
        result[..., 1] = robot.max_speed * told[..., 1]
    result[..., 2] = robot.max_turn_rate * told[..., -1]
    return result
