"""What is wrong with a motion capture, judged from what arrived of it. No ROS here.

Each rule looks at one kind of mistake. It compares the measurements with the scenario: the names,
the size of the arena, and that bodies stand upright on a floor.
"""

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from lab_bridge.findings import Finding, error, fact, warning
from lab_bridge.marker_mapping import Marker, MarkerMapping, Placed
from push_model.arrays import Array
from push_scenario.lab import AXES, LabSettings

_UPRIGHT = math.radians(10.0)  # greatest tilt of bodies that stand
_LEVEL = 0.15  # [m] greatest difference of heights on a floor
_SLOW = 30.0  # [Hz]
_FAR_OFF = 1.0  # [s] between the clocks
_RECEIPT = 0.002  # [s] age of a stamp that was given on arrival
_USABLE = 0.9  # of the poses of a body
_TF = "tf2_msgs/msg/TFMessage"  # which several nodes may publish


@dataclass(frozen=True)
class Sample:
    """A pose as it arrived. arrived: [s] system clock. stamp: [s] of its message, or None."""

    marker: str
    seen: Marker
    stamp: float | None
    arrived: float


@dataclass(frozen=True)
class CaptureFacts:
    """What was observed of a motion capture.

    sources: topics or addresses that the driver listens to. publishers: types of those who publish
    on each topic, one entry a publisher; empty for a server. expected: type that the driver takes.
    others: topics in the graph that carry poses. troubles: what the driver refused.
    domain, discovery: of this machine.
    """

    sources: tuple[str, ...]
    samples: Sequence[Sample] = ()
    publishers: Mapping[str, Sequence[str]] = field(default_factory=dict)
    expected: str = ""
    others: Sequence[str] = ()
    troubles: Sequence[str] = ()
    domain: str = "0"
    discovery: str = "LOCALHOST"


@dataclass(frozen=True)
class Room:
    """low, high: corners ``(2,)`` [m] of the map."""

    low: Array
    high: Array

    @property
    def size(self) -> float:
        """[m] diagonal."""
        return float(np.hypot(*(self.high - self.low)))


def diagnose_capture(
    facts: CaptureFacts, lab: LabSettings, bodies: Sequence[str], room: Room
) -> list[Finding]:
    """Findings, the gravest first. bodies: robots and objects of the scenario."""
    found = _publishers(facts)
    if not facts.samples:
        return found + _nothing(facts, found)
    found += _names(facts, lab, bodies)
    found += _unusable(facts, lab, bodies)
    units = _units(facts, lab, bodies, room)
    found += units or _axes(facts, lab, bodies)
    if not any(f.weight.value == "error" for f in found):
        found += _outside(facts, lab, bodies, room)
    seen = {s.marker for s in facts.samples}
    markers = [lab.marker(b) for b in bodies if lab.marker(b) in seen]
    found += _stamps(facts, lab, markers)
    found += _rate(facts, markers)
    order = {"error": 0, "warning": 1, "fact": 2}
    return sorted(found, key=lambda f: order[f.weight.value])


def _publishers(facts: CaptureFacts) -> list[Finding]:
    found = []
    for topic, kinds in facts.publishers.items():
        wrong = sorted({k for k in kinds if k != facts.expected})
        right = sum(k == facts.expected for k in kinds)
        if wrong and not right:
            found.append(
                error(
                    "WRONG_TYPE",
                    f"{topic} carries {', '.join(wrong)}, not {facts.expected}",
                    "set lab.poses.kind to the driver of that type",
                )
            )
        if right > 1 and facts.expected == _TF:
            text = f"{right} nodes publish on {topic}"
            remedy = "that is right, unless two of them publish the same body"
            found.append(warning("TWO_PUBLISHERS", text, remedy))
        elif right > 1:
            found.append(
                error(
                    "TWO_PUBLISHERS",
                    f"{right} nodes publish on {topic}",
                    "stop all but one: ros2 topic info -v names them",
                )
            )
    return found


def _nothing(facts: CaptureFacts, before: list[Finding]) -> list[Finding]:
    listed = ", ".join(facts.sources)
    if facts.troubles:
        text = f"the pose driver has failed: {facts.troubles[-1]}"
        return [error("NO_POSES", text, "check the address of the server, and that it streams")]
    if before:
        return []
    if facts.publishers and not any(facts.publishers.values()):
        others = f"; topics with poses: {', '.join(facts.others)}" if facts.others else ""
        return [
            error(
                "NO_POSES",
                f"nobody publishes on {listed} in domain {facts.domain} "
                f"(discovery {facts.discovery}){others}",
                "start the motion-capture driver with the same ROS_DOMAIN_ID and "
                "ROS_AUTOMATIC_DISCOVERY_RANGE, or correct lab.poses.topic",
            )
        ]
    return [
        error(
            "NO_POSES",
            f"nothing arrives on {listed}, although somebody is to publish there",
            "check that the motion-capture software tracks and streams",
        )
    ]


