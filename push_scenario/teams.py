"""Teams: which robots move which object, and where to."""

from collections.abc import Mapping
from dataclasses import dataclass

from push_model.arrays import Array
from push_model.settings import SettingsError, bounded, settings
from push_scenario.poses import PoseValue, to_array, to_value


@settings
class TimedPose:
    """A pose of a trajectory."""

    at: float = bounded(low=0.0, high=1e6, doc="Time after the trajectory begins (s)")
    pose: PoseValue = bounded(doc="Pose [x, y, theta] [m, m, rad] in the world frame")


@settings
class TeamEntry:
    """A team in a scenario file."""

    robots: tuple[str, ...] = bounded(doc="Names of robots or of groups of robots")
    object: str = bounded(
        "", doc="The object of the team; may be left out if the scenario has only one"
    )
    goal: PoseValue | None = bounded(None, doc="Goal [x, y, theta] [m, m, rad] of the object")
    goals: tuple[PoseValue, ...] = bounded((), doc="Several goals, reached one after another")
    trajectory: tuple[TimedPose, ...] = bounded((), doc="Timed poses of the object")

    def __post_init__(self) -> None:
        check_aims(self.goal, self.goals, self.trajectory)


@dataclass(frozen=True)
class Team:
    """Robots that move one object.

    name: "" for the only team of a scenario without teams. object: "" when there is none.
    goals: poses ``(3,)`` of the object's geometric frame, to be reached one after another.
    trajectory: poses to be followed in time, instead of goals.
    """

    name: str
    robots: tuple[str, ...]
    object: str
    goals: tuple[Array, ...] = ()
    trajectory: tuple[TimedPose, ...] = ()

    @property
    def goal(self) -> Array | None:
        """The first goal ``(3,)``."""
        return self.goals[0] if self.goals else None

    @property
    def aims(self) -> tuple[Array, ...]:
        """All poses of the goals or of the trajectory."""
        return self.goals or tuple(to_array(t.pose) for t in self.trajectory)


def check_aims(goal: object, goals: tuple[object, ...], trajectory: tuple[TimedPose, ...]) -> None:
    """Raise SettingsError for more than one kind of aim, or a trajectory that goes back in time."""
    if sum((goal is not None, bool(goals), bool(trajectory))) > 1:
        raise SettingsError("expected one of 'goal', 'goals' and 'trajectory', got several")
    times = [t.at for t in trajectory]
    for i, (before, after) in enumerate(zip(times, times[1:], strict=False)):
        if after <= before:
            raise SettingsError(f"trajectory[{i + 1}].at: {after} must come after {before}")
    if len(times) == 1:
        raise SettingsError("a trajectory needs at least two poses")


def goals_of(
    goal: tuple[float, float, float] | None, goals: tuple[tuple[float, float, float], ...]
) -> tuple[Array, ...]:
    """The goals of a file's ``goal`` or ``goals``."""
    return tuple(to_array(g) for g in (goals if goal is None else (goal,)))


def aims_to_mapping(
    goals: tuple[Array, ...], trajectory: tuple[TimedPose, ...]
) -> dict[str, object]:
    """``goal``, ``goals`` or ``trajectory`` in the form of a file."""
    if trajectory:
        return {"trajectory": [{"at": t.at, "pose": list(t.pose)} for t in trajectory]}
    if len(goals) > 1:
        return {"goals": [to_value(g) for g in goals]}
    return {"goal": to_value(goals[0]) if goals else None}


def made_teams(
    entries: Mapping[str, TeamEntry],
    groups: Mapping[str, tuple[str, ...]],
    objects: tuple[str, ...],
    where: str,
) -> dict[str, Team]:
    """Teams of a file.

    Parameters
    ----------
    groups: names of robots by the name that the file gives them. objects: all names.
    """
    teams: dict[str, Team] = {}
    owner: dict[str, str] = {}
    for name, entry in entries.items():
        here = f"{where}.{name}"
        if not (name.isascii() and name.isidentifier()):
            raise SettingsError(f"{here}: a name must be letters, digits and underscores")
        robots: list[str] = []
        for i, robot in enumerate(entry.robots):
            if robot not in groups:
                known = ", ".join(groups)
                raise SettingsError(
                    f"{here}.robots[{i}]: unknown robot '{robot}'; expected one of: {known}"
                )
            robots += groups[robot]
        if not robots:
            raise SettingsError(f"{here}.robots: at least one robot is needed")
        item = entry.object or (objects[0] if len(objects) == 1 else "")
        if item not in objects:
            known = ", ".join(objects) or "none"
            raise SettingsError(f"{here}.object: expected one of: {known}; got '{item}'")
        for body in (*robots, item):
            if body in owner:
                both = f"'{owner[body]}'" if owner[body] != name else "this one, twice"
                raise SettingsError(f"{here}: '{body}' belongs to team {both} already")
            owner[body] = name
        goals = goals_of(entry.goal, entry.goals)
        teams[name] = Team(name, tuple(robots), item, goals, entry.trajectory)
    return teams
