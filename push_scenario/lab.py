"""The ``lab`` section of a scenario: where poses come from, and how robots are commanded.

A driver is chosen by ``kind``; ``other`` names one outside the packages. The drivers themselves are
in ``lab_bridge``, a file each.
"""

from collections.abc import Collection
from dataclasses import field
from typing import Any, Literal

import numpy as np

from push_model.arrays import Array
from push_model.settings import SettingsError, bounded, settings
from push_scenario.poses import PoseValue

AXES: dict[str, tuple[str, str, str]] = {"z_up": ("x", "y", "z"), "y_up": ("x", "-z", "y")}
"""Names for two usual choices of ``axes``."""

UNITS = {"m": 1.0, "mm": 1e-3}
"""[m] of a unit of length."""


@settings
class PoseStampedSource:
    """A topic of geometry_msgs/PoseStamped for each body."""

    kind: Literal["pose_stamped"] = field(default="pose_stamped", kw_only=True)
    topic: str = bounded(
        "/{name}/pose", doc="Topic of a body; {name} stands for the body's name in motion capture"
    )


@settings
class PoseArraySource:
    """One topic of geometry_msgs/PoseArray. Its poses have no names, so their order is given."""

    kind: Literal["pose_array"] = field(default="pose_array", kw_only=True)
    topic: str = bounded(doc="Topic of the poses")
    order: tuple[str, ...] = bounded(doc="Names of the poses of an array, in their order")


@settings
class NamedPoseArraySource:
    """One topic of motion_capture_tracking_interfaces/NamedPoseArray."""

    kind: Literal["named_pose_array"] = field(default="named_pose_array", kw_only=True)
    topic: str = bounded(
        "/mocap/poses",
        doc="Topic of the poses of motion capture; it must not be the topic /poses of this suite",
    )


@settings
class TransformSource:
    """Transforms of tf2_msgs/TFMessage; the name of a body is its child frame."""

    kind: Literal["tf"] = field(default="tf", kw_only=True)
    topic: str = bounded("/tf", doc="Topic of the transforms")
    frame: str = bounded("", doc="Parent frame of the bodies; transforms from others are ignored")


@settings
class MotionCaptureSource:
    """A motion-capture server, read by the Python package ``motioncapture``."""

    kind: Literal["motioncapture"] = field(default="motioncapture", kw_only=True)
    system: str = bounded(doc="Kind of server, for example optitrack, vicon, qualisys, vrpn, mock")
    options: dict[str, str] = bounded(
        doc="Options of the connection, for example hostname; see the package's documentation"
    )


@settings
class OtherSource:
    """A pose driver outside the packages."""

    kind: Literal["other"] = field(default="other", kw_only=True)
    driver: str = bounded(doc="The driver, as MODULE:ATTRIBUTE")
    settings: dict[str, Any] = field(default_factory=dict)


PoseSource = (
    PoseStampedSource
    | PoseArraySource
    | NamedPoseArraySource
    | TransformSource
    | MotionCaptureSource
    | OtherSource
)


@settings
class TwistLink:
    """A robot that takes geometry_msgs/Twist or TwistStamped."""

    kind: Literal["twist"] = field(default="twist", kw_only=True)
    topic: str = bounded(doc="Topic of the robot's velocity commands")
    stamped: bool = bounded(False, doc="Whether the type is TwistStamped instead of Twist")


@settings
class WheelsLink:
    """A robot that takes wheel speeds as std_msgs/Float64MultiArray."""

    kind: Literal["wheels"] = field(default="wheels", kw_only=True)
    topic: str = bounded(doc="Topic of the wheel speeds")
    scale: float = bounded(
        1.0,
        low=-1e6,
        high=1e6,
        doc="Value on the topic for a wheel speed of 1 rad/s; negative for reversed motors",
    )
    left_first: bool = bounded(True, doc="Whether the left wheel comes first in the array")


@settings
class EPuck2Link:
    """An e-puck2 with the maker's WiFi firmware, over TCP."""

    kind: Literal["epuck2"] = field(default="epuck2", kw_only=True)
    host: str = bounded(doc="Address of the robot")
    port: int = bounded(1000, low=1, high=65535, doc="TCP port of the robot")
    steps_per_turn: float = bounded(
        1000.0, low=1.0, high=1e6, doc="Motor steps per revolution of a wheel (dimensionless)"
    )
    max_steps: int = bounded(
        1000, low=1, high=1100, doc="Greatest speed that is sent to a motor (steps/s)"
    )
    silence: float = bounded(
        1.0,
        low=0.05,
        high=60.0,
        doc="Time without an answer after which the connection counts as lost (s)",
    )


