"""The rearranger node: goals of several objects in, one move after another to the supervisor."""

import math
import sys
import time
from collections.abc import Generator
from enum import Enum, auto
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_srvs.srv import Trigger

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.jobs import GoalRefused, JobError, JobPhase
from push_model.occupancy import OccupancyGrid as Grid
from push_model.settings import SettingsError, from_mapping
from push_model.traction import too_heavy
from push_msgs.msg import JobState, Poses
from push_planner.goal_messages import goals_of, same_goals
from push_planner.peers import Mover
from push_planner.push_plan import PlanError, PlanningFailed
from push_planner.rearrangement import Move, Rearrangement, RearrangementSettings
from push_planner.settings import PlannerSettings
from push_ros.belief_feed import BeliefFeed
from push_ros.conversions import pose_stamped_to_ros
from push_ros.diagnostics import Diagnostics
from push_ros.map_feed import MapFeed
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import COMMAND, LATCHED
from push_ros.scheduling import Urgency
from push_ros.services import CALLS, Services
from push_scenario.scenario import Scenario, load_scenario

GOALS = "goal_poses"
"""Topic of the goals, in the namespace of the team."""
STATE = "rearrangement"
"""Topic of what this node does, there too."""
ASIDE = "out of the way"
"""How the reason of a state ends where an object is moved aside."""
CANCEL = "cancel_rearrangement"
"""Service that ends it, there too."""

_PERIOD = 0.1  # [s] of the frames that are looked at
_PATIENCE = 10.0  # [s] until a job ends whose map, poses or supervisor do not come
_GONE = "the supervisor does not answer; restart it, or launch with --respawn"
_ENDS = (JobError.CANCELED, JobError.PREEMPTED, JobError.CLOCK_RESET, JobError.TOO_HEAVY)
_CODES = {
    PlanError.INVALID_GOAL: JobError.INVALID_GOAL,
    PlanError.OUTSIDE_MAP: JobError.OUTSIDE_MAP,
    PlanError.GOAL_OCCUPIED: JobError.GOAL_OCCUPIED,
}


class _Phase(Enum):
    IDLE = auto()
    WAITING = auto()  # for map, poses or the supervisor
    PLANNING = auto()
    MOVING = auto()


