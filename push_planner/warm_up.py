"""Load what is compiled before the first request."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from push_model.occupancy import OccupancyGrid
from push_model.specs import ObjectSpec, RobotSpec
from push_planner.arc_pushes import pushes_over_arcs
from push_planner.cost_bound import CostBound
from push_planner.planner import PushPlanner
from push_planner.push_graph import SearchStatistics
from push_planner.robot_path import NoRobotPath, plan_robot_path
from push_planner.run_ends import RunEnds
from push_planner.settings import PlannerSettings
from push_planner.single_run import least_single_run

_HALF = 1.5  # [m] of the map, and more for large bodies
_CELL = 0.02  # [m]
_NODES = 1000  # of a search over arcs


def warm_up(settings: PlannerSettings, robot: RobotSpec, item: ObjectSpec) -> None:
    """Plan a short push by all searches, and a way of the robot from beside a wall, on a small map.

    Raises PlanningFailed, which means no harm.
    """
    half = _HALF + 4.0 * (robot.body_radius + item.geometry.circumradius)
    cells = int(2.0 * half / _CELL)
    occupied = np.zeros((cells, cells), dtype=bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    grid = OccupancyGrid(occupied, _CELL, np.full(2, -half))
    quick = replace(settings, improvement_rounds=0, rrt_iterations=50, max_expansions=2)
    planner = PushPlanner(quick, grid, robot, item)
    ends = np.zeros(3), np.array([0.3, 0.0, 0.0])
    planner.solve(*ends)
    CostBound(planner.scene, *ends).of_boxes(np.zeros((1, 5)))
    known = RunEnds.of(planner.scene, *ends)
    for _ in pushes_over_arcs(planner.scene, known, np.inf, None, _NODES, SearchStatistics()):
        pass
    for _ in least_single_run(planner.scene, known, 0, 1.0):
        pass
    near = half - _CELL - robot.footprint_radius - 0.5 * settings.safety_distance
    beside, away = np.array([-near, 0.0, 0.0]), np.array([0.5 * half, 0.5 * half, 1.0])
    circles = np.array([[0.0, 0.0, robot.footprint_radius]])
    with suppress(NoRobotPath):
        plan_robot_path(planner.scene.field, robot, settings, beside, away, circles)
