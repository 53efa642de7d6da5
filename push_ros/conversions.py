"""Between messages and the project's types: ``x_to_ros`` and ``x_from_ros``, free functions."""

import array
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseStamped, TransformStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid as GridMessage
from nav_msgs.msg import Path

from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid
from push_model.push_segment import PushSegment
from push_model.stable_push import CurvatureLimits
from push_model.trajectory import Trajectory
from push_msgs.msg import Circle, Contacts, Poses
from push_msgs.msg import PlanStatistics as StatisticsMessage
from push_msgs.msg import PushPlan as PlanMessage
from push_msgs.msg import PushSegment as SegmentMessage
from push_msgs.msg import Trajectory as TrajectoryMessage
from push_ros.validation import FARTHEST, FRAME, InvalidMessage, check_frame, finite, planar_pose

_PLAIN = np.array([FARTHEST, FARTHEST, math.pi])  # [m], [m], [rad]: poses that need no closer look


def time_to_ros(seconds: float) -> Time:
    """[s] to a stamp."""
    nanoseconds = round(seconds * 1e9)
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


def time_from_ros(stamp: Time) -> float:
    """A stamp in [s]."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def pose_to_ros(pose: Array) -> Pose:
    """Pose ``(3,)`` to geometry_msgs/Pose."""
    message = Pose()  # filled in place: parts made apart would be made twice
    message.position.x, message.position.y = float(pose[0]), float(pose[1])
    q = message.orientation
    _, _, q.z, q.w = se2.quaternion_from_yaw(float(pose[2]))
    return message


def pose_stamped_to_ros(pose: Array, seconds: float) -> PoseStamped:
    """Pose ``(3,)`` in the fixed frame to geometry_msgs/PoseStamped."""
    message = PoseStamped(pose=pose_to_ros(pose))
    message.header.frame_id = FRAME
    message.header.stamp = time_to_ros(seconds)
    return message


def poses_to_ros(poses: Mapping[str, Array], seconds: float) -> Poses:
    """A frame of poses ``(3,)`` by name, measured at a time [s]."""
    table = np.array(list(poses.values()), dtype=np.float64).reshape(-1, 3)
    return frame_to_ros(list(poses), table, seconds)


def frame_to_ros(names: Sequence[str], table: Array, seconds: float) -> Poses:
    """A frame of named poses ``(n, 3)``, measured at a time [s]."""
    message = Poses(names=list(names))
    message.header.frame_id = FRAME
    message.header.stamp = time_to_ros(seconds)
    message.x, message.y, message.theta = (_doubles(column) for column in table.T)
    return message


def poses_from_ros(
    message: Poses, wanted: Collection[str] | None = None
) -> tuple[dict[str, Array], list[str]]:
    """Poses ``(3,)`` by name, and a sentence for each that is refused.

    wanted: names to look at; all, when None. Raises InvalidMessage when it is no frame at all.
    """
    names, columns = message.names, (message.x, message.y, message.theta)
    if any(len(c) != len(names) for c in columns):
        raise InvalidMessage("the arrays of a Poses message must have the same length")
    table = np.empty((len(names), 3))
    for k, column in enumerate(columns):
        table[:, k] = column
    if (np.abs(table) <= _PLAIN).all() and len(set(names)) == len(names):
        found = zip(names, table, strict=True)
        return {n: p for n, p in found if wanted is None or n in wanted}, []
    poses: dict[str, Array] = {}
    refused = []
    for name, pose in zip(names, table, strict=True):
        if wanted is not None and name not in wanted:
            continue
        if not math.isfinite(pose.sum()) or abs(pose[2]) > FARTHEST:
            refused.append(f"{name} is not finite")
        elif max(abs(pose[0]), abs(pose[1])) > FARTHEST:
            refused.append(f"{name}: ({pose[0]:.3g}, {pose[1]:.3g}) m is not a plausible position")
        elif name in poses:
            refused.append(f"{name} stands twice in one frame")
        else:
            if abs(pose[2]) > math.pi:
                pose[2] = se2.wrap(float(pose[2]))
            poses[name] = pose
    return poses, refused


def contacts_to_ros(contacts: Any, seconds: float) -> Contacts:
    """Contacts of a time [s], as columns: body_a, body_b ``(n,)``; position, normal, force
    ``(n, 3)``; duty ``(n,)``."""
    message = Contacts()
    message.header.frame_id = FRAME
    message.header.stamp = time_to_ros(seconds)
    message.body_a, message.body_b = contacts.body_a, contacts.body_b
    message.x, message.y, message.z = map(_doubles, contacts.position.T)
    message.normal_x, message.normal_y, message.normal_z = map(_doubles, contacts.normal.T)
    message.force_x, message.force_y, message.force_z = map(_doubles, contacts.force.T)
    message.duty = _doubles(contacts.duty)
    return message


def _doubles(values: Array) -> "array.array[float]":
    """Quicker for a message than a list."""
    return array.array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def transform_to_ros(name: str, pose: Array, seconds: float) -> TransformStamped:
    """Pose ``(3,)`` of a body as a transform from the fixed frame."""
    message = TransformStamped(child_frame_id=name)
    message.header.frame_id = FRAME
    message.header.stamp = time_to_ros(seconds)
    message.transform.translation.x = float(pose[0])
    message.transform.translation.y = float(pose[1])
    _, _, message.transform.rotation.z, message.transform.rotation.w = se2.quaternion_from_yaw(
        float(pose[2])
    )
    return message


def twist_to_ros(v: float, omega: float, stamp: Time) -> TwistStamped:
    """A command that answers the poses of a stamp."""
    message = TwistStamped()
    message.header.stamp = stamp
    message.header.frame_id = "base_link"
    message.twist.linear.x = v
    message.twist.angular.z = omega
    return message


def trajectory_to_ros(trajectory: Trajectory) -> TrajectoryMessage:
    """Trajectory to its message."""
    message = TrajectoryMessage()
    message.header.frame_id = FRAME
    columns = [trajectory.time, *trajectory.pose.T, *trajectory.twist.T]
    for name, column in zip(("time", "x", "y", "theta", "v", "omega"), columns, strict=True):
        setattr(message, name, _doubles(column))
    return message


def trajectory_from_ros(message: TrajectoryMessage) -> Trajectory:
    """Message to a trajectory; raises InvalidMessage when it is none."""
    columns = [
        np.asarray(getattr(message, n), dtype=np.float64)
        for n in ("time", "x", "y", "theta", "v", "omega")
    ]
    if len({len(c) for c in columns}) != 1:
        raise InvalidMessage("the arrays of a trajectory must have the same length")
    try:
        return Trajectory(columns[0], np.column_stack(columns[1:4]), np.column_stack(columns[4:]))
    except ValueError as error:
        raise InvalidMessage(str(error)) from None


def circles_to_ros(circles: Array) -> list[Circle]:
    """``(n, 3)`` x, y, radius to messages."""
    return [Circle(x=float(x), y=float(y), radius=float(r)) for x, y, r in circles]


def circles_from_ros(messages: Any) -> Array:
    """Messages to ``(n, 3)``; raises InvalidMessage when not finite."""
    circles = np.array([[c.x, c.y, c.radius] for c in messages], dtype=np.float64).reshape(-1, 3)
    finite(circles, "an obstacle")
    return circles


def grid_to_ros(grid: OccupancyGrid, seconds: float) -> GridMessage:
    """Occupancy grid to nav_msgs/OccupancyGrid: 0 free, 100 occupied."""
    message = GridMessage()
    message.header.frame_id = FRAME
    message.header.stamp = time_to_ros(seconds)
    message.info.map_load_time = message.header.stamp
    message.info.resolution = float(grid.resolution)
    message.info.height, message.info.width = grid.occupied.shape
    message.info.origin = pose_to_ros(np.array([*grid.origin, 0.0]))
    message.data = array.array("b", (grid.occupied.astype(np.int8) * 100).tobytes())
    return message


def grid_from_ros(message: GridMessage) -> OccupancyGrid:
    """nav_msgs/OccupancyGrid to a grid; unknown cells count as occupied."""
    check_frame(message.header.frame_id, "the map")
    info = message.info
    rows, columns = int(info.height), int(info.width)
    data = np.asarray(message.data, dtype=np.int8)
    if rows < 3 or columns < 3 or data.size != rows * columns:
        raise InvalidMessage(
            "a map must have at least 3 x 3 cells and one value for each cell, got "
            f"{rows} x {columns} cells and {data.size} values"
        )
    if not 1e-3 <= info.resolution <= 10.0:
        raise InvalidMessage(
            f"the resolution of a map must be from 0.001 m to 10 m, got {info.resolution} m"
        )
    q = info.origin.orientation
    finite((info.origin.position.x, info.origin.position.y, q.z, q.w), "the map's origin")
    if abs(se2.yaw_from_quaternion(q.x, q.y, q.z, q.w)) > 1e-6:
        raise InvalidMessage("a map whose origin is rotated is not supported; rotate its cells")
    cells = data.reshape(rows, columns)
    origin = np.array([info.origin.position.x, info.origin.position.y])
    return OccupancyGrid((cells < 0) | (cells >= 50), round(float(info.resolution), 9), origin)


def plan_to_ros(plan: Any, robot: str, item: str, seconds: float) -> PlanMessage:
    """push_planner.PushPlan to its message."""
    message = PlanMessage(robot=robot, object=item, goal=pose_to_ros(plan.goal))
    message.header.frame_id = FRAME
    message.header.stamp = time_to_ros(seconds)
    message.cost, message.length = float(plan.cost), float(plan.length)
    message.cost_bound, message.clearance = float(plan.cost_bound), float(plan.clearance)
    message.segments = [segment_to_ros(s) for s in plan.segments]
    message.statistics = StatisticsMessage(
        **{
            k: type(v)(v) if isinstance(v, int) else float(v)
            for k, v in vars(plan.statistics).items()
        }
    )
    return message


def segment_to_ros(segment: PushSegment) -> SegmentMessage:
    """A push to its message."""
    return SegmentMessage(
        side=segment.side,
        object_start=pose_to_ros(segment.object_start),
        object_end=pose_to_ros(segment.object_end),
        robot_start=pose_to_ros(segment.robot_start),
        robot_end=pose_to_ros(segment.robot_end),
        robot_standoff=pose_to_ros(segment.standoff),
        k_start=float(segment.k_start),
        k_end=float(segment.k_end),
        length=float(segment.length),
        curvature_min=float(segment.limits.minimum),
        curvature_max=float(segment.limits.maximum),
        clearance=float(segment.clearance),
        trajectory=trajectory_to_ros(segment.trajectory),
        turns=segment.turns,
    )


def segment_from_ros(message: SegmentMessage) -> PushSegment:
    """A push from its message; raises InvalidMessage."""
    finite((message.k_start, message.k_end, message.length), "a length of a push")
    if math.isnan(message.clearance):
        raise InvalidMessage("the clearance of a push is not a number")
    return PushSegment(
        int(message.side),
        planar_pose(message.object_start, "object_start"),
        planar_pose(message.object_end, "object_end"),
        planar_pose(message.robot_start, "robot_start"),
        planar_pose(message.robot_end, "robot_end"),
        planar_pose(message.robot_standoff, "robot_standoff"),
        message.k_start,
        message.k_end,
        message.length,
        limits_from_ros(message),
        message.clearance,
        trajectory_from_ros(message.trajectory),
        bool(message.turns),
    )


def limits_from_ros(message: Any) -> CurvatureLimits:
    """curvature_min and curvature_max of a message; raises InvalidMessage."""
    low, high = message.curvature_min, message.curvature_max
    finite((low, high), "a curvature limit")
    if not low < 0.0 < high:
        raise InvalidMessage(f"the curvature limits must enclose 0, got [{low}, {high}] 1/m")
    return CurvatureLimits(low, high)


def path_to_ros(trajectories: list[Trajectory], seconds: float) -> Path:
    """Trajectories one after the other as nav_msgs/Path."""
    message = Path()
    message.header.frame_id = FRAME
    message.header.stamp = time_to_ros(seconds)
    for trajectory in trajectories:
        for pose in trajectory.pose[:: max(1, len(trajectory.pose) // 100)]:
            message.poses.append(pose_stamped_to_ros(pose, seconds))
    return message
