"""The colours of bodies, plans and layers: the same on the page, in reports and in pictures.

Five of the colours of robots and sides are those of Okabe and Ito, which people with
colour-blindness can tell apart. Whatever a colour says is also said by a name, a dash or a shape.
"""

import colorsys
import zlib

ROBOTS = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#56b4e9",
    "#b8860b",
    "#7a5fd0",
    "#6b8e23",
)
"""One robot after another; also sides of an object, and teams."""

OBJECT, GOAL, PLAN, INK = "#8a6a4a", "#c22f3d", "#777777", "#222222"
OBSTACLE = "#6e6e6e"

EACH = 50
"""Number of robots up to which they have the colours of ``ROBOTS``, in turn; more robots have the
colour of their team."""

_LAYERS = {
    "forces": "#1b7837",
    "friction cones": "#74a883",
    "wrench": "#762a83",
    "way": "#777777",
    "density": "#7b6fb0",
    "cells": "#999999",
    "centroids": "#c05a1a",
    "region": "#aaaaaa",
    "target": "#c22f3d",
    "not moving": "#8a1c1c",
}


def robot_colour(number: int) -> str:
    """Of a robot by its number in the scenario, or of a side or a team by its number."""
    return ROBOTS[number % len(ROBOTS)]


def layer_colour(layer: str) -> str:
    """Of a layer of a report: a fixed one, or one that follows from its name."""
    if layer in _LAYERS:
        return _LAYERS[layer]
    hue = (zlib.crc32(layer.encode()) % 360) / 360.0
    red, green, blue = (round(255 * v) for v in colorsys.hls_to_rgb(hue, 0.4, 0.55))
    return f"#{red:02x}{green:02x}{blue:02x}"
