"""One push of a plan, as planner, supervisor and controller use it."""

from dataclasses import dataclass, replace

import numpy as np

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
    clearance [m] of robot and object along the path; infinite if unknown. turns: whether the robot
    pushes on a corner, straight ahead, until ``side`` lies flush against its bumper; the object
    turns meanwhile, and where it ends is only roughly known.
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
    turns: bool = False

    def part(self, begin: float, end: float) -> "PushSegment":
        """The push between two times [s] along its trajectory, at the speeds of the whole.

        ``k_start``, ``k_end`` and ``clearance`` are those of the whole push.
        """
        way = self.trajectory.between(begin, end)
        grasp = self.grasp
        return replace(
            self,
            object_start=se2.compose(way.pose[0], grasp),
            object_end=se2.compose(way.pose[-1], grasp),
            robot_start=way.pose[0],
            robot_end=way.pose[-1],
            standoff=se2.compose(way.pose[0], se2.between(self.robot_start, self.standoff)),
            length=way.length,
            trajectory=way,
        )

    @property
    def grasp(self) -> Array:
        """Nominal pose ``(3,)`` of the object in the robot frame."""
        return se2.between(self.robot_start, self.object_start)

    @property
    def object_poses(self) -> Array:
        """``(n, 3)`` of the object along the trajectory; between its ends if it turns."""
        poses = self.trajectory.pose
        if not self.turns:
            x, y, theta = self.grasp
            c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
            moved = np.column_stack([c * x - s * y, s * x + c * y, np.full(len(poses), theta)])
            carried: Array = poses + moved
            return carried
        part = np.linspace(0.0, 1.0, len(poses))[:, None]
        change = self.object_end - self.object_start
        change[2] = se2.wrap(change[2])
        between: Array = self.object_start + part * change
        return between

    def contact(self, item: Array) -> Array:
        """Pose ``(3,)`` of the robot in contact with the side, the object being at ``item``."""
        return se2.compose(item, se2.inverse(self.grasp))
