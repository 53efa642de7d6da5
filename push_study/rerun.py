"""Run the run of a bag again, in lockstep, and say how the two compare."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node

from push_bringup.node_settings import changed
from push_bringup.systems import LIVE, nodes_of
from push_model.settings import SettingsError
from push_msgs.msg import Belief
from push_record.bag import ending
from push_record.compare import Comparison, compare_bags
from push_record.contents import BagContents, Job, State, load, until
from push_record.parting import Parting, partings
from push_record.revision import revision, versions
from push_record.run_of_bag import Call, CannotRerun, Input, RunOfBag, run_of_bag
from push_ros.claims import own_domain
from push_ros.names import space
from push_ros.qos import BELIEF
from push_ros.services import KINDS, from_json
from push_scenario.scenario import Scenario
from push_study.graph_run import LockstepRun

_PATIENCE = 120.0  # [s] of simulation beyond the end of a live bag in which its jobs may end
_SETTLE = 0.5  # [s] of simulation after that


StateTimes = tuple[str, float | None, float | None]
"""Name of a state, and its time [s] in the bag and in the re-run."""


@dataclass(frozen=True)
class Rerun:
    """How a bag and its re-run compare.

    bag: of the re-run. setup: differences of revision and installed versions, a line each.
    comparison: of a repeatable run; None for live use. partings: of the bodies, states: of the
    jobs, of live use.
    """

    run: RunOfBag
    bag: Path
    setup: tuple[str, ...]
    comparison: Comparison | None
    partings: tuple[Parting, ...]
    states: tuple[StateTimes, ...]

    @property
    def code(self) -> int:
        """Exit code: 0 equal, or of live use; 1 different."""
        return int(self.comparison is not None and not self.comparison.equal)


def changes_of_setup(run: RunOfBag) -> tuple[str, ...]:
    """In what the source and the installed versions differ from those of a bag."""
    found = []
    now = revision()
    if run.revision != now:
        found.append(f"revision: {run.revision or 'unknown'} in the bag, {now or 'unknown'} here")
    elif now.endswith("-dirty"):
        found.append(f"revision: {now} in both, with changes that are not committed")
    if not run.versions:
        found.append("installed versions: the bag does not name them")
        return tuple(found)
    here = versions()
    for name in dict.fromkeys((*run.versions, *here)):
        then, is_ = (v.get(name, "none") for v in (run.versions, here))
        if then != is_:
            found.append(f"{name}: {then} in the bag, {is_} here")
    return tuple(found)


def rerun(
    bag: Path,
    out: Path,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Rerun:
    """Run the run of a bag again and compare.

    Parameters
    ----------
    bag: recorded by this suite. out: folder of the bag of the re-run, which must not exist.
    parameters: node name to settings that are changed, nested as in a scenario.
    say: told, before anything runs, what the bag lacks, in what the set-up differs, and what is
        run.

    Raises
    ------
    CannotRerun: the bag lacks something. FileNotFoundError: it is none. SettingsError: settings.
    """
    run = run_of_bag(bag)
    scenario, world = (changed(s, parameters or {}) for s in (run.scenario, run.world))
    if not run.repeatable:
        scenario, world = (_without_deadlines(s) for s in (scenario, world))
    try:
        nodes = nodes_of(run.system, scenario, run.namespace)
    except SettingsError as error:
        raise CannotRerun(f"{bag}: {error}") from None
    if not any(node.traits.owner for node in nodes):
        raise CannotRerun(f"{bag}: the system '{run.system}' has no goals that could be repeated")
    trouble = ending(bag).text
    if trouble:
        say(f"{trouble}; only what can be read is compared")
    setup = changes_of_setup(run)
    for line in setup:
        say(line)
    pace = "in lockstep" if run.repeatable else "live"
    say(
        f"running again: {run.system}, {run.scenario.name}, recorded {pace} from {run.start:.2f} s "
        f"to {run.end:.2f} s, {len(run.inputs)} messages to the suite"
    )
    if run.restarted:
        say(f"somebody started the world anew at {run.end:.2f} s; what follows is not run again")
    _run_again(run, scenario, world, out)
    if run.repeatable:
        return Rerun(run, out, setup, compare_bags(bag, out), (), ())
    pair = load(bag), load(out)
    if run.restarted:
        pair = until(pair[0], run.end), until(pair[1], run.end)
    return Rerun(run, out, setup, None, tuple(partings(*pair)), _states(*pair))


def _without_deadlines(scenario: Scenario) -> Scenario:
    """Settings of live use are left to the defaults: in lockstep no wall clock decides."""
    nodes = {node: dict(values) for node, values in scenario.parameters.items()}
    for node, sections in LIVE.items():
        for section, values in sections.items():
            own = nodes.get(node, {}).get(section, {})
            if own:
                nodes[node][section] = {k: v for k, v in own.items() if k not in values}
    return replace(scenario, parameters=nodes)


class _Person(Node):
    """Sends the beliefs of a bag again, and calls the services that were called.

    The publisher and the clients are there from the start: the nodes discover them before the first
    tick.
    """

    def __init__(self, run: RunOfBag) -> None:
        super().__init__("person")
        self._publisher: Any = None
        self._answer: Any = None
        self._clients_of: dict[str, Any] = {}
        for given in run.inputs:
            if given.team is not None:
                continue
            if isinstance(given.data, bytes):
                topic = f"{space(run.namespace)}belief"
                self._publisher = self._publisher or self.create_publisher(Belief, topic, BELIEF)
            else:
                name, kind = str(given.data[0]), str(given.data[1])
                if kind not in KINDS:
                    raise CannotRerun(f"the service {name} has an unknown type, {kind}")
                if name not in self._clients_of:
                    self._clients_of[name] = self.create_client(KINDS[kind], name)

    def send(self, data: "bytes | Call") -> None:
        """Publish a belief, or call a service."""
        if isinstance(data, bytes):
            assert self._publisher is not None
            self._publisher.publish(data)
            return
        name, kind, request = data
        self._answer = self._clients_of[name].call_async(from_json(KINDS[kind], request))

    @property
    def waits(self) -> bool:
        """Whether a service has not answered yet; calls are made one after the other."""
        return self._answer is not None and not self._answer.done()


class _Inputs:
    """Sends what a bag holds of people when the world is where it was when they sent it."""

    def __init__(self, run: RunOfBag, graph: LockstepRun, person: _Person) -> None:
        capture = run.world.parameters.get("bridge", {}).get("motion_capture", {})
        self._delay = 0.0 if run.repeatable else float(capture.get("latency", 0.0))
        self._graph, self._person = graph, person
        self._left = deque(run.inputs)
        self._aimed: set[str] = set()

    @property
    def done(self) -> bool:
        """Whether all has been sent, and all jobs have ended."""
        teams = self._graph.teams
        return not self._left and all(teams[name].ended for name in self._aimed)

    def send(self, begun: bool = True) -> None:
        """Send what is due. begun: whether the world steps."""
        while self._left and not self._person.waits and self._due(self._left[0], begun):
            given = self._left.popleft()
            if given.team is None:
                self._person.send(given.data)  # type: ignore[arg-type]
                continue
            goal = given.data if isinstance(given.data, bytes) else np.array(given.data)
            self._graph.teams[given.team].send_goal(goal)
            self._aimed.add(given.team)

    def _due(self, given: Input, begun: bool) -> bool:
        if not begun:
            return given.time < 0.0
        if self._graph.bridge.time < given.time + self._delay - 1e-9:
            return False
        waits = given.after_job and given.team in self._aimed
        return not waits or self._graph.teams[given.team or ""].ended


def _run_again(run: RunOfBag, scenario: Scenario, world: Scenario, out: Path) -> None:
    people: list[_Person] = []

    def extra() -> list[Node]:
        people.append(_Person(run))
        return list(people)

    with (
        own_domain(),
        LockstepRun(
            scenario,
            extra,
            world=world,
            quiet=True,
            system=run.system,
            namespace=run.namespace,
            record=out,
        ) as graph,
    ):
        inputs = _Inputs(run, graph, people[0])
        graph.connect()
        inputs.send(begun=False)
        graph.bridge.start()
        writer, bridge = graph.recorder.writer, graph.bridge  # type: ignore[union-attr]
        if run.repeatable:

            def over() -> bool:
                inputs.send()
                return bool(writer.last > round(1e9 * run.end))

            graph.spin_until(over, run.end + _SETTLE)
            return

        def ended() -> bool:
            inputs.send()
            return bool(bridge.time >= run.end and inputs.done)

        graph.spin_until(ended, run.end + _PATIENCE)
        begin = bridge.time
        graph.spin_until(lambda: bridge.time > begin + _SETTLE, 2.0 * _SETTLE)


def _changes(job: Job) -> list[State]:
    """States of a job; of several in a row that have the same name, the first."""
    kept: list[State] = []
    for state in job.states:
        if not kept or kept[-1].name != state.name:
            kept.append(state)
    return kept


def _states(first: BagContents, second: BagContents) -> tuple[StateTimes, ...]:
    """States of all jobs, aligned by their names."""
    found: list[StateTimes] = []
    for key, job in first.jobs.items():
        team = f"{key.strip('/')}: " if key.strip("/") else ""
        other = second.jobs.get(key)
        ours, theirs = _changes(job), _changes(other) if other is not None else []
        match = SequenceMatcher(None, [s.name for s in ours], [s.name for s in theirs])
        for _, a0, a1, b0, b1 in match.get_opcodes():
            for k in range(max(a1 - a0, b1 - b0)):
                one = ours[a0 + k] if a0 + k < a1 else None
                two = theirs[b0 + k] if b0 + k < b1 else None
                name = (one or two or ours[0]).name
                times = [None if s is None else s.time for s in (one, two)]
                found.append((f"{team}{name}", times[0], times[1]))
    return tuple(found)