class RearrangerNode(Node):
    """Brings several objects to their goals, one at a time, by one robot."""

    def __init__(
        self,
        scenario: Scenario | None = None,
        robot: str = "",
        namespace: str = "",
        world: str = "",
    ) -> None:
        """namespace: the team's; world: the bridge's, where it is another one."""
        super().__init__("rearranger", namespace=namespace)
        names = names_of(self, world)
        name = self.declare_parameter("scenario", "rearrange").value
        robot = str(self.declare_parameter("robot", robot).value)
        scenario = scenario or load_scenario(str(name))
        self._robot = scenario.robot(robot)[0]
        self._items = tuple(scenario.objects)
        values = dict(scenario.parameters.get("rearranger", {}))
        poses = values.pop("poses", {})
        self.settings = declare_settings(
            self, RearrangementSettings, values, where="rearranger", apply=self._apply
        )
        gate = declare_settings(self, PoseGateSettings, poses, "poses", "rearranger.poses")
        self._planner_settings = from_mapping(
            PlannerSettings, scenario.parameters.get("planner", {}), "planner"
        )
        self._field: DistanceField | None = None
        self._grid: Grid | None = None
        self._phase = _Phase.IDLE
        self._goals: dict[str, Array] = {}
        self._work: Generator[str, None, list[Move]] | None = None
        self._moves: list[Move] = []
        self._index = self._failures = 0
        self._since = math.nan  # [s] on the clock of silence: since when something is missing
        self.planning = 0.0  # [s] CPU time of the search for moves, of the last job
        self._state = JobState(system="rearrange", robots=[self._robot])
        self._diagnostics = Diagnostics(self, names, self._diagnose)
        self._poses = PoseFeed(
            self,
            names,
            gate,
            (self._robot, *self._items),
            self._diagnostics,
            self._on_frame,
            _PERIOD,
        )
        MapFeed(self, names, self._diagnostics, self._take_map)
        self._beliefs = BeliefFeed(self, names, scenario, self._diagnostics)
        self._mover = Mover(self, names, self._moved)
        self._topic = names.team(GOALS)
        self._publisher = self.create_publisher(JobState, names.team(STATE), LATCHED)
        events = self._diagnostics.subscription_events(self._topic)
        self.create_subscription(
            Poses, self._topic, self._on_goals, COMMAND, event_callbacks=events
        )
        services = Services(self, names.team(CALLS), lambda: self._poses.stamp)
        services.serve(Trigger, names.team(CANCEL), self._on_cancel)
        self.create_timer(0.2, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._tell(JobPhase.IDLE, "waiting for goals")

    @property
    def ready(self) -> bool:
        """Whether goals could be worked on."""
        return self._grid is not None and bool(self._mover.ready)

    @property
    def busy(self) -> bool:
        """Whether objects are being brought to their goals."""
        return self._phase is not _Phase.IDLE

    def _apply(self, settings: RearrangementSettings) -> None:
        if self.busy:
            raise SettingsError("the rearranger is busy; change its parameters when it is idle")
        self.settings = settings

    def _take_map(self, grid: Grid) -> None:
        self._grid, self._field = grid, None
        if self._phase is _Phase.PLANNING:
            self._wait("the map has changed")

    # Goals

    def _on_goals(self, message: Poses) -> None:
        try:
            goals = self._judged(message)
        except GoalRefused as refusal:
            self._diagnostics.refuse(self._topic, str(refusal))
            state = self._state
            state.refusals += 1
            state.refusal_code, state.refusal = int(refusal.code), str(refusal)
            self._publisher.publish(state)
            return
        if self.busy and same_goals(goals, self._goals):  # of another client, which takes over
            self._state.job += 1
            self._publisher.publish(self._state)
            return
        if self.busy:
            self._end(JobError.PREEMPTED, "new goals replace these")
        self._goals, self._failures, self.planning = goals, 0, 0.0
        self._state.job += 1
        self._state.replans = 0
        self._wait("goals were given")

    def _judged(self, message: Poses) -> dict[str, Array]:
        """The goals ``(3,)`` by name.

        Raises
        ------
        GoalRefused: goals that cannot be, as far as is known without a plan.
        """
        goals = goals_of(message, self._items)
        if self._grid is not None:
            try:
                self._rearrangement().check(goals)
            except PlanningFailed as failure:
                code = _CODES.get(failure.code, JobError.PLANNING_FAILED)
                raise GoalRefused(code, str(failure)) from None
            except SettingsError as error:
                raise GoalRefused(JobError.PLANNING_FAILED, str(error)) from None
        belief = self._beliefs.current
        for name, goal in goals.items():
            pose = self._pose(name)
            if pose is not None and self.settings.reached(pose, goal):
                continue
            problem = too_heavy(belief.robot(self._robot), belief.object(name))
            if problem is not None:
                raise GoalRefused(JobError.TOO_HEAVY, f"'{name}': {problem}")
        return goals

    def _rearrangement(self) -> Rearrangement:
        """For the present map and belief."""
        assert self._grid is not None
        if self._field is None:
            self._field = DistanceField(self._grid)
        belief = self._beliefs.current
        return Rearrangement(
            self.settings,
            self._planner_settings,
            self._field,
            belief.robot(self._robot),
            {n: belief.object(n) for n in self._items},
        )

    # The job

    def _wait(self, why: str) -> None:
        """Plan as soon as everything is there."""
        self._mover.forget()
        self._phase, self._since, self._work = _Phase.WAITING, math.nan, None
        self._moves, self._index = [], 0
        self._tell(JobPhase.PLANNING, why)
        self._tend()

    def _tend(self) -> None:
        """Begin to plan, or lose patience."""
        if self._phase is _Phase.MOVING:
            self._tend_move()
        if self._phase is not _Phase.WAITING:
            return
        poses = {n: p for n in self._items if (p := self._pose(n)) is not None}
        robot = self._pose(self._robot)
        missing = [n for n in self._goals if n not in poses]
        if self.ready and not missing and robot is not None:
            self._plan(poses, robot)
            return
        if self._impatient():
            if not self.ready:
                self._end(JobError.NODE_LOST, "no map came" if self._grid is None else _GONE)
            else:
                names = ", ".join(missing or [self._robot])
                self._end(JobError.POSES_STALE, f"no poses of {names} arrive")

    def _tend_move(self) -> None:
        """Lose patience with a supervisor that is gone."""
        if self._mover.ready:
            self._since = math.nan
            return
        self._mover.missed()
        if self._impatient():
            self._end(JobError.NODE_LOST, f"'{self._state.object}': {_GONE}")

    def _impatient(self) -> bool:
        """Whether something has been missing for too long; call this while it is."""
        now = self._poses.clock.now
        self._since = now if math.isnan(self._since) else self._since
        return now - self._since > _PATIENCE

    def _plan(self, poses: dict[str, Array], robot: Array) -> None:
        try:
            self._work = self._rearrangement().plan(poses, self._goals, robot)
        except SettingsError as error:
            self._end(JobError.PLANNING_FAILED, str(error))
            return
        self._phase = _Phase.PLANNING
        self._tell(JobPhase.PLANNING, "searching for an order of pushes")
        self._slice()

    def _slice(self) -> None:
        """Queue the next slice of planning behind whatever else the executor has to do."""
        assert self.executor is not None
        work = self._work
        self.executor.create_task(lambda: self._on_slice(work))

    def _on_slice(self, work: Generator[str, None, list[Move]] | None) -> None:
        if work is None or work is not self._work or self._phase is not _Phase.PLANNING:
            return
        began = time.thread_time()
        try:
            next(work)
        except StopIteration as finished:
            self.planning += time.thread_time() - began
            self._moves, self._index, self._work = finished.value, 0, None
            self._next()
        except PlanningFailed as failure:
            self._end(_CODES.get(failure.code, JobError.PLANNING_FAILED), str(failure))
        else:
            self.planning += time.thread_time() - began
            self._slice()

    def _next(self) -> None:
        """Ask for the next move."""
        if self._index == len(self._moves):
            self._conclude()
            return
        self._phase, self._since = _Phase.MOVING, math.nan
        move = self._moves[self._index]
        goal = pose_stamped_to_ros(move.goal, self._poses.stamp)
        self._state.object, self._state.goal = move.object, goal
        where = ASIDE if move.aside else "to its goal"
        self._tell(JobPhase.PUSHING, f"'{move.object}' {where}")
        self._mover.move(move.object, move.goal, self._poses.stamp)

    def _conclude(self) -> None:
        """All moves are made; something may have been displaced meanwhile."""
        poses = {n: self._pose(n) for n in self._goals}
        s = self.settings
        off = [n for n, p in poses.items() if p is None or not s.reached(p, self._goals[n])]
        if not off:
            self._end(JobError.NONE, "every object is at its goal")
            return
        names = ", ".join(f"'{n}'" for n in off)
        self._again(JobError.OFF_TARGET, f"{names} moved away from the goal or cannot be seen")

    def _again(self, code: JobError, why: str) -> None:
        """Plan again, or end when that has been done too often."""
        if self._failures >= self.settings.max_failures:
            self._end(code, why)
            return
        self._failures += 1
        self._state.replans += 1
        self._wait(f"planning again: {why}")

    def _moved(self, code: JobError, why: str) -> None:
        """The move under way has ended."""
        if code == JobError.NONE:
            self._index += 1
            self._next()
        elif code in _ENDS:
            self._end(code, f"'{self._state.object}': {why}")
        else:
            self._again(code, f"'{self._state.object}': {why}")

    def _end(self, code: JobError, why: str) -> None:
        self._mover.forget()
        self._phase, self._work = _Phase.IDLE, None
        self._state.error_code = int(code)
        self._tell(JobPhase.IDLE, why)

    # What comes in

    def _pose(self, name: str) -> Array | None:
        pose: Array | None = self._poses.pose(name)
        return pose

    def _on_frame(self, frame: Frame) -> None:
        if frame.verdict is Stamp.RESET and self.busy:
            self._end(JobError.CLOCK_RESET, "the clock jumped back; send the goals again")
        self._tend()

    def _on_watchdog(self) -> None:
        """Wall time, for when no frames come; in lockstep there is always one to come."""
        if not self._poses.clock.lockstep:
            self._tend()

    def _on_cancel(self, request: Any, response: Any) -> Any:
        response.success = self.busy
        response.message = "canceled" if self.busy else "there is nothing to cancel"
        if self.busy:
            self._end(JobError.CANCELED, "canceled")
        return response

    # What goes out

    def _tell(self, phase: JobPhase, reason: str) -> None:
        state = self._state
        if phase == JobPhase.IDLE:
            state.object, state.goal = "", PoseStamped()
        else:
            state.error_code = int(JobError.NONE)
        state.header = pose_stamped_to_ros(np.zeros(3), self._poses.stamp).header
        state.state, state.state_name, state.reason = int(phase), phase.name, reason
        state.step_index, state.step_count = self._index, len(self._moves)
        done = self._index / len(self._moves) if self._moves else 0.0
        state.progress = done if self.busy or phase == JobPhase.IDLE else 0.0
        self._publisher.publish(state)
        self.get_logger().info(f"{phase.name}: {reason}")

    def _diagnose(self) -> dict[str, Any]:
        return {
            "state": self._phase.name,
            "reason": self._state.reason,
            "error code": int(self._state.error_code),
            "moves": f"{self._index} of {len(self._moves)}",
            "planning time (s)": f"{self.planning:.2f}",
            "warning": "",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(RearrangerNode, urgency=Urgency.BACKGROUND)


if __name__ == "__main__":
    sys.exit(main())
