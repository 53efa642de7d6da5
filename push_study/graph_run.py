"""A whole run in one process: every node on one executor, in lockstep, repeatable to the bit."""

import math
import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from push_bringup.job_result import JobResult, result_of
from push_bringup.monitor import Pose
from push_bringup.node_kinds import NodeSpec
from push_bringup.node_settings import changed, resolved
from push_bringup.suite import rows_of
from push_bringup.systems import LOCKSTEP, nodes_of, teams_of
from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.settings import SettingsError
from push_msgs.msg import JobState
from push_record.recorder import RecorderNode
from push_ros.claims import claim_domain, claim_world, on_this_machine
from push_ros.names import Names, space
from push_ros.pace_feed import pace_known
from push_ros.process import Spinner, prepare_environment
from push_scenario.scenario import Scenario
from push_study.discovery import Discovery, NotDiscovered, unmatched
from push_study.observer import Observer

_STUCK = 50_000  # spins without a tick, 20 a second or more, after which a run will not go on
_ROLES = ("controller", "planner", "supervisor")


@dataclass
class TeamRun:
    """The nodes of a team, and who watches it. A group's node is its controller and supervisor,
    a swarm's is all three."""

    controller: Any
    planner: Any
    supervisor: Any
    observer: Observer
    _jobs: int = 0
    _refusals: int = 0

    def send_goal(self, goal: Array | bytes) -> None:
        """Publish a goal ``(3,)``, or a serialised message; ``ended`` is of its job."""
        before = self.observer.state
        assert before is not None, "the run has not been started"
        self._jobs, self._refusals = int(before.job), int(before.refusals)
        self.observer.send_goal(goal)

    @property
    def refused(self) -> bool:
        """Whether a goal was refused since the last one was sent."""
        state = self.observer.state
        return state is not None and int(state.refusals) > self._refusals

    @property
    def ended(self) -> bool:
        """Whether the job of the last goal has ended, or the goal was refused."""
        state = self.observer.state
        assert state is not None
        begun = state.job > self._jobs and state.state == JobState.IDLE and not state.plan_ready
        return bool(begun or self.refused)


