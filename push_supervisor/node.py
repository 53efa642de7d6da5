"""The supervisor node: goals in, questions to planner and controller out, the job's state out."""

import sys
from collections.abc import Collection
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Header, String

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_model import se2
from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.occupancy import OccupancyGrid as Grid
from push_model.push_segment import PushSegment
from push_model.settings import SettingsError
from push_msgs.action import MoveObject
from push_ros.belief_feed import BeliefFeed, belief_of
from push_ros.diagnostics import Diagnostics
from push_ros.job_intake import JobIntake
from push_ros.job_memory import KeptJob
from push_ros.map_feed import MapFeed
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import LATCHED, STREAM
from push_ros.scheduling import Urgency
from push_ros.validation import FRAME
from push_scenario.scenario import Scenario, load_scenario
from push_supervisor import commands, events, repair
from push_supervisor.arrival import Arrival, arrival
from push_supervisor.blocked_way import BlockedWay
from push_supervisor.commands import Command, Question
from push_supervisor.displacement import Displacement
from push_supervisor.event_queue import EventQueue
from push_supervisor.events import Event
from push_supervisor.machine import Machine
from push_supervisor.objects import Objects
from push_supervisor.peers import Peers
from push_supervisor.questions import Seen, ask
from push_supervisor.requests import Moment, Peer, Request, Requests, Step
from push_supervisor.settings import SupervisorSettings
from push_supervisor.surroundings import Surroundings

_POSE_PERIOD = 0.045  # [s] of the frames that are looked at


