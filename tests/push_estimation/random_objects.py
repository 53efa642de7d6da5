"""Random robots and objects for a calibration, by a seed."""

from dataclasses import dataclass, replace

import numpy as np

from push_estimation.calibration_runs import Calibration, Plan, Runs
from push_model import se2
from push_model.arrays import Array
from push_model.shape_specs import PolygonShape, RectangleShape
from push_model.specs import ObjectSpec
from push_scenario.bodies import load_object, load_robot
from tests.push_estimation.planar_rig import PlanarRig


@dataclass(frozen=True)
class Case:
    """What is true, and what was found."""

    item: ObjectSpec
    distance: float
    marker: Array
    found: Calibration

    @property
    def floor(self) -> bool:
        return holds(self.found.floor, self.item.floor_friction)

    @property
    def contact(self) -> bool:
        return holds(self.found.contact, self.item.contact_friction)

    @property
    def distance_error(self) -> float:
        """[m]"""
        return np.inf if self.found.distance is None else self.found.distance.value - self.distance

    @property
    def frame_error(self) -> Array:
        """``(3,)`` [m, m, rad] of the robot's frame."""
        return se2.between(se2.inverse(self.marker), self.found.frame)


def holds(interval, truth):
    return interval is not None and interval.low <= truth <= interval.high


def calibrated(seed: int, holes: tuple[float, float] = (np.inf, 0.0)) -> Case:
    """A random box or hexagon, a random bumper and marker frame, 0.1 mm and 0.03 degrees of noise;
    calibrated with what the files say of the 9 cm box. holes: see PlanarRig."""
    luck = np.random.default_rng(seed)
    box, epuck = load_object("box9"), load_robot("epuck")
    if luck.random() < 0.7:
        shape = RectangleShape(length=luck.uniform(0.08, 0.2), width=luck.uniform(0.08, 0.2))
    else:
        angle = np.arange(6) * np.pi / 3 + np.pi / 6
        corners = luck.uniform(0.08, 0.12) * np.column_stack([np.cos(angle), np.sin(angle)])
        shape = PolygonShape(vertices=tuple((float(x), float(y)) for x, y in corners))
    item = replace(
        box,
        shape=shape,
        mass=luck.uniform(0.03, 0.2),
        floor_friction=luck.uniform(0.15, 0.6),
        contact_friction=luck.uniform(0.1, 0.45),
    )
    bumper = replace(epuck.bumper, distance=luck.uniform(0.045, 0.056))
    marker = np.array([*luck.uniform(-0.02, 0.02, 2), luck.uniform(-3.0, 3.0)])
    rig = PlanarRig(replace(epuck, bumper=bumper), item, marker=marker, seed=seed, holes=holes)
    plan = Plan(epuck.push_distance, epuck.bumper.width / 2.0, box.contact_friction, item.outline)
    return Case(item, bumper.distance, marker, Runs(rig, plan).everything())
