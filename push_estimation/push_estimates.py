"""Friction of the contact, centre of mass of the object and latency of the poses, while one robot
pushes one object: from poses and commands alone. No ROS, no clock."""

from collections.abc import Mapping
from dataclasses import dataclass

from push_estimation.line_push_model import Bumper
from push_estimation.push_belief import PushBelief, PushPriorSettings
from push_estimation.push_windows import PushWindows
from push_estimation.stream_latency import LatencySettings, StreamLatency
from push_model.arrays import Array
from push_model.belief import Interval
from push_model.bumpers import FlatBumper
from push_model.specs import ObjectSpec, RobotSpec

_SAME = 5.0  # [s] within which contradictions of one kind are the same
_NARROW = 1.0 / 3.0  # of the prior's width: an interval whose median is used, not the file's value


@dataclass(frozen=True)
class Contradiction:
    """time: [s] stamp of the frame. quantities: whose intervals were widened or whose data were not
    used. widened: whether the intervals were widened. sentence: for a person."""

    time: float
    quantities: tuple[str, ...]
    widened: bool
    sentence: str


class PushEstimates:
    """Takes commands and frames; gives intervals of 95 %.

    push: friction and centre of mass; None for a robot or an object without a line contact.
    latency: of the poses. contradictions: newest last, the latest twenty.
    """

    def __init__(
        self,
        robot: RobotSpec,
        item: ObjectSpec,
        prior: PushPriorSettings | None = None,
        latency: LatencySettings | None = None,
    ) -> None:
        self._item = item
        self.push: PushBelief | None = None
        self._windows: PushWindows | None = None
        if isinstance(robot.bumper, FlatBumper) and item.shape.shape().sides:
            bumper = Bumper(robot.push_distance, robot.bumper.width / 2.0)
            self.push = PushBelief(item, bumper, prior)
            self._windows = PushWindows(item.outline, bumper)
        self.latency = StreamLatency(latency)
        self.contradictions: list[Contradiction] = []
        self.told = 0
        """Number of contradictions; those of the same kind that follow within 5 s count once."""

    def command(self, stamp: float, v: float, omega: float) -> None:
        """A command [m/s, rad/s] to the robot and the stamp [s] of the poses that it answers."""
        self.latency.command(stamp, v, omega)

    def frame(self, stamp: float, robot: Array | None, item: Array | None) -> bool:
        """Poses ``(3,)`` of a frame and its stamp [s]; None for a body that was not seen.

        Returns whether anything was learned.
        """
        learned = False
        if robot is None:
            return False
        told = self.latency.pose(stamp, robot)
        if told is not None:
            learned = told.used
            self._note(stamp, ("latency",), told.contradicted, told.sentence)
        if item is None or self._windows is None or self.push is None:
            return learned
        window = self._windows.add(stamp, robot, item)
        if window is not None:
            verdict = self.push.take(window)
            learned |= verdict.used
            names = ("contact_friction", "com_x", "com_y")
            self._note(stamp, names, verdict.contradicted, verdict.sentence)
        return learned

    def interrupted(self) -> None:
        """The stream was interrupted: windows under way are dropped, what was learned stays."""
        self.latency.forget()
        if self._windows is not None:
            self._windows.reset()

    def intervals(self) -> dict[str, Interval]:
        """What is estimated of each quantity, by its name among the quantities of a belief."""
        found = {"latency": self.latency.interval()}
        if self.push is not None:
            names = ("contact_friction", "com_x", "com_y")
            found |= dict(zip(names, self.push.intervals(), strict=True))
        return found

    def priors(self) -> dict[str, Interval]:
        """The intervals before anything was seen."""
        found = {"latency": self.latency.prior}
        if self.push is not None:
            names = ("contact_friction", "com_x", "com_y")
            found |= dict(zip(names, self.push.prior, strict=True))
        return found

    def believed(self) -> dict[str, Interval]:
        """The same as others are to use it.

        The value is the median where the interval is at most a third as wide as the prior's. Else
        little is known, and it is the value of the object's file, or the end of the interval that
        is nearest to it; but no friction that is more likely to be lower than not, since a plan
        that trusts in too much friction slips. The latency is left out until its interval is that
        narrow.
        """
        item, priors, found = self._item, self.priors(), dict[str, Interval]()
        files: Mapping[str, float] = {
            "contact_friction": item.contact_friction,
            "com_x": item.com[0],
            "com_y": item.com[1],
        }
        for name, i in self.intervals().items():
            if i.width <= _NARROW * priors[name].width:
                found[name] = i
            elif name in files:
                value = min(max(files[name], i.low), i.high)
                if name == "contact_friction":
                    value = min(value, i.value)
                found[name] = Interval(value, i.low, i.high)
        return found

    def _note(self, time: float, names: tuple[str, ...], widened: bool, sentence: str) -> None:
        if not sentence:
            return
        alike = [c for c in self.contradictions if c.sentence == sentence]
        if widened or not alike or not 0.0 <= time - alike[-1].time < _SAME:
            self.told += 1
        self.contradictions.append(Contradiction(time, names, widened, sentence))
        del self.contradictions[:-20]
