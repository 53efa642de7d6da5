"""What is sent to planner and controller for a command of the state machine."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from push_model.arrays import Array
from push_supervisor import commands, motions, repair
from push_supervisor.peers import Peers
from push_supervisor.surroundings import Surroundings

Touched = Callable[[], tuple[str, Surroundings, Array] | None]


@dataclass(frozen=True)
class Seen:
    """What is known when a question is asked.

    robot, item: poses ``(3,)``. others: of the other bodies by name, None if unknown. stamp: [s] of
    the poses. touched: tells which object the robot may be touching, what stands around that one,
    and its pose.
    """

    near: Surroundings
    robot: Array
    item: Array
    others: Mapping[str, Array | None]
    stamp: float
    touched: Touched

    @property
    def bodies(self) -> Array:
        """``(n, 3)`` x, y, radius [m] of the other bodies."""
        return self.near.bodies(self.others)


def ask(
    peers: Peers, number: int, command: commands.Question | commands.Repair, seen: Seen
) -> None:
    """Send a question, which has a number."""
    near, robot, item = seen.near, seen.robot, seen.item
    heartbeat = near.settings.heartbeat_timeout
    match command:
        case commands.MakePlan(goal, preemptive):
            peers.plan(number, item, goal, seen.stamp, preemptive, seen.bodies, robot)
        case commands.Repair(goal, push):
            then = push.object_end, goal, seen.stamp, False, seen.bodies, repair.robot(near, push)
            peers.plan(number, *then, under_way=push)
        case commands.FindPath(segment):
            circles = near.on_the_way(item, seen.others)
            wait = motions.standoff(segment, item)
            peers.path(number, robot, wait, circles, len(seen.bodies) > 0)
        case commands.FollowPush(segment, going_on):
            peers.push(number, segment, near.push(segment), heartbeat, going_on)
        case commands.FollowRetreat() if (touched := seen.touched()) is not None:
            name, near, there = touched
            peers.move(number, *near.retreat(robot, there), heartbeat, name)
        case _:
            peers.move(number, *near.motion(command, robot, item), heartbeat)
