"""Rooms with several boxes: the scenes of ReloPush, and its generator.

Ahn & Mavrogiannis, arXiv 2409.18231; facts from github.com/fluentrobotics/ReloPush at 05e17ca: the
nominal poses and +-5 cm of noise (``script/testdata_gen_from_nominal.py``), the six files in
``testdata``, the distances of ``script/instance_generator.py``, the bounds of ``params.cpp`` and of
``path_planning_tools.h``. There a car of 0.29 m wheelbase pushes boxes of 0.15 m; its rear axle
stays within the bounds and its nose reaches 0.3 m beyond them. Here an e-puck pushes the 9 cm box.
All lengths are scaled by 0.09 / 0.15, and walls stand where the car's nose would end.
"""

from dataclasses import dataclass, replace

import numpy as np

from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec
from push_scenario.scenario import Scenario, load_scenario

SCALE = 0.6
"""Our lengths over theirs."""
BOUNDS = (4.0, 5.4)
"""[m] of the car's rear axle, and of boxes."""
_NOSE = 0.3  # [m] of the car, ahead of its rear axle
_NOISE = 0.05  # [m] of every position
_APART, _DRAWN = 0.7, (4.0, 5.2)  # [m] between all positions of the generator, and its bounds
_ROBOT_APART = 0.4  # [m] between the robot and them
_DRAWS, _TRIES = 200, 1000  # times that all are drawn anew; places that are drawn each time

_Place = tuple[float, float]


@dataclass(frozen=True)
class Scene:
    """Lengths [m] of the authors: positions of the boxes, and of their goals in the same order;
    place and heading [rad] of the robot. Boxes are parallel to the walls, at goals too."""

    boxes: tuple[_Place, ...]
    goals: tuple[_Place, ...]
    robot: tuple[float, float, float]


SCENES: dict[str, Scene] = {
    "relopush-2": Scene(
        ((2.05, 3.65), (1.0, 3.65)), ((0.0, 0.05), (3.0, 3.65)), (2.0, 2.5, 1.5708)
    ),
    "relopush-3": Scene(
        ((1.0, 1.5), (1.4, 2.3), (1.2, 3.1)),
        ((3.8, 2.3), (3.4, 3.1), (3.6, 1.5)),
        (2.0, 2.5, 1.5708),
    ),
    "relopush-4": Scene(
        ((2.9, 2.13), (0.58, 4.04), (2.9, 3.37), (2.09, 0.8)),
        ((0.33, 2.91), (1.12, 1.88), (1.47, 4.39), (0.63, 0.76)),
        (2.35, 2.43, 1.5708),
    ),
    "relopush-5": Scene(
        ((2.8, 3.4), (1.4, 2.3), (1.35, 4.0), (3.0, 2.3), (1.58, 4.7)),
        ((3.6, 1.5), (3.8, 2.3), (3.4, 3.1), (2.9, 4.0), (3.8, 5.0)),
        (2.35, 2.43, 1.5708),
    ),
    "relopush-6": Scene(
        (
            (3.735, 2.473),
            (0.927, 0.71),
            (0.97, 2.56),
            (2.549, 3.891),
            (1.228, 3.439),
            (2.212, 0.617),
        ),
        ((0.75, 0.715), (3.717, 2.542), (2.05, 2.56), (3.03, 3.218), (0.9, 4.6), (3.573, 0.361)),
        (3.5, 3.5, 3.14),
    ),
    "relopush-8": Scene(
        (
            (2.7, 1.35),
            (2.0, 3.65),
            (1.86, 1.553),
            (2.096, 2.365),
            (3.034, 3.23),
            (2.058, 4.515),
            (1.021, 2.937),
            (2.745, 0.756),
        ),
        (
            (3.6, 0.45),
            (3.6, 1.55),
            (3.6, 2.65),
            (3.6, 3.75),
            (0.4, 0.45),
            (0.4, 1.6),
            (0.4, 2.8),
            (0.4, 4.0),
        ),
        (1.0, 1.0, 1.5708),
    ),
}
"""data_2o1r, data_3o_2, data_4o, data_5o, data_6o2 and data_8o, to a millimetre. In data_5o the
fourth goal has a heading of 3 rad, which is left out: their boxes may arrive on any side."""


