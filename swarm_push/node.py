"""The swarm's node: targets in, velocities of all robots that are seen out.

Every frame of the pose stream is answered with one message on ``cmd_vels``; where robots decide for
themselves (``agent_node.py``), with the target that they have: then this node only takes goals,
watches, and tells how the job stands.
"""

import math
import sys
import time
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_model.free_space import FreeSpace
from push_model.jobs import GoalRefused, JobError, JobPhase
from push_model.occupancy import OccupancyGrid as Grid
from push_msgs.action import MoveObject, SwarmMove
from push_msgs.msg import SwarmStatus, SwarmTarget, Velocities
from push_ros.actions import GoalServer
from push_ros.process import run_node
from push_ros.qos import COMMAND, STATUS
from push_ros.team_node import PATIENCE, TeamNode
from push_ros.validation import FRAME, InvalidMessage
from push_scenario.scenario import Scenario
from swarm_push.parameters import declare_swarm
from swarm_push.swarm_job import SwarmJob
from swarm_push.swarm_messages import status_to_ros, target_to_ros, targets_from_ros


class SwarmNode(TeamNode):
    """Robots of one type, one object, one job at a time."""

    def __init__(
        self,
        scenario: Scenario | None = None,
        robots: tuple[str, ...] = (),
        item: str = "",
        namespace: str = "",
        world: str = "",
    ) -> None:
        """robots, item: the swarm's. namespace: the team's; world: the bridge's, where it is
        another one."""
        super().__init__("swarm", "swarm-square", scenario, robots, item, namespace, world)
        names = self.names
        self.settings = declare_swarm(self, self.scenario)
        self.job: SwarmJob | None = None
        self._why_not = "there is no map yet"
        self._space: FreeSpace | None = None
        self._commands = self._targets = None
        if self.settings.agents.decentralised:
            topic = names.team("swarm_target")
            self._targets = self.create_publisher(SwarmTarget, topic, COMMAND)
        else:
            self._commands = self.create_publisher(Velocities, names.world("cmd_vels"), COMMAND)
        self._status = self.create_publisher(SwarmStatus, names.team("swarm_status"), STATUS)
        self.listen(self.settings.poses)
        self._moves = GoalServer(
            self,
            SwarmMove,
            names.team("swarm_move"),
            check=lambda request: None,
            refuse=self._refuse_targets,
            start=self._begin_targets,
            cancel=lambda: self.end_job(JobError.CANCELED, "canceled"),
            preempt=lambda request: self.end_job(JobError.PREEMPTED, "other targets replace it"),
        )
        self._publish_state()

    @property
    def ready(self) -> bool:
        """Whether a goal could be worked on."""
        return self._grid is not None

    # The owner of the job, see JobOwner

    @property
    def busy(self) -> bool:
        """See JobOwner."""
        return self.job is not None and self.job.busy

    def check_goal(self, goal: Array) -> None:
        """See JobOwner."""
        if self._grid is None or self._space is None:
            return
        if self.job is None:
            raise GoalRefused(JobError.PLANNING_FAILED, self._why_not)
        if not self._grid.contains(float(goal[0]), float(goal[1])):
            raise GoalRefused(JobError.OUTSIDE_MAP, "the goal is outside the map")
        reach = float(np.hypot(*self._item.outline.T).max())
        roomy = self._space.clearance(goal[None, :2])[0] >= reach
        track, pose = self.job.track, self._item.mass_pose(goal)
        if not self.settings.job.orientation:
            pose = np.array([*goal[:2], math.nan])
        if not (roomy if track is None else track.fits(pose)):
            raise GoalRefused(JobError.GOAL_OCCUPIED, "the object does not fit there")

    def take_goal(self, goal: Array, plan_only: bool) -> None:
        """See JobOwner."""
        target = self._item.mass_pose(goal)
        if not self.settings.job.orientation:
            target = np.array([*goal[:2], math.nan])
        self._begin([target])
        if plan_only:
            self.end_job(JobError.INVALID_GOAL, "a swarm makes no plans that could wait")

    def end_job(self, code: JobError, message: str) -> None:
        """See JobOwner."""
        if self.job is not None:
            self.job.end(code, message)
        self._look_after_job()

    # Targets

    def _refuse_targets(self, request: Any) -> Any:
        """The result for targets that cannot be; None where they can."""
        try:
            if request.object not in ("", self.object):
                raise GoalRefused(JobError.UNKNOWN_OBJECT, f"unknown object '{request.object}'")
            for target in targets_from_ros(request, self._item):
                self.check_goal(target)
        except InvalidMessage as error:
            self._diagnostics.refuse("swarm_move", str(error))
            return SwarmMove.Result(error_code=int(JobError.INVALID_GOAL), error_msg=str(error))
        except GoalRefused as refusal:
            return SwarmMove.Result(error_code=int(refusal.code), error_msg=str(refusal))
        return None

    def _begin_targets(self, request: Any) -> None:
        self._begin(targets_from_ros(request, self._item))

    def _begin(self, targets: list[Array]) -> None:
        self._waiting = time.monotonic()
        if self.job is not None:
            self.job.begin(targets)
        self._look_after_job()

    # The world

    def _take_map(self, grid: Grid) -> None:
        self.end_job(JobError.PREEMPTED, "the map has changed")
        self._grid, self._space = grid, FreeSpace(grid)
        self.job = self._job(grid)
        self._look_after_job()

    def _job(self, grid: Grid) -> SwarmJob | None:
        """For a map; None where there can be none, for the reason in ``_why_not``."""
        job = self.settings.make_job(grid, self._item, self._robot)
        if isinstance(job, str):
            self._why_not = job
            return None
        job.warm_up()
        return job

    def _tick(self) -> dict[str, tuple[float, float]]:
        """Twists of all robots that are seen; they stand while the object is not."""
        item = self._poses.pose(self.object)
        if item is None or self.job is None or not self.job.busy:
            return {}
        self._waiting = time.monotonic()
        self._pose = self._item.mass_pose(item)
        seen = {n: p for n in self.robots if (p := self._poses.pose(n)) is not None}
        others, began = self._poses.discs(self._others), time.thread_time()
        twists = self.job.step(self._poses.stamp, self._pose, seen, others)
        if self.job.last is not None:
            cost, names = time.thread_time() - began, self.job.taking_part
            law = self.settings.laws.law.law
            self._status.publish(
                status_to_ros(self._stamp, self.object, law, names, self.job, self._pose, cost)
            )
        return twists

    def _publish(self, twists: dict[str, tuple[float, float]]) -> None:
        """To every robot, also those that are not seen: they stand. Or where those that decide for
        themselves are to bring the object."""
        if self._targets is not None:
            target = self.job.target if self.job is not None and self.job.busy else None
            self._targets.publish(target_to_ros(self._stamp, target))
            return
        assert self._commands is not None
        told = [twists.get(name, (0.0, 0.0)) for name in self.robots]
        first, second = [a for a, _ in told], [b for _, b in told]
        if self.job is not None and self.job.holonomic:
            message = Velocities(names=list(self.robots), vx=first, vy=second)
            message.header.frame_id = FRAME
        else:
            message = Velocities(names=list(self.robots), vx=first, omega=second)
            message.header.frame_id = "base_link"
        message.header.stamp = self._stamp
        self._commands.publish(message)

    def _on_watchdog(self) -> None:
        """Wall time, for when nothing comes."""
        now = time.monotonic()
        if not self.busy or self._poses.paused:
            self._waiting = now
        elif now - self._waiting > PATIENCE:
            self.end_job(JobError.POSES_STALE, "poses of the object do not come")

    # Outputs

    def _look_after_job(self) -> None:
        """Tell how the job stands, end what has ended."""
        job = self.job
        state = (
            (JobPhase.IDLE, "waiting for a map", 0)
            if job is None
            else (job.state, job.reason, job.index)
        )
        self._tell(state)

    def _publish_state(self) -> None:
        job = self.job
        state, reason, index = self._told or (JobPhase.IDLE, "waiting for a map", 0)
        count = len(job.targets) if job is not None else 0
        self._intake.publish(
            self._poses.stamp,
            state=int(state),
            state_name=state.name,
            reason=reason,
            error_code=0 if job is None else int(job.error),
            progress=index / count if count else float(not self.busy),
            step_index=min(index, max(0, count - 1)),
            step_count=count,
        )
        self.get_logger().info(f"{state.name}: {reason}")
        if job is not None and job.busy:
            away, _ = job.errors(self._pose)
            told = {"state_name": state.name}
            self._moves.feedback(SwarmMove.Feedback(target=index, position_error=away, **told))
            self._intake.feedback(
                MoveObject.Feedback(
                    state=int(state),
                    push_index=index,
                    push_count=count,
                    distance_to_goal=away,
                    **told,
                )
            )

    def _finish(self) -> None:
        """Tell whoever waits how the job ended."""
        job = self.job
        if job is None:
            return
        away, turned = job.errors(self._pose)
        common = {
            "error_code": int(job.error),
            "error_msg": "" if job.error is JobError.NONE else job.reason,
            "position_error": away,
            "orientation_error": turned,
        }
        if self._moves.active:
            result = SwarmMove.Result(times=job.times, **common)
            self._moves.finish(result, success=job.error is JobError.NONE)
        if self._intake.waited_for:
            self._intake.finish(MoveObject.Result(**common))

    def _state(self) -> dict[str, Any]:
        job = self.job
        seen = sum(self._poses.pose(n) is not None for n in self.robots)
        dead = sorted(job.dead) if job is not None else []
        return {
            "state": self._told[0].name if self._told else "IDLE",
            "reason": self._told[1] if self._told else "",
            "robots": f"{seen} of {len(self.robots)} seen",
            "robots that do not move": " ".join(dead),
            "law": self.settings.laws.law.law,
            "poses refused": self._poses.gate.refused,
            "warning": "no poses" if self._poses.pose(self.object) is None else "",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(SwarmNode)


if __name__ == "__main__":
    sys.exit(main())
