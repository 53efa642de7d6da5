"""Types of robots, objects and environments: the contents of the files in config/."""

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from push_model.arrays import Array
from push_model.bumpers import Bumper, FlatBumper
from push_model.drives import Drive, SpeedDrive, TorqueDrive
from push_model.kinematics import DifferentialDrive
from push_model.limit_surface import GRAVITY, EllipsoidLimitSurface, uniform_pressure_radius
from push_model.outlines import convex_hull, inside_convex
from push_model.se2 import compose, pose
from push_model.settings import SettingsError, bounded, settings
from push_model.shape_specs import ShapeSpec
from push_model.shapes import Shape, polygon


@settings
class RobotSpec:
    """A robot type: a round body, its drive and its bumper.

    Its frame is at the axle midpoint with x forward; for a holonomic robot, at the middle. Missing
    values are filled in on construction: the height of the bumper's middle (that of the axle, or
    half the body's without wheels) and the casters (front and rear, or none without wheels).
    """

    drive: Drive
    bumper: Bumper
    body_radius: float = bounded(low=1e-3, high=2.0, doc="Radius of the body (m)")
    body_height: float = bounded(low=1e-3, high=2.0, doc="Height of the body (m)")
    mass: float = bounded(low=1e-3, high=500.0, doc="Total mass (kg)")
    com_ahead: float = bounded(
        0.0,
        low=-2.0,
        high=2.0,
        doc="Position of the body's centre of mass, positive ahead of the axle (m)",
    )
    inertia: float | None = bounded(
        None,
        low=1e-9,
        high=1000.0,
        doc="Inertia I_r about the vertical axis through the centre of mass (kg m^2)",
    )
    casters: tuple[float, ...] | None = bounded(
        None, low=-2.0, high=2.0, doc="Position of each caster, positive ahead of the axle (m)"
    )
    caster_clearance: float = bounded(
        2e-4, low=0.0, high=0.1, doc="Height of the casters above the floor at rest (m)"
    )
    robot_friction: float = bounded(
        1.0,
        low=0.01,
        high=2.0,
        doc="Friction coefficient between two robots of this type (dimensionless).",
    )

    def __post_init__(self) -> None:
        axle = self.drive.wheel_radius if isinstance(self.drive, DifferentialDrive) else None
        if self.bumper.z is None:
            z = self.body_height / 2.0 if axle is None else axle
            object.__setattr__(self, "bumper", replace(self.bumper, z=z))
        if self.casters is None:
            span = 0.75 * self.body_radius
            object.__setattr__(self, "casters", () if axle is None else (span, -span))
        if abs(self.com_ahead) >= self.body_radius:
            raise SettingsError(
                f"com_ahead {self.com_ahead} lies outside the body_radius {self.body_radius}"
            )
        if isinstance(self.drive, SpeedDrive | TorqueDrive):
            wheels = 2.0 * self.drive.wheel_mass
            if wheels >= self.mass:
                raise SettingsError(f"mass {self.mass} must be more than its wheels', {wheels}")

    @property
    def kinematics(self) -> DifferentialDrive | None:
        """Kinematics of its two wheels; None if it moves in any direction."""
        return self.drive if isinstance(self.drive, DifferentialDrive) else None

    @property
    def differential(self) -> DifferentialDrive:
        """Kinematics of its two wheels, for callers that support nothing else.

        Raises
        ------
        SettingsError: it has no wheels.
        """
        if not isinstance(self.drive, DifferentialDrive):
            raise SettingsError(
                f"a robot with two driven wheels is needed, its drive is '{self.drive.kind}'"
            )
        return self.drive

    @property
    def flat_bumper(self) -> FlatBumper:
        """Its bumper, for callers that support only a flat one.

        Raises
        ------
        SettingsError: it is not flat.
        """
        if not isinstance(self.bumper, FlatBumper):
            raise SettingsError(f"a flat bumper is needed, the robot's is a '{self.bumper.kind}'")
        return self.bumper

    @property
    def max_speed(self) -> float:
        """[m/s]."""
        return self.drive.max_speed

    @property
    def max_turn_rate(self) -> float:
        """[rad/s] of a turn in place."""
        return self.drive.max_turn_rate

    @property
    def push_distance(self) -> float:
        """[m] D, from the axle midpoint forward to where the bumper touches."""
        return self.bumper.distance

    @property
    def bumper_z(self) -> float:
        """[m] of the bumper's middle above the floor."""
        assert self.bumper.z is not None  # filled in when it was built
        return self.bumper.z

    @property
    def lever(self) -> float:
        """[m] distance by which a turn of 1 rad moves the wheels (or the rim without wheels)."""
        return self.body_radius if self.kinematics is None else self.kinematics.half_track

    @property
    def footprint_radius(self) -> float:
        """[m] of the circle about the axle midpoint that holds body and bumper."""
        return max(self.body_radius, self.bumper.reach)

    @property
    def outline(self) -> Array:
        """``(n, 2)`` [m] convex outline of body and bumper in the robot frame."""
        return self.bumper.outline(self.body_radius)