def scene(name: str, seed: int) -> Scene:
    """A scene of ``SCENES`` with its noise, or one that is drawn: ``random-N`` of N boxes, and
    ``shuffle-N``, in which the goal of each of N boxes is the place of another one.

    Raises
    ------
    SettingsError: there is no such scene, or no room for so many boxes.
    """
    random = np.random.default_rng([seed, 2409])
    kind, _, count = name.rpartition("-")
    if kind == "random" and count.isdigit() and int(count) > 0:
        return _drawn(random, int(count))
    if kind == "shuffle" and count.isdigit() and int(count) > 1:
        drawn = _drawn(random, int(count))
        return replace(drawn, goals=drawn.boxes[1:] + drawn.boxes[:1])
    if name not in SCENES:
        known = ", ".join((*SCENES, "random-N", "shuffle-N"))
        raise SettingsError(f"there is no scene '{name}'; expected one of: {known}")
    nominal = SCENES[name]

    def noisy(x: float, y: float) -> _Place:
        off = random.uniform(-_NOISE, _NOISE, 2)
        return max(0.0, x + float(off[0])), max(0.0, y + float(off[1]))

    boxes = tuple(noisy(*p) for p in nominal.boxes)
    goals = tuple(noisy(*p) for p in nominal.goals)
    x, y, heading = nominal.robot
    return Scene(boxes, goals, (*noisy(x, y), heading))


def _drawn(random: np.random.Generator, count: int) -> Scene:
    """Boxes and goals at least ``_APART`` from each other, and a robot that touches no box."""
    for _ in range(_DRAWS):
        places: list[np.ndarray] = []
        for _ in range(_TRIES):
            place = random.uniform(_APART, np.array(_DRAWN) - _APART)
            near = _APART if len(places) < 2 * count else _ROBOT_APART
            if all(np.hypot(*(place - p)) >= near for p in places):
                places.append(place)
            if len(places) == 2 * count + 1:
                found = [(float(x), float(y)) for x, y in places]
                heading = float(random.uniform(-np.pi, np.pi))
                boxes, goals = tuple(found[:count]), tuple(found[count : 2 * count])
                return Scene(boxes, goals, (*found[-1], heading))
    raise SettingsError(f"no room for {count} boxes; give a smaller number")


def scenario_of(name: str, seed: int) -> Scenario:
    """The scenario of a scene, with its arrangement.

    Raises
    ------
    SettingsError: see ``scene``; or a box that stands in a wall, or in another one.
    """
    return scaled(scene(name, seed), f"{name}-{seed}")


def scaled(found: Scene, name: str) -> Scenario:
    """The scenario of a scene: an e-puck and 9 cm boxes, and all lengths times ``SCALE``."""
    example = load_scenario("rearrange")
    robot, item = example.robot()[1], example.object()[1]

    def pose(x: float, y: float, heading: float = 0.0) -> np.ndarray:
        place = SCALE * (np.array([x, y]) - 0.5 * np.array(BOUNDS))
        return np.append(place, heading)

    wide, high = (SCALE * (length + 2.0 * _NOSE) for length in BOUNDS)
    names = [f"box{i + 1}" for i in range(len(found.boxes))]
    made = Scenario(
        name,
        EnvironmentSpec((wide, high)),
        {example.robot()[0]: (robot, pose(*found.robot))},
        {n: (item, pose(*p)) for n, p in zip(names, found.boxes, strict=True)},
        arrangement={n: pose(*p) for n, p in zip(names, found.goals, strict=True)},
    )
    made.check(made.name)
    return made
