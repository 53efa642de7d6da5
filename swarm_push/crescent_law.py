"""The crescent law: robots enclose the pushed side of an object and push it with a given twist.

The density to be covered lies along the object's rim, where the desired twist moves the outline
away from the robots (``crescent.py``). Each robot moves to the centroid of its Voronoi cell
(Lloyd's control), round the object where that is in the way. As soon as the robots in contact can
make most of the wrench that the motion needs, they push: each moves with the velocity that the
desired twist gives its place, plus Lloyd's control. The density is put at the measured pose of the
object at every tick.
"""

import math

import numpy as np
from scipy.optimize import nnls

from push_model import se2
from push_model.arrays import Array, Mask
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.screws import point_velocities
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec
from swarm_push.coverage import Coverage
from swarm_push.crescent import crescent
from swarm_push.density import Density
from swarm_push.escape import Escape
from swarm_push.law import Scene, SwarmPhase, SwarmStep
from swarm_push.rim import Nearest, Rim
from swarm_push.walls import Walls
from swarm_push.way_round import WayRound

_REACH = 0.1  # [m] of gaps to the object that are looked at
_WORSE = 0.1  # part of the wrench that may lack beyond what lacked at the beginning


@settings
class CrescentLawSettings:
    """Speeds, and when robots are in place to push.

    The robots *hold* the object when the forces of those in contact, within their friction cones,
    make the wrench of the desired motion but for a part that may lack.
    """

    speed: float = bounded(
        0.85,
        low=0.05,
        high=1.0,
        doc="Push speed as a fraction of the robot's maximum speed (dimensionless)",
    )
    slowing: float = bounded(
        1.0,
        low=0.01,
        high=10.0,
        doc="Push speed near the target, divided by the remaining distance (1/s)",
    )
    least_speed: float = bounded(
        0.2,
        low=0.0,
        high=1.0,
        doc="Lowest push speed as a fraction of the robot's maximum speed (dimensionless)",
    )
    gain: float = bounded(
        3.0,
        low=0.01,
        high=100.0,
        doc="Proportional gain of a robot's velocity towards the centroid of its cell (1/s)",
    )
    shift: float = bounded(
        0.3,
        low=0.0,
        high=100.0,
        doc="Proportional gain of a pushing robot's velocity along the outline of the object "
        "(1/s); low, because wheels that slip sideways transmit no push",
    )
    press: float = bounded(
        0.01,
        low=0.0,
        high=1.0,
        doc="Distance by which the density lies inside the line of contact (the line of the "
        "centres of touching robots) during a push, so that robots keep pressing (m)",
    )
    wait: float = bounded(
        6e-3,
        low=0.0,
        high=1.0,
        doc="Distance from the line of contact (the line of the centres of touching robots) at "
        "which robots wait until the push begins (m)",
    )
    clearance: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Gap to the object that robots keep while they move around it (m)",
    )
    slide: float = bounded(
        0.015,
        low=0.0,
        high=0.04,
        doc="Depth inside the line of contact (the line of the centres of touching robots) at "
        "which a robot that slides along the object may aim (m)",
    )
    contact: float = bounded(
        0.015,
        low=1e-3,
        high=1.0,
        doc="Distance from the line of contact (the line of the centres of touching robots) within "
        "which a robot counts as in contact (m)",
    )
    least: float = bounded(
        0.3,
        low=0.0,
        high=0.99,
        doc="Places are not used at which the outline of the object, during the desired motion, "
        "moves away from the robot more slowly than this fraction of the highest such speed along "
        "the outline (dimensionless)",
    )
    hold: float = bounded(
        0.25,
        low=0.0,
        high=1.0,
        doc="Fraction of the needed wrench that may still be missing when a push begins "
        "(dimensionless)",
    )
    patience: float = bounded(
        3.0,
        low=0.0,
        high=600.0,
        doc="Longest time to wait until no robot is in front of the object and robots can "
        "apply enough wrench (s)",
    )
    stuck: float = bounded(
        12.0,
        low=1.0,
        high=600.0,
        doc="Time without progress of an object at a wall after which the object is moved away "
        "from the wall (s)",
    )
    budge: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Motion along the desired twist within the time 'stuck' that counts as progress (m)",
    )
    lost: float = bounded(
        0.7,
        low=0.0,
        high=1.0,
        doc="Fraction of the needed wrench that may be missing during a push before it is "
        "interrupted (dimensionless)",
    )


