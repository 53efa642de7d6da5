"""Control of a group that pushes an object along a trajectory, section 3.2.2. No ROS, no clock.

(3.20) says which wrench the object needs, (3.22)-(3.24) which forces within the friction cones come
nearest to it, (3.25) how robots whose velocities are commanded make them. As printed, a robot moves
along its force. Here robots follow the twist of the object that the forces can make, by its limit
surface, as if they were fixed to it, and those that are to carry more than their share go ahead a
little (docs/errata.md).

The contacts are where the robots are now, not where they were placed: a robot with a ring that
turns rolls along the object, by the ring's radius times the turn. Robots that are held against that
drag the object aside, so they are only led back slowly.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import nnls

from grasp_opt.contact_outline import ContactOutline, Contacts
from push_model import se2
from push_model.arrays import Array, Mask
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.limit_surface import EllipsoidLimitSurface
from push_model.screws import point_velocities
from push_model.settings import bounded, settings

_SQUARES = 1e-3  # weight of forces beside the wrench that they lack

_SLANT = 0.2  # cosine of the greatest angle between a robot's way to the object and the normal


@settings
class GroupControlSettings:
    """Gains of (3.20) and (3.25)."""

    law: Literal["twist", "printed"] = bounded(
        "twist",
        doc="Control law of the robots: 'twist' (they follow the feasible twist of the object) "
        "or 'printed' (they follow their contact forces, (3.25) of the thesis as printed).",
    )
    position_gain: float = bounded(
        40.0,
        low=0.0,
        high=1e4,
        doc="Proportional gain K_P of (3.20) of the thesis: force per position error of the "
        "object (N/m).",
    )
    orientation_gain: float = bounded(
        6.0,
        low=0.0,
        high=1e4,
        doc="Proportional gain K_P of (3.20) of the thesis: torque per orientation error of "
        "the object (Nm/rad).",
    )
    velocity_gain: float = bounded(
        2.0,
        low=0.0,
        high=1e4,
        doc="Derivative gain K_D of (3.20) of the thesis: force per velocity error of the "
        "object (N s/m).",
    )
    turning_gain: float = bounded(
        0.1,
        low=0.0,
        high=1e4,
        doc="Derivative gain K_D of (3.20) of the thesis: torque per turn rate error of the "
        "object (Nm s/rad).",
    )
    place_gain: float = bounded(
        0.05,
        low=0.0,
        high=100.0,
        doc="Gain K_PR of (3.25) of the thesis: speed of a robot along the outline per distance "
        "from its place (1/s).",
    )
    gap_gain: float = bounded(
        2.0,
        low=0.0,
        high=100.0,
        doc="Speed at which a robot closes its gap to the object, divided by the gap (1/s).",
    )
    lost: float = bounded(
        5e-3,
        low=1e-4,
        high=1.0,
        doc="Gap between robot and object above which the robot counts as out of contact (m).",
    )
    approach: float = bounded(
        0.02,
        low=0.0,
        high=1.0,
        doc="Highest speed relative to the object at which a robot closes its gap to the "
        "object (m/s).",
    )
    force_gain: float = bounded(
        0.002,
        low=0.0,
        high=10.0,
        doc="Gain K_VR of (3.25) of the thesis: robot speed per contact force (m/s/N).",
    )
    correction: float = bounded(
        2.0,
        low=1.0,
        high=10.0,
        doc="Highest speed of the object while errors are corrected, as a multiple of the "
        "speed of the trajectory (dimensionless).",
    )
    apart: float = bounded(
        8e-3, low=0.0, high=1.0, doc="Gap between two robots below which they are driven apart (m)."
    )
    apart_gain: float = bounded(
        0.5,
        low=0.0,
        high=100.0,
        doc="Speed at which two robots are driven apart, divided by the missing gap (1/s).",
    )
    lead: float = bounded(
        0.025,
        low=1e-3,
        high=1.0,
        doc="Distance ahead of the axle of the point whose velocity a robot on wheels controls "
        "(m).",
    )
    pose_delay: float = bounded(
        0.0,
        low=0.0,
        high=1.0,
        doc="Latency of the pose stream that the group compensates, from measurement to "
        "command (s).",
    )


PRINTED_LAW = GroupControlSettings(
    law="printed",
    position_gain=1000.0,
    orientation_gain=100.0,
    force_gain=0.09,
    place_gain=1.0,
)
"""Gains with which (3.25) as printed works: a push ahead of some robots on flat sides, or of two on
the ellipse, at 0.05 m/s.

