"""How an object moves in front of a flat bumper, for many frictions and centres of mass at once.

The model is quasi-static: an ellipsoidal limit surface (3.4) and Coulomb friction at the bumper.
The object turns with the bumper as long as the line of force passes between the ends of the
contact (S3). It sticks while the force lies inside the friction cone, and slides with the force at
the edge of the cone otherwise. Where the line of force would pass beyond an end, the object pivots
about that end. An object that is not flush touches the bumper at one end only.

All is given in the frame of the pushed side: origin in the middle of the side, x into the object,
y to the left. The state of the bumper in this frame is the position q of its middle along the side
and its heading phi, which is zero when the bumper is flush.
"""

from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array, Mask

_TINY = 1e-9


@dataclass(frozen=True)
class Bumper:
    """distance: [m] D, from the axle forward to the face. half_width: [m] of the face."""

    distance: float
    half_width: float


@dataclass(frozen=True)
class Candidates:
    """What may be true. friction: ``(n,)`` of the contact. depth, aside: ``(n,)`` [m] centre of
    mass in the frame of the side. radius: ``(n,)`` [m] c of the limit surface."""

    friction: Array
    depth: Array
    aside: Array
    radius: Array


def relative_rates(
    candidates: Candidates, bumper: Bumper, side: float, q: Array, phi: Array, drive: Array
) -> tuple[Array, Array]:
    """Rates of q [m/s] and phi [rad/s] for each candidate.

    Parameters
    ----------
    side: [m] length of the pushed side.
    q, phi: ``(n,)`` state for each candidate; phi is exactly 0 where the bumper is flush.
    drive: ``(2,)`` v [m/s] and omega [rad/s] of the robot.
    """
    c, (v, omega) = candidates, drive
    half, end = bumper.half_width, side / 2.0
    right, left = np.maximum(q - half, -end), np.minimum(q + half, end)

    # Line contact: the object turns with the robot.
    ahead = v - omega * (c.aside - q)
    most = c.friction * np.maximum(ahead, 0.0)
    across = np.clip(omega * (bumper.distance + c.depth), -most, most)
    force_at = c.aside - (c.depth * across + c.radius**2 * omega) / np.maximum(ahead, _TINY)
    turn = np.full_like(ahead, omega)

    flush = phi == 0.0
    pivots = np.where(flush, (force_at > left) | (force_at < right), True)
    if pivots.any():
        at_left = np.where(flush, force_at > left, phi < 0.0)
        point = np.where(at_left, left, right)
        arm = np.where(flush, point - q, np.where(at_left, half, -half))
        one = _point_contact(c, bumper, phi, point, arm, drive)
        ahead = np.where(pivots, one[0], ahead)
        across = np.where(pivots, one[1], across)
        turn = np.where(pivots, one[2], turn)

    # The middle of the bumper moves, and so does the material point of the object below it.
    cos, sin = np.cos(phi), np.sin(phi)
    middle = sin * v + cos * omega * bumper.distance
    behind = np.where(flush, 0.0, -half * np.abs(sin))
    moves = np.where(ahead > 0.0, 1.0, 0.0)
    return middle - moves * (across + turn * (behind - c.depth)), omega - moves * turn


def _point_contact(
    c: Candidates, bumper: Bumper, phi: Array, point: Array, arm: Array, drive: Array
) -> tuple[Array, Array, Array]:
    """Velocity of the centre of mass and turn rate ``(n,)`` each of an object that is pushed at one
    point: at ``point`` [m] along the side, ``arm`` [m] to the left of the bumper's middle."""
    v, omega = drive
    cos, sin = np.cos(phi), np.sin(phi)
    forward, sideways = v - omega * arm, omega * bumper.distance
    vx, vy = cos * forward - sin * sideways, sin * forward + cos * sideways
    a, b, square = c.depth, point - c.aside, c.radius**2
    turn = -(a * vy + b * vx) / (square + a**2 + b**2)
    ahead, across = vx + turn * b, vy + turn * a
    slides: Mask = np.abs(across) > c.friction * ahead
    if slides.any():
        edge = np.sign(across) * c.friction
        lever = (a * edge + b) / square
        share = np.maximum(1.0 + b * lever, 0.1)
        sliding = vx / share
        ahead = np.where(slides, sliding, ahead)
        across = np.where(slides, edge * sliding, across)
        turn = np.where(slides, -lever * sliding, turn)
    return ahead, across, turn


def followed(
    candidates: Candidates,
    bumper: Bumper,
    side: float,
    start: tuple[float, float],
    drives: Array,
    step: float,
) -> tuple[Array, Array]:
    """q and phi ``(n, k + 1)`` while the robot drives ``(k, 2)`` v, omega, each for a step [s].

    start: q [m] and phi [rad] at the beginning, the same for all candidates; phi is 0 for a flush
    contact. An object that closes on the bumper is flush from then on.
    """
    n = len(candidates.friction)
    q, phi = np.full(n, start[0]), np.full(n, start[1])
    found_q, found_phi = [q], [phi]
    for drive in drives:
        rate_q, rate_phi = relative_rates(candidates, bumper, side, q, phi, drive)
        q, after = q + step * rate_q, phi + step * rate_phi
        phi = np.where((phi != 0.0) & (after * phi <= 0.0), 0.0, after)
        found_q.append(q)
        found_phi.append(phi)
    return np.stack(found_q, axis=1), np.stack(found_phi, axis=1)
