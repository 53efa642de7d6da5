"""The group's node: goals and trajectories in, velocities of all its robots out.

Every frame of the pose stream is answered with one message on ``cmd_vels``; the steps come from the
grasp optimizer.
"""

import sys
import time
from typing import Any

import numpy as np

from grasp_opt.group_control import GroupControlSettings
from grasp_opt.group_job import GroupJob, GroupJobSettings, Request
from grasp_opt.group_messages import plan_from_ros, status_to_ros, trajectory_from_ros
from grasp_opt.group_push import GroupPushSettings
from grasp_opt.moves import MoveSettings
from grasp_opt.object_trajectory import ObjectTrajectory
from push_estimation.pose_gate import PoseGateSettings
from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace, Obstacles
from push_model.jobs import GoalRefused, JobError, JobPhase
from push_model.object_way import WayFinder
from push_model.occupancy import OccupancyGrid as Grid
from push_msgs.action import MoveObject, PlanGroupPush, PushAlong
from push_msgs.msg import GroupStatus, Velocities
from push_ros.actions import GoalClient, GoalServer
from push_ros.conversions import circles_to_ros, pose_stamped_to_ros, pose_to_ros
from push_ros.parameters import declare_settings
from push_ros.process import run_node
from push_ros.qos import COMMAND, STATUS
from push_ros.team_node import PATIENCE, TeamNode
from push_ros.validation import InvalidMessage
from push_scenario.scenario import Scenario

_ERRORS = {
    PlanGroupPush.Result.INVALID_GOAL: JobError.INVALID_GOAL,
    PlanGroupPush.Result.UNKNOWN_OBJECT: JobError.UNKNOWN_OBJECT,
    PlanGroupPush.Result.TOO_FEW: JobError.TOO_HEAVY,
}


