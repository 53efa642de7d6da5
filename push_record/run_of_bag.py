"""What a bag says of the run that it holds: enough to run it again.

The metadata of a bag has these entries: ``scenario`` (what the nodes believe), ``world`` (what is
simulated, if it differs), ``scenario_name``, ``seed``, ``namespace``, ``system``, ``pace``
(``lockstep`` or ``live``), ``revision``, ``versions``, and what a study notes beside them.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from push_model.settings import SettingsError
from push_record.bag import RawRecord, read_raw
from push_record.contents import bag_scenario
from push_record.interfaces import typestore
from push_record.topics import team_names
from push_ros.services import CALLS, RESTARTS
from push_ros.validation import InvalidMessage, planar_pose
from push_scenario.scenario import Scenario, scenario_from_text

Goal = tuple[float, float, float]
"""x [m], y [m], heading [rad]."""

Call = tuple[str, str, str]
"""Full name of a service, its type, and the request as JSON."""

_IDLE = 1  # state of JobState
_POSE = "geometry_msgs/msg/PoseStamped"
_SAME = 1e-6  # [m], [rad] of two goals that are the same
_NO_GOALS = (
    "a job of the bag came as a trajectory or as several targets in an action "
    "(push_along, swarm_move), whose goals are not in the bag; only goals on goal_pose "
    "and of move_object can be repeated"
)


@dataclass(frozen=True)
class Input:
    """What somebody sent to the suite: a goal, a belief, the call of a service.

    team: whose goal it is; None for a belief and for a call. data: CDR bytes; or a goal
    ``(x, y, theta)`` that came by an action and is known from the state of the job; or the call of
    a service: name, type, request. time: [s] of the world when it was
    sent; negative before the first tick. after_job: the team's job before it had ended by then.
    """

    team: str | None
    data: bytes | Goal | Call
    time: float
    after_job: bool


@dataclass(frozen=True)
class RunOfBag:
    """A recorded run. world: what was simulated. repeatable: it ran in lockstep in one process.

    start, end: [s] of the world at which the recording began and ended; or time began anew.
    restarted: whether it did, because somebody reset the world or loaded another scenario.
    """

    scenario: Scenario
    world: Scenario
    system: str
    namespace: str
    repeatable: bool
    inputs: tuple[Input, ...]
    start: float
    end: float
    revision: str
    versions: dict[str, str]
    restarted: bool = False


class CannotRerun(SettingsError):
    """Says what a bag lacks."""


def run_of_bag(bag: Path) -> RunOfBag:
    """Read it.

    Raises
    ------
    CannotRerun: the bag lacks something. FileNotFoundError: it is none.
    """
    try:
        scenario, metadata = bag_scenario(bag)
    except ValueError as error:
        raise CannotRerun(str(error)) from None
    namespace = metadata.get("namespace", "")
    seen = _Seen(scenario, namespace)
    for record in read_raw(bag):
        seen.take(record)
    if not seen.ticks:
        raise CannotRerun(f"{bag}: no /clock in it, so the times of its goals are not known")
    system = metadata.get("system", "") or seen.system
    if not system:
        raise CannotRerun(f"{bag}: neither metadata nor /job_state name the system that ran")
    world = scenario
    told = metadata.get("world", "") or seen.world
    if told:
        world = scenario_from_text(told, scenario.name, f"{bag} (world)")
    seed = metadata.get("seed", "")
    if seed.isdigit() and "seed" not in scenario.parameters.get("bridge", {}):
        scenario = scenario.settings("bridge", seed=int(seed))
    lockstep = bool(world.parameters.get("bridge", {}).get("lockstep", False))
    pace = metadata.get("pace", "lockstep" if lockstep else "live")
    inputs = seen.inputs(live=pace != "lockstep")
    return RunOfBag(
        scenario,
        world,
        system,
        namespace,
        pace == "lockstep",
        inputs,
        seen.start,
        seen.end,
        metadata.get("revision", ""),
        dict(json.loads(metadata.get("versions", "{}"))),
        seen.restarted,
    )


class _Seen:
    """Collects goals, beliefs and states of jobs in the order in which they were recorded."""

    def __init__(self, scenario: Scenario, namespace: str) -> None:
        teams = team_names(scenario, namespace)
        names = next(iter(teams.values()))
        self._clock, self._scenario = names.world("clock"), names.world("scenario")
        self._belief = names.world("belief")
        self._calls = {names.world(CALLS), *(n.team(CALLS) for n in teams.values())}
        self._goals = {n.team("goal_pose"): team for team, n in teams.items()}
        self._states = {n.team("job_state"): team for team, n in teams.items()}
        known = {**scenario.teams, "": scenario.team()} if "" in teams else scenario.teams
        self._objects = {team: known[team].object for team in teams}
        self._store = typestore()
        self.ticks = 0
        self.start = self.end = 0.0
        self.system = self.world = ""
        self.restarted = False
        self._ended: dict[str, bool] = {}
        self._idle: dict[str, bool] = {}
        self._jobs: dict[str, int] = {}
        self._refusals: dict[str, int] = {}
        self._found: list[Input] = []
        self._begun: list[tuple[str, Goal, float, bool]] = []

    def take(self, record: RawRecord) -> None:
        """Add a message; none counts after time has begun anew."""
        if self.restarted:
            return
        time = 1e-9 * record.stamp
        self.end = max(self.end, time) if self.ticks else 0.0
        if record.topic == self._clock:
            self.start = self.start if self.ticks else time
            self.ticks += 1
        elif record.topic == self._scenario:
            self.world = self.world or str(self._message(record).data)
        elif record.topic in self._states:
            self._take_state(self._states[record.topic], record)
        elif record.topic in self._calls:
            self._take_call(record, time if self.ticks else -1.0)
        elif record.topic == self._belief or record.topic in self._goals:
            team = self._goals.get(record.topic)
            moment = time if self.ticks else -1.0
            ended = team is not None and self._ended.get(team, False)
            self._found.append(Input(team, bytes(record.data), moment, ended))

    def _take_call(self, record: RawRecord, moment: float) -> None:
        call = self._message(record)
        if str(call.type) in RESTARTS:
            self.restarted = bool(call.success)
            return
        told = str(call.service), str(call.type), str(call.request)
        self._found.append(Input(None, told, moment, False))

    def inputs(self, live: bool) -> tuple[Input, ...]:
        """What was sent, in order. live: a goal has the time of the poses at which its job began,
        because the log time of a message from another process is later by an unknown delay."""
        found = list(self._found)
        acted: list[Input] = []
        paired: set[int] = set()
        for team, goal, time, after_job in self._begun:
            k = self._sent_for(found, paired, team, goal)
            if k is None:
                acted.append(Input(team, goal, time, after_job))
                continue
            paired.add(k)
            if live:
                found[k] = replace(found[k], time=time)
        return tuple(sorted([*found, *acted], key=lambda item: item.time))

    def _sent_for(self, found: list[Input], paired: set[int], team: str, goal: Goal) -> int | None:
        """Index of the message with which a job began; None if its goal came by an action."""
        for k, item in enumerate(found):
            if item.team != team or not isinstance(item.data, bytes) or k in paired:
                continue
            sent = self._goal_of(self._store.deserialize_cdr(item.data, _POSE))
            if sent is not None and np.allclose(sent, goal, rtol=0.0, atol=_SAME):
                return k
        return None

    def _take_state(self, team: str, record: RawRecord) -> None:
        message = self._message(record)
        self.system = self.system or str(message.system)
        job, before = int(message.job), self._jobs.get(team, 0)
        if job > before and str(message.object) != self._objects[team]:
            raise CannotRerun(
                f"a job of the bag is about '{message.object}', which was named in an action; only "
                "goals of the first object of a team can be repeated"
            )
        refused = int(message.refusals) > self._refusals.get(team, 0)
        self._refusals[team] = int(message.refusals)
        if job > before:
            if not message.goal.header.frame_id:
                raise CannotRerun(_NO_GOALS)
            goal = self._goal_of(message.goal)
            stamp = message.header.stamp
            if goal is not None:
                time = float(stamp.sec) + 1e-9 * float(stamp.nanosec)
                self._begun.append((team, goal, time, self._ended.get(team, False)))
            self._jobs[team] = job
        idle = int(message.state) == _IDLE and not message.plan_ready
        if self._idle.get(team, False) and not idle and job == before:
            raise CannotRerun(_NO_GOALS)  # older bags gave such a task no number of its own
        self._idle[team] = idle and job == before
        self._ended[team] = refused or (idle and job > 0)

    @staticmethod
    def _goal_of(message: Any) -> Goal | None:
        if not message.header.frame_id:
            return None
        try:
            x, y, theta = planar_pose(message.pose, "the goal").tolist()
        except InvalidMessage:
            return None
        return x, y, theta

    def _message(self, record: RawRecord) -> Any:
        return self._store.deserialize_cdr(record.data, record.type)
