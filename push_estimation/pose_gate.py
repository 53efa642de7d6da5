"""From a stream of tracked poses to poses that may be acted on. No ROS here.

Policy on stamps: zero is refused, and so is one that is not newer than the last. A gap forward
beyond ``timeout`` counts as an interruption of the stream. One that lies back by more than
``reset_gap``, or ahead by more than ``leap``, is refused too, until the stream persists there: then
it counts as a reset of the clock, or as an interruption.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum

from push_model import se2
from push_model.arrays import Array
from push_model.settings import bounded, settings


@settings
class PoseGateSettings:
    """When a pose is too old or too far."""

    timeout: float = bounded(
        0.15,
        low=0.01,
        high=5.0,
        doc="Age of the last pose of a body above which it counts as stale (s).",
    )
    max_speed: float = bounded(
        0.5,
        low=0.01,
        high=20.0,
        doc="Highest plausible speed of a body (m/s); a faster change of position is rejected "
        "as a jump.",
    )
    max_turn_rate: float = bounded(
        10.0,
        low=0.1,
        high=100.0,
        doc="Highest plausible turn rate of a body (rad/s); a faster change of heading is "
        "rejected as a jump.",
    )
    jump_margin: float = bounded(
        0.02,
        low=0.0,
        high=1.0,
        doc="Distance that two successive poses may differ in addition to max_speed times "
        "their time difference (m).",
    )
    turn_margin: float = bounded(
        0.2,
        low=0.0,
        high=3.2,
        doc="Angle that two successive poses may differ in addition to max_turn_rate times "
        "their time difference (rad).",
    )
    persistence: int = bounded(
        10,
        low=1,
        high=1000,
        doc="Number of frames for which an implausible pose must persist before it is accepted.",
    )
    reset_gap: float = bounded(
        0.5,
        low=0.01,
        high=60.0,
        doc="Backward step of the stamps above which it counts as a reset of the clock (s).",
    )
    leap: float = bounded(
        10.0,
        low=0.1,
        high=3600.0,
        doc="Forward step of a stamp above which the frame is rejected at first (s).",
    )
    stamp_persistence: int = bounded(
        3,
        low=1,
        high=1000,
        doc="Number of frames in a row that must agree before a reset or a large forward step "
        "of the stamps is accepted.",
    )


class Stamp(Enum):
    """Verdict on a frame's stamp."""

    OK = "ok"
    REFUSED = "refused"
    RESET = "reset"
    RESUMED = "resumed"


Values = tuple[float, float, float]


@dataclass
class _Body:
    """values: of the pose."""

    pose: Array
    values: Values
    stamp: float
    candidate: Values | None = None
    repeats: int = 0

    def take(self, pose: Array, values: Values, stamp: float) -> None:
        """A further accepted pose."""
        self.pose, self.values, self.stamp = pose, values, stamp
        self.candidate, self.repeats = None, 0


class PoseGate:
    """Gates the poses of named bodies.

    bodies: whose poses are kept; all, when None. Counters: refused (non-finite pose or bad stamp),
    jumps (gated poses). refusal: why the last stamp was refused.
    """

    def __init__(
        self, settings: PoseGateSettings | None = None, bodies: Collection[str] | None = None
    ) -> None:
        self.settings = settings or PoseGateSettings()
        self.bodies = None if bodies is None else frozenset(bodies)
        self.refused = 0
        self.jumps = 0
        self.refusal = ""
        self.reset()

    def admit(self, names: Collection[str]) -> None:
        """Keep the poses of further bodies."""
        if self.bodies is not None:
            self.bodies |= frozenset(names)

    def reset(self) -> None:
        """Forget all bodies and the clock."""
        self.stamp = 0.0
        self._elsewhere = 0.0  # newest stamp of a stream that may have moved there
        self._frames_elsewhere = 0
        self._bodies: dict[str, _Body] = {}

    def begin(self, stamp: float) -> Stamp:
        """Judge the stamp [s] of a frame; ``accept`` is for the poses of accepted frames only."""
        s = self.settings
        if not math.isfinite(stamp) or stamp <= 0.0:
            return self._refuse(f"its stamp is {stamp:g}")
        ahead = stamp - self.stamp
        verdict = Stamp.OK
        if self.stamp > 0.0:
            if ahead < -s.reset_gap or ahead > s.leap:
                if not self._persists(stamp):
                    return self._refuse(f"its stamp lies {ahead:+.2f} s from the last one")
                verdict = Stamp.RESET if ahead < 0.0 else Stamp.RESUMED
            elif ahead <= 0.0:
                return self._refuse("its stamp is not newer than the last")
            elif ahead > s.timeout:
                verdict = Stamp.RESUMED
        if verdict is Stamp.RESET:
            self.reset()
        self.stamp = stamp
        self._frames_elsewhere = 0
        return verdict

    def _persists(self, stamp: float) -> bool:
        """Whether the stream has gone on from a far-off stamp for long enough."""
        follows = 0.0 < stamp - self._elsewhere <= self.settings.timeout
        self._frames_elsewhere = self._frames_elsewhere + 1 if follows else 1
        self._elsewhere = stamp
        return self._frames_elsewhere >= self.settings.stamp_persistence

    def _refuse(self, why: str) -> Stamp:
        self.refused += 1
        self.refusal = why
        return Stamp.REFUSED

    def accept(self, name: str, pose: Array) -> bool:
        """Offer a pose ``(3,)`` of this frame; False when it is refused, gated or not wanted."""
        if self.bodies is not None and name not in self.bodies:
            return False
        x, y, heading = pose.tolist()
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(heading)):
            self.refused += 1
            return False
        values = x, y, heading
        body = self._bodies.get(name)
        if body is None:
            self._bodies[name] = _Body(pose, values, self.stamp)
            return True
        s = self.settings
        # Long unseen is not a licence to be anywhere: the allowance stops growing.
        elapsed = min(self.stamp - body.stamp, 4.0 * s.timeout)
        if self._close(body.values, values, elapsed):
            body.take(pose, values, self.stamp)
            return True
        self.jumps += 1
        if body.candidate is not None and self._close(body.candidate, values, s.timeout):
            body.repeats += 1
        else:
            body.repeats = 1
        body.candidate = values
        if body.repeats >= s.persistence:
            body.take(pose, values, self.stamp)
            return True
        return False

    def _close(self, first: Values, second: Values, elapsed: float) -> bool:
        s = self.settings
        (x, y, heading), (x2, y2, heading2) = first, second
        way, turn = math.hypot(x2 - x, y2 - y), abs(se2.wrap(heading2 - heading))
        return (
            way <= s.max_speed * elapsed + s.jump_margin
            and turn <= s.max_turn_rate * elapsed + s.turn_margin
        )

    def pose(self, name: str) -> Array | None:
        """The last accepted pose, None when there is none or it is stale."""
        body = self._bodies.get(name)
        if body is None or self.stamp - body.stamp > self.settings.timeout:
            return None
        return body.pose

    def age(self, name: str) -> float:
        """[s] since the last accepted pose; inf when there is none."""
        body = self._bodies.get(name)
        return float("inf") if body is None else self.stamp - body.stamp