Sliding friction does not depend on speed, so that the printed law goes at ``force_gain`` times a
robot's share of it, whatever the trajectory asks for. Only errors of the object, through stiff
gains of (3.20), bring it to the trajectory's speed. Robots move along their forces, not with the
object: on turns, and where robots on a curved outline carry unlike forces, they come apart."""


@dataclass(frozen=True)
class GroupCommand:
    """What one tick asks for.

    wrench ``(3,)`` in the object's frame; forces ``(n, 2)`` [N] likewise; lacking: part of the
    wrench that they do not make; gaps ``(n,)`` [m] between robots and object; contacts: where the
    robots are now; velocities ``(n, 2)`` [m/s] of robots in the world's frame; twist ``(3,)`` that
    the forces give the object, in its frame.
    """

    wrench: Array
    forces: Array
    lacking: float
    gaps: Array
    contacts: Contacts
    velocities: Array
    twist: Array


def distribute(wrench: Array, contacts: Contacts, friction: float, length: float) -> Array:
    """(3.22)-(3.24): forces ``(n, 2)`` [N] within the cones that come nearest to a wrench ``(3,)``.

    Torques count as forces at ``length`` [m]; of equal ones the least.
    """
    n = len(contacts.points)
    scale = np.array([1.0, 1.0, length])
    G = grasp_matrix(contacts.points) / scale[:, None]
    spread = np.zeros((2 * n, 2 * n))
    for i, normal in enumerate(contacts.normals):
        spread[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = cone_edges(normal, friction).T
    A = np.vstack([G @ spread, _SQUARES * spread])
    answer, _ = nnls(A, np.concatenate([wrench / scale, np.zeros(2 * n)]))
    forces: Array = (spread @ answer).reshape(n, 2)
    return forces


class GroupController:
    """One group on one object, placed at ``ways (n,)`` [m] along its outline.

    offsets: ``(n,)`` [m] gaps to the believed outline at which the robots touch the object; other
    than 0 where the outline is not as believed.
    """

    def __init__(
        self,
        outline: ContactOutline,
        ways: Array,
        friction: float,
        surface: EllipsoidLimitSurface,
        radius: float,
        settings: GroupControlSettings | None = None,
    ) -> None:
        """radius: [m] of the robots' rings. friction: of the contacts, as believed."""
        self.settings = settings or GroupControlSettings()
        self.outline, self.friction, self.surface = outline, friction, surface
        self._radius, self.ways = radius, ways
        self.places = outline.at(ways).centres(radius)
        self.offsets = np.zeros(len(ways))

    def closing(self, pose: Array, robots: Array, velocities: Array) -> tuple[Array, Array]:
        """Gaps ``(n,)`` [m] of robots at ``(n, 2)`` to the believed outline of an object at a pose
        ``(3,)``, and how fast [m/s] velocities ``(n, 2)`` of the robots close them."""
        way, away = self.outline.nearest(se2.transform(se2.inverse(pose), robots))
        normals = self.outline.at(way).normals @ se2.rotation_matrix(float(pose[2])).T
        return away - self._radius, (velocities * normals).sum(axis=1)

    def meet(self, pose: Array, ahead: Array, robots: Array) -> Array:
        """Velocities ``(n, 2)`` [m/s] by which robots come to an object at a pose ``(3,)`` along
        unit directions ``ahead (n, 2)`` in its frame.

        A robot that already goes the way that it will push does not have to turn at the object. One
        that would go along the outline goes towards it, too.
        """
        s = self.settings
        local = se2.transform(se2.inverse(pose), robots)
        way, away = self.outline.nearest(local)
        gaps = away - self._radius - self.offsets
        normals = self.outline.at(way).normals
        across = np.column_stack([-normals[:, 1], normals[:, 0]])
        along = (across * ahead).sum(axis=1)
        slant = np.maximum(_SLANT, (normals * ahead).sum(axis=1))
        along = np.copysign(np.sqrt(np.maximum(0.0, 1.0 - slant**2)), along)
        ahead = slant[:, None] * normals + along[:, None] * across
        speed = np.clip(s.gap_gain * gaps / slant, -s.approach, s.approach)
        velocities: Array = (speed[:, None] * ahead) @ se2.rotation_matrix(float(pose[2])).T
        return velocities

    def ahead(self, twist: Array) -> Array:
        """``(n, 2)`` unit directions of the robots at their places as the object begins to move
        with a twist ``(3,)``, in its frame."""
        directions = point_velocities(twist, self.places)
        unit: Array = directions / np.hypot(*directions.T)[:, None]
        return unit

    def command(
        self,
        pose: Array,
        twist: Array,
        wanted: Array,
        wanted_twist: Array,
        robots: Array,
        headings: Array | None = None,
    ) -> GroupCommand:
        """One tick.

        Parameters
        ----------
        pose, twist ``(3,)``: of the object's centre of mass, as estimated; wanted likewise, of now;
            all along the world's axes. robots: ``(n, 2)`` [m] their centres.
        """
        s, c = self.settings, self.surface.radius
        off = wanted - pose
        off[2] = math.remainder(off[2], 2.0 * math.pi)
        off, change, task = (
            _into(float(pose[2]), v) for v in (off, wanted_twist - twist, wanted_twist)
        )
        wrench = (
            np.array([s.position_gain, s.position_gain, s.orientation_gain]) * off
            + np.array([s.velocity_gain, s.velocity_gain, s.turning_gain]) * change
            + self.surface.wrench(task)  # (3.21); zero at rest, where the printed one is 0/0
        )
        local = se2.transform(se2.inverse(pose), robots)
        way, away = self.outline.nearest(local)
        contacts, gaps = self.outline.at(way), away - self._radius - self.offsets
        touching = gaps < s.lost
        forces = np.zeros((len(robots), 2))
        if touching.any():
            here = Contacts(contacts.points[touching], contacts.normals[touching])
            forces[touching] = distribute(wrench, here, self.friction, c)
        made = grasp_matrix(contacts.points) @ forces.ravel()
        scale = np.array([1.0, 1.0, c])
        size = float(np.linalg.norm(wrench / scale))
        lacking = float(np.linalg.norm((wrench - made) / scale)) / size if size > 0.0 else 0.0
        off_place = s.place_gain * (self.places - local)
        pushed = self._feasible(made, task)
        if s.law == "printed":
            moved = off_place + s.force_gain * forces
        else:
            normals = contacts.normals
            moved = point_velocities(pushed, local + self._ahead_of(pose, headings))
            moved += off_place - (off_place * normals).sum(axis=1)[:, None] * normals
            moved += self._inward(gaps, forces, normals, touching)[:, None] * normals
        self._keep_apart(moved, local)
        world = se2.rotation_matrix(float(pose[2]))
        velocities = moved @ world.T
        return GroupCommand(wrench, forces, lacking, gaps, contacts, velocities, pushed)

    def _ahead_of(self, pose: Array, headings: Array | None) -> Array:
        """``(n, 2)`` [m] from the robots' centres to their controlled points, in the frame of an
        object at a pose ``(3,)``; zero where no headings are given."""
        if headings is None:
            return np.zeros(2)
        angles = headings - pose[2]
        return self.settings.lead * np.column_stack([np.cos(angles), np.sin(angles)])

    def _keep_apart(self, moved: Array, local: Array) -> None:
        """Let robots at ``local (n, 2)`` that come too close to each other part again, by changing
        their velocities ``moved (n, 2)``."""
        s = self.settings
        for i, j in itertools.combinations(range(len(local)), 2):
            between = local[j] - local[i]
            away = float(np.hypot(*between))
            lacking = 2.0 * self._radius + s.apart - away
            if lacking <= 0.0 or away == 0.0:
                continue
            unit = between / away
            short = s.apart_gain * lacking - float((moved[j] - moved[i]) @ unit)
            if short > 0.0:
                moved[i] -= 0.5 * short * unit
                moved[j] += 0.5 * short * unit

    def _inward(self, gaps: Array, forces: Array, normals: Array, touching: Mask) -> Array:
        """``(n,)`` [m/s] towards the object: what is away comes, who is to carry more goes ahead.

        Of those in contact only what differs between them counts: all together ahead would push
        the object ahead.
        """
        s = self.settings
        inward: Array = np.clip(s.gap_gain * gaps, -s.approach, s.approach)
        if touching.any():
            inward[touching] += s.force_gain * (forces * normals).sum(axis=1)[touching]
            inward[touching] -= inward[touching].mean()
        return inward

    def _feasible(self, wrench: Array, task: Array) -> Array:
        """The twist ``(3,)`` that a wrench makes by the limit surface, as fast as the wrench is of
        the floor's greatest friction times the task's speed."""
        scale = np.array([1.0, 1.0, self.surface.radius])
        scaled = wrench / scale
        size, speed = float(np.linalg.norm(scaled)), float(np.linalg.norm(task * scale))
        if size == 0.0 or speed == 0.0:
            return np.zeros(3)
        pace = min(self.settings.correction, size / self.surface.max_force) * speed
        twist: Array = pace * scaled / size / scale
        return twist


def _into(heading: float, twist: Array) -> Array:
    """A twist ``(3,)`` along the world's axes in a frame with that heading."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([c * twist[0] + s * twist[1], -s * twist[0] + c * twist[1], twist[2]])
