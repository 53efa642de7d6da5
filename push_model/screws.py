"""Screw motions: motions with one constant twist, and the one between two poses."""

import math

import numpy as np

from push_model import se2
from push_model.arrays import Array


def point_velocities(twist: Array, points: Array) -> Array:
    """Velocities ``(n, 2)`` [m/s] of points ``(n, 2)`` [m] of a body with a twist ``(3,)``, all in
    its frame."""
    return np.column_stack([twist[0] - twist[2] * points[:, 1], twist[1] + twist[2] * points[:, 0]])


def screw_poses(start: Array, motion: Array, part: Array) -> Array:
    """Poses ``(k, 3)`` after fractions ``(k,)`` of a screw motion, headings continuous."""
    angle = motion[2] * part
    sine, rest = np.sinc(angle / math.pi), _versine(angle)
    x = part * (sine * motion[0] - rest * motion[1])
    y = part * (rest * motion[0] + sine * motion[1])
    c, s = math.cos(start[2]), math.sin(start[2])
    return np.column_stack([start[0] + c * x - s * y, start[1] + s * x + c * y, start[2] + angle])


def screw_between(start: Array, goal: Array) -> Array:
    """The screw motion ``(3,)``, in the frame at start, from start to goal by the shorter turn."""
    local = se2.between(start, goal)
    angle = float(local[2])
    sine, rest = float(np.sinc(angle / math.pi)), float(_versine(np.array([angle]))[0])
    vx, vy = np.linalg.solve([[sine, -rest], [rest, sine]], local[:2])
    return np.array([vx, vy, angle])


def _versine(angle: Array) -> Array:
    """(1 - cos a) / a."""
    half = 0.5 * np.asarray(angle)
    result: Array = np.sin(half) * np.sinc(half / math.pi)
    return result
