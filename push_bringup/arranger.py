"""A small ROS client for people: sends goals of several objects, tells what becomes of them."""

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack

from std_msgs.msg import String

from push_model.jobs import JobError
from push_model.settings import SettingsError
from push_msgs.msg import JobState, Poses
from push_planner.rearranger_node import GOALS, STATE
from push_ros.latched import visitor
from push_ros.names import Names, space
from push_ros.process import heard
from push_ros.qos import COMMAND, LATCHED
from push_ros.validation import FRAME
from push_scenario.scenario import scenario_from_text

_SILENCE = 10.0  # [s] wall time without the node after which nobody waits any longer


class Arranger:
    """Sends goals to the node ``rearranger``. Use it as a context manager."""

    def __init__(self, namespace: str = "") -> None:
        self._names = Names(space(namespace), space(namespace))
        self._stack = ExitStack()
        self._state: JobState | None = None
        self._news: list[JobState] = []
        self._scenario = ""
        self._jobs = self._refusals = 0

    def __enter__(self) -> "Arranger":
        self._node, self._spinner = self._stack.enter_context(visitor(None))
        names = self._names
        self._publisher = self._node.create_publisher(Poses, names.team(GOALS), COMMAND)
        self._node.create_subscription(JobState, names.team(STATE), self._on_state, LATCHED)
        self._node.create_subscription(String, names.world("scenario"), self._on_scenario, LATCHED)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _on_state(self, message: JobState) -> None:
        self._state = message
        self._news.append(message)

    def _on_scenario(self, message: String) -> None:
        self._scenario = str(message.data)

    def connect(self, limit: float) -> bool:
        """Whether node and scenario were found within limit [s] of wall time."""
        return bool(
            self._spinner.until(
                lambda: (
                    self._state is not None
                    and bool(self._scenario)
                    and heard(self._node, self._publisher, state=STATE)
                ),
                limit,
            )
        )

    def arrangement(self) -> dict[str, tuple[float, float, float]]:
        """The goals [m, m, rad] by name that the scenario gives.

        Raises
        ------
        SettingsError: it gives none.
        """
        scenario = scenario_from_text(self._scenario, "scenario", "the scenario that runs")
        if not scenario.arrangement:
            raise SettingsError(
                "the scenario that runs has no 'arrangement'; give goals: NAME X Y THETA …"
            )
        poses = scenario.arrangement.items()
        return {n: (float(p[0]), float(p[1]), float(p[2])) for n, p in poses}

    def send(self, goals: Mapping[str, tuple[float, float, float]]) -> None:
        """Publish goals [m, m, rad] by name; ``follow`` is of their job."""
        assert self._state is not None
        self._jobs, self._refusals = int(self._state.job), int(self._state.refusals)
        self._news.clear()
        message = Poses(names=list(goals))
        message.header.frame_id = FRAME
        message.x, message.y, message.theta = (
            list(column) for column in zip(*goals.values(), strict=True)
        )
        self._publisher.publish(message)

    def follow(self, timeout: float, tell: Callable[[str], None]) -> tuple[str, str]:
        """Wait for the end of the job: the name of its error, empty without one, and why.

        timeout: [s] wall time. tell: called with a sentence for each new state.
        """
        end, last, begun = time.monotonic() + timeout, time.monotonic(), False
        while time.monotonic() < end:
            self._spinner.until(lambda: bool(self._news), 0.5)
            if self._publisher.get_subscription_count():
                last = time.monotonic()
            elif time.monotonic() - last > _SILENCE:
                return JobError.NODE_LOST.name, "the rearranger is gone"
            while self._news:
                state = self._news.pop(0)
                if state.refusals > self._refusals:
                    return JobError(state.refusal_code).name, str(state.refusal)
                if state.job <= self._jobs:
                    if begun or state.job < self._jobs:
                        text = "the rearranger was restarted; send the goals again"
                        return JobError.JOB_FORGOTTEN.name, text
                    continue
                begun = True
                if state.job > self._jobs + 1:
                    return JobError.PREEMPTED.name, "goals that were sent later have replaced these"
                step = f" ({state.step_index + 1} of {state.step_count})"
                busy = state.state != JobState.IDLE
                tell(str(state.reason) + (step if busy and state.step_count else ""))
                if not busy:
                    code = JobError(state.error_code)
                    return "" if code is JobError.NONE else code.name, str(state.reason)
        return "TIMEOUT", f"no end within {timeout:g} s; the job goes on"
