"""Check start poses and goals: not in a wall, not in another body, not outside the arena."""

from collections.abc import Iterable, Mapping

import numpy as np
from scipy.spatial import cKDTree

from push_model.arrays import Array
from push_model.specs import ObjectSpec, RobotSpec
from push_scenario.room import Footprint, Room, object_footprint, robot_footprint
from push_scenario.teams import Team

Robots = dict[str, tuple[RobotSpec, Array]]
Objects = dict[str, tuple[ObjectSpec, Array]]


def start_troubles(robots: Robots, objects: Objects, room: Room) -> list[str]:
    """Problems of start poses, one line each, with the names of the bodies."""
    bodies = [robot_footprint(f"robot '{n}'", s, p) for n, (s, p) in robots.items()]
    bodies += [object_footprint(f"object '{n}'", s, p) for n, (s, p) in objects.items()]
    found = []
    for body in bodies:
        trouble = room.trouble(body)
        if trouble is not None:
            found.append(f"{body.name} starts {trouble}, at {_at(body)}")
    for first, second in _near(bodies):
        if first.meets(second):
            found.append(f"{first.name} starts in {second.name}, at {_at(first)}")
    return found


def aim_troubles(teams: Iterable[Team], objects: Objects, room: Room) -> list[str]:
    """Problems of goals and trajectories, one line each."""
    found = []
    for team in teams:
        of_team = f" of team '{team.name}'" if team.name else ""
        kind = "goal" if team.goals else "pose of the trajectory"
        for i, aim in enumerate(team.aims):
            which = f"{kind} {i + 1}" if len(team.aims) > 1 else kind
            if team.object:
                body = object_footprint(which, objects[team.object][0], aim)
            else:
                body = Footprint(which, aim[:2], 0.0, None)
            trouble = room.trouble(body)
            if trouble is not None:
                what = f"object '{team.object}' at the {which}" if team.object else f"the {which}"
                found.append(f"{what}{of_team} is {trouble}, at {_at(body)}")
    return found


def arrangement_troubles(
    arrangement: Mapping[str, Array], objects: Objects, room: Room
) -> list[str]:
    """Problems of goals of several objects, one line each."""
    goals = [object_footprint(n, objects[n][0], pose) for n, pose in arrangement.items()]
    told = [(goal, room.trouble(goal)) for goal in goals]
    found = [f"goal of '{g.name}' is {why}, at {_at(g)}" for g, why in told if why is not None]
    pairs = [(one, two) for one, two in _near(goals) if one.meets(two)]
    found += [f"goals of '{one.name}' and '{two.name}' overlap" for one, two in pairs]
    return found


def _near(bodies: list[Footprint]) -> list[tuple[Footprint, Footprint]]:
    """Pairs whose circles overlap, in the order of the bodies."""
    if len(bodies) < 2:
        return []
    centres = np.array([b.centre for b in bodies])
    radii = np.array([b.radius for b in bodies])
    # Few bodies are large: search pairs of small ones, and the neighbours of each large one.
    small = radii <= 2.0 * np.median(radii)
    pairs = set()
    at = np.flatnonzero(small)
    tree = cKDTree(centres[at])
    for i, j in tree.query_pairs(2.0 * float(radii[at].max())):
        pairs.add((int(min(at[i], at[j])), int(max(at[i], at[j]))))
    for i in np.flatnonzero(~small):
        apart = np.hypot(*(centres - centres[i]).T)
        for j in np.flatnonzero(apart < radii + radii[i]):
            if i != j:
                pairs.add((int(min(i, j)), int(max(i, j))))
    return [(bodies[i], bodies[j]) for i, j in sorted(pairs)]


def _at(body: Footprint) -> str:
    return f"({body.centre[0]:.4g}, {body.centre[1]:.4g})"
