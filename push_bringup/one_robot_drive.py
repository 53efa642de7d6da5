"""How one robot drives: the motions that the state machine asks for, tracked. No ROS, no clock."""

from push_bringup.one_robot_plans import wider
from push_job.method import Seen
from push_model.belief import POSES, Belief
from push_model.stick_certificate import ContactBelief
from push_mpc import Push, Task, Tick, TrajectoryTracker, line_contact
from push_mpc.believed_push import Unstable, believed_push
from push_mpc.other_bodies import kept_off
from push_supervisor import Surroundings, commands, events

_TICK = 0.01  # [s] assumed where the time since the last frame is not known
_GAP = 0.15  # [s] between frames from which on the robot has stood still meanwhile


class Drive:
    """Motions of one robot, one at a time; tick: of the last frame, None without a motion."""

    def __init__(self, tracker: TrajectoryTracker, robot: str, item: str) -> None:
        """robot, item: names."""
        self.tracker = tracker
        self.tick: Tick | None = None
        self._robot, self._item = robot, item
        self._push: Push | None = None  # under way, as it was planned
        self._time = float("nan")
        self.held = 0.0
        """[s] that the robot has not been seen."""
        tracker.warm_up()

    @property
    def pushing(self) -> bool:
        """Whether the motion under way is a push."""
        return self.tracker.push is not None

    def start(
        self, command: commands.Motion, near: Surroundings, seen: Seen, belief: Belief
    ) -> events.Event | None:
        """Begin a motion of a robot that is seen; the failure of a push that is not stable."""
        way, circles = near.motion(command, seen.robots[self._robot], seen.object)
        self._push = None
        if isinstance(command, commands.FollowPush):
            grasp, limits = command.segment.grasp, command.segment.limits
            self._push = Push(grasp, limits, line_contact(near.robot, near.item, grasp))
        s = self.tracker.settings
        ends = s.position_tolerance, s.orientation_tolerance
        going_on = isinstance(command, commands.FollowPush) and command.going_on
        self.tracker.start(Task(way, self._push, circles, *ends), going_on)
        return self.believe(belief) if belief.values or belief.outlines else None

    def believe(self, belief: Belief) -> events.Event | None:
        """Go on with what is believed now: a push gets other limits, or fails without any."""
        push, failure = None, None
        latency = (POSES, "latency") in belief.values
        delay = belief.latency.value if latency else self.tracker.settings.pose_delay
        if self.tracker.active and self._push is not None:
            try:
                robot, item = belief.robot(self._robot), belief.object(self._item)
                push = believed_push(self._push, robot, item, ContactBelief.of(belief, self._item))
            except Unstable as error:
                self.tracker.stop()
                failure = events.MotionFailed(str(error))
        self.tracker.believe(push, delay)
        return failure

    def follow(
        self, seen: Seen, body_radius: float
    ) -> tuple[tuple[float, float], events.Event | None]:
        """v [m/s] and omega [rad/s] for a frame, and how the motion has ended in it, if it has.
        The robot stands while it is not seen."""
        tracker, ages, robot = self.tracker, seen.ages, seen.robots.get(self._robot)
        dt, self._time, self.tick = seen.time - self._time, seen.time, None
        if not 0.0 < dt <= _GAP:
            dt = _TICK
            tracker.halt()
        self.held = self.held + dt if robot is None else 0.0
        if robot is None or not tracker.active:
            tracker.rest(dt)
            return (0.0, 0.0), None
        shown = self.pushing and ages.get(self._item, 0.0) <= 0.0
        item, age = seen.object if shown else None, ages.get(self._robot, 0.0)
        others = kept_off(robot, wider(seen.obstacles, body_radius))
        self.tick = tick = tracker.tick(dt, robot, item, others, age)
        event: events.Event | None = None
        if tick.finished:
            event = events.MotionFailed(tick.message) if tick.code else events.MotionDone()
        return (tick.v, tick.omega), event
