"""Plans and states of a group as messages, and back. Knows ROS."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from grasp_opt.contact_outline import Contacts
from grasp_opt.object_trajectory import ObjectTrajectory, sampled
from grasp_opt.placement import Placement
from grasp_opt.sequencing import Move
from grasp_opt.step_planner import GroupPlan
from push_model import se2
from push_model.specs import ObjectSpec
from push_msgs.msg import GroupMove
from push_msgs.msg import GroupPlan as PlanMessage
from push_ros.conversions import time_to_ros
from push_ros.validation import FRAME, InvalidMessage, finite

_LONGEST = 100_000  # samples of a trajectory that somebody sends


def plan_to_ros(plan: GroupPlan, item: str, names: Sequence[str], seconds: float) -> PlanMessage:
    """names: of all robots; seconds: [s] of the stamp."""
    placed, task = plan.placement, plan.trajectory
    message = PlanMessage(object=item, pushers=[names[i] for i in plan.pushers])
    message.header.frame_id = FRAME
    message.header.stamp = time_to_ros(seconds)
    message.way = placed.way.tolist()
    message.contact_x, message.contact_y = placed.contacts.points.T.tolist()
    message.normal_x, message.normal_y = placed.contacts.normals.T.tolist()
    message.force = np.linalg.norm(placed.forces, axis=2).max(axis=0).tolist()
    message.cost, message.margin = float(placed.cost), float(placed.margin)
    message.time = task.time.tolist()
    message.x, message.y, message.theta = task.pose.T.tolist()
    message.vx, message.vy, message.omega = task.twist.T.tolist()
    message.moves = [
        GroupMove(
            robot=names[move.robot],
            batch=k,
            x=move.points[:, 0].tolist(),
            y=move.points[:, 1].tolist(),
            turn=move.heading is not None,
            heading=move.heading or 0.0,
        )
        for k, batch in enumerate(plan.batches)
        for move in batch
    ]
    message.pieces = plan.left
    return message


def plan_from_ros(message: PlanMessage, names: Sequence[str]) -> GroupPlan:
    """Raises InvalidMessage for robots that are not in the group, or numbers that are none."""
    number = {name: i for i, name in enumerate(names)}
    try:
        pushers = tuple(number[name] for name in message.pushers)
        moves = [(m.batch, number[m.robot], m) for m in message.moves]
    except KeyError as error:
        raise InvalidMessage(f"robot {error} is not in the group") from None
    contacts = Contacts(
        np.column_stack([message.contact_x, message.contact_y]),
        np.column_stack([message.normal_x, message.normal_y]),
    )
    task = ObjectTrajectory(
        np.array(message.time),
        np.column_stack([message.x, message.y, message.theta]),
        np.column_stack([message.vx, message.vy, message.omega]),
    )
    finite(np.concatenate([task.pose.ravel(), task.twist.ravel(), message.way]), "the plan")
    forces = np.array(message.force)[None, :, None] * contacts.normals[None]
    placed = Placement(
        np.array(message.way), contacts, message.cost, forces, np.zeros((0, 3)), message.margin
    )
    batches: dict[int, list[Move]] = {}
    for batch, robot, move in moves:
        points = np.column_stack([move.x, move.y])
        finite(points, "a move")
        heading = float(move.heading) if move.turn else None
        batches.setdefault(int(batch), []).append(Move(robot, points, heading))
    ordered = tuple(tuple(batches[k]) for k in sorted(batches))
    return GroupPlan(pushers, placed, task, ordered, int(message.pieces))


def trajectory_from_ros(message: Any, item: ObjectSpec) -> ObjectTrajectory:
    """Of the centre of mass, from arrays time, x, y, theta of the object's frame.

    Raises
    ------
    InvalidMessage
    """
    arrays = [np.asarray(a, dtype=np.float64) for a in (message.time, message.x, message.y)]
    arrays.append(np.asarray(message.theta, dtype=np.float64))
    if len({len(a) for a in arrays}) != 1 or len(arrays[0]) > _LONGEST:
        raise InvalidMessage(
            f"time, x, y, theta must be equally long, with at most {_LONGEST} samples"
        )
    for array in arrays:
        finite(array, "the trajectory")
    pose = np.column_stack(arrays[1:])
    centres = np.array([se2.transform(p, np.array([item.com]))[0] for p in pose])
    try:
        return sampled(arrays[0], np.column_stack([centres, pose[:, 2]]))
    except ValueError as error:
        raise InvalidMessage(str(error)) from None
