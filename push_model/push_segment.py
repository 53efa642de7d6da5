"""One push of a plan, as planner, supervisor and controller use it."""

from dataclasses import dataclass

from push_model import se2
from push_model.arrays import Array
from push_model.stable_push import CurvatureLimits
from push_model.trajectory import Trajectory


@dataclass(frozen=True)
class PushSegment:
    """The robot on one side of the object along one cubic curve, (2.2)-(2.4), or along several.

    Poses ``(3,)`` [m, m, rad] in the world frame; of the robot: its axle midpoint.

    side: index of the pushed side of the object's outline. standoff: where the robot's approach
    begins. k_start, k_end [m]: tangent lengths of (2.4), of the first and of the last curve.
    length [m] of the robot's path. limits: stable curvatures for an object at its nominal place.
    clearance [m] of robot and object along the path; infinite if unknown.
    """

    side: int
    object_start: Array
    object_end: Array
    robot_start: Array
    robot_end: Array
    standoff: Array
    k_start: float
    k_end: float
    length: float
    limits: CurvatureLimits
    clearance: float
    trajectory: Trajectory

    @property
    def grasp(self) -> Array:
        """Nominal pose ``(3,)`` of the object in the robot frame."""
        return se2.between(self.robot_start, self.object_start)

    def contact(self, item: Array) -> Array:
        """Pose ``(3,)`` of the robot in contact with the side, the object being at ``item``."""
        return se2.compose(item, se2.inverse(self.grasp))
