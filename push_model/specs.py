"""What a robot, an object and an environment are: the typed contents of the files in config/."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_model.limit_surface import GRAVITY, EllipsoidLimitSurface, uniform_pressure_radius
from push_model.settings import SettingsError, bounded
from push_model.shapes import Shape, shape_from_mapping


@dataclass(frozen=True)
class BumperSpec:
    """What a robot pushes with."""

    kind: Literal["flat"]
    width: float = bounded(low=1e-3, high=2.0, doc="[m] of the flat face")
    distance: float = bounded(low=1e-3, high=2.0, doc="[m] D, axle to face")
    height: float = bounded(0.006, low=1e-3, high=1.0, doc="[m] of the face, at axle height")


@dataclass(frozen=True)
class RobotSpec:
    """A differential-drive robot type."""

    wheel_radius: float = bounded(low=1e-3, high=1.0, doc="[m]")
    half_track: float = bounded(low=1e-3, high=1.0, doc="[m] half the wheel distance")
    max_wheel_speed: float = bounded(low=1e-2, high=100.0, doc="[rad/s]")
    body_radius: float = bounded(low=1e-3, high=2.0, doc="[m]")
    body_height: float = bounded(low=1e-3, high=2.0, doc="[m]")
    mass: float = bounded(low=1e-3, high=500.0, doc="[kg] in all")
    wheel_mass: float = bounded(low=1e-4, high=50.0, doc="[kg] of one wheel")
    wheel_torque: float = bounded(low=1e-4, high=100.0, doc="[Nm] greatest motor torque")
    wheel_friction: float = bounded(1.0, low=0.0, high=3.0, doc="wheel on floor")
    bumper: BumperSpec = field(default_factory=lambda: BumperSpec("flat", 0.07, 0.05))

    @property
    def drive(self) -> DifferentialDrive:
        """Its kinematics."""
        return DifferentialDrive(self.wheel_radius, self.half_track, self.max_wheel_speed)

    @property
    def footprint_radius(self) -> float:
        """[m] of the circle about the axle midpoint that holds body and bumper."""
        corner = math.hypot(self.bumper.distance, self.bumper.width / 2.0)
        return max(self.body_radius, corner)

    @property
    def outline(self) -> Array:
        """``(n, 2)`` [m] convex outline of body and bumper in the robot frame."""
        angle = np.linspace(math.pi / 2.0, 1.5 * math.pi, 13)
        back = self.body_radius * np.column_stack([np.cos(angle), np.sin(angle)])
        d, w = self.bumper.distance, self.bumper.width / 2.0
        return np.vstack([back, [[d, -w], [d, w]]])


@dataclass(frozen=True)
class ObjectSpec:
    """A pushable object."""

    shape: dict[str, Any]
    mass: float = bounded(low=1e-3, high=500.0, doc="[kg]")
    height: float = bounded(low=5e-3, high=2.0, doc="[m]")
    floor_friction: float = bounded(low=0.01, high=2.0, doc="object on floor")
    contact_friction: float = bounded(low=0.0, high=2.0, doc="robot on object")
    feet: int = bounded(4, low=3, high=16, doc="number of soft feet, see docs/physics.md")

    def __post_init__(self) -> None:
        shape_from_mapping(self.shape)

    @property
    def geometry(self) -> Shape:
        """The shape."""
        return shape_from_mapping(self.shape)

    def limit_surface(self) -> EllipsoidLimitSurface:
        """Ellipsoid with the force and pure-spin torque of uniform pressure."""
        force = self.floor_friction * self.mass * GRAVITY
        return EllipsoidLimitSurface(force, force * uniform_pressure_radius(self.geometry))


@dataclass(frozen=True)
class BoxSpec:
    """A box-shaped obstacle."""

    centre: tuple[float, float]
    size: tuple[float, float]
    yaw: float = 0.0

    def __post_init__(self) -> None:
        if not all(math.isfinite(s) and s > 0.0 for s in self.size):
            raise SettingsError(f"size must be positive, got {self.size}")


@dataclass(frozen=True)
class CircleSpec:
    """A round obstacle."""

    centre: tuple[float, float]
    radius: float = bounded(low=1e-3, high=100.0, doc="[m]")


@dataclass(frozen=True)
class PolygonSpec:
    """A convex polygonal obstacle."""

    vertices: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class EnvironmentSpec:
    """An arena centred on the origin with walls all round and obstacles inside."""

    size: tuple[float, float]
    boxes: tuple[BoxSpec, ...] = ()
    circles: tuple[CircleSpec, ...] = ()
    polygons: tuple[PolygonSpec, ...] = ()
    resolution: float = bounded(0.01, low=1e-3, high=0.5, doc="[m] of the occupancy grid")
    wall_height: float = bounded(0.1, low=0.01, high=5.0, doc="[m]")
    wall_friction: float = bounded(0.3, low=0.0, high=2.0, doc="robot or object on wall")

    def __post_init__(self) -> None:
        if not all(math.isfinite(s) and s > 0.0 for s in self.size):
            raise SettingsError(f"size must be positive, got {self.size}")
        if self.size[0] * self.size[1] / self.resolution**2 > 4e6:
            raise SettingsError("the grid would have over four million cells; coarsen resolution")
        for p in self.polygons:
            if not shape_from_mapping({"polygon": {"vertices": p.vertices}}).convex:
                raise SettingsError("an obstacle polygon must be convex; split it")
