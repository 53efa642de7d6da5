"""From what a pose driver hears to frames of poses in the map. What cannot be is refused here, by
the same gate as in every node, and counted for people."""

import math
from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from lab_bridge.frame_assembly import Assembled, FrameAssembler
from lab_bridge.marker_mapping import Marker, MarkerMapping, Placed
from lab_bridge.settings import LabBridgeSettings
from push_estimation.pose_gate import PoseGate, PoseGateSettings, Stamp
from push_model.arrays import Array
from push_scenario.lab import LabSettings

_KEPT = 200  # frames for the figures


@dataclass(frozen=True)
class Clocks:
    """monotonic: [s] for intervals. system: [s] the clock that stamps of capture are of."""

    monotonic: Callable[[], float]
    system: Callable[[], float]


@dataclass
class Figures:
    """What the stream is like, of the newest frames."""

    arrivals: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))
    ages: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))

    @property
    def rate(self) -> float:
        """[Hz] frames per second; nan where there are too few."""
        a = self.arrivals
        return (len(a) - 1) / (a[-1] - a[0]) if len(a) > 1 and a[-1] > a[0] else math.nan

    @property
    def age(self) -> tuple[float, float]:
        """[s] mean and standard deviation of arrival minus stamp of capture."""
        if not self.ages:
            return math.nan, math.nan
        return float(np.mean(self.ages)), float(np.std(self.ages))


class PoseIntake:
    """A PoseSink."""

    def __init__(
        self,
        lab: LabSettings,
        bodies: Collection[str],
        settings: LabBridgeSettings,
        gate: PoseGateSettings,
        clocks: Clocks,
        publish: Callable[[float, Mapping[str, Array], Stamp], None],
        complain: Callable[[str, str], None],
        impossible: Callable[[Mapping[str, Array]], str] = lambda poses: "",
    ) -> None:
        """publish: called with the stamp [s], the poses ``(3,)`` by body, and the verdict on the
        stamp. complain: called with what is refused and why. impossible: why the poses of a frame
        cannot be, empty where they can."""
        self.mapping = MarkerMapping(lab, bodies)
        self.gate = PoseGate(gate, bodies)
        self._assembler: FrameAssembler[Marker] = FrameAssembler(
            self.mapping.bodies, settings.assembly
        )
        self._by_capture = lab.stamps == "capture"
        self._tilt, self._clocks = settings.max_tilt, clocks
        self._publish, self._complain, self._impossible = publish, complain, impossible
        self.figures = Figures()
        self.unknown: set[str] = set()
        """Names in motion capture that belong to no body."""

    @property
    def missing(self) -> list[str]:
        """Bodies that no frame has shown for a while, or ever."""
        return [b for b in self.mapping.markers if self.gate.pose(b) is None]

    def part(self, marker: str, seen: Marker, stamp: float | None) -> None:
        """See PoseSink."""
        if marker not in self.mapping.bodies:
            self._meet_stranger(marker)
            return
        now = self._clocks.monotonic()
        for frame in self._assembler.add(marker, seen, self._time(stamp), now):
            self._take(frame)

    def frame(self, seen: Mapping[str, Marker], stamp: float | None) -> None:
        """See PoseSink."""
        known = {m: s for m, s in seen.items() if m in self.mapping.bodies}
        for marker in seen.keys() - known.keys():
            self._meet_stranger(marker)
        if known:
            self._take(Assembled(self._time(stamp), known, self._clocks.monotonic()))

    def refuse(self, where: str, reason: str) -> None:
        """See PoseSink."""
        self._complain(where, reason)

    def poll(self) -> None:
        """Let frames go on that have waited long enough."""
        for frame in self._assembler.poll(self._clocks.monotonic()):
            self._take(frame)

    def _time(self, stamp: float | None) -> float:
        return stamp if self._by_capture and stamp is not None else self._clocks.system()

    def _meet_stranger(self, marker: str) -> None:
        if marker not in self.unknown:
            self.unknown.add(marker)
            self._complain(f"body '{marker}'", "the scenario has no body of this name")

    def _take(self, frame: Assembled[Marker]) -> None:
        verdict = self.gate.begin(frame.stamp)
        if verdict is Stamp.REFUSED:
            self._complain("frame", self.gate.refusal)
            return
        self.figures.arrivals.append(frame.arrived)
        if self._by_capture:
            self.figures.ages.append(self._clocks.system() - frame.stamp)
        poses: dict[str, Array] = {}
        for marker, seen in frame.parts.items():
            body = self.mapping.bodies[marker]
            placed = self.mapping.place(body, seen)
            if self._plausible(body, placed) and self.gate.accept(body, placed.pose):  # type: ignore[union-attr]
                poses[body] = placed.pose  # type: ignore[union-attr]
        why = self._impossible(poses)
        if why:
            self._complain("frame", f"{why}; see lab.units and lab.origin")
            return
        self._publish(frame.stamp, poses, verdict)

    def _plausible(self, body: str, placed: Placed | None) -> bool:
        if placed is None:
            self._complain(body, "its pose is not finite, or its orientation is no rotation")
        elif placed.tilt > self._tilt:
            self._complain(
                body, f"it is tilted by {math.degrees(placed.tilt):.0f} degrees; see lab.axes"
            )
        else:
            return True
        return False
