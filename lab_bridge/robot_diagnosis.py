"""What is wrong with robots, judged from their links and from how they moved. No ROS here."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lab_bridge.findings import Finding, error, fact, warning
from push_model.arrays import Array

_MOVED = 0.3  # of the expected way
_SCALE = 0.2  # relative error of the way that is still right
_TURNED = 0.5  # of the angle
_ASKEW = math.radians(12.0)


@dataclass(frozen=True)
class DriveTest:
    """A robot was let go straight ahead, and then to turn on the spot.

    ahead, turn: expected way [m] and angle [rad], both positive. way: ``(3,)`` measured motion
    [m, m, rad] of the straight part, in the robot's frame at its start. turned: [rad] measured
    angle of the turn. others: robots that moved although only this one was commanded.
    """

    ahead: float
    turn: float
    way: Array
    turned: float
    others: Sequence[str] = ()


@dataclass(frozen=True)
class RobotFacts:
    """troubles: of each link, empty where it is connected. tests: of robots that were driven; None
    where motion capture lost the robot meanwhile. seen: robots that motion capture shows."""

    troubles: Mapping[str, str]
    tests: Mapping[str, DriveTest | None] = field(default_factory=dict)
    seen: frozenset[str] | None = None


def diagnose_robots(facts: RobotFacts) -> list[Finding]:
    """Findings, robot by robot."""
    found = []
    for robot, trouble in facts.troubles.items():
        if trouble:
            remedy = (
                "switch it on, check its address and the network, and that no other program uses it"
            )
            found.append(error("ROBOT_SILENT", f"{robot}: {trouble}", remedy))
        elif facts.seen is not None and robot not in facts.seen:
            text = f"{robot} is connected, but motion capture does not show it"
            found.append(error("NOT_SEEN", text, "see planar-push doctor mocap"))
        elif robot in facts.tests:
            test = facts.tests[robot]
            if test is None:
                text = f"motion capture lost {robot} while it drove"
                found.append(error("NOT_SEEN", text, "see planar-push doctor mocap"))
            else:
                found += _drive(robot, test)
        else:
            found.append(fact("CONNECTED", f"{robot} answers"))
    return found


def _drive(robot: str, test: DriveTest) -> list[Finding]:
    length = float(np.hypot(*test.way[:2]))
    stays, faces = length < _MOVED * test.ahead, abs(test.turned) < _MOVED * test.turn
    if stays and faces:
        if test.others:
            text = f"{robot} was commanded, but {', '.join(test.others)} moved"
            return [error("ROBOTS_SWAPPED", text, "exchange their addresses or their names")]
        return [
            error(
                "NO_MOTION",
                f"{robot} is connected, but it does not move",
                "check its battery, its selector, and that its wheels touch the floor",
            )
        ]
    if stays or faces:
        text = "turns, but does not drive ahead" if stays else "drives ahead, but does not turn"
        remedy = "check both motors, and how the robot driver converts v and omega to wheel speeds"
        return [error("NO_MOTION", f"{robot} {text}", remedy)]
    forward = float(test.way[0]) > 0.0
    left = test.turned > 0.0
    if not forward and not left:
        text = f"{robot} drives and turns the wrong way round"
        remedy = "its motors are reversed, or left and right and their signs are exchanged"
        return [error("ROBOT_REVERSED", text, remedy)]
    if not left:
        text = f"{robot} turns the wrong way round"
        return [error("WHEELS_SWAPPED", text, "exchange the left and the right wheel")]
    angle = math.atan2(test.way[1], test.way[0]) - 0.5 * float(test.way[2])
    if abs(angle) > _ASKEW:
        return [
            error(
                "MARKER_YAW",
                f"{robot} drives at {math.degrees(angle):.0f} degrees to its heading",
                f"add {-angle:+.3f} rad to the yaw of lab.bodies.{robot}.offset, or run "
                "planar-push calibrate",
            )
        ]
    ratio = length / test.ahead
    if abs(ratio - 1.0) > _SCALE:
        return [
            warning(
                "SCALE",
                f"{robot} goes {ratio:.2f} times as far as commanded",
                "check wheel_radius of its type, and lab.units",
            )
        ]
    ratio_of_turn = test.turned / test.turn
    if abs(ratio_of_turn - 1.0) > _TURNED:
        text = f"{robot} turns {ratio_of_turn:.2f} times as far as commanded"
        return [warning("SCALE", text, "check wheel_radius and half_track of its type")]
    return [
        fact("DRIVES", f"{robot} drives and turns as commanded ({100.0 * ratio:.0f} % of the way)")
    ]