class LockstepRun:
    """The graph of a scenario in this process. Use it as a context manager.

    bridge: its node. teams: by name. controller, planner, supervisor, observer: of the first team.
    """

    def __init__(
        self,
        scenario: Scenario,
        extra: Callable[[], list[Node]] | None = None,
        world: Scenario | None = None,
        quiet: bool = False,
        system: str = "single",
        namespace: str = "",
        record: Path | None = None,
        about: Mapping[str, str] | None = None,
        observe_bodies: bool = True,
    ) -> None:
        """Make the nodes.

        Parameters
        ----------
        scenario: what planner, controller and supervisor believe.
        extra: makes further nodes, e.g. a recorder, once ROS is up. The run does not begin before
            every node that has a property ``ready`` says that it is.
        world: what the bridge simulates, when it differs from what is believed.
        quiet: log warnings only.
        system: which nodes, see ``push_bringup.systems``. namespace: of the world.
        record: folder of a bag from which ``planar-push rerun`` can repeat the run.
        about: further metadata of that bag.
        observe_bodies: whether the observer keeps poses and contacts; without, its trace is empty.

        Raises
        ------
        SettingsError: the scenario is for a lab, or another run is open in this ROS domain.
        """
        prepare_environment()
        if quiet:
            set_logger_level("", LoggingSeverity.WARN)
        if "ROS_DOMAIN_ID" not in os.environ:
            claim_domain()
        self._names = Names(space(namespace), space(namespace))
        self._stack = ExitStack()
        self.spinner: Spinner | None = None
        self.scenario, simulated = (
            resolved(changed(s.settings("bridge", lockstep=True), LOCKSTEP, only_missing=True))
            for s in (scenario, world or scenario)
        )
        if scenario.on != "sim":
            raise SettingsError(f"'{scenario.name}' is for a lab; a run in lockstep is simulated")
        specs = nodes_of(system, scenario, namespace)
        if not rclpy.ok():
            with on_this_machine():  # the robots of a lab elsewhere may have this domain
                rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            self._stack.callback(rclpy.try_shutdown)
        nodes: list[Node] = []
        try:
            self._claim()
            made: dict[str, Any] = {}
            for spec in specs:
                made[spec.name] = spec.make(simulated if spec.kind == "bridge" else self.scenario)
                nodes.append(made[spec.name])
            self.bridge = made["bridge"]
            self.teams: dict[str, TeamRun] = {}
            for team in teams_of(scenario):
                parts = {s.kind: s for s in specs if s.kind != "bridge" and s.team == team.name}
                owner = next(part for part in parts.values() if part.traits.owner)
                names = Names(space(namespace), space(owner.namespace))
                observer = Observer(names, team.robots, team.object, observe_bodies)
                nodes.append(observer)
                self.teams[team.name] = _team_run(made, parts, observer)
            nodes.extend(extra() if extra else [])
            self.recorder: RecorderNode | None = None
            if record is not None:
                told = {"pace": "lockstep", "system": system, **(about or {})}
                if simulated.text != self.scenario.text:
                    told["world"] = simulated.text
                self.recorder = RecorderNode(record, self.scenario, None, namespace, told)
                nodes.append(self.recorder)
        except BaseException:
            for node in nodes:
                node.destroy_node()
            self._stack.close()
            raise
        first = next(iter(self.teams.values()))
        self.controller, self.planner = first.controller, first.planner
        self.supervisor, self.observer = first.supervisor, first.observer
        kinds = [s.kind for s in specs]
        owned = [len(s.robots) for s in specs if s.traits.commands]
        self._commanded = kinds.count("supervisor") + sum(owned)
        self._listeners = sum(s.traits.listens for s in specs)
        self.nodes = tuple(nodes)
        self.spinner = Spinner(nodes)

    def _claim(self) -> None:
        """Only one run in a namespace of a domain: two would answer each other's frames."""
        domain = str(rclpy.get_default_context().get_domain_id())
        claim = claim_world(domain, self._names.world_space)
        if claim is None:
            raise SettingsError(
                f"a bridge already runs in domain {domain}; close it, or set another ROS_DOMAIN_ID"
            )
        self._stack.callback(claim.close)

    def __enter__(self) -> "LockstepRun":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Destroy everything that this run made. The bag gets all that was published before."""
        if self.spinner is not None:
            if self.recorder is not None and self.bridge.running:
                self.bridge.running = False
                with suppress(NotDiscovered):
                    Discovery(self.observer, self.spinner).probe()
            self.spinner.close()
        self._stack.close()

    def connect(self) -> None:
        """Wait until all nodes know each other, further ones included; nothing moves before.

        Whatever the nodes subscribe to and publish must have been made before: what is found only
        while the world steps is found at another tick in each run. No clock limits the wait, see
        ``push_study/discovery.py``.

        Raises
        ------
        NotDiscovered: they will not.
        """
        assert self.spinner is not None

        def parts() -> tuple[object, ...]:
            return (
                *(bool(getattr(node, "ready", True)) for node in self.nodes),
                self._recorded(),
                len(self.bridge.commanded()) >= self._commanded,
                bool(self.bridge.heard_by(self._listeners)),
                all(pace_known(node) for node in self.nodes),
            )

        discovery = Discovery(self.observer, self.spinner)
        discovery.wait(
            lambda: (*parts(), len(self.bridge.commanded()), *unmatched(self.nodes)),
            lambda: all(parts()) and not unmatched(self.nodes),
        )
        discovery.settle()

    def _recorded(self) -> bool:
        """Whether the recorder has what every node says of itself before the start. A latched
        message reaches a late subscriber at any time; it must not be during the run."""
        if self.recorder is None:
            return True
        world = ("map", "scenario", "paused")
        topics = [self._names.world(t) for t in world]
        for run in self.teams.values():
            topics += [run.observer.names.team(t) for t in ("job_state", "status_text")]
        return all(self.recorder.writer.count(topic) for topic in topics)

    def start(self) -> None:
        """Connect and begin to step."""
        self.connect()
        self.bridge.start()

    def spin_until(
        self, condition: Callable[[], bool], sim_limit: float, wall_limit: float = math.inf
    ) -> bool:
        """Spin until the condition holds; False after sim_limit [s] sim time or wall_limit [s].

        A study leaves wall_limit alone: how busy the machine is must not decide how a run ends.

        Raises
        ------
        RuntimeError: the world does not step any more, however often the nodes are spun.
        """
        assert self.spinner is not None
        end, tick, spins = self.bridge.time + sim_limit, -1, 0

        def over() -> bool:
            nonlocal tick, spins
            if condition() or self.bridge.time > end:
                return True
            spins = spins + 1 if tick == self.bridge.tick else 0
            tick = self.bridge.tick
            if spins > _STUCK:
                raise RuntimeError(f"the world stands at tick {tick}: no node goes on with the run")
            return False

        self.spinner.until(over, wall_limit)
        return condition()

    def reach(
        self,
        goal: Array,
        sim_limit: float = 300.0,
        team: str = "",
        meanwhile: Callable[["LockstepRun"], None] | None = None,
    ) -> JobState | None:
        """Send a team a goal ``(3,)`` and wait until its job ends.

        meanwhile: called as soon as the goal is sent; may spin this run.

        Returns its state then, or None after sim_limit [s] of sim time.
        """
        run = self.teams[team] if team else next(iter(self.teams.values()))
        run.send_goal(goal)
        if meanwhile is not None:
            meanwhile(self)
        return run.observer.state if self.spin_until(lambda: run.ended, sim_limit) else None

    def reach_all(
        self,
        goals: Mapping[str, Pose] | None = None,
        sim_limit: float = 300.0,
    ) -> dict[str, JobResult]:
        """Goals of several teams at once; default: the scenario's, each team's in a row.

        sim_limit: [s] for each goal. The result of a team is that of its last goal, or of the first
        one that is not reached. Errors are of the ground truth.
        """
        ahead = {name: list(row) for name, row in rows_of(goals, self.scenario).items()}
        under_way: dict[str, tuple[Pose, float]] = {}  # and when it was sent
        results: dict[str, JobResult] = {}

        def send(name: str) -> None:
            under_way[name] = ahead[name].pop(0), self.bridge.time
            self.teams[name].send_goal(np.array(under_way[name][0]))

        for name in ahead:
            send(name)
        while under_way:
            left = min(begin for _, begin in under_way.values()) + sim_limit - self.bridge.time
            self.spin_until(lambda: any(self.teams[n].ended for n in under_way), left)
            for name, (goal, begin) in list(under_way.items()):
                if self.teams[name].ended or self.bridge.time >= begin + sim_limit:
                    results[name] = self._result(name, goal, begin)
                    del under_way[name]
                    if results[name].success and ahead[name]:
                        send(name)
        return {name: results[name] for name in ahead}

    def _result(self, name: str, goal: Pose, begin: float) -> JobResult:
        run = self.teams[name]
        state, trace = run.observer.state, run.observer.trace
        assert state is not None
        pose = trace.object[-1] if trace.object else None
        result = result_of(state, goal, pose, self.bridge.time - begin, name)
        if run.refused:
            code, reason = JobError(int(state.refusal_code)), f"goal refused: {state.refusal}"
            return replace(result, code=code, reason=reason, refused=True)
        return result if run.ended else replace(result, code=None)


def _team_run(
    made: Mapping[str, Any], parts: Mapping[str, NodeSpec], observer: Observer
) -> TeamRun:
    owner = next(k for k, part in parts.items() if part.traits.owner)
    planner = "optimizer" if "optimizer" in parts else owner
    kinds = _ROLES if owner == "supervisor" else (owner, planner, owner)
    controller, planner_node, supervisor = (made[parts[k].name] for k in kinds)
    return TeamRun(controller, planner_node, supervisor, observer)
