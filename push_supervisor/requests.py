"""Requests: what was asked of which node, how often, and what to make of silence. No ROS.

The state machine commands; a node is asked as soon as it is there and the poses are known. One that
dies in the middle of its work never answers. Its servers stay in the graph for seconds, and those
of one started in its place look the same: only signs of life tell. The controller must give one in
time by the clock of the poses, which stands still with them, and by the owner's clock, for a
simulation that runs fast. The planner must give one in time by the owner's clock. In lockstep the
world does not wait for the planner, which may take any time there: it is lost only when its server
has left the graph.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from push_model.jobs import JobError
from push_supervisor import commands
from push_supervisor.commands import Question
from push_supervisor.settings import SupervisorSettings

ASKS = 3
"""Times that the planner is asked the same."""


class Peer(Enum):
    """Who can be asked."""

    PLANNER = "the planner"
    PATHS = "the planner of robot paths"
    CONTROLLER = "the controller"


PEERS: Mapping[type[Question], Peer] = {
    commands.MakePlan: Peer.PLANNER,
    commands.FindPath: Peer.PATHS,
    commands.FollowPath: Peer.CONTROLLER,
    commands.FollowApproach: Peer.CONTROLLER,
    commands.FollowPush: Peer.CONTROLLER,
    commands.FollowRetreat: Peer.CONTROLLER,
}
"""Who is asked for what."""


@dataclass(frozen=True)
class Moment:
    """clock [s]: see ``push_ros.pace_feed.LivenessClock``; stamp [s]: of the poses; poses: whether
    those of robot and object are known; ready: whether a peer's server is there; lockstep: whether
    the world waits for its controllers."""

    clock: float
    stamp: float
    poses: bool
    ready: Callable[[Peer], bool]
    lockstep: bool = False


@dataclass(frozen=True)
class Request:
    """What to ask. delay: [s] of pose time to wait before."""

    command: Question
    delay: float = 0.0

    @property
    def peer(self) -> Peer:
        """Who is asked."""
        return PEERS[type(self.command)]


class Step(Enum):
    """What the owner is to do now."""

    WAIT = "nothing"
    ASK = "ask, with the number of this asking"
    LOST = "the controller is gone"
    GIVE_UP = "nobody will answer"


@dataclass(frozen=True)
class Verdict:
    """code, message: with GIVE_UP and LOST."""

    step: Step
    code: JobError = JobError.NONE
    message: str = ""


_WAIT, _ASK = Verdict(Step.WAIT), Verdict(Step.ASK)


class Requests:
    """One request at a time; each asking has a number, by which answers are told from late ones.

    request: the one under way, None when there is none. asks: how often it was asked.
    """

    def __init__(self, settings: SupervisorSettings) -> None:
        self.settings = settings
        self.request: Request | None = None
        self.number = 0
        self.asks = 0
        self._asked = False
        self._not_before = 0.0  # [s] pose time
        self._missing: float | None = None  # [s] by the clock since when it could not be asked
        self._sign_clock = self._sign_stamp = 0.0

    def begin(self, request: Request, now: Moment) -> None:
        """Take a request in the place of whatever is under way."""
        self.drop()
        self.request = request
        self._not_before = now.stamp + request.delay

    def drop(self) -> None:
        """Whatever is under way is not wanted any more; answers to it are late."""
        self.request = None
        self.number += 1
        self.asks = 0
        self._asked, self._missing = False, None

    def tend(self, now: Moment) -> Verdict:
        """To be called often; says what to do. After ASK the request counts as asked."""
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
                Step.GIVE_UP, JobError.NODE_LOST, f"{peer.value} is not in the ROS graph"
            )
        return Verdict(Step.GIVE_UP, JobError.POSES_STALE, "no poses of robot and object")

    def sign(self, number: int, now: Moment) -> None:
        """A sign of life of whoever was asked with this number."""
        if number == self.number and self._asked:
            self._sign_clock, self._sign_stamp = now.clock, now.stamp

    def answer(self, number: int) -> bool:
        """Whether an answer is the one waited for, and not a late one; the request is done then."""
        if number != self.number or not self._asked:
            return False
        self.drop()
        return True

    def _ask(self, now: Moment) -> Verdict:
        self.number += 1
        self.asks += 1
        self._asked = True
        self._sign_clock, self._sign_stamp = now.clock, now.stamp
        return _ASK

    def _listen(self, request: Request, now: Moment) -> Verdict:
        """Whether the silence has lasted too long."""
        if now.lockstep and request.peer is not Peer.CONTROLLER and now.ready(request.peer):
            return _WAIT
        silence = now.clock - self._sign_clock
        if request.peer is Peer.CONTROLLER:
            silence = min(silence, now.stamp - self._sign_stamp)
            if silence <= self.settings.controller_timeout:
                return _WAIT
            self.drop()
            return Verdict(Step.LOST, JobError.NODE_LOST, f"{request.peer.value} is gone")
        if silence <= self.settings.answer_timeout:
            return _WAIT
        if self.asks >= ASKS:
            self.drop()
            text = f"{request.peer.value} does not answer"
            return Verdict(Step.GIVE_UP, JobError.NODE_LOST, text)
        self.number += 1  # what comes now is late
        self._asked = False
        return self.tend(now)
