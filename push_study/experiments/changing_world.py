"""The world changes while the robot pushes: a body appears on its way, or the goal moves."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.settings import SettingsError
from push_model.shape_specs import EllipseShape
from push_model.specs import ObjectSpec
from push_planner import PlannerSettings, PlanningFailed, PushPlanner
from push_planner.among_bodies import plan_among_bodies
from push_ros.claims import own_domain
from push_scenario.events import Place
from push_scenario.footing import Footing
from push_scenario.scenario import Scenario, load_scenario
from push_study.experiments.single_robot import SCENARIOS as NINE
from push_study.graph_run import LockstepRun
from push_study.job import SUCCESS_ORIENTATION, SUCCESS_POSITION, check_goal, digest, run_job
from push_study.observer import final_errors
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty
from push_supervisor.state import State

SCENARIOS = NINE
"""Where none are named."""
OPTIONS = {"uncertainty": "mild"}

KINDS = ("body", "goal")
"""What changes: a body is put on the way of the pushes, or another goal is sent."""
BODY = "visitor"
_VISITOR = ObjectSpec(
    EllipseShape(0.04, 0.04), mass=2.0, height=0.06, floor_friction=0.5, contact_friction=0.2
)
_SHARE = (0.1, 0.6)  # of the first push that is done when it happens
_AHEAD, _FROM_GOAL = 0.12, 0.25  # [m] of the body from the object, and from the goal, at least
_ASIDE = 0.03  # [m] of the body from the planned path of the object, at most
_SPARE = 0.02  # [m] between the object at a new goal and the walls, at least
_TRIES = 60  # draws of a change
_PATIENCE = 300.0  # [s] of sim time


@dataclass(frozen=True)
class ChangeTask:
    """One trial. kind: of ``KINDS``. digest: of the scenario's text."""

    scenario: str
    seed: int
    out: str
    kind: str
    uncertainty: str = "mild"
    digest: str = ""


def tasks(options: StudyOptions) -> list[ChangeTask]:
    """Every scenario with both kinds of change, as often as there are trials."""
    made = []
    for name in options.scenarios:
        scenario = load_scenario(name)
        check_goal(scenario)
        if len(scenario.robots) != 1 or len(scenario.objects) != 1:
            raise SettingsError(f"scenario '{name}' needs one robot and one object")
        text = digest(scenario)
        made += [
            ChangeTask(name, seed, str(options.out), kind, options.uncertainty, text)
            for seed in range(options.seed, options.seed + options.trials)
            for kind in KINDS
        ]
    return made


def with_visitor(scenario: Scenario) -> Scenario:
    """The scenario with a further body, where it is farthest from the way from start to goal."""
    assert scenario.goal is not None
    (_, start), *_ = scenario.objects.values()
    (_, robot), *_ = scenario.robots.values()
    there = replace(scenario, objects={**scenario.objects, BODY: (_VISITOR, start)})
    footing = Footing(there)
    poses = {name: pose for name, (_, pose) in (*there.robots.items(), *there.objects.items())}
    line = np.linspace(start[:2], scenario.goal[:2], 20)
    kept = np.vstack([line, robot[:2]])
    x0, x1, y0, y1 = scenario.grid.extent
    places = [
        np.array([x, y, 0.0])
        for x in np.linspace(x0, x1, 30)
        for y in np.linspace(y0, y1, 30)
        if footing.trouble(BODY, np.array([x, y, 0.0]), poses) is None
    ]
    best = max(places, key=lambda p: float(np.hypot(*(kept - p[:2]).T).min()))
    return replace(there, objects={**scenario.objects, BODY: (_VISITOR, best)})


