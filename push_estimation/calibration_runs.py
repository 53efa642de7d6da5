"""What a robot does for a calibration: a turn on the spot, a straight drive, pushes that end at
once, and pushes in curves. Between pushes it goes back behind the same side of the object.

The runs work on a ``Rig``, a robot and an object with their poses, in a lab or in simulation.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from push_estimation.bumper_distance import bumper_distance, side_ahead
from push_estimation.contact_friction import contact_friction, sliding_ratios
from push_estimation.floor_friction import floor_friction
from push_estimation.intervals import TooLittle
from push_estimation.marker_offset import axle_in_marker_frame, heading_in_marker_frame
from push_estimation.tracks import Track
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Interval

_TURN = 0.9  # [rad/s]
_DRIVE = 0.04  # [m/s]
_CURVE = 0.04  # [m/s]
_RAMP, _HOLD = 1.0, 1.6  # [s] of a curve
_ASIDE = 0.8  # of half the bumper's width
_GAP = 0.03  # [m] between bumper and side before a push
_BACK = 0.05  # [m/s] of the way back
_STEP = 0.05  # [s] of the control of the way back
_PATIENCE = 40.0  # [s] for a way back
_TIGHTEST = 12.0  # [1/m]
_TURNS = 3  # until one of them is seen well enough


class Rig(Protocol):
    """A robot that may be driven, and an object in front of it."""

    @property
    def robot(self) -> Array:
        """``(3,)`` newest pose of the robot as it is measured now, map frame."""
        ...

    @property
    def item(self) -> Array:
        """``(3,)`` newest pose of the object."""
        ...

    def run(self, v: float, omega: float, seconds: float) -> Track:
        """Drive with a twist [m/s, rad/s] for some time [s]; what was seen meanwhile.

        The robot goes on with that twist until the next call. A run during which poses are lost may
        be shorter, and the robot stands after it.
        """
        ...


@dataclass
class Plan:
    """How much is done, and what is assumed at first.

    distance: [m] of the bumper. half_width: [m] of a flat bumper, 0 for a ring. friction: of the
    contact. outline ``(n, 2)``, com ``(2,)`` [m] in
    the object's frame. straight, curves: number of pushes. speed: [m/s] of pushes that end at once.
    """

    distance: float
    half_width: float
    friction: float
    outline: Array
    com: Array = field(default_factory=lambda: np.zeros(2))
    straight: int = 8
    curves: int = 6
    speed: float = 0.11


@dataclass(frozen=True)
class Calibration:
    """frame: ``(3,)`` the robot's frame in the one that is measured now. axle: x and y of it with
    intervals [m]. distance: [m] of the bumper. floor, contact: friction; None where it could not be
    found, with the reason in ``troubles``."""

    frame: Array
    axle: tuple[Interval, Interval] | None
    distance: Interval | None
    floor: Interval | None
    contact: Interval | None
    troubles: tuple[str, ...]


class Runs:
    """The runs of one calibration."""

    def __init__(
        self, rig: Rig, plan: Plan, tell: Callable[[str], None] = lambda text: None
    ) -> None:
        """tell: called with what is being done."""
        self._rig, self._plan, self._tell = rig, plan, tell
        self._frame = np.zeros(3)

    def robot(self) -> Array:
        """``(3,)`` pose of the robot, with what is known of its marker frame."""
        pose: Array = se2.compose(self._rig.robot, self._frame)
        return pose

    def marker(self) -> tuple[Array, tuple[Interval, Interval]]:
        """The robot's frame in the measured one: by a turn and a drive on free floor."""
        self._tell("turning on the spot, and driving 6 cm")
        turn = self._rig.run(0.0, _TURN, 1.1 * 2.0 * math.pi / _TURN)
        self._rig.run(0.0, 0.0, 0.3)
        self._rig.run(-_DRIVE, 0.0, 1.5)
        self._rig.run(0.0, 0.0, 0.3)
        drive = self._rig.run(_DRIVE, 0.0, 1.5)
        self._rig.run(0.0, 0.0, 0.3)
        settled = drive if not len(drive.time) else drive.between(drive.time[0] + 0.3, math.inf)
        x, y = axle_in_marker_frame(turn.robot)
        yaw = heading_in_marker_frame(settled.time, settled.robot)
        self._frame = np.array([x.value, y.value, yaw])
        return self._frame, (x, y)

    def face(self) -> Array:
        """``(3,)`` in the object's frame: middle of the side that the robot is at, x inward."""
        outline, item, robot = self._plan.outline, self._rig.item, self.robot()
        toward = math.atan2(*(item - robot)[1::-1])
        _, _, corner = side_ahead(np.array([*robot[:2], toward]), item, outline)
        corners = se2.transform(item, outline)
        first = int(np.argmin(np.hypot(*(corners - corner).T)))
        a, b = outline[first], outline[(first + 1) % len(outline)]
        along = (b - a) / float(np.hypot(*(b - a)))
        inward = math.atan2(along[0], -along[1])
        foot = float((self._plan.com - a) @ along)  # pushed against the centre of mass
        rim = min(0.3 * float(np.hypot(*(b - a))), 0.04)
        foot = min(max(foot, rim), float(np.hypot(*(b - a))) - rim)
        return np.array([*(a + foot * along), inward])

    def go_behind(self, face: Array, aside: float = 0.0) -> None:
        """Stand before a side, with a gap to it, and ``aside`` [m] to the left of its middle."""
        place = se2.compose(face, np.array([-self._plan.distance - _GAP, aside, 0.0]))
        away = se2.between(self._rig.item, self.robot())
        depth = float(se2.between(face, away)[0])
        need = depth + self._plan.distance + _GAP + 0.02
        if need > 0.0:
            self._rig.run(-_BACK, 0.0, need / _BACK)
        target: Array = se2.compose(self._rig.item, place)
        spent = 0.0
        while spent < _PATIENCE:
            spent += _STEP
            here = self.robot()
            rest = se2.between(here, target)
            far = float(np.hypot(*rest[:2]))
            if far < 0.003:
                if abs(rest[2]) < 0.008:
                    break
                self._rig.run(0.0, max(-0.6, min(0.6, 2.5 * float(rest[2]))), _STEP)
                continue
            bearing = math.atan2(rest[1], rest[0])
            sign = 1.0
            if abs(bearing) > math.pi / 2:  # backwards is nearer
                sign, bearing = -1.0, se2.wrap(bearing + math.pi)
            if abs(bearing) > 0.25 and far > 0.004:
                self._rig.run(0.0, max(-0.8, min(0.8, 2.5 * bearing)), _STEP)
            else:
                v = sign * min(_BACK, max(0.01, 0.8 * far))
                self._rig.run(v, 1.5 * bearing, _STEP)
        else:
            raise TooLittle("the robot did not get behind the object")
        self._rig.run(0.0, 0.0, 0.3)

    def straight(self, face: Array) -> tuple[Track, float]:
        """A straight push that ends at once; the time [s] of its end, -inf if it was not seen."""
        self._tell("a straight push")
        self.go_behind(face)
        seconds = _GAP / self._plan.speed + 0.75
        push = self._rig.run(self._plan.speed, 0.0, seconds)
        rest = self._rig.run(0.0, 0.0, 0.5)
        whole = Track(
            np.concatenate([push.time, rest.time]),
            np.vstack([push.robot, rest.robot]),
            np.vstack([push.item, rest.item]),
        )
        return whole.corrected(self._frame), float(push.time[-1]) if len(push.time) else -math.inf

    def curve(self, face: Array, curvature: float) -> Track:
        """A push into a curve [1/m] during which the object should slide.

        The bumper is put to one side, so that the force, which is inclined, still passes through
        it. Otherwise the object would turn about the bumper's end instead of sliding.
        """
        self._tell(f"a push in a curve of {1.0 / curvature:+.2f} m")
        self.go_behind(face, -math.copysign(_ASIDE * self._plan.half_width, curvature))
        self._rig.run(_CURVE, 0.0, _GAP / _CURVE + 0.4)
        steps = round(_RAMP / _STEP)
        for k in range(steps):
            self._rig.run(_CURVE, _CURVE * curvature * (k + 1) / steps, _STEP)
        push = self._rig.run(_CURVE, _CURVE * curvature, _HOLD)
        self._rig.run(0.0, 0.0, 0.3)
        return push.corrected(self._frame)

    def curves(self, face: Array, distance: float) -> list[Track]:
        """Pushes into curves to both sides by turns; they get tighter until the object slides.

        distance: [m] of the bumper.

        Raises
        ------
        TooLittle: the bumper is not flat.
        """
        plan = self._plan
        if plan.half_width <= 0.0:
            raise TooLittle("a flat bumper is needed")
        lever = distance + float(se2.between(face, np.array([*plan.com, 0.0]))[0])
        curvature, pushes = (1.5 * plan.friction + 0.05) / lever, list[Track]()
        for k in range(plan.curves):
            for _ in range(4):
                push = self.curve(face, curvature if k % 2 == 0 else -curvature)
                if len(sliding_ratios(push, plan.outline, plan.com, distance)) >= 4:
                    break
                curvature = min(1.3 * curvature, _TIGHTEST)
            pushes.append(push)
        return pushes

    def everything(self) -> Calibration:
        """All runs; what cannot be found is named, and the rest goes on."""
        plan, troubles = self._plan, list[str]()
        axle: tuple[Interval, Interval] | None = None
        for k in range(_TURNS):
            try:
                _, axle = self.marker()
                break
            except TooLittle as error:
                if k == _TURNS - 1:
                    troubles.append(f"marker frame: {error}")
        face = self.face()
        pushes = [self.straight(face) for _ in range(plan.straight)]
        distance, floor, contact = None, None, None
        try:
            distance = bumper_distance([p.between(0.0, t) for p, t in pushes], plan.outline)
        except TooLittle as error:
            troubles.append(f"bumper distance: {error}")
        try:
            floor = floor_friction(pushes)
        except TooLittle as error:
            troubles.append(f"floor friction: {error}")
        near = plan.distance if distance is None else distance.value
        try:
            contact = contact_friction(self.curves(face, near), plan.outline, plan.com, near)
        except TooLittle as error:
            troubles.append(f"contact friction: {error}")
        return Calibration(self._frame, axle, distance, floor, contact, tuple(troubles))
