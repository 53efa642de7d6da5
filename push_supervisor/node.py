"""The supervisor node: goals in, questions to planner and controller out, the job's state out."""

import sys
from typing import Any

import numpy as np
import yaml
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Header, String

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_model import se2
from push_model.arrays import Array
from push_model.jobs import GoalRefused, JobError
from push_model.occupancy import OccupancyGrid as Grid
from push_model.settings import SettingsError
from push_msgs.action import MoveObject
from push_ros.belief_feed import BeliefFeed
from push_ros.diagnostics import Diagnostics
from push_ros.job_intake import JobIntake
from push_ros.job_memory import KeptJob
from push_ros.map_feed import MapFeed
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import LATCHED, STREAM
from push_ros.validation import FRAME
from push_scenario.scenario import Scenario, load_scenario
from push_supervisor import commands, events, motions
from push_supervisor.arrival import Arrival, arrival
from push_supervisor.blocked_way import BlockedWay
from push_supervisor.commands import Command, Question
from push_supervisor.displacement import Displacement
from push_supervisor.event_queue import EventQueue
from push_supervisor.events import Event
from push_supervisor.machine import Machine
from push_supervisor.peers import Peers
from push_supervisor.requests import Moment, Peer, Request, Requests, Step
from push_supervisor.settings import SupervisorSettings
from push_supervisor.surroundings import Surroundings

_POSE_PERIOD = 0.045  # [s] of the frames that are looked at