class GroupNode(TeamNode):
    """Robots of one type, one object, one job at a time."""

    def __init__(
        self,
        scenario: Scenario | None = None,
        robots: tuple[str, ...] = (),
        item: str = "",
        namespace: str = "",
        world: str = "",
    ) -> None:
        """robots, item: the group's. namespace: the team's; world: the bridge's, where it is
        another one."""
        super().__init__("group", "group-ellipse", scenario, robots, item, namespace, world)
        names = self.names
        values = dict(self.scenario.parameters.get("group", {}))
        sections = {k: values.pop(k, {}) for k in ("push", "control", "moves", "poses")}
        self.job = GroupJob(
            self._item,
            self._robot,
            len(self.robots),
            declare_settings(self, GroupJobSettings, values, where="group"),
            declare_settings(self, GroupPushSettings, sections["push"], "push", "group.push"),
            declare_settings(
                self, GroupControlSettings, sections["control"], "control", "group.control"
            ),
            declare_settings(self, MoveSettings, sections["moves"], "moves", "group.moves"),
        )
        gate = declare_settings(self, PoseGateSettings, sections["poses"], "poses", "group.poses")
        self._finder: WayFinder | None = None
        self._asked: Request | None = None
        self._wanted = self._waiting  # since when the optimizer is
        self._commands = self.create_publisher(Velocities, names.world("cmd_vels"), COMMAND)
        self._status = self.create_publisher(GroupStatus, names.team("group_status"), STATUS)
        self._optimizer = GoalClient(self, PlanGroupPush, names.team("plan_group_push"))
        self.listen(gate)
        self._along = GoalServer(
            self,
            PushAlong,
            names.team("push_along"),
            check=lambda request: None,
            refuse=self._refuse_trajectory,
            start=self._begin_along,
            cancel=lambda: self.end_job(JobError.CANCELED, "canceled"),
            preempt=lambda request: self.end_job(JobError.PREEMPTED, "a trajectory replaces it"),
        )
        self._publish_state()

    @property
    def ready(self) -> bool:
        """Whether a goal could be worked on."""
        return self._grid is not None and self._optimizer.ready

    # The owner of the job, see JobOwner

    @property
    def busy(self) -> bool:
        """See JobOwner."""
        return self.job.busy

    def check_goal(self, goal: Array) -> None:
        """See JobOwner."""
        if self._grid is None or self._finder is None:
            return
        if not self._grid.contains(float(goal[0]), float(goal[1])):
            raise GoalRefused(JobError.OUTSIDE_MAP, "the goal is outside the map")
        room = self._finder.clearance(self._item.mass_pose(goal), Obstacles())[0]
        if room <= 0.0:
            raise GoalRefused(JobError.GOAL_OCCUPIED, "the object does not fit there")

    def take_goal(self, goal: Array, plan_only: bool) -> None:
        """See JobOwner."""
        self.job.begin(self._item.mass_pose(goal))
        if plan_only:
            self.end_job(JobError.INVALID_GOAL, "a group plans a step at a time; it cannot wait")
        self._begun()

    def end_job(self, code: JobError, message: str) -> None:
        """See JobOwner."""
        self.job.end(code, message)
        self._optimizer.forget()
        self._look_after_job()

    # Trajectories

    def _refuse_trajectory(self, request: Any) -> Any:
        """The result for a trajectory that cannot be; None where it can."""
        try:
            task = trajectory_from_ros(request, self._item)
        except InvalidMessage as error:
            return PushAlong.Result(error_code=int(JobError.INVALID_GOAL), error_msg=str(error))
        off = se2.between(task.pose[0], self._pose)
        away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        s = self.job.settings
        if away > 4.0 * s.position_tolerance or turned > 4.0 * s.orientation_tolerance:
            text = f"the object is {1e3 * away:.0f} mm, {turned:.2f} rad from where it begins"
            return PushAlong.Result(error_code=int(JobError.INVALID_GOAL), error_msg=text)
        return None

    def _begin_along(self, request: Any) -> None:
        self.job.begin_along(trajectory_from_ros(request, self._item))
        self._begun()

    def _begun(self) -> None:
        self._waiting = self._wanted = time.monotonic()
        self._look_after_job()

    # The world

    def _take_map(self, grid: Grid) -> None:
        self._grid = grid
        self._finder = WayFinder(FreeSpace(grid), self._item.geometry.outline, 0.0)

    def _on_reset(self) -> None:
        self.job.revive()
        super()._on_reset()

    def _tick(self) -> dict[str, tuple[float, float]]:
        """Twists of all robots; they stand while a pose is not known."""
        item = self._poses.pose(self.object)
        robots = [self._poses.pose(name) for name in self.robots]
        if item is None or any(r is None for r in robots):
            return {}
        self._waiting = time.monotonic()
        self._pose = self._item.mass_pose(item)
        began = time.thread_time()
        twists = self.job.step(self._poses.stamp, self._pose, np.array(robots))
        step, plan = self.job.last, self.job.plan
        if step is not None and plan is not None:
            away, turned = self._errors(plan.trajectory, step.time)
            figures = {
                "friction": self._item.contact_friction,
                "margin": float(plan.placement.margin),
                "position_error": away,
                "orientation_error": turned,
                "solve_time": time.thread_time() - began,
            }
            pushers = [self.robots[i] for i in plan.pushers]
            dead = [self.robots[i] for i in self.job.dead]
            self._status.publish(
                status_to_ros(self._stamp, self.object, pushers, step, self._pose, figures, dead)
            )
        return {n: (float(v), float(w)) for n, (v, w) in zip(self.robots, twists, strict=True)}

    def _errors(self, task: ObjectTrajectory, when: float) -> tuple[float, float]:
        off = se2.between(task.sample(when), self._pose)
        return float(np.hypot(off[0], off[1])), abs(float(off[2]))

    def _publish(self, twists: dict[str, tuple[float, float]]) -> None:
        told = [twists.get(name, (0.0, 0.0)) for name in self.robots]
        message = Velocities(
            names=list(self.robots), vx=[v for v, _ in told], omega=[w for _, w in told]
        )
        message.header.stamp, message.header.frame_id = self._stamp, "base_link"
        self._commands.publish(message)

    def _on_watchdog(self) -> None:
        """Wall time, for when nothing comes: no poses, or no answer."""
        now = time.monotonic()
        if not self.job.busy or self._poses.paused:
            self._waiting = self._wanted = now
            return
        if self.job.request is None or self._optimizer.ready:
            self._wanted = now
        else:  # gone, perhaps to come again: it is asked anew then
            self._asked = None
            self._optimizer.forget()
        if now - self._wanted > PATIENCE:
            self.end_job(JobError.NODE_LOST, "the grasp optimizer is not there")
        elif now - self._waiting > PATIENCE:
            self.end_job(JobError.POSES_STALE, "poses of the object or a robot do not come")
        self._look_after_job()

    # The optimizer

    def _look_after_job(self) -> None:
        """Ask for the step that the job wants, tell how it stands, end what has ended."""
        request = self.job.request
        if request is None:
            self._asked = None
        elif request is not self._asked and self._optimizer.ready:
            self._asked = request
            self._ask(request)
        self._tell((self.job.state, self.job.reason, self.job.pushes))

    def _ask(self, request: Request) -> None:
        goal = PlanGroupPush.Goal(object=self.object, robots=list(self.robots))
        goal.start = pose_to_ros(self._item.geometric_pose(request.pose))
        goal.goal = pose_stamped_to_ros(self._item.geometric_pose(request.goal), self._poses.stamp)
        goal.places = [pose_to_ros(pose) for pose in request.robots]
        goal.fewest = request.fewest
        goal.dead = [self.robots[i] for i in request.dead]
        goal.obstacles = circles_to_ros(self._poses.discs(self._others))
        if request.trajectory is not None:
            task = request.trajectory
            poses = np.array([self._item.geometric_pose(p) for p in task.pose])
            goal.time, goal.theta = task.time.tolist(), task.pose[:, 2].tolist()
            goal.x, goal.y = poses[:, 0].tolist(), poses[:, 1].tolist()

        def answered(result: Any) -> None:
            if self.job.request is not request:
                return
            if result is None:
                self.job.failed(JobError.PLANNING_FAILED, "the optimizer rejected the request")
            elif result.error_code:
                code = _ERRORS.get(result.error_code, JobError.PLANNING_FAILED)
                self.job.failed(code, result.error_msg)
            else:
                try:
                    self.job.planned(plan_from_ros(result.plan, self.robots))
                except InvalidMessage as error:
                    self.job.failed(JobError.PLANNING_FAILED, str(error))
            self._look_after_job()

        self._optimizer.send(goal, answered)

    # Outputs

    def _publish_state(self) -> None:
        job = self.job
        pieces = job.pushes + max(0, job.left - (job.state is JobPhase.PUSHING))
        state, name, index = int(job.state), job.state.name, max(0, job.pushes - 1)
        progress = float(not job.busy) if not pieces else min(1.0, job.pushes / pieces)
        if job.busy and job.goal is not None:
            way = float(np.hypot(*(job.goal - self._pose)[:2]))
            told = MoveObject.Feedback(state=state, state_name=name, distance_to_goal=way)
            told.push_index, told.push_count = index, pieces
            self._intake.feedback(told)
            self._along.feedback(PushAlong.Feedback(state_name=name, progress=progress))
        self._intake.publish(
            self._poses.stamp,
            state=state,
            state_name=name,
            reason=job.reason,
            error_code=int(job.error),
            progress=progress,
            step_index=index,
            step_count=pieces,
            replans=job.replans,
        )
        self.get_logger().info(f"{job.state.name}: {job.reason}")

    def _finish(self) -> None:
        """Tell whoever waits how the job ended."""
        job, away, turned = self.job, float("inf"), float("inf")
        if job.goal is not None:
            off = se2.between(job.goal, self._pose)
            away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        common = {
            "error_code": int(job.error),
            "error_msg": "" if job.error is JobError.NONE else job.reason,
            "position_error": away,
            "orientation_error": turned,
        }
        if self._along.active:
            margin = job.plan.placement.margin if job.plan is not None else -1.0
            result = PushAlong.Result(margin=float(margin), **common)
            self._along.finish(result, success=job.error is JobError.NONE)
        if self._intake.waited_for:
            self._intake.finish(MoveObject.Result(pushes=job.pushes, replans=job.replans, **common))

    def _state(self) -> dict[str, Any]:
        return {
            "state": self.job.state.name,
            "reason": self.job.reason,
            "error code": int(self.job.error),
            "pushes": self.job.pushes,
            "replans": self.job.replans,
            "robots that do not move": " ".join(self.robots[i] for i in self.job.dead),
            "poses refused": self._poses.gate.refused,
            "warning": "no poses" if self._poses.pose(self.object) is None else "",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(GroupNode)


if __name__ == "__main__":
    sys.exit(main())
