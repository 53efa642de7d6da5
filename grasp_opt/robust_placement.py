"""Placements for robots that correct errors as they push: with a margin, or with a certificate."""

from collections.abc import Callable
from dataclasses import replace

from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.placement import NoPlacement, Placement, PlacementSettings, Placer
from grasp_opt.slices import Work, finish
from push_model.arrays import Array, Mask
from push_model.specs import ObjectSpec
from push_model.stick_certificate import ContactBelief

MARGIN = 0.1
"""That is asked for, then half of it, then any that holds."""


def robust_placement(
    item: ObjectSpec,
    trajectory: ObjectTrajectory,
    count: int,
    radius: float,
    most_force: float,
    settings: PlacementSettings | None = None,
    believed: ContactBelief | None = None,
    margin: float = MARGIN,
) -> Placement:
    """``robust_search`` at once."""
    return finish(
        robust_search(item, trajectory, count, radius, most_force, settings, None, believed, margin)
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
    margin: float = MARGIN,
) -> Work[Placement]:
    """The best placement for robots that correct errors as they push: one that holds for all that
    is believed; else with a margin, or half of it, as far as there is one. All robots push, none
    with more than ``most_force`` [N].

    Raises
    ------
    NoPlacement: none holds the task at all.
    """
    settings, candidates = settings or PlacementSettings(), None
    certified = () if believed is None else ((0.0, believed),)
    margins = dict.fromkeys((margin, 0.5 * margin, 0.0))
    for least, sure in (*certified, *((least, None) for least in margins)):
        asked = replace(settings, least_margin=least, only_pushing=True, most_force=most_force)
        placer = Placer(item, trajectory, count, radius, asked, free, candidates, sure)
        candidates = yield from placer.candidates()
        try:
            return (yield from placer.search())
        except NoPlacement:
            if sure is None and least == 0.0:
                raise
    raise AssertionError("unreachable")