class Change:
    """Makes the change once, in the middle of the first push.

    goal: the goal that counts at the end. made: in words, what happened; empty before.
    """

    def __init__(self, believed: Scenario, world: Scenario, kind: str, seed: int) -> None:
        assert believed.goal is not None
        self.goal, self.made, self.at = np.array(believed.goal), "", float("nan")
        self._kind = kind
        self._footing = Footing(world)
        self._random = np.random.default_rng([seed, zlib.crc32(believed.name.encode()), 11])
        self._share = float(self._random.uniform(*_SHARE))
        robot, (self._name, self._item) = believed.robot()[1], believed.object()
        self._planner = PushPlanner(PlannerSettings(), believed.grid, robot, self._item)

    def __call__(self, run: LockstepRun) -> None:
        """Wait for the moment, and make the change."""
        machine = run.supervisor.machine

        def due() -> bool:
            if machine.state is not State.PUSHING:
                return False
            segment, item = machine.segment, run.bridge.world.poses()[self._name]
            done = float(np.hypot(*(item - segment.object_start)[:2]))
            whole = float(np.hypot(*(segment.object_end - segment.object_start)[:2]))
            return done >= self._share * whole

        team = next(iter(run.teams.values()))
        run.spin_until(lambda: due() or team.ended, _PATIENCE)
        if not due():
            return
        poses = run.bridge.world.poses()
        self.at = run.bridge.time
        if self._kind == "goal":
            goal = self._new_goal(poses[self._name], poses[BODY])
            if goal is not None:
                self.goal, self.made = goal, "the goal moves"
                team.send_goal(goal)
            return
        pushed = [
            se2.compose(pose, segment.grasp)
            for segment in machine.remaining
            for pose in segment.trajectory.pose[::4]
        ]
        place = self._on_the_way(np.array(pushed), poses)
        if place is not None:
            self.made = "a body appears"
            pose = (float(place[0]), float(place[1]), 0.0)
            run.bridge.disturb(Place(at=self.at, body=BODY, pose=pose))

    def _solvable(self, item: Array, goal: Array, body: Array) -> bool:
        circle = np.array([[body[0], body[1], _VISITOR.geometry.circumradius]])
        try:
            for progress in plan_among_bodies(self._planner, item, goal, circle):
                if progress.best is not None:
                    return True
        except PlanningFailed:
            pass
        return False

    def _new_goal(self, item: Array, body: Array) -> Array | None:
        """Anywhere on the map where a plan leads to, from where the object is."""
        x0, x1, y0, y1 = self._planner.scene.field.grid.extent
        for _ in range(_TRIES):
            goal: Array = self._random.uniform([x0, y0, -np.pi], [x1, y1, np.pi])
            room = self._planner.scene.object_clearance(self._item.mass_pose(goal))
            if room >= _SPARE and self._solvable(item, goal, body):
                return goal
        return None

    def _on_the_way(self, pushed: Array, poses: dict[str, Array]) -> Array | None:
        """On the way of the pushes; so that another way is left."""
        item = poses[self._name]
        first = int(np.argmin(np.hypot(*(pushed[:, :2] - item[:2]).T)))
        for _ in range(_TRIES):
            on_path = pushed[self._random.integers(first, len(pushed)), :2]
            angle = self._random.uniform(-np.pi, np.pi)
            aside = _ASIDE * np.array([np.cos(angle), np.sin(angle)])
            place = np.append(on_path + aside, 0.0)
            reach = self._item.geometry.circumradius + _VISITOR.geometry.circumradius
            if np.hypot(*(place - item)[:2]) < reach + _AHEAD:
                continue
            if np.hypot(*(place - self.goal)[:2]) < _FROM_GOAL:
                continue
            if self._footing.trouble(BODY, place, poses) is not None:
                continue
            if self._solvable(item, self.goal, place):
                return place
        return None


def trial(task: ChangeTask) -> Row:
    """Push the object to the goal, and change the world on the way."""
    with own_domain():
        scenario = with_visitor(load_scenario(task.scenario))
        believed, world, drawn = uncertainty(task.uncertainty).draw(scenario, task.seed)
        change = Change(believed, world, task.kind, task.seed)
        measures, trace = run_job(believed, world, meanwhile=change)
    position, orientation = final_errors(trace, change.goal)
    row = {"scenario": task.scenario, "seed": task.seed, "kind": task.kind, **measures, **drawn}
    row |= {"position_error_m": position, "orientation_error_rad": orientation}
    if not change.made:
        return row | {"success": False, "reason": f"nothing changed; {measures['reason']}"}
    ended = trace.states[-1][3] == 0
    close = position <= SUCCESS_POSITION and orientation <= SUCCESS_ORIENTATION
    success = bool(ended and close and measures["collisions"] == 0)
    return row | {"success": success, "changed_at_s": change.at}


def statistics(rows: list[Row]) -> dict[str, Any]:
    """By kind of change: how many end at the goal, their errors, and what it cost."""
    found: dict[str, Any] = {}
    for kind in KINDS:
        some = [r for r in rows if r.get("kind") == kind]
        if not some:
            continue
        found[kind] = {"trials": len(some), "successes": sum(bool(r["success"]) for r in some)}
        done = [r for r in some if "changed_at_s" in r]
        if not done:
            continue
        p = [r["position_error_m"] for r in done]
        found[kind] |= {
            "position_median_m": float(np.median(p)),
            "position_worst_m": float(np.max(p)),
            "new_plans": sum(int(r["replans"]) for r in done),
            "collision_ticks": sum(int(r["collisions"]) for r in done),
        }
    return found


def conclude(options: StudyOptions, tasks: Sequence[ChangeTask], rows: list[Row]) -> None:
    """How many end at the goal, and what it cost."""
    for kind, mine in statistics(rows).items():
        print(f"{kind}: {mine['successes']} of {mine['trials']} at the goal")
        if "position_median_m" not in mine:
            continue
        print(
            f"  {1e3 * mine['position_median_m']:.2f} mm median, "
            f"{1e3 * mine['position_worst_m']:.2f} most; {mine['new_plans']} new plans, "
            f"{mine['collision_ticks']} ticks with a collision"
        )
