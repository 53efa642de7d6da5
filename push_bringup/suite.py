"""Run a suite from a Python script: its nodes as processes, goals in, results out.

::

    with Suite("env1-target1", parameters={"planner": {"push_speed": 0.06}}) as suite:
        print(suite.reach(1.3, 0.75, 0.0))
"""

import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from push_bringup.failures import SuiteFailed
from push_bringup.job_result import JobEvent, JobResult
from push_bringup.launcher import Launcher
from push_bringup.monitor import Monitor, Pose
from push_bringup.preparation import check_domain, prepare
from push_bringup.systems import teams_of
from push_model.settings import SettingsError
from push_ros.latched import own_context
from push_scenario.scenario import Scenario

_START = 60.0  # [s] wall time for all nodes to start


class Suite:
    """Runs a system in its own processes. Use it as a context manager.

    It prints nothing. The output of the nodes is kept, and quoted if one of them dies.
    """

    def __init__(
        self,
        scenario: str | Scenario = "env1-target1",
        *,
        system: str = "single",
        parameters: Mapping[str, Mapping[str, Any]] | None = None,
        namespace: str = "",
        record: str | Path = "",
        factor: float | None = None,
        respawn: bool = False,
        verbose: bool = False,
        on_event: Callable[[JobEvent], None] | None = None,
        context: Any = None,
    ) -> None:
        """Check the arguments; start nothing yet.

        Parameters
        ----------
        scenario, system, parameters, namespace, record, factor: see ``prepare``.
        respawn: start a node that died again. verbose: let the nodes write to the terminal.
        on_event: called with each ``JobEvent`` while a method of this class waits; the supervisors
            then log only warnings, not their states.
        context: ROS context whose domain the nodes use; default: a new one.

        Raises
        ------
        SettingsError, FileExistsError: see ``prepare``.
        """
        self.setup = prepare(
            scenario,
            system=system,
            parameters=parameters,
            namespace=namespace,
            record=record,
            factor=factor,
        )
        self.scenario = self.setup.scenario
        self._respawn, self._verbose = respawn, verbose
        self._on_event = on_event or (lambda event: None)
        owners = [node for node in self.setup.nodes if node.traits.owner]
        self._quiet = tuple(node.traits.module for node in owners) if on_event else ()
        self._context = context
        self._stack = ExitStack()
        self._launcher: Launcher | None = None
        self._monitors: dict[str, Monitor] = {}
        self._said: list[str] = []
        self._stopping = self._stop_requested = False

    def __enter__(self) -> "Suite":
        try:
            self._start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _start(self) -> None:
        context = self._context
        if context is None:
            context = self._stack.enter_context(own_context())
        check_domain(self.setup.namespace, context)
        folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory("-planar-push")))
        logs = None if self._verbose else folder
        children = self.setup.write(folder)
        for child in children:
            if child.module in self._quiet:
                child.arguments += ["--log-level", "warn"]
        self._launcher = Launcher(
            children,
            self._respawn,
            self._said.append,
            logs,
            domain=int(context.get_domain_id()),
        )
        self._stack.callback(self._launcher.stop)
        self._launcher.start()
        for team in teams_of(self.scenario):
            monitor = Monitor(self.setup.namespace, team.name, context, self._on_event)
            self._monitors[team.name] = self._stack.enter_context(monitor)
        end = time.monotonic() + _START
        for monitor in self._monitors.values():
            if not monitor.connect(end - time.monotonic(), self._alive):
                self.check()
                if self._stopping:
                    raise SuiteFailed("the suite was stopped before all nodes had started")
                raise SuiteFailed(f"the nodes did not start in time: {monitor.missing()}")

    def _alive(self) -> bool:
        self.check()
        return not self._stopping

    def check(self) -> None:
        """Raise SuiteFailed when a node has died and is not started again."""
        assert self._launcher is not None, "the suite has not been started"
        dead = [] if self._stopping else self._launcher.failed()
        if dead:
            words = [f"{n}: {self._launcher.last_words(n)}" for n in dead]
            raise SuiteFailed("\n".join([*self._said[-len(dead) :], *words]))

    def request_stop(self) -> None:
        """Make waiting methods return soon; may be called from a signal handler."""
        self._stopping = self._stop_requested = True
        if self._launcher is not None:
            self._launcher.request_stop()

    @property
    def stop_requested(self) -> bool:
        """Whether it was asked to stop."""
        return self._stop_requested

    def stop(self) -> None:
        """Stop all nodes, which closes the bag; safe to call twice."""
        self._stopping = True
        self._stack.close()

    def monitor(self, team: str = "") -> Monitor:
        """The client of a team; of the first team if no name is given."""
        team = team or next(iter(self._monitors))
        if team not in self._monitors:
            known = ", ".join(self._monitors)
            raise SettingsError(f"unknown team '{team}'; the scenario has: {known}")
        return self._monitors[team]

    def reach(
        self, x: float, y: float, theta: float, *, team: str = "", timeout: float = 300.0
    ) -> JobResult:
        """Bring a team's object to a pose [m, m, rad]; waits up to timeout [s] of wall time.

        Raises
        ------
        SuiteFailed: a node died during the job.
        """
        name = self.monitor(team).team
        return self.reach_all({name: (x, y, theta)}, timeout=timeout)[name]

    def reach_all(
        self, goals: Mapping[str, Pose] | None = None, *, timeout: float = 300.0
    ) -> dict[str, JobResult]:
        """Send goals to several teams at once; default: the scenario's, each team's in a row.

        timeout: [s] of wall time for each goal. The result of a team is that of its last goal, or
        of the first one that is not reached.
        """
        rows = rows_of(goals, self.scenario)
        ahead = {self.monitor(name).team: list(row) for name, row in rows.items()}
        results: dict[str, JobResult] = {}
        ends: dict[str, float] = {}

        def send(name: str) -> None:
            self._monitors[name].send_goal(ahead[name].pop(0))
            ends[name] = time.monotonic() + timeout

        for name in ahead:
            send(name)
        while len(results) < len(ahead):
            stopped = "" if self._alive() else "the suite was stopped before the job ended"
            for name in ahead.keys() - results.keys():
                late = time.monotonic() > ends[name]
                why = f"the job did not end within {timeout:g} s" if late else stopped
                monitor = self._monitors[name]
                monitor.spin(0.02)
                result = monitor.poll() or (monitor.unfinished(why) if why else None)
                if result is None:
                    continue
                if result.success and ahead[name] and not stopped:
                    send(name)
                else:
                    results[name] = replace(result, bag=self.setup.bag)
        return {name: results[name] for name in ahead}


def rows_of(goals: Mapping[str, Pose] | None, scenario: Scenario) -> dict[str, tuple[Pose, ...]]:
    """Goals [m, m, rad] in a row by team: one each that is given, or those of the scenario."""
    return scenario_goals(scenario) if goals is None else {n: (g,) for n, g in goals.items()}


def scenario_goals(scenario: Scenario) -> dict[str, tuple[Pose, ...]]:
    """The goals of every team that has some, in their order.

    Raises
    ------
    SettingsError: no team has a goal.
    """
    goals: dict[str, tuple[Pose, ...]] = {}
    for team in teams_of(scenario):
        if team.goals:
            goals[team.name] = tuple((float(x), float(y), float(t)) for x, y, t in team.goals)
    if not goals:
        name = f"scenario '{scenario.name}'"
        if any(team.trajectory for team in teams_of(scenario)):
            raise SettingsError(
                f"{name} has a trajectory and no goal; send the trajectory by the action "
                "push_along (examples/push_along_a_trajectory.py)"
            )
        raise SettingsError(f"{name} has no goal; add 'goal' or 'goals' to it")
    return goals