@settings
class ObjectSpec:
    """A pushable object.

    Two frames: the *geometric* one has its origin in the centroid of the outline's area. Motion
    capture sees it, and poses in files, on topics and of goals are its poses. Mechanics works about
    the centre of mass, ``com`` in the geometric frame, with parallel axes: ``geometry`` and
    ``limit_surface`` are given there; ``mass_pose`` and ``geometric_pose`` convert.
    The two are the same when ``com`` is (0, 0).
    """

    shape: ShapeSpec
    mass: float = bounded(low=1e-3, high=500.0, doc="Mass of the object (kg)")
    height: float = bounded(low=5e-3, high=2.0, doc="Height of the object (m)")
    floor_friction: float = bounded(
        low=0.01, high=2.0, doc="Friction coefficient of object and floor (dimensionless)"
    )
    contact_friction: float = bounded(
        low=0.0, high=2.0, doc="Friction coefficient of bumper and object (dimensionless)"
    )
    feet: int = bounded(
        4, low=3, high=16, doc="Number of soft feet under an object in the PyBullet world"
    )
    com: tuple[float, float] = bounded(
        (0.0, 0.0), low=-100.0, high=100.0, doc="Centre of mass in the geometric frame (m)"
    )
    inertia: float | None = bounded(
        None,
        low=1e-9,
        high=1e6,
        doc="Inertia about the centre of mass (kg m^2); default: that of uniform density",
    )

    def __post_init__(self) -> None:
        if not inside_convex(convex_hull(self.outline), np.array([self.com]))[0]:
            raise SettingsError(
                f"com {self.com} must lie within the object, which would tip over otherwise"
            )

    @cached_property
    def geometry(self) -> Shape:
        """The shape about the centre of mass."""
        shape = self.shape.shape()
        return shape if self.com == (0.0, 0.0) else shape.about(self.com)

    @cached_property
    def outline(self) -> Array:
        """``(n, 2)`` [m] in the geometric frame."""
        return self.shape.shape().outline

    @cached_property
    def pressure_radius(self) -> float:
        """[m] spin torque of the floor under uniform pressure, over its greatest force."""
        return uniform_pressure_radius(self.geometry)

    @property
    def moment(self) -> float:
        """[kg m^2] about the vertical through the centre of mass."""
        if self.inertia is not None:
            return self.inertia
        return self.mass * self.geometry.inertia_per_mass

    def mass_pose(self, geometric: Array) -> Array:
        """Pose ``(3,)`` of the centre of mass when the geometric frame is there."""
        return geometric if self.com == (0.0, 0.0) else compose(geometric, pose(*self.com, 0.0))

    def geometric_pose(self, mass: Array) -> Array:
        """Pose ``(3,)`` of the geometric frame when the centre of mass is there."""
        x, y = self.com
        return mass if self.com == (0.0, 0.0) else compose(mass, pose(-x, -y, 0.0))

    def limit_surface(self) -> EllipsoidLimitSurface:
        """Ellipsoid about the centre of mass, with force and spin torque of uniform pressure."""
        force = self.floor_friction * self.mass * GRAVITY
        return EllipsoidLimitSurface(force, force * self.pressure_radius)


@settings
class BoxSpec:
    """A box-shaped obstacle."""

    centre: tuple[float, float]
    size: tuple[float, float]
    yaw: float = 0.0

    def __post_init__(self) -> None:
        if not all(math.isfinite(s) and s > 0.0 for s in self.size):
            raise SettingsError(f"size must be positive, got {self.size}")


@settings
class CircleSpec:
    """A round obstacle."""

    centre: tuple[float, float]
    radius: float = bounded(low=1e-3, high=100.0, doc="Radius of the obstacle (m)")


@settings
class PolygonSpec:
    """A convex polygonal obstacle."""

    vertices: tuple[tuple[float, float], ...]


@settings
class EnvironmentSpec:
    """An arena centred on the origin, with walls around it and obstacles inside."""

    size: tuple[float, float]
    boxes: tuple[BoxSpec, ...] = ()
    circles: tuple[CircleSpec, ...] = ()
    polygons: tuple[PolygonSpec, ...] = ()
    resolution: float = bounded(0.01, low=1e-3, high=0.5, doc="Cell size of the occupancy grid (m)")
    wall_height: float = bounded(0.1, low=0.01, high=5.0, doc="Height of the walls (m)")
    wall_friction: float = bounded(
        0.3,
        low=0.0,
        high=2.0,
        doc="Friction coefficient of robot or object and wall (dimensionless)",
    )

    def __post_init__(self) -> None:
        if not all(math.isfinite(s) and s > 0.0 for s in self.size):
            raise SettingsError(f"size must be positive, got {self.size}")
        if self.size[0] * self.size[1] / self.resolution**2 > 4e6:
            raise SettingsError("the grid would have over four million cells; coarsen resolution")
        for p in self.polygons:
            if not polygon(np.array(p.vertices)).convex:
                raise SettingsError("an obstacle polygon must be convex; split it")
