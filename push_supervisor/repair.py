"""Where a new plan can begin while the robot pushes."""

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.push_segment import PushSegment
from push_supervisor.blocked_way import obstruction
from push_supervisor.events import Event, PlanFailed, PlanFound, RepairLate
from push_supervisor.machine import Machine
from push_supervisor.state import State
from push_supervisor.surroundings import Surroundings

_LEAST = 0.7  # [s] of push: for less, planning does not begin
_ROOM = 2.5  # [s] of the push that must be free after the place: about 0.25 m
_LATE = 0.5  # [s] before the place, at which a plan is needed: to brake there, with late poses
_TURN = 0.1  # [m/rad] that an angle of the object counts


def reached(segment: PushSegment, item: Array) -> float:
    """[s] along the trajectory of a push that the object at a pose ``(3,)`` has come."""
    poses = segment.object_poses
    turned = (poses[:, 2] - item[2] + np.pi) % (2.0 * np.pi) - np.pi
    off = np.hypot(*(poses[:, :2] - item[:2]).T) + _TURN * np.abs(turned)
    return float(segment.trajectory.time[int(np.argmin(off))])


def _away(pose: Array, goal: Array) -> float:
    return float(np.hypot(*(pose - goal)[:2]))


def beginning(
    near: Surroundings,
    segment: PushSegment,
    item: Array,
    bodies: Array,
    goal: Array | None = None,
) -> PushSegment | None:
    """A push under way, up to where it will be after ``repair_time``, or up to its end; None if
    that is not free, or too soon, or not nearer to a goal. Beyond it, ``_ROOM`` must be free, too:
    close in front of an obstacle there may be no plan.

    Parameters
    ----------
    item: ``(3,)`` pose of the object now.
    bodies: ``(n, 3)`` [m] x, y, radius of others.
    goal: ``(3,)`` to which the object is to come nearer; None if it does not matter.
    """
    now = reached(segment, item)
    end = min(now + near.settings.repair_time, segment.trajectory.duration)
    if end - now < _LEAST:
        return None
    begun, ahead = segment.part(0.0, end), segment.part(now, end + _ROOM)
    if goal is not None and _away(begun.object_end, goal) > _away(item, goal):
        return None
    if near.blocked([ahead]) or obstruction([ahead], near.outlines, bodies, item) is not None:
        return None
    return begun


def robot(near: Surroundings, beginning: PushSegment) -> Array:
    """Pose ``(3,)`` of the robot from which its way to another side begins: backed off."""
    back = np.array([-near.settings.detach_distance, 0.0, 0.0])
    behind: Array = se2.compose(beginning.robot_end, back)
    return behind


def to_come(machine: Machine, item: Array | None) -> list[PushSegment]:
    """The pushes that are not done yet; of the one under way, only what lies ahead of the object.

    item: ``(3,)`` its pose, None if unknown.
    """
    pushes = machine.remaining
    if machine.state is not State.PUSHING or item is None or pushes[0].turns:
        return pushes
    return [_ahead(pushes[0], item), *pushes[1:]]


def _ahead(push: PushSegment, item: Array) -> PushSegment:
    return push.part(reached(push, item), push.trajectory.duration)


def checked(event: Event, near: Surroundings, item: Array | None) -> Event | None:
    """An answer to the question for a repair. The planner may have made the plan before the map
    changed: a plan that is blocked is none, and dropped if a better one follows."""
    if not isinstance(event, PlanFound) or item is None:
        return event
    first, *rest = event.segments
    problem = near.blocked([_ahead(first, item), *rest])
    if not problem:
        return event
    return None if event.improving else PlanFailed(JobError.PLANNING_FAILED, problem)


def late(beginning: PushSegment, item: Array) -> RepairLate | None:
    """Whether a plan that begins at the end of a push is needed now."""
    came = reached(beginning, item) > beginning.trajectory.duration - _LATE
    return RepairLate() if came else None
