"""What a placement of robots is judged by."""

from typing import Literal

from push_model.settings import bounded, settings


@settings
class PlacementWeights:
    """Weights of (3.16) and room between robots."""

    model: Literal["limit_surface", "printed"] = bounded(
        "limit_surface",
        doc="Model of the object's motion in the placement cost (3.16) of the thesis: "
        "'limit_surface', or 'printed' for (3.17) as printed.",
    )
    steps: int = bounded(
        50,
        low=5,
        high=1000,
        doc="Number N of time steps into which the placement cost (3.16) of the thesis divides a "
        "given trajectory; for pushes to a goal, see the parameter 'steps' of the optimizer.",
    )
    position_weight: float = bounded(
        1e4,
        low=1e-6,
        high=1e9,
        doc="Weight Q of position errors in the placement cost (3.16) of the thesis (1/m^2).",
    )
    orientation_weight: float = bounded(
        200.0,
        low=0.0,
        high=1e9,
        doc="Weight Q of orientation errors in the placement cost (3.16) of the thesis (1/rad^2).",
    )
    force_weight: float = bounded(
        0.05,
        low=1e-9,
        high=1e9,
        doc="Weight R of contact forces in the placement cost (3.16) of the thesis; forces are "
        "fractions of the floor friction (dimensionless).",
    )
    gap: float = bounded(
        5e-3,
        low=0.0,
        high=1.0,
        doc="Least gap between the bodies of two robots that push along a given trajectory (m); "
        "for pushes to a goal, see the parameter 'gap' of the optimizer.",
    )
    corner: float = bounded(
        0.015,
        low=0.0,
        high=1.0,
        doc="Least distance of a contact from a corner of the object's outline (m).",
    )


@settings
class PlacementSettings(PlacementWeights):
    """What a placement must hold besides; the optimizer chooses it from the task itself."""

    least_margin: float = bounded(
        -1.0,
        low=-1.0,
        high=1.0,
        doc="Least margin of the grasp-task compatibility test that a placement must have: the "
        "sine of an angle (dimensionless).",
    )
    only_pushing: bool = bounded(
        False,
        doc="Whether only placements are accepted in which every robot pushes during the whole "
        "task.",
    )
    most_force: float = bounded(
        1e6,
        low=1e-3,
        high=1e6,
        doc="Highest force that a robot may exert, at most its traction (N).",
    )