def _names(facts: CaptureFacts, lab: LabSettings, bodies: Sequence[str]) -> list[Finding]:
    seen = {s.marker for s in facts.samples}
    wanted = {lab.marker(b): b for b in bodies}
    strangers = sorted(seen - wanted.keys())
    found = []
    for marker in sorted(wanted.keys() - seen):
        near = difflib.get_close_matches(marker, strangers, 1, 0.0)
        hint = f"set lab.bodies.{wanted[marker]}.name"
        hint += f", perhaps to '{near[0]}'" if near else ""
        heard = f"; unknown names: {', '.join(strangers)}" if strangers else ""
        found.append(
            error(
                "WRONG_NAME",
                f"no pose of '{marker}', which is '{wanted[marker]}'{heard}",
                f"{hint}; or make the motion-capture software track the body",
            )
        )
    return found


def _unusable(facts: CaptureFacts, lab: LabSettings, bodies: Sequence[str]) -> list[Finding]:
    """Bodies whose poses are not finite, or no rotation: the bridge leaves such poses out."""
    mapping, found = MarkerMapping(lab, bodies), []
    for body, marker in mapping.markers.items():
        poses = [s.seen for s in facts.samples if s.marker == marker]
        good = sum(mapping.place(body, seen) is not None for seen in poses)
        if good < _USABLE * len(poses):
            bad = f"{len(poses) - good} of {len(poses)} poses of '{marker}'"
            text = f"{bad} cannot be used (not finite, or no valid rotation)"
            remedy = f"motion capture loses '{body}': see that its markers are visible"
            found.append((warning if good else error)("UNUSABLE", text, remedy))
    return found


def _placed(
    facts: CaptureFacts, lab: LabSettings, bodies: Sequence[str]
) -> dict[str, tuple[Placed, ...]]:
    """All measurements of each body in the map."""
    mapping = MarkerMapping(lab, bodies)
    result: dict[str, list[Placed]] = {}
    for sample in facts.samples:
        body = mapping.bodies.get(sample.marker)
        placed = None if body is None else mapping.place(body, sample.seen)
        if body is not None and placed is not None:
            result.setdefault(body, []).append(placed)
    return {b: tuple(p) for b, p in result.items()}


def _spread(facts: CaptureFacts, lab: LabSettings, bodies: Sequence[str]) -> tuple[float, float]:
    """[m] greatest distance of a body from the map's origin, and between two bodies."""
    where = [np.array(p[-1].pose[:2]) for p in _placed(facts, lab, bodies).values()]
    far = max((float(np.hypot(*w)) for w in where), default=0.0)
    gap = max((float(np.hypot(*(a - b))) for a in where for b in where), default=0.0)
    return far, gap


def _units(
    facts: CaptureFacts, lab: LabSettings, bodies: Sequence[str], room: Room
) -> list[Finding]:
    far, gap = _spread(facts, lab, bodies)
    other: Literal["m", "mm"] = "mm" if lab.units == "m" else "m"
    far_other, _ = _spread(facts, replace(lab, units=other), bodies)
    if lab.units == "m" and far > 20.0 * room.size and far_other < 2.0 * room.size:
        text = f"bodies are {far:.0f} m from the origin of a map of {room.size:.1f} m"
        return [
            error("MILLIMETRES", text, "motion capture counts in millimetres: set lab.units: mm")
        ]
    small = 0.01 * room.size
    if lab.units == "mm" and far < small and gap < small and small < far_other < 2.0 * room.size:
        text = f"all bodies are within {1e3 * max(far, gap):.1f} mm of each other and the origin"
        return [error("METRES", text, "motion capture counts in metres: set lab.units: m")]
    return []


def _uneven(facts: CaptureFacts, lab: LabSettings, bodies: Sequence[str]) -> tuple[float, float]:
    """Greatest tilt [rad], and greatest difference of heights [m], of the newest poses."""
    newest = [p[-1] for p in _placed(facts, lab, bodies).values()]
    heights = [p.height for p in newest]
    return (
        max((p.tilt for p in newest), default=0.0),
        max(heights, default=0.0) - min(heights, default=0.0),
    )


