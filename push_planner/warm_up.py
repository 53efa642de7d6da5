"""Load what is compiled before the first request."""

from dataclasses import replace

import numpy as np

from push_model.occupancy import OccupancyGrid
from push_model.specs import ObjectSpec, RobotSpec
from push_planner.planner import PushPlanner
from push_planner.settings import PlannerSettings

_HALF = 1.5  # [m] of the map, and more for large bodies
_CELL = 0.02  # [m]


def warm_up(settings: PlannerSettings, robot: RobotSpec, item: ObjectSpec) -> None:
    """Plan a short push on a small map. Raises PlanningFailed, which means no harm."""
    half = _HALF + 4.0 * (robot.body_radius + item.geometry.circumradius)
    cells = int(2.0 * half / _CELL)
    occupied = np.zeros((cells, cells), dtype=bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    grid = OccupancyGrid(occupied, _CELL, np.full(2, -half))
    quick = replace(settings, improvement_rounds=0, rrt_iterations=50, max_expansions=2)
    PushPlanner(quick, grid, robot, item).solve(np.zeros(3), np.array([0.3, 0.0, 0.0]))
