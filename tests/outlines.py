"""Outlines of objects that are long or not convex; an e-puck fits into the recess of the U."""

from push_model.settings import from_mapping
from push_model.specs import ObjectSpec

L = [[0, 0], [0.2, 0], [0.2, 0.06], [0.06, 0.06], [0.06, 0.2], [0, 0.2]]
T = [[0, 0], [0.24, 0], [0.24, 0.06], [0.15, 0.06], [0.15, 0.2], [0.09, 0.2], [0.09, 0.06]]
T = [*T, [0, 0.06]]
U = [[0, 0], [0.24, 0], [0.24, 0.14], [0.19, 0.14], [0.19, 0.05], [0.05, 0.05], [0.05, 0.14]]
U = [*U, [0, 0.14]]
SLIM = [[0, 0], [0.3, 0], [0.3, 0.05], [0, 0.05]]
CONCAVE = (L, T, U)


def values_of(outline):
    """An object of this outline, as it stands in a file."""
    return {
        "shape": {"polygon": {"vertices": outline}},
        "mass": 0.05,
        "height": 0.06,
        "floor_friction": 0.3,
        "contact_friction": 0.2,
    }


def item_of(outline):
    return from_mapping(ObjectSpec, values_of(outline), "")