def _axes(facts: CaptureFacts, lab: LabSettings, bodies: Sequence[str]) -> list[Finding]:
    tilt, step = _uneven(facts, lab, bodies)
    if tilt < _UPRIGHT and step < _LEVEL:
        return []
    if tilt < _UPRIGHT:  # which the bridge takes
        text = f"bodies are upright, but their heights differ by {step:.2f} m"
        remedy = "ignore this if the markers are at different heights; else correct lab.axes"
        return [warning("WRONG_AXES", text, remedy)]
    text = f"bodies are tilted by {math.degrees(tilt):.0f} degrees, heights differ by {step:.2f} m"
    for name, axes in (*AXES.items(), ("[y, z, x]", ("y", "z", "x"))):
        t, s = _uneven(facts, replace(lab, axes=axes), bodies)
        if t < _UPRIGHT and s < _LEVEL:
            remedy = f"with axes {name} they stand upright on one floor: set lab.axes: {name}"
            return [error("WRONG_AXES", text, remedy)]
    return [
        error(
            "TILTED",
            text + ", in whatever axes",
            "define the rigid bodies anew while they stand upright on the floor",
        )
    ]


def _outside(
    facts: CaptureFacts, lab: LabSettings, bodies: Sequence[str], room: Room
) -> list[Finding]:
    found = []
    for body, placed in _placed(facts, lab, bodies).items():
        x, y = placed[-1].pose[:2]
        if not ((room.low <= (x, y)).all() and ((x, y) <= room.high).all()):
            found.append(
                error(
                    "OUTSIDE",
                    f"{body} is at ({x:.2f}, {y:.2f}) m, outside the map",
                    "measure lab.origin, the pose of the motion-capture frame in the map",
                )
            )
    return found


def _stamps(facts: CaptureFacts, lab: LabSettings, markers: Sequence[str]) -> list[Finding]:
    """Of all bodies, one finding a code; what is right only of the first one."""
    each = [_stamps_of(marker, facts, lab) for marker in markers]
    first = each[0] if each else []
    further = [f for found in each[1:] for f in found if f.weight.value != "fact"]
    return list({f.code: f for f in (*reversed(further), *first)}.values())


def _stamps_of(one: str, facts: CaptureFacts, lab: LabSettings) -> list[Finding]:
    stamps = np.array([s.stamp for s in facts.samples if s.marker == one and s.stamp is not None])
    arrived = np.array(
        [s.arrived for s in facts.samples if s.marker == one and s.stamp is not None]
    )
    if not len(stamps):
        return [fact("STAMPS", "poses have no stamps of capture; the time of arrival is used")]
    by_receipt = "use stamps of arrival: set lab.stamps: receipt"
    steps = np.diff(stamps)
    if lab.stamps == "receipt" and (steps <= 0.0).any():
        return [fact("STAMPS", "the stamps of motion capture are not used (lab.stamps: receipt)")]
    if len(steps) and (steps <= 0.0).mean() > 0.5:
        text = f"the stamps of '{one}' stand still at {stamps[-1]:.3f} s"
        return [error("STALE_CLOCK", text, f"mend the clock of the driver, or {by_receipt}")]
    if len(steps) and (steps < -0.5).any():
        text = f"the stamps of '{one}' go back"
        return [error("CLOCK_BACK", text, f"look for a second driver, or {by_receipt}")]
    ages = arrived - stamps
    mean, spread = float(ages.mean()), float(ages.std())
    if lab.stamps == "capture" and not -0.005 < mean < _FAR_OFF:
        text = f"the stamps of '{one}' differ from this machine's clock by {mean:+.2f} s"
        return [
            warning("CLOCK_OFFSET", text, f"synchronise the clocks (chrony, PTP), or {by_receipt}")
        ]
    kind = "of arrival" if abs(mean) < _RECEIPT and spread < _RECEIPT else "of capture"
    told = f"stamps are {kind}; age {1e3 * mean:.1f} ms, jitter {1e3 * spread:.1f} ms"
    found = [fact("LATENCY", told)]
    if lab.stamps == "capture" and kind == "of capture" and lab.latency is not None:
        excess = mean - lab.latency - lab.latency_spread
        if excess > 0.01:
            declared = f"lab.latency says {1e3 * lab.latency:.0f} ms"
            text = f"the poses of '{one}' are {1e3 * mean:.0f} ms old, {declared}"
            found.append(warning("LATENCY_DECLARED", text, f"set lab.latency: {mean:.3f}"))
    return found


def _rate(facts: CaptureFacts, markers: Sequence[str]) -> list[Finding]:
    """Of the body of which the fewest poses arrived."""
    times = {m: [s.arrived for s in facts.samples if s.marker == m] for m in markers}
    if not times:
        return []
    one = min(times, key=lambda m: len(times[m]))
    arrived = np.array(times[one])
    if len(arrived) < 3 or arrived[-1] <= arrived[0]:
        return [
            warning("RATE", f"only {len(arrived)} poses of '{one}' arrived", "check the stream")
        ]
    gaps = np.diff(arrived)
    rate = 1.0 / float(gaps.mean())
    told = f"'{one}': {rate:.0f} poses per second, longest gap {1e3 * gaps.max():.0f} ms"
    if rate < _SLOW:
        return [warning("RATE", told, "let motion capture send at least 50 frames per second")]
    return [fact("RATE", told)]