class SupervisorNode(Node):
    """One robot, one object at a time, one job at a time.

    Goals on ``goal_pose`` are of the object that the node is made for. A goal of the action may
    name any other object of the scenario that belongs to no other team.
    """

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
        self.robot, self.object = scenario.robot(robot)[0], scenario.object(item)[0]
        values = dict(scenario.parameters.get("supervisor", {}))
        poses = {"persistence": 3, **values.pop("poses", {})}
        self.settings = declare_settings(
            self, SupervisorSettings, values, where="supervisor", apply=self._apply
        )
        gate = declare_settings(self, PoseGateSettings, poses, "poses", "supervisor.poses")
        self._objects = Objects(scenario, self.robot, self.object, lambda: self.settings)
        self.surroundings = self._objects.around(self.object, belief_of(scenario))
        asked = self._at_goal, lambda: self._touched() is not None
        self.machine = Machine(self.settings, *asked, beginning=self._beginning)
        self._repairs = 0  # number of plans that were asked for during a push
        self._requests = Requests(self.settings)
        self._ticks = 0
        self._displacement = Displacement(self.machine)
        self._blocked_way = BlockedWay(self.machine)
        self._fire = EventQueue(self.machine, self._carry_out, self._publish_state).fire
        self._diagnostics = Diagnostics(self, self.names, self._diagnose)
        bodies, told = list(scenario.radii), self._diagnostics
        self._poses = PoseFeed(self, self.names, gate, bodies, told, self._on_frame, _POSE_PERIOD)
        self._peers = Peers(
            self, self.names, self.robot, self.object, self._on_answer, self._on_sign
        )
        self._connect(scenario)
        job = self, "single", [self.robot], self.object
        self._intake = JobIntake(self, self.names, self._diagnostics, *job, choice=self)
        self._publish_state()

    def _connect(self, scenario: Scenario) -> None:
        names = self.names
        beat = names.robot(self.robot, "heartbeat")
        self._heartbeat_publisher = self.create_publisher(Header, beat, STREAM)
        MapFeed(self, names, self._diagnostics, self._take_map)
        self._beliefs = BeliefFeed(
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
        self._objects.check(self.object)
        self.surroundings.check_goal(goal)

    def take_goal(self, goal: Array, plan_only: bool) -> None:
        """See JobOwner."""
        self._fire(events.GoalGiven(goal, plan_only, self.object))

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

    # Goals of other objects, see ObjectChoice

    @property
    def names_of_objects(self) -> Collection[str]:
        """See ObjectChoice."""
        return self._objects.names

    def check_other(self, item: str, goal: Array) -> None:
        """See ObjectChoice."""
        self._objects.check(item)
        self._around(item).check_goal(goal)

    def use(self, item: str) -> None:
        """See ObjectChoice."""
        self.surroundings = self._around(item)
        self.object = self._peers.item = item

    def _around(self, item: str) -> Surroundings:
        if item == self.object:
            return self.surroundings
        return self._objects.around(item, self._beliefs.current, self.surroundings.grid)

    # The world

    def _take_map(self, grid: Grid) -> None:
        if not self.surroundings.take_map(grid):
            return
        pushes = repair.to_come(self.machine, self._pose(self.object))
        self._fire(events.MapChanged(self.surroundings.blocked(pushes)))

    def _on_scenario(self, message: String) -> None:
        """Another world: a job ends when its robot or its object is not what it was."""
        try:
            ended = self._objects.take_world(message.data, self.object)
        except ValueError as error:
            self._diagnostics.refuse(self.names.world("scenario"), str(error))
            return
        if ended:
            self.end_job(JobError.UNKNOWN_OBJECT, ended)

    def _on_frame(self, frame: Frame) -> None:
        """Frames come every 50 ms."""
        if frame.verdict is Stamp.REFUSED:
            return
        if frame.verdict is Stamp.RESET:
            self._fire(events.ClockReset())
            self._intake.reset()
        if self.machine.left:
            self._fire(events.PushLeft())
        self._ticks += 1
        self._heartbeat_publisher.publish(Header(stamp=frame.stamp, frame_id=FRAME))
        self._tend()
        seen = {n: p for n in (self.object, self.robot) if (p := self._pose(n)) is not None}
        self._intake.frame(self._poses.stamp, lambda: seen, self.ready and len(seen) == 2)
        if self._ticks % 2 == 0:
            self._watch_way()
            if self._intake.waited_for:
                self._intake.feedback(self._feedback())

    def _on_watchdog(self) -> None:
        """Wall time, for when no frames come; in lockstep there is always one to come."""
        self._intake.wait(self._poses.clock.now)
        if self._poses.silence > 0.3:
            self._tend()

    def _bodies(self) -> Array:
        near = self.surroundings
        return near.bodies({name: self._pose(name) for name in near.others})

    def _watch_way(self) -> None:
        near = self.surroundings
        robot, item = self._pose(self.robot), self._pose(self.object)
        self._fire(self._displacement.look(item))
        if self.machine.repairing and item is not None:
            self._fire(repair.late(self.machine.segment, item))
        self._fire(self._blocked_way.look(near, robot, item, self._bodies()))

    def _pose(self, name: str) -> Array | None:
        """The pose ``(3,)`` of a body, None when it is not known now."""
        if self._poses.silence > self.settings.pose_timeout:
            return None
        pose: Array | None = self._poses.pose(name)
        return pose

    def _touched(self) -> tuple[str, Surroundings, Array] | None:
        """The object that the robot may be touching, whoever left it there."""
        robot = self._pose(self.robot)
        if robot is None:
            return None
        return self._objects.touched(robot, self.object, self._pose, self._around)

    # The machine and its requests

    def _carry_out(self, command: Command) -> None:
        match command:
            case commands.Repair():
                self._repairs += 1
                self._ask(-self._repairs, command)
            case commands.CancelRepair():
                self._peers.stop_planning()
            case commands.Finish(code, message, going_on=True):
                self._finish(code, message)
            case commands.Stop() | commands.CancelPlan() | commands.Finish():
                self._requests.drop()
                self._peers.let_go()
                if isinstance(command, commands.Finish):
                    self._finish(command.code, command.message)
            case _:
                waits = isinstance(command, commands.MakePlan | commands.FindPath) and command.later
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
        if number == -self._repairs and self.machine.repairing:
            self._fire(repair.checked(event, self.surroundings, self._pose(self.object)))
        elif self._requests.answer(number):
            self._fire(event)

    def _ask(self, number: int, command: Question | commands.Repair) -> None:
        """Send what a command asks for; the poses are known."""
        robot, item = self._pose(self.robot), self._pose(self.object)
        assert robot is not None and item is not None
        others = {name: self._pose(name) for name in self.surroundings.others}
        seen = Seen(self.surroundings, robot, item, others, self._poses.stamp, self._touched)
        ask(self._peers, number, command, seen)

    # A plan that is made while the robot pushes

    def _beginning(self, segment: PushSegment, goal: Array | None) -> PushSegment | None:
        item = self._pose(self.object)
        if item is None or self._pose(self.robot) is None or not self._peers.ready(Peer.PLANNER):
            return None
        return repair.beginning(self.surroundings, segment, item, self._bodies(), goal)

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
    return run_node(SupervisorNode, urgency=Urgency.CONTROL)


if __name__ == "__main__":
    sys.exit(main())
