"""A law that pushes with a crescent: robots go round the object to where it is pushed from, find
hold of it together, and move on with it.

The density lies along the object's rim where the twist that the object is to have moves the outline
away from the robots (``crescent.py``). Robots go to the centroids of their cells, round the object
where it is in the way. As soon as those at the object can make most of the wrench that the motion
takes, the density moves on with the object's wanted twist, and every robot with it: a moving
density is followed by its own velocity and Lloyd's control together.
"""

import math

import numpy as np
from scipy.optimize import nnls

from push_model import se2
from push_model.arrays import Array, Mask
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.screws import screw_between
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec
from swarm_push.coverage import Coverage
from swarm_push.crescent import crescent
from swarm_push.law import Scene, SwarmPhase, SwarmStep
from swarm_push.rim import Rim
from swarm_push.way_round import WayRound


@settings
class CrescentLawSettings:
    """Speeds, and what counts as hold."""

    speed: float = bounded(0.85, low=0.05, high=1.0, doc="of a push, over the robots' greatest")
    slowing: float = bounded(1.0, low=0.01, high=10.0, doc="[1/s] of the way that is left")
    least_speed: float = bounded(0.2, low=0.0, high=1.0, doc="of a push, over the robots' greatest")
    gain: float = bounded(3.0, low=0.01, high=100.0, doc="[1/s] towards centroids")
    press: float = bounded(0.01, low=0.0, high=1.0, doc="[m] of the density into the object")
    wait: float = bounded(6e-3, low=0.0, high=1.0, doc="[m] from it until the push begins")
    clearance: float = bounded(0.02, low=1e-3, high=1.0, doc="[m] of robots that go round it")
    contact: float = bounded(0.015, low=1e-3, high=1.0, doc="[m] from it that count as hold")
    least: float = bounded(0.3, low=0.0, high=0.99, doc="part of the approach that makes a place")
    hold: float = bounded(0.25, low=0.0, high=1.0, doc="part of the wrench that may lack to begin")
    lost: float = bounded(0.7, low=0.0, high=1.0, doc="part that may lack as they push")


