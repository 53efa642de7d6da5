"""The line contact of a flat bumper and a side, for the contact forces of section 2.4.2."""

from dataclasses import dataclass, replace

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.bumpers import FlatBumper
from push_model.grasp import line_contact_grasp
from push_model.specs import ObjectSpec, RobotSpec

_TOUCH = 1e-3  # [m] distance from the bumper's face up to which an outline touches it


@dataclass(frozen=True)
class LineContact:
    """A line contact in the robot frame, with the object at its nominal place.

    face: [m] from the axle midpoint to the bumper's face. right, left: [m] y of the contact's ends.
    width: [m] of the bumper.
    centre: ``(2,)`` [m] of the object's mass. friction: of the contact. radius: [m] c of the limit
    surface's ellipsoid, its greatest torque over its greatest force.
    """

    face: float
    right: float
    left: float
    centre: Array
    friction: float
    radius: float
    width: float

    def trusted(self, part: float) -> "LineContact":
        """The same contact with a fraction of the believed friction."""
        return replace(self, friction=part * self.friction)

    def moved(self, ahead: float, aside: float) -> "LineContact":
        """The contact for an object [m] off its nominal place; the ends stay on the bumper."""
        half = self.width / 2.0
        right, left = max(self.right + aside, -half), min(self.left + aside, half)
        return replace(self, right=right, left=left, centre=self.centre + np.array([ahead, aside]))

    @property
    def motion_of_forces(self) -> Array:
        """H G of (2.53) ``(3, 4)``: forces along the cones' edges to the object's twist.

        Twist at the centre of mass in the robot's axes, up to a common factor: the unit of the
        forces does not matter to a quasi-static motion. Columns f_1R, f_1L, f_2R, f_2L of (2.39).
        """
        ahead, y = float(self.centre[0]) - self.face, float(self.centre[1])
        grasp = line_contact_grasp(ahead, self.right - y, self.left - y, self.friction)
        scaled: Array = grasp * np.array([[1.0], [1.0], [self.radius**-2.0]])
        return scaled


def line_contact(robot: RobotSpec, item: ObjectSpec, grasp: Array) -> LineContact | None:
    """The contact of an object at a pose ``(3,)`` in the robot frame; None if it is no line."""
    if not isinstance(robot.bumper, FlatBumper):
        return None
    half = robot.bumper.width / 2.0
    outline = se2.transform(grasp, item.outline)
    touching = outline[np.abs(outline[:, 0] - robot.push_distance) < _TOUCH, 1]
    if len(touching) < 2:
        return None
    right, left = max(float(touching.min()), -half), min(float(touching.max()), half)
    if left - right < _TOUCH:
        return None
    surface = item.limit_surface()
    radius = float(surface.wrench(np.array([0.0, 0.0, 1.0]))[2])
    radius /= float(surface.wrench(np.array([1.0, 0.0, 0.0]))[0])
    centre = item.mass_pose(np.zeros(3))[:2]
    place = se2.transform(grasp, centre[None])[0]
    return LineContact(
        robot.push_distance, right, left, place, item.contact_friction, radius, 2.0 * half
    )
