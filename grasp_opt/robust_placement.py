"""Placements for robots that correct errors as they push: with a margin, or with a certificate."""

from collections.abc import Callable
from dataclasses import replace

from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.placement import NoPlacement, Placement, PlacementSettings, Placer
from grasp_opt.slices import Work, finish
from push_model.arrays import Array, Mask
from push_model.specs import ObjectSpec
from push_model.stick_certificate import ContactBelief

_MARGINS = (0.1, 0.05, 0.0)  # that are asked for, one after another


def robust_placement(
    item: ObjectSpec,
    trajectory: ObjectTrajectory,
    count: int,
    radius: float,
    most_force: float,
    settings: PlacementSettings | None = None,
    believed: ContactBelief | None = None,
) -> Placement:
    """``robust_search`` at once."""
    return finish(
        robust_search(item, trajectory, count, radius, most_force, settings, None, believed)
    )


def robust_search(
    item: ObjectSpec,
    trajectory: ObjectTrajectory,
    count: int,
    radius: float,
    most_force: float,
    settings: PlacementSettings | None = None,
    free: Callable[[Array], Mask] | None = None,
    believed: ContactBelief | None = None,
) -> Work[Placement]:
    """The best placement for robots that correct errors as they push: one that holds for all that
    is believed; else with a margin of up to 0.1 as far as there is one. All robots push, and none
    with more than ``most_force`` [N].

    Raises
    ------
    NoPlacement: none holds the task at all.
    """
    settings, candidates = settings or PlacementSettings(), None
    certified = () if believed is None else ((0.0, believed),)
    for least, sure in (*certified, *((least, None) for least in _MARGINS)):
        asked = replace(settings, least_margin=least, only_pushing=True, most_force=most_force)
        placer = Placer(item, trajectory, count, radius, asked, free, candidates, sure)
        candidates = yield from placer.candidates()
        try:
            return (yield from placer.search())
        except NoPlacement:
            if sure is None and least == _MARGINS[-1]:
                raise
    raise AssertionError("unreachable")
