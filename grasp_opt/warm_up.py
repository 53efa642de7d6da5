"""Loads what is compiled before the first request, so that no plan pays for it."""

from dataclasses import replace

import numpy as np

from grasp_opt.object_trajectory import screw
from grasp_opt.placement import NoPlacement, PlacementSettings
from grasp_opt.robust_placement import robust_placement
from push_model import object_way
from push_model.specs import ObjectSpec, RobotSpec


def warm_up(item: ObjectSpec, robot: RobotSpec, settings: PlacementSettings | None = None) -> str:
    """Find a way for an object, and place two robots for a short push.

    Returns why there is no placement, which does not matter, or nothing.
    """
    object_way.warm_up()
    ahead = screw(np.zeros(3), np.array([0.1, 0.0, 0.0]), 0.05, 0.05, 0.2)
    few = replace(settings or PlacementSettings(), steps=5)
    try:
        robust_placement(item, ahead, 2, robot.footprint_radius, 1e3, few)
    except NoPlacement as error:
        return str(error)
    return ""