@settings
class OtherLink:
    """A robot driver outside the packages."""

    kind: Literal["other"] = field(default="other", kw_only=True)
    driver: str = bounded(doc="The driver, as MODULE:ATTRIBUTE")
    settings: dict[str, Any] = field(default_factory=dict)


RobotLink = TwistLink | WheelsLink | EPuck2Link | OtherLink


@settings
class LabBody:
    """How motion capture sees a body."""

    name: str = bounded("", doc="Name of the body in motion capture; default: as in the scenario")
    offset: PoseValue = bounded(
        (0.0, 0.0, 0.0),
        doc="Pose [x, y, yaw] [m, m, rad] of the marker frame in the frame of the body",
    )


@settings
class LabSettings:
    """Drivers of poses and robots, and how measured poses become poses in the map."""

    poses: PoseSource
    robots: dict[str, RobotLink]
    bodies: dict[str, LabBody] = field(default_factory=dict)
    axes: str | tuple[str, str, str] = bounded(
        "z_up",
        doc="The map's x, y and z (up) in axes of motion capture: z_up, y_up, or a list such as "
        "[x, -z, y]",
    )
    units: Literal["m", "mm"] = bounded("m", doc="Unit of the measured positions")
    origin: PoseValue = bounded(
        (0.0, 0.0, 0.0),
        doc="Pose [x, y, yaw] [m, m, rad] of the motion-capture frame in the map, after axes "
        "and units are applied",
    )
    stamps: Literal["capture", "receipt"] = bounded(
        "capture",
        doc="Time to which a pose belongs: 'capture' (the stamp of its message) or 'receipt' (the "
        "time of its arrival)",
    )
    latency: float | None = bounded(
        None,
        low=0.0,
        high=1.0,
        doc="Age of a pose when it arrives (s), published on /belief; default: not published",
    )
    latency_spread: float = bounded(
        0.0,
        low=0.0,
        high=0.5,
        doc="Half width of the interval of the latency (s)",
    )

    def __post_init__(self) -> None:
        axes_matrix(self.axes)
        if self.latency is None and self.latency_spread > 0.0:
            raise SettingsError("latency_spread needs a latency")

    def marker(self, body: str) -> str:
        """Name of a body in motion capture."""
        entry = self.bodies.get(body)
        return entry.name if entry is not None and entry.name else body

    def offset(self, body: str) -> Array:
        """``(3,)`` pose of the marker frame in the frame of the body [m, m, rad]."""
        entry = self.bodies.get(body)
        return np.array(entry.offset if entry is not None else (0.0, 0.0, 0.0), dtype=np.float64)


def axes_matrix(axes: str | tuple[str, ...]) -> Array:
    """``(3, 3)`` rotation from axes of motion capture to those of the map.

    Raises
    ------
    SettingsError: no such name, an axis twice, or a mirror image.
    """
    names = AXES.get(axes) if isinstance(axes, str) else axes
    known = "z_up, y_up, or three of x, y, z with or without '-', for example [x, -z, y]"
    if names is None:
        raise SettingsError(f"axes: expected {known}; got '{axes}'")
    letters = [str(n).removeprefix("-") for n in names]
    if sorted(letters) != ["x", "y", "z"]:
        raise SettingsError(f"axes: expected {known}; got {list(names)}")
    matrix = np.zeros((3, 3))
    for row, name in enumerate(names):
        matrix[row, "xyz".index(letters[row])] = -1.0 if name.startswith("-") else 1.0
    if np.linalg.det(matrix) < 0.0:
        raise SettingsError(
            f"axes: {list(names)} is a mirror image; change the sign of one axis, or swap two"
        )
    return matrix


def check_lab(
    lab: LabSettings, robots: Collection[str], objects: Collection[str], where: str
) -> None:
    """Raise SettingsError unless a lab has a driver for each robot and knows no other body."""
    bodies = {*robots, *objects}
    found = [
        f"{where}.robots: no driver for the robot '{r}'" for r in robots if r not in lab.robots
    ]
    for section, names, known in (
        ("robots", lab.robots, robots),
        ("bodies", lab.bodies, bodies),
    ):
        strange = sorted(set(names) - set(known))
        if strange:
            listed = ", ".join(known)
            found.append(f"{where}.{section}: {strange} not in the scenario, which has: {listed}")
    markers: dict[str, str] = {}
    for body in (*robots, *objects):
        other = markers.setdefault(lab.marker(body), body)
        if other != body:
            found.append(
                f"{where}.bodies: '{other}' and '{body}' have the same name in motion capture, "
                f"'{lab.marker(body)}'"
            )
    if found:
        raise SettingsError("\n".join(found))
