"""Requests of the supervisor to other nodes, with time-outs and retries. No ROS.

The state machine issues commands. Each command becomes a request to one node. The request is sent
as soon as the server of that node is in the graph and the poses are known.

A node that dies during its work never answers. Its servers stay in the graph for some seconds, and
the servers of a restarted node look the same. The supervisor therefore relies on signs of life,
such as feedback:

- The controller counts as lost if the time without a sign of life is too long by pose time and also
  by the clock of the supervisor. Pose time stands still without poses. The second clock matters
  in a simulation that is faster than real time.
- The planner counts as silent if this time is too long by the clock of the supervisor.
- In lockstep, planning may take any time. The planner then counts as lost only when its server has
  left the graph. If it comes back and shows no sign of life, it has forgotten the request.
- Without poses, pose time stands still. The time without a sign of life of the controller is then
  limited by the clock of the supervisor alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from push_model.jobs import JobError
from push_supervisor import commands
from push_supervisor.commands import Question
from push_supervisor.settings import SupervisorSettings

ASKS = 3
"""Maximum number of times that the same request is sent to the planner."""


class Peer(Enum):
    """The nodes to which requests are sent, with their names in messages."""

    PLANNER = "the planner"
    PATHS = "the planner of robot paths"
    CONTROLLER = "the controller"


PEERS: Mapping[type[Question], Peer] = {
    commands.MakePlan: Peer.PLANNER,
    commands.FindPath: Peer.PATHS,
    commands.FollowPath: Peer.CONTROLLER,
    commands.FollowApproach: Peer.CONTROLLER,
    commands.FollowPush: Peer.CONTROLLER,
    commands.FollowTurn: Peer.CONTROLLER,
    commands.FollowRetreat: Peer.CONTROLLER,
}
"""The node to which each kind of command is sent."""


@dataclass(frozen=True)
class Moment:
    """The present state of the surroundings, as far as requests depend on it.

    clock: [s] time of the supervisor, see ``push_ros.pace_feed.LivenessClock``. stamp: [s] of the
    newest poses. poses: whether the poses of robot and object are known. ready: whether the server
    of a peer is in the graph. lockstep: whether the world waits for its controllers.
    """

    clock: float
    stamp: float
    poses: bool
    ready: Callable[[Peer], bool]
    lockstep: bool = False


@dataclass(frozen=True)
class Request:
    """A request. command: what is requested. delay: [s] of pose time before it is sent."""

    command: Question
    delay: float = 0.0

    @property
    def peer(self) -> Peer:
        """The node to which the request is sent."""
        return PEERS[type(self.command)]


class Step(Enum):
    """What the supervisor has to do now."""

    WAIT = "nothing"
    ASK = "send the request, with its number"
    LOST = "the controller is gone"
    GIVE_UP = "nobody will answer"


@dataclass(frozen=True)
class Verdict:
    """What to do now. code, message: the reason of the steps GIVE_UP and LOST."""

    step: Step
    code: JobError = JobError.NONE
    message: str = ""


_WAIT, _ASK = Verdict(Step.WAIT), Verdict(Step.ASK)
_BLIND = Verdict(
    Step.GIVE_UP,
    JobError.POSES_STALE,
    "no poses of robot and object arrive; check the motion capture",
)


class Requests:
    """Handles one request at a time.

    Each attempt has a number. An answer with an older number is late and is ignored.

    request: the present request, or None. number: of the last attempt. asks: number of attempts of
    the present request.
    """

    def __init__(self, settings: SupervisorSettings) -> None:
        self.settings = settings
        self.request: Request | None = None
        self.number = 0
        self.asks = 0
        self._asked = False
        self._gone = False  # whether the node has left the graph since its last sign of life
        self._not_before = 0.0  # [s] pose time
        self._missing: float | None = None  # [s] by the clock since when it could not be asked
        self._sign_clock = self._sign_stamp = 0.0

    def begin(self, request: Request, now: Moment) -> None:
        """Begin a request. It replaces the present one."""
        self.drop()
        self.request = request
        self._not_before = now.stamp + request.delay

    def drop(self) -> None:
        """Abandon the present request. Answers to it are ignored."""
        self.request = None
        self.number += 1
        self.asks = 0
        self._asked, self._missing = False, None

    def tend(self, now: Moment) -> Verdict:
        """Say what to do now; call this often. After ASK the request counts as sent."""
        if self.request is None:
            return _WAIT
        if self._asked:
            return self._listen(self.request, now)
        if now.poses and now.ready(self.request.peer):
            self._missing = None
            if now.stamp < self._not_before:
                return _WAIT
            return self._ask(now)
        if self._missing is None:
            self._missing = now.clock
        if now.clock - self._missing <= self.settings.node_timeout:
            return _WAIT
        peer = self.request.peer
        self.drop()
        if now.poses:
            return Verdict(
                Step.GIVE_UP,
                JobError.NODE_LOST,
                f"{peer.value} is not in the ROS graph; start it, or launch with --respawn",
            )
        return _BLIND

    def sign(self, number: int, now: Moment) -> None:
        """Take note of a sign of life of the node that received the attempt with this number."""
        if number == self.number and self._asked:
            self._gone = False
            self._sign_clock, self._sign_stamp = now.clock, now.stamp

    def answer(self, number: int) -> bool:
        """Whether an answer belongs to the present attempt. If so, the request is complete."""
        if number != self.number or not self._asked:
            return False
        self.drop()
        return True

    def _ask(self, now: Moment) -> Verdict:
        self.number += 1
        self.asks += 1
        self._asked, self._gone = True, False
        self._sign_clock, self._sign_stamp = now.clock, now.stamp
        return _ASK

    def _listen(self, request: Request, now: Moment) -> Verdict:
        """Whether the silence has lasted too long."""
        self._gone = self._gone or not now.ready(request.peer)
        if now.lockstep and request.peer is not Peer.CONTROLLER and not self._gone:
            return _WAIT
        silence = now.clock - self._sign_clock
        if request.peer is Peer.CONTROLLER:
            if not now.poses and silence > self.settings.node_timeout:
                self.drop()
                return _BLIND
            silence = min(silence, now.stamp - self._sign_stamp)
            if silence <= self.settings.controller_timeout:
                return _WAIT
            self.drop()
            return Verdict(
                Step.LOST, JobError.NODE_LOST, f"{request.peer.value} no longer responds"
            )
        if silence <= self.settings.answer_timeout:
            return _WAIT
        if self.asks >= ASKS:
            self.drop()
            text = f"{request.peer.value} does not answer"
            return Verdict(Step.GIVE_UP, JobError.NODE_LOST, text)
        self.number += 1  # what comes now is late
        self._asked = False
        return self.tend(now)
