"""The program of the authors of ReloPush, and the instances that they published."""

import json
import math
import os
import subprocess
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

from push_model.arrays import Array
from push_model.settings import SettingsError
from push_study.relopush.scenes import BOUNDS, Scene
from push_study.rivals.dubins_plans import DubinsPlan, Push, dubins, dubins_plans

PROGRAM = "RELOPUSH_PLAN"
"""Environment variable: the program that ``make relopush`` compiles."""
FILES = {
    "2": "data_2o1r",
    "3": "data_3o_2",
    "4": "data_4o",
    "5": "data_5o",
    "6": "data_6o2",
    "8": "data_8o",
}
"""Of ``COUNT`` instances each, by the number of boxes."""
COUNT = 100
ALONE = "1"
"""Number of boxes of instances that are made of them."""
MODES = {"relopush": "proposed", "dubinsonly": "dubins_only", "mponly": "mp_only"}
"""Of the program, by our names: its method, and two baselines of its authors. ``dubins_only`` has
no pre-relocations: if a Dubins path is not free, it plans this push by Hybrid A*. ``mp_only`` has
no graph, and plans all pushes by Hybrid A*."""
RADIUS = 0.29 / math.tan(0.185)
"""[m] of the tightest bend of a push (``path_planning_tools.h``)."""
_NEARER = 0.14  # [m] by which the car ends nearer to the box than it begins (``params.cpp``)
_BEFORE = 0.625  # [m] of the car from the box before it begins to push (``params.cpp``)
_BEFORE_RELOCATION = 2.0 * _BEFORE  # before a pre-relocation: ``find_pre_push`` is called twice
_HANGS = 1800.0  # [s] of wall time without an answer; a baseline takes about a minute at most


@dataclass(frozen=True)
class Part:
    """A part of a plan, in the order of execution.

    kind: ``app``, a drive to a box; ``pre``, a straight push of a box to a place from which its
    goal can be reached; ``temp``, one of a box over whose place another one is pushed; ``final``, a
    push along a Dubins path to a goal, or to the place of such a box. start, end: poses ``(3,)``
    [m, m, rad]; if ``final``, of the box with the heading of the car; if ``pre`` or ``temp``, of
    the car. Those of ``app`` are not always those of the drive.
    """

    kind: str
    start: Array
    end: Array

    @property
    def way(self) -> float:
        """[m] by which a box is pushed."""
        if self.kind == "app":
            return 0.0
        if self.kind == "final":
            return dubins(self.start, self.end, RADIUS)[1]
        return float(np.hypot(*(self.end - self.start)[:2])) - _NEARER


@dataclass(frozen=True)
class Told:
    """parts: of the plan; empty if none was found. cpu: [s] of the search."""

    parts: tuple[Part, ...]
    cpu: float


def program() -> Path:
    """Of the authors; raises SettingsError if it is not there."""
    path = Path(os.environ.get(PROGRAM, ".relopush/plan")).absolute()
    if not path.is_file():
        raise SettingsError(
            f"this study needs the planner of the authors of ReloPush, and {path} does not exist; "
            f"run 'make relopush' in the clone and start the study there, or set {PROGRAM}"
        )
    return path


def instance(boxes: str, index: int) -> str:
    """A published one, as the authors write it: of the file for this number of boxes. With one
    box, it is a random box of a random instance, alone."""
    if boxes == ALONE:
        return _alone(np.random.default_rng([index, 2409]))
    return _lines(boxes)[index]


def parsed(line: str) -> Scene:
    """An instance as a scene. The headings of goals are left out: see ``SCENES``."""
    parts = dict(part.split(":") for part in line.split("!"))
    rows = {k: [row.split(",") for row in parts[k].split(";")] for k in ("mo", "goal", "assign")}
    goals = {name: (float(x), float(y)) for name, x, y, *_ in rows["goal"]}
    assigned = {box: goals[goal] for box, goal in rows["assign"]}
    x, y, heading = map(float, parts["robot"].split(","))
    return Scene(
        tuple((float(x), float(y)) for _, x, y, *_ in rows["mo"]),
        tuple(assigned[name] for name, *_ in rows["mo"]),
        (x, y, heading),
    )


def plan(line: str, mode: str = "proposed") -> Told:
    """Of an instance, by the program of the authors, in one of its ``MODES``.

    Raises
    ------
    RuntimeError: it has crashed, or does not answer.
    """
    try:
        done = subprocess.run(
            [str(program()), mode],
            input=line,
            capture_output=True,
            text=True,
            timeout=_HANGS,
            check=True,
        )
    except subprocess.CalledProcessError as error:
        raise RuntimeError(f"the program of ReloPush ended with {error.returncode}") from None
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"no answer within {_HANGS:.0f} s") from None
    told = json.loads(done.stdout.splitlines()[-1])
    parts = tuple(Part(p["kind"], np.array(p["start"]), np.array(p["end"])) for p in told["paths"])
    return Told(parts if told["found"] else (), float(told["cpu_s"]))


def plan_alone(line: str, strict: bool = True) -> list[DubinsPlan]:
    """Of an instance with one box, by our reconstruction with the bend, the room and the rules of
    the authors, best first. A box may arrive with any of its sides in front.

    Two details of the program decide which plan is its best: before a pre-relocation, the car must
    stand ``_BEFORE_RELOCATION`` from the box inside of the bounds; and a pre-relocation counts with
    the way of the car, which is ``_NEARER`` longer than that of the box. Which of two equally near
    places it takes is a matter of its rounding. ``strict``: with the rules of the authors; without
    them, the plans are those of the contests of the leaderboard.
    """
    (box,), (goal,), _ = astuple(parsed(line))
    turns = [0.5 * math.pi * k for k in range(4)]
    pushes = [Push(np.array([0.0, 0.0, -turn]), RADIUS) for turn in turns]
    goals = [np.array([*goal, turn]) for turn in turns]

    def clear(path: Array, index: int) -> bool:
        """Box and car, before it begins to push, are inside of the bounds."""
        return _inside(path) and _inside(_behind(path[0], _BEFORE))

    found = dubins_plans(np.array([*box, 0.0]), goals, pushes, clear, strict)
    if not strict:
        return found
    kept = [
        plan
        for plan in found
        if not plan.relocates or _inside(_behind(plan.path[0], _BEFORE_RELOCATION))
    ]
    return sorted(kept, key=lambda plan: plan.length + _NEARER * plan.relocates)


def _behind(pose: Array, away: float) -> Array:
    """Pose ``(1, 3)`` of a robot some way [m] behind its pose ``(3,)``."""
    x, y, heading = pose
    return np.array([[x - away * math.cos(heading), y - away * math.sin(heading), heading]])


def _inside(poses: Array) -> bool:
    """Whether poses ``(n, 3)`` are inside of the bounds."""
    return bool((poses[:, :2] >= 0.0).all() and (poses[:, :2] < BOUNDS).all())


def _alone(random: np.random.Generator) -> str:
    lines = _lines(str(random.choice(list(FILES))))
    scene = parsed(lines[random.integers(len(lines))])
    k = random.integers(len(scene.boxes))
    (x, y), (to_x, to_y), robot = scene.boxes[k], scene.goals[k], scene.robot
    place = ",".join(map(str, robot))
    return f"mo:b,{x},{y},0,4!robot:{place}!goal:d,{to_x},{to_y},0,4!assign:b,d"


def _lines(boxes: str) -> list[str]:
    file = program().parent / "relopush" / "testdata" / f"{FILES[boxes]}.txt"
    return file.read_text().split()