class CrescentLaw:
    """Robots of a radius [m] and a greatest speed [m/s] about one object."""

    def __init__(
        self,
        region: Array,
        item: ObjectSpec,
        radius: float,
        speed: float,
        settings: CrescentLawSettings | None = None,
    ) -> None:
        """region: ``(m, 2)`` [m] corners of the convex one in which centres of robots may be."""
        self.settings = s = settings or CrescentLawSettings()
        self._coverage, self._item = Coverage(region), item
        self._radius, self._speed = radius, speed
        outline = item.geometry.outline
        self._rim = Rim(outline, radius, 1.5 * radius)
        self._fine = Rim(outline, radius, 0.01)
        self._round = WayRound(outline, radius, s.clearance)
        self._lever = float(np.hypot(*self._fine.points.T).max())
        self._surface = item.limit_surface()
        self._pushing = False

    def reset(self) -> None:
        """See SwarmLaw."""
        self._pushing = False

    def step(self, scene: Scene) -> SwarmStep:
        """See SwarmLaw."""
        s, pose = self.settings, scene.pose
        twist = self._twist(pose, scene.target)
        local = se2.transform(se2.inverse(pose), scene.robots)
        lacking, held = self._lacking(local, twist)
        self._pushing = lacking <= (s.lost if self._pushing else s.hold)
        off = -s.press if self._pushing else s.wait
        density = crescent(self._rim, pose, twist, off, s.least)
        centroids = self._coverage.centroids(scene.robots, density)
        goals = se2.transform(se2.inverse(pose), centroids)
        aims, length = self._way_round(scene).aims(local, goals)
        near = length < 3.0 * self._radius
        phase = self._phase(near, held, local)
        moved = self._towards(aims - local, length)
        if self._pushing:
            moved += rigid(twist, local)
        moved = moved @ se2.rotation_matrix(float(pose[2])).T
        return SwarmStep(moved, density, centroids, phase)

    def _way_round(self, scene: Scene) -> WayRound:
        """Round the object, and round what stands at it."""
        if not len(scene.others):
            return self._round
        local = scene.others.copy()
        local[:, :2] = se2.transform(se2.inverse(scene.pose), scene.others[:, :2])
        away = np.hypot(*(local[:, None, :2] - self._fine.points).transpose(2, 0, 1)).min(axis=1)
        room = self._radius + 2.0 * self.settings.clearance
        close = local[away - local[:, 2] < room]
        if not len(close):
            return self._round
        return WayRound(self._item.geometry.outline, self._radius, self.settings.clearance, close)

    def _twist(self, pose: Array, target: Array) -> Array:
        """``(3,)`` that the object is to have, in its frame."""
        s = self.settings
        if math.isnan(target[2]):
            c, sn = math.cos(pose[2]), math.sin(pose[2])
            x, y = target[:2] - pose[:2]
            motion = np.array([c * x + sn * y, -sn * x + c * y, 0.0])
        else:
            motion = screw_between(pose, target)
        way = math.hypot(motion[0], motion[1]) + self._lever * abs(motion[2])
        if way < 1e-9:
            return np.zeros(3)
        pace = min(s.speed * self._speed, max(s.slowing * way, s.least_speed * self._speed))
        twist: Array = pace * motion / way
        return twist

    def _lacking(self, local: Array, twist: Array) -> tuple[float, Mask]:
        """Part of the wrench that a twist takes which robots at the object cannot make, and who
        ``(n,)`` is there and where the object is pushed from."""
        s, rim = self.settings, self._fine
        away = np.hypot(*(local[:, None] - rim.points[None]).transpose(2, 0, 1))
        k = away.argmin(axis=1)
        approach = rim.approach(twist)
        inward = ((local - rim.points[k]) * rim.normals[k]).sum(axis=1)
        near = (away[np.arange(len(k)), k] < s.contact) | (inward > 0.0)
        held: Mask = near & (approach[k] > 0.5 * s.least * max(float(approach.max()), 1e-12))
        if not held.any() or not twist.any():
            return 1.0, held
        normals = rim.normals[k[held]]
        points = rim.points[k[held]] + self._radius * normals
        scale = np.array([1.0, 1.0, self._surface.radius])
        wrench = self._surface.wrench(twist) / scale
        wrench /= np.linalg.norm(wrench)
        edges = np.array([cone_edges(n, self._item.contact_friction) for n in normals])
        G = grasp_matrix(points) / scale[:, None]
        columns = np.einsum("ikj,ilj->kil", G.reshape(3, -1, 2).transpose(1, 0, 2), edges)
        return float(nnls(columns.reshape(3, -1), wrench)[1]), held

    def _towards(self, way: Array, length: Array) -> Array:
        """Velocities ``(n, 2)`` [m/s] along ways that are so long [m] altogether."""
        away = np.hypot(*way.T)
        speed = np.minimum(self.settings.gain * np.maximum(length, away), self._speed)
        moved: Array = way * (speed / np.maximum(away, 1e-9))[:, None]
        return moved

    def _phase(self, near: Mask, held: Mask, local: Array) -> SwarmPhase:
        if self._pushing:
            return SwarmPhase.PUSH
        if held.any() and (near | held).all():
            return SwarmPhase.REALIGN
        far = np.hypot(*local.T) > 2.0 * self._lever
        return SwarmPhase.GATHER if far.mean() > 0.5 else SwarmPhase.GO_ROUND


def rigid(twist: Array, points: Array) -> Array:
    """Velocities ``(n, 2)`` [m/s] of points ``(n, 2)`` [m] of a body that moves with a twist, all
    in its frame."""
    return np.column_stack([twist[0] - twist[2] * points[:, 1], twist[1] + twist[2] * points[:, 0]])
