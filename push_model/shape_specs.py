"""Shapes in files: ``{rectangle: {length: 0.09, width: 0.09}}``, chosen by their key.

``{kind: rectangle, length: 0.09, width: 0.09}`` means the same.
"""

from dataclasses import field
from typing import Annotated, Any, Literal

import numpy as np

from push_model.settings import bounded, from_mapping, settings, told_by_key
from push_model.shapes import Shape, ellipse, flower, polygon, rectangle


@settings
class RectangleShape:
    """A rectangle; its frame is in the middle."""

    kind: Literal["rectangle"] = field(default="rectangle", kw_only=True)
    length: float = bounded(low=1e-4, high=100.0, doc="Size along x (m)")
    width: float = bounded(low=1e-4, high=100.0, doc="Size along y (m)")

    def shape(self) -> Shape:
        """The shape."""
        return rectangle(self.length, self.width)


@settings
class PolygonShape:
    """A simple polygon, convex or not."""

    kind: Literal["polygon"] = field(default="polygon", kw_only=True)
    vertices: tuple[tuple[float, float], ...] = bounded(
        low=-100.0, high=100.0, doc="Corners in order, clockwise or counter-clockwise (m)"
    )
    frame: Literal["centroid", "given"] = bounded(
        "centroid",
        doc="Frame of the object: 'centroid' puts its origin at the centroid of the polygon; "
        "'given' keeps the frame of the corners. Motion capture gives the pose of this frame",
    )

    def __post_init__(self) -> None:
        self.shape()

    def shape(self) -> Shape:
        """The shape."""
        return polygon(np.array(self.vertices), moved=self.frame == "centroid")


@settings
class EllipseShape:
    """An ellipse; its frame is in the middle."""

    kind: Literal["ellipse"] = field(default="ellipse", kw_only=True)
    semi_axis_x: float = bounded(low=1e-4, high=100.0, doc="Semi-axis along x (m)")
    semi_axis_y: float = bounded(low=1e-4, high=100.0, doc="Semi-axis along y (m)")

    def shape(self) -> Shape:
        """The shape."""
        return ellipse(self.semi_axis_x, self.semi_axis_y)


@settings
class FlowerShape:
    """r(phi) = radius + amplitude cos(petals phi)."""

    kind: Literal["flower"] = field(default="flower", kw_only=True)
    radius: float = bounded(low=1e-4, high=100.0, doc="Mean radius (m)")
    amplitude: float = bounded(low=0.0, high=100.0, doc="Amplitude of the petals (m)")
    petals: int = bounded(low=2, high=60, doc="Number of petals")

    def __post_init__(self) -> None:
        self.shape()

    def shape(self) -> Shape:
        """The shape."""
        return flower(self.radius, self.amplitude, self.petals)


ShapeSpec = Annotated[
    RectangleShape | PolygonShape | EllipseShape | FlowerShape,
    told_by_key("rectangle", "polygon", "ellipse", "flower"),
]


@settings
class _Shaped:
    shape: ShapeSpec


def shape_from_mapping(values: Any) -> Shape:
    """The shape of parsed YAML.

    Raises
    ------
    SettingsError: unknown kind or wrong sizes; names them and what was expected.
    """
    return from_mapping(_Shaped, {"shape": values}, "").shape.shape()