class SupervisorNode(Node):
    """One robot, one object, one job at a time."""

    def __init__(
        self,
        scenario: Scenario | None = None,
        robot: str = "",
        item: str = "",
        namespace: str = "",
        world: str = "",
    ) -> None:
        """namespace: the team's; world: the bridge's, where it is another one."""
        super().__init__("supervisor", namespace=namespace)
        self.names = names_of(self, world)
        name = self.declare_parameter("scenario", "env1-target1").value
        robot = str(self.declare_parameter("robot", robot).value)
        item = str(self.declare_parameter("object", item).value)
        scenario = scenario or load_scenario(str(name))
        self.robot, robot_spec = scenario.robot(robot)
        self.object, item_spec = scenario.object(item)
        values = dict(scenario.parameters.get("supervisor", {}))
        poses = {"persistence": 3, **values.pop("poses", {})}
        self.settings = declare_settings(
            self, SupervisorSettings, values, where="supervisor", apply=self._apply
        )
        gate = declare_settings(self, PoseGateSettings, poses, "poses", "supervisor.poses")
        bodies = scenario.radii
        others = {k: r for k, r in bodies.items() if k not in (self.robot, self.object)}
        self.surroundings = Surroundings(robot_spec, item_spec, others, self.settings)
        self.machine = Machine(self.settings, self._at_goal, self._touching)
        self._requests = Requests(self.settings)
        self._ticks = 0
        self._displacement = Displacement(self.machine)
        self._blocked_way = BlockedWay(self.machine)
        self._world: Any = None  # what the world says that robot and object are
        self._fire = EventQueue(self.machine, self._carry_out, self._publish_state).fire
        self._diagnostics = Diagnostics(self, self.names, self._diagnose)
        self._poses = PoseFeed(
            self, self.names, gate, list(bodies), self._diagnostics, self._on_frame, _POSE_PERIOD
        )
        self._peers = Peers(
            self, self.names, self.robot, self.object, self._on_answer, self._on_sign
        )
        self._intake = JobIntake(
            self, self.names, self._diagnostics, self, "single", [self.robot], self.object
        )
        self._connect(scenario)
        self._publish_state()

    def _connect(self, scenario: Scenario) -> None:
        names = self.names
        heartbeat = names.robot(self.robot, "heartbeat")
        self._heartbeat_publisher = self.create_publisher(Header, heartbeat, STREAM)
        MapFeed(self, names, self._diagnostics, self._take_map)
        BeliefFeed(
            self,
            names,
            scenario,
            self._diagnostics,
            lambda belief: self.surroundings.believe(
                belief.robot(self.robot), belief.object(self.object)
            ),
        )
        self.create_subscription(String, names.world("scenario"), self._on_scenario, LATCHED)
        self._watchdog = self.create_timer(
            0.1, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    @property
    def ready(self) -> bool:
        """Whether a goal could be worked on: the map is known, and the other nodes are there."""
        return self.surroundings.grid is not None and all(map(self._peers.ready, Peer))

    def _apply(self, settings: SupervisorSettings) -> None:
        if self.machine.busy:
            raise SettingsError("the supervisor is busy; change its parameters when it is idle")
        self.settings = self.machine.settings = self._requests.settings = settings
        self.surroundings.change_settings(settings)

    # The owner of the job, see JobOwner

    @property
    def busy(self) -> bool:
        """See JobOwner."""
        return self.machine.busy

    @property
    def plan_ready(self) -> bool:
        """See JobOwner."""
        return self.machine.plan_ready

    def check_goal(self, goal: Array) -> None:
        """See JobOwner."""
        if self._world is not None:
            for name, body in zip((self.robot, self.object), self._world, strict=True):
                if body is None:
                    text = f"no body '{name}' in the world; use a name of the scenario"
                    raise GoalRefused(JobError.UNKNOWN_OBJECT, text)
        self.surroundings.check_goal(goal)

    def take_goal(self, goal: Array, plan_only: bool) -> None:
        """See JobOwner."""
        self._fire(events.GoalGiven(goal, plan_only))

    def end_job(self, code: JobError, message: str) -> None:
        """See JobOwner."""
        self._fire(events.JobAborted(code, message))

    def execute(self) -> None:
        """See JobOwner."""
        self._fire(events.ExecuteCommanded())

    def resume(self, job: KeptJob) -> None:
        """See JobOwner."""
        self.take_goal(np.array(job.targets[-1]), job.plan_only)

    def stop(self) -> None:
        """The process ends in good order."""
        self._intake.forget()

    # The world

    def _take_map(self, grid: Grid) -> None:
        if not self.surroundings.take_map(grid):
            return
        self._fire(events.MapChanged(self.surroundings.blocked(self.machine.remaining)))

    def _on_scenario(self, message: String) -> None:
        """Another world: a job ends when its robot or its object is not what it was."""
        try:
            values = yaml.safe_load(message.data)
            bodies = values.get("robots") or {}, values.get("objects") or {}
            robot, item = bodies[0].get(self.robot), bodies[1].get(self.object)
            now = [None if b is None else b["type"] for b in (robot, item)]
        except (yaml.YAMLError, AttributeError, KeyError, TypeError) as error:
            self._diagnostics.refuse(
                self.names.world("scenario"), f"the message is not a scenario: {error}"
            )
            return
        before, self._world = self._world, now
        if before is not None and before != now:
            gone = [n for n, b in zip((self.robot, self.object), now, strict=True) if b is None]
            what = f"without {' and '.join(gone)}" if gone else "with another robot or object"
            self.end_job(JobError.UNKNOWN_OBJECT, f"another scenario was loaded, {what}")

    def _on_frame(self, frame: Frame) -> None:
        """Frames come every 50 ms."""
        if frame.verdict is Stamp.REFUSED:
            return
        if frame.verdict is Stamp.RESET:
            self._fire(events.ClockReset())
            self._intake.reset()
        self._ticks += 1
        self._heartbeat_publisher.publish(Header(stamp=frame.stamp, frame_id=FRAME))
        self._tend()
        seen = {n: p for n in (self.object, self.robot) if (p := self._pose(n)) is not None}
        self._intake.frame(self._poses.stamp, lambda: seen, self.ready and len(seen) == 2)
        if self._ticks % 2 == 0:
            self._watch_displacement()
            self._watch_way()
            if self._intake.waited_for:
                self._intake.feedback(self._feedback())

    def _on_watchdog(self) -> None:
        """Wall time, for when no frames come; in lockstep there is always one to come."""
        self._intake.wait(self._poses.clock.now)
        if self._poses.silence > 0.3:
            self._tend()

    def _watch_displacement(self) -> None:
        moved = self._displacement.look(self._pose(self.object))
        if moved is not None:
            self._fire(moved)

    def _watch_way(self) -> None:
        near = self.surroundings
        bodies = near.bodies({name: self._pose(name) for name in near.others})
        robot, item = self._pose(self.robot), self._pose(self.object)
        blocked = self._blocked_way.look(near, robot, item, bodies)
        if blocked is not None:
            self._fire(blocked)

    def _pose(self, name: str) -> Array | None:
        """The pose ``(3,)`` of a body, None when it is not known now."""
        if self._poses.silence > self.settings.pose_timeout:
            return None
        pose: Array | None = self._poses.pose(name)
        return pose

    def _touching(self) -> bool:
        robot, item = self._pose(self.robot), self._pose(self.object)
        if robot is None or item is None:
            return False
        return self.surroundings.touching(robot, item)

    # The machine and its requests

    def _carry_out(self, command: Command) -> None:
        if isinstance(command, (commands.Stop, commands.CancelPlan, commands.Finish)):
            self._requests.drop()
            self._peers.let_go()
            if isinstance(command, commands.Finish):
                self._finish(command.code, command.message)
            return
        waits = isinstance(command, (commands.MakePlan, commands.FindPath)) and command.later
        delay = self.settings.wait if waits else 0.0
        self._requests.begin(Request(command, delay), self._now())
        self._tend()

    def _now(self) -> Moment:
        """The clocks and who is there."""
        known = self._pose(self.robot) is not None and self._pose(self.object) is not None
        clock = self._poses.clock
        return Moment(clock.now, self._poses.stamp, known, self._peers.ready, clock.lockstep)

    def _tend(self) -> None:
        """See to the request under way."""
        verdict = self._requests.tend(self._now())
        request = self._requests.request
        if verdict.step is Step.ASK and request is not None:
            if self._requests.asks > 1:
                self.get_logger().warning(
                    f"{request.peer.value} does not answer; the request is repeated"
                )
            self._ask(self._requests.number, request.command)
        elif verdict.step is Step.LOST:
            self._peers.let_go()
            self._fire(events.MotionFailed(verdict.message, lost=True))
        elif verdict.step is Step.GIVE_UP:
            self._fire(events.JobAborted(verdict.code, verdict.message))

    def _on_sign(self, number: int) -> None:
        self._requests.sign(number, self._now())

    def _on_answer(self, number: int, event: Event) -> None:
        if self._requests.answer(number):
            self._fire(event)

    def _ask(self, number: int, command: Question) -> None:
        """Send what a command asks for; the poses are known."""
        robot, item = self._pose(self.robot), self._pose(self.object)
        assert robot is not None and item is not None
        near, peers = self.surroundings, self._peers
        bodies = {name: self._pose(name) for name in near.others}
        heartbeat = self.settings.heartbeat_timeout
        match command:
            case commands.MakePlan(goal, preemptive):
                stamp, others = self._poses.stamp, near.bodies(bodies)
                peers.plan(number, item, goal, stamp, preemptive, others, robot)
            case commands.FindPath(segment):
                circles = near.on_the_way(item, bodies)
                wait = motions.standoff(segment, item)
                crowded = len(near.bodies(bodies)) > 0
                peers.path(number, robot, wait, circles, crowded)
            case commands.FollowPush(segment):
                peers.push(number, segment, near.push(segment), heartbeat)
            case _:
                peers.move(number, *near.motion(command, robot, item), heartbeat)

    # Outputs

    def _errors(self, goal: Any) -> tuple[float, float]:
        item = self._pose(self.object)
        if item is None or goal is None:
            return float("inf"), float("inf")
        local = se2.between(goal, item)
        return float(np.hypot(local[0], local[1])), abs(float(local[2]))

    def _at_goal(self, goal: Any) -> Arrival:
        return arrival(self.settings, *self._errors(goal))

    def _finish(self, code: JobError, message: str) -> None:
        way, turn = self._errors(self.machine.goal)
        self._intake.finish(
            MoveObject.Result(
                error_code=int(code),
                error_msg=message,
                position_error=way,
                orientation_error=turn,
                pushes=self.machine.pushes,
                replans=self.machine.replans,
            )
        )

    def _feedback(self) -> Any:
        way, _ = self._errors(self.machine.goal)
        m = self.machine
        return MoveObject.Feedback(
            state=int(m.state),
            state_name=m.state.name,
            push_index=m.index,
            push_count=len(m.segments),
            distance_to_goal=way,
        )

    def _publish_state(self) -> None:
        m = self.machine
        done = min(m.index, len(m.segments))
        self._intake.publish(
            self._poses.stamp,
            state=int(m.state),
            state_name=m.state.name,
            reason=m.reason,
            error_code=int(m.error),
            progress=done / len(m.segments) if m.segments else float(not m.busy),
            step_index=m.index,
            step_count=len(m.segments),
            replans=m.replans,
        )
        self.get_logger().info(f"{m.state.name}: {m.reason}")

    def _diagnose(self) -> dict[str, Any]:
        m = self.machine
        return {
            "state": m.state.name,
            "reason": m.reason,
            "error code": int(m.error),
            "replans": m.replans,
            "poses refused": self._poses.gate.refused,
            "pose jumps": self._poses.gate.jumps,
            "warning": "no poses" if self._pose(self.object) is None else "",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(SupervisorNode)


if __name__ == "__main__":
    sys.exit(main())