class CrescentLaw:
    """The law for robots of a radius [m] and a greatest speed [m/s] about one object."""

    def __init__(
        self,
        region: Array,
        item: ObjectSpec,
        radius: float,
        speed: float,
        settings: CrescentLawSettings | None = None,
        walls: Walls | None = None,
    ) -> None:
        """region: ``(m, 2)`` [m] corners of the convex one in which centres of robots may be;
        walls: what stands in it."""
        self.settings = settings or CrescentLawSettings()
        self._coverage, self._walls = Coverage(region), walls
        self._radius, self._speed = radius, speed
        self._pushing = False
        self._hold_since = self._settled = math.inf  # [s] of time
        self._begun_with = 1.0
        self._to_go = 0.0  # [m] of all ways of robots
        self.believe(item)

    def believe(self, item: ObjectSpec) -> None:
        """See SwarmLaw."""
        s, radius, outline = self.settings, self._radius, item.geometry.outline
        self._item = item
        self._rim = Rim(outline, radius, 1.5 * radius)
        self._fine = Rim(outline, radius, 0.01)
        self._round = WayRound(outline, radius, s.clearance, s.slide)
        self._lever = float(np.hypot(*self._fine.points.T).max())
        self._surface = item.limit_surface()
        self._escape: Escape | None = None
        if self._walls is not None:
            self._escape = Escape(self._rim, item, radius, self._walls, s.stuck, s.budge)

    def reset(self) -> None:
        """See SwarmLaw."""
        self._pushing, self._hold_since, self._settled = False, math.inf, math.inf
        if self._escape is not None:
            self._escape.reset()

    def step(self, scene: Scene) -> SwarmStep:
        """See SwarmLaw."""
        s, pose = self.settings, scene.pose
        local = se2.transform(se2.inverse(pose), scene.robots)
        near = self._fine.nearest(local)
        twist = self._off_walls(scene.time, pose, self._twist(pose, scene.target), near)
        lacking, held, ahead = self._lacking(near, twist)
        self._look_for_hold(scene.time, lacking, bool(ahead.any()))
        off = -s.press if self._pushing else s.wait
        drive = self._rim.drive(twist, self._item.contact_friction)
        density = crescent(self._rim, pose, drive, off, s.least, self._free_places(scene))
        centroids = self._centroids(scene, density)
        goals = self._at_rim(se2.transform(se2.inverse(pose), centroids), off)
        aims, length = self._ways(scene, local, goals)
        self._to_go = float(length.sum())
        arrived = length < 3.0 * self._radius
        self._settled = min(self._settled, scene.time) if arrived.all() else math.inf
        phase = self._phase(arrived, held, local)
        moved = self._towards(aims - local, length)
        if self._pushing:
            moved = np.where(held[:, None], self._pressed(near, goals - local), moved)
            moved += point_velocities(twist, local)
        inward, most = self._bounds(near, twist, held)
        world = se2.rotation_matrix(float(pose[2])).T
        return SwarmStep(moved @ world, density, centroids, phase, inward @ world, most)

    def _centroids(self, scene: Scene, density: Density) -> Array:
        """Centroids of the cells. Robots that do not see the object have no cell: they go to it."""
        if self._walls is None or self._walls.open:
            return self._coverage.centroids(scene.robots, density)
        item = np.repeat(scene.pose[None, :2], len(scene.robots), axis=0)
        seen = self._walls.sees(scene.robots, item)
        item[seen] = self._coverage.centroids(scene.robots[seen], density)
        return item

    def _free_places(self, scene: Scene) -> Mask | None:
        """Which places at the object are clear of walls and of what stands about; None: all."""
        if self._walls is None and not len(scene.others):
            return None
        places = se2.transform(scene.pose, self._rim.points)
        free = np.ones(len(places), dtype=np.bool_)
        if self._walls is not None:
            free = self._walls.free(places)
        others = scene.others
        away = np.hypot(*(places[:, None] - others[None, :, :2]).transpose(2, 0, 1))
        free &= (away > self._radius + others[:, 2]).all(axis=1)
        return free

    def _ways(self, scene: Scene, local: Array, goals: Array) -> tuple[Array, Array]:
        """Where robots head for on their ways to goals, all ``(n, 2)`` [m] in the object's frame,
        and how far ``(n,)`` [m] they have to go: round the object, and round walls."""
        way, walls = self._way_round(scene), self._walls
        if walls is None or walls.open:
            return way.aims(local, goals)
        pose, back = scene.pose, se2.inverse(scene.pose)
        goals = se2.transform(back, walls.into_room(se2.transform(pose, goals)))
        aims, length = way.aims(local, goals)
        aims = walls.into_room(se2.transform(pose, aims))
        aims, length = walls.round_corners(scene.robots, aims, length, pose[:2])
        return se2.transform(back, aims), length

    def _off_walls(self, now: float, pose: Array, twist: Array, near: Nearest) -> Array:
        """The twist that is wanted; where the object is stuck at a wall although robots are there,
        for a while one off it."""
        if self._escape is None:
            return twist
        there = bool((near[1] > -self.settings.contact).any())
        off = self._escape.motion(now, pose, twist, self._to_go if there else None)
        return twist if off is None else self.settings.least_speed * self._speed * off

    def _at_rim(self, goals: Array, off: float) -> Array:
        """Centroids ``(n, 2)`` of few robots' parts of the crescent lie behind its line, in the
        object, where no way leads to: they are moved out to it."""
        k, depth = self._fine.nearest(goals)
        excess = np.maximum(depth + off, 0.0)
        moved: Array = goals - excess[:, None] * self._fine.normals[k]
        return moved

    def _look_for_hold(self, now: float, lacking: float, ahead: bool) -> None:
        """Begin to push as soon as there is hold and nobody in front, or stop for want of it."""
        s = self.settings
        if self._pushing:
            self._pushing = lacking <= max(s.lost, self._begun_with + _WORSE)
            self._settled = self._hold_since = math.inf
            return
        # Those who are all there and have no better hold push with what they have.
        enough = lacking <= s.hold or (now - self._settled > s.patience and lacking < 1.0)
        self._hold_since = min(self._hold_since, now) if enough else math.inf
        self._pushing = enough and (not ahead or now - self._hold_since > s.patience)
        self._begun_with = lacking

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
        s, outline = self.settings, self._item.geometry.outline
        return WayRound(outline, self._radius, s.clearance, s.slide, close)

    def _twist(self, pose: Array, target: Array) -> Array:
        """``(3,)`` that the object is to have, in its frame: straight ahead, turning as it goes."""
        s = self.settings
        c, sn = math.cos(pose[2]), math.sin(pose[2])
        x, y = target[:2] - pose[:2]
        turn = 0.0 if math.isnan(target[2]) else se2.wrap(float(target[2] - pose[2]))
        motion = np.array([c * x + sn * y, -sn * x + c * y, turn])
        way = math.hypot(motion[0], motion[1]) + self._lever * abs(motion[2])
        if way < 1e-9:
            return np.zeros(3)
        pace = min(s.speed * self._speed, max(s.slowing * way, s.least_speed * self._speed))
        twist: Array = pace * motion / way
        return twist

    def _lacking(self, nearest: Nearest, twist: Array) -> tuple[float, Mask, Mask]:
        """Part of the wrench that a twist takes which robots at the object cannot make; who
        ``(n,)`` is there and where the object is pushed from, and who where it goes to."""
        s, rim = self.settings, self._fine
        k, depth = nearest
        approach, near = rim.drive(twist, self._item.contact_friction), depth > -s.contact
        some = 0.5 * s.least * max(float(approach.max()), 1e-12)
        held: Mask = near & (approach[k] > some)
        ahead: Mask = near & (approach[k] < -some)
        if not held.any() or not twist.any():
            return 1.0, held, ahead
        normals = rim.normals[k[held]]
        points = rim.points[k[held]] + self._radius * normals
        scale = np.array([1.0, 1.0, self._surface.radius])
        wrench = self._surface.wrench(twist) / scale
        wrench /= np.linalg.norm(wrench)
        edges = np.array([cone_edges(n, self._item.contact_friction) for n in normals])
        G = grasp_matrix(points) / scale[:, None]
        columns = np.einsum("ikj,ilj->kil", G.reshape(3, -1, 2).transpose(1, 0, 2), edges)
        return float(nnls(columns.reshape(3, -1), wrench)[1]), held, ahead

    def _towards(self, way: Array, length: Array) -> Array:
        """Velocities ``(n, 2)`` [m/s] along ways that are so long [m] altogether."""
        away = np.hypot(*way.T)
        speed = np.minimum(self.settings.gain * np.maximum(length, away), self._speed)
        moved: Array = way * (speed / np.maximum(away, 1e-9))[:, None]
        return moved

    def _pressed(self, nearest: Nearest, way: Array) -> Array:
        """Velocities ``(n, 2)`` [m/s] of robots at the object on ways to their places, besides that
        of the object: along its rim only slowly, for wheels that slip aside do not push."""
        normals = self._fine.normals[nearest[0]]
        inward = (way * normals).sum(axis=1)[:, None] * normals
        speeds: Array = self.settings.gain * inward + self.settings.shift * (way - inward)
        return speeds

    def _bounds(self, nearest: Nearest, twist: Array, held: Mask) -> tuple[Array, Array]:
        """Inward normals ``(n, 2)`` and how fast ``(n,)`` [m/s] robots may go along them: as fast
        as the object flees, and by so much of the gap that may close. Only those that push may
        press: a robot that touches another robot is not driven further towards it."""
        s = self.settings
        k, depth = nearest
        fleeing = self._fine.approach(twist)[k] if self._pushing else np.zeros(len(k))
        room = np.where(held & self._pushing, s.press, -s.wait)
        most = np.where(depth > -_REACH, fleeing + s.gain * (room - depth), np.inf)
        return self._fine.normals[k], most

    def _phase(self, arrived: Mask, held: Mask, local: Array) -> SwarmPhase:
        if self._pushing:
            return SwarmPhase.PUSH
        if held.any() and (arrived | held).all():
            return SwarmPhase.REALIGN
        far = np.hypot(*local.T) > 2.0 * self._lever
        return SwarmPhase.GATHER if far.mean() > 0.5 else SwarmPhase.GO_ROUND
