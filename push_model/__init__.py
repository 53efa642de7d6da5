"""Mechanics of planar pushing: SE(2), shapes, friction, limit surfaces, stable pushes, kinematics.

Free space: a distance field of a map, lines of sight, ways of discs and of objects through it.
numpy, scipy and compiled kernels (numba); imports nothing else of the project. SI units, radians,
REP-103 axes.
"""

from push_model import kernel_cache as kernel_cache  # before any file with kernels
from push_model import se2
from push_model.coulomb import cone_angle, cone_edges, in_cone
from push_model.grasp import grasp_matrix, line_contact_grasp
from push_model.kinematics import DifferentialDrive, unicycle_step
from push_model.limit_surface import (
    EllipsoidLimitSurface,
    LimitSurface,
    PressureLimitSurface,
    uniform_pressure_radius,
)
from push_model.push_segment import PushSegment
from push_model.pushable_sides import pushable_sides
from push_model.settings import SettingsError, from_mapping
from push_model.shape_specs import shape_from_mapping
from push_model.shapes import Shape, Side, ellipse, flower, polygon, rectangle
from push_model.stable_push import (
    CurvatureLimits,
    PusherContact,
    contact_on_side,
    curvature_limits,
    lynch_mason_stable,
    shifted_limits,
)
from push_model.trajectory import Trajectory, along_curve, concatenate, line, rotation

__all__ = [
    "CurvatureLimits",
    "DifferentialDrive",
    "EllipsoidLimitSurface",
    "LimitSurface",
    "PressureLimitSurface",
    "PushSegment",
    "PusherContact",
    "SettingsError",
    "Shape",
    "Side",
    "Trajectory",
    "along_curve",
    "concatenate",
    "cone_angle",
    "cone_edges",
    "contact_on_side",
    "curvature_limits",
    "ellipse",
    "flower",
    "from_mapping",
    "grasp_matrix",
    "in_cone",
    "line",
    "line_contact_grasp",
    "lynch_mason_stable",
    "polygon",
    "pushable_sides",
    "rectangle",
    "rotation",
    "se2",
    "shape_from_mapping",
    "shifted_limits",
    "unicycle_step",
    "uniform_pressure_radius",
]
