"""What stands around a job: the map, the other bodies, and which motions and goals they allow.

Poses ``(3,)`` [m, m, rad], circles ``(n, 3)`` x, y and least distance of the axle midpoint [m],
world frame. Pure geometry: the poses are passed in.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.jobs import GoalRefused, JobError
from push_model.occupancy import OccupancyGrid
from push_model.outlines import convex_hull, inset
from push_model.push_segment import PushSegment
from push_model.specs import ObjectSpec, RobotSpec
from push_model.traction import too_heavy
from push_model.trajectory import Trajectory
from push_supervisor import commands, motions
from push_supervisor.footprint import gap, overlaps
from push_supervisor.settings import SupervisorSettings

_LOOK_AHEAD = 3.0  # [s] of full speed beside a motion within which obstacles matter
_TOUCHING = 0.8  # of the distance that a robot backs off: nearer, it has not backed off
_STRAY = 0.006  # [m] that a robot that pushes may come nearer to a wall than is planned
_DRIFT = 0.006  # [m] beside the path of a push from which on what lies ahead is looked at
_FORESEEN, _STEP = 0.12, 0.01  # [m] of the path that is looked at, and between places on it
_KEEP = 0.003  # [m] that robot and object keep off walls there
_FASTEST = 0.9  # of its greatest speed, at which a robot approaches and backs off
_NONE = np.zeros((0, 3))


class Surroundings:
    """Of one robot and one object.

    others: [m] radius of each other body, by name.
    """

    def __init__(
        self,
        robot: RobotSpec,
        item: ObjectSpec,
        others: Mapping[str, float],
        settings: SupervisorSettings,
    ) -> None:
        self.others, self.settings = dict(others), settings
        self.grid: OccupancyGrid | None = None
        self.walls = _NONE
        self.believe(robot, item)

    def believe(self, robot: RobotSpec, item: ObjectSpec) -> None:
        """Go on with what is believed of robot and object now."""
        self.robot, self.item = robot, item
        self._too_heavy = too_heavy(robot, item)
        self._outline, self._item_outline = robot.outline, item.outline
        self._hull = convex_hull(self._item_outline)
        self._wide = tuple(inset(o, -_KEEP) for o in (self._outline, self._item_outline))
        self._item_radius = item.geometry.circumradius

    @property
    def outlines(self) -> tuple[Array, Array]:
        """``(n, 2)`` [m] of robot and object in their frames."""
        return self._outline, self._item_outline

    def change_settings(self, settings: SupervisorSettings) -> None:
        """The margin may be another one."""
        self.settings = settings
        if self.grid is not None:
            self._draw_walls(self.grid)

    def take_map(self, grid: OccupancyGrid) -> bool:
        """A map has come; whether it differs from the one before."""
        old, self.grid = self.grid, grid
        self._draw_walls(grid)
        return old is not None and not old.equals(grid)

    def _draw_walls(self, grid: OccupancyGrid) -> None:
        margin = self.settings.obstacle_margin
        self.walls = motions.wall_circles(grid, self.robot.body_radius, margin)

    def check_goal(self, goal: Array) -> None:
        """Raise GoalRefused where the object cannot be brought, as far as is known without a plan.

        Without a map it may stand anywhere.
        """
        if self._too_heavy is not None:
            raise GoalRefused(JobError.TOO_HEAVY, self._too_heavy)
        if self.grid is None:
            return
        where = f"({goal[0]:.2f}, {goal[1]:.2f}, {goal[2]:.2f})"
        if not self.grid.contains(goal[0], goal[1]):
            raise GoalRefused(JobError.OUTSIDE_MAP, f"{where} lies outside the map")
        if overlaps(self.grid, self._item_outline, goal):
            text = f"at {where} the object would overlap an obstacle"
            raise GoalRefused(JobError.GOAL_OCCUPIED, text)

    def touching(self, robot: Array, item: Array) -> bool:
        """Whether the robot stands nearer to the object than it does after it has backed off."""
        return self._gap(robot, item) < _TOUCHING * self.settings.detach_distance

    def blocked(self, segments: Sequence[PushSegment]) -> str:
        """Which of the pushes the map does not allow, in words; empty when all are free."""
        if self.grid is None:
            return ""
        for number, segment in enumerate(segments, 1):
            for pose, item in zip(
                segment.trajectory.pose[::2], segment.object_poses[::2], strict=True
            ):
                if overlaps(self.grid, self._outline, pose) or overlaps(
                    self.grid, self._item_outline, item
                ):
                    where = f"({item[0]:.2f}, {item[1]:.2f})"
                    return f"the map has changed: push {number} meets an obstacle at {where}"
        return ""

    def drift(self, segment: PushSegment, robot: Array, item: Array) -> str:
        """What robot or object will meet if they go on as far beside the path of a push as they are
        now, in words; empty if nothing. Plans answer for the path itself only."""
        if self.grid is None:
            return ""
        path = segment.trajectory.pose
        first = int(np.argmin(np.hypot(*(path[:, :2] - robot[:2]).T)))
        beside = se2.between(path[first], robot)
        if abs(float(beside[1])) < _DRIFT:
            return ""
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[first:, :2], axis=0).T))])
        grasp, done = se2.between(robot, item), -_STEP
        for ahead, pose in zip(way, path[first:], strict=True):
            if ahead > _FORESEEN:
                break
            if ahead < done + _STEP:
                continue
            done = ahead
            there = se2.compose(pose, beside)
            for what, outline, at in (
                ("the robot", self._wide[0], there),
                ("the object", self._wide[1], se2.compose(there, grasp)),
            ):
                if overlaps(self.grid, outline, at):
                    off = f"{1e3 * abs(float(beside[1])):.0f} mm"
                    return f"the robot is {off} beside its path, on which {what} meets an obstacle"
        return ""

    def bodies(self, poses: Mapping[str, Array | None], extra: float = 0.0) -> Array:
        """Circles ``(n, 3)`` about the other bodies, as wide as they are and ``extra`` [m]."""
        rows = [
            (pose[0], pose[1], radius + extra)
            for name, radius in self.others.items()
            if (pose := poses.get(name)) is not None
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    def on_the_way(self, item: Array, poses: Mapping[str, Array | None]) -> Array:
        """Circles that the way to a stand-off goes round: the object and the other bodies."""
        radius = self.robot.footprint_radius
        own = motions.outline_circles(se2.transform(item, self._item_outline), radius)
        return np.vstack([own, self.bodies(poses, radius)])

    def motion(
        self, command: commands.Motion, robot: Array, item: Array
    ) -> tuple[Trajectory, Array]:
        """The trajectory that a command asks for, and what to keep off along it."""
        match command:
            case commands.FollowPath(way):
                return way, self.follow(way, item)
            case commands.FollowApproach(segment):
                return self.approach(segment, robot, item)
            case commands.FollowPush(segment):
                return segment.trajectory, self.push(segment)
            case commands.FollowTurn(segment):
                return self.turn(segment, robot, item)
            case commands.FollowRetreat():
                return self.retreat(robot, item)

    def follow(self, way: Trajectory, item: Array) -> Array:
        """What to keep off on the way to a stand-off: walls and the object."""
        reach = self.robot.body_radius + self.settings.obstacle_margin
        own = motions.outline_circles(se2.transform(item, self._item_outline), reach)
        return self._beside(np.vstack([self.walls, own]), way)

    def approach(self, segment: PushSegment, robot: Array, item: Array) -> tuple[Trajectory, Array]:
        """To contact, keeping off walls."""
        way = motions.approach(segment, robot, item, self._paced())
        return way, self._beside(self.walls, way)

    def push(self, segment: PushSegment) -> Array:
        """What to keep off in a push.

        The robot leaves its path where the object has slid along the bumper. Its bumper reaches
        farther than its body, so that walls are as wide as the bumper asks for, as far as the path
        keeps off them by ``_STRAY`` more.
        """
        way = segment.trajectory
        circles = motions.near(self.walls, way, _LOOK_AHEAD * self.robot.max_speed)
        reach = self.robot.footprint_radius - self.robot.body_radius
        return motions.spared(motions.widened(circles, way, reach, _STRAY), way)

    def turn(self, segment: PushSegment, robot: Array, item: Array) -> tuple[Trajectory, Array]:
        """Straight on from contact with a corner, keeping off walls."""
        way = motions.turn(segment, robot, item, float(segment.trajectory.twist[:, 0].max()))
        return way, self._beside(self.walls, way)

    def retreat(self, robot: Array, item: Array) -> tuple[Trajectory, Array]:
        """Away from the object, keeping off walls."""
        depth = 0.0
        if not self.item.geometry.convex:
            beside, far = se2.between(item, robot), 2.0 * self._item_radius
            depth = motions.recess(beside, self._outline, self._hull, far)
        way = motions.retreat(
            robot, lambda pose: self._gap(pose, item), self.walls, self._paced(), depth
        )
        return way, self._beside(self.walls, way)

    def _paced(self) -> SupervisorSettings:
        """The settings, with no greater speed than the robot's."""
        fastest = _FASTEST * self.robot.max_speed
        return replace(self.settings, approach_speed=min(self.settings.approach_speed, fastest))

    def _gap(self, robot: Array, item: Array) -> float:
        return gap(self._outline, robot, self._item_outline, item)

    def _beside(self, circles: Array, way: Trajectory) -> Array:
        reach = _LOOK_AHEAD * self.robot.max_speed
        return motions.spared(motions.near(circles, way, reach), way)
