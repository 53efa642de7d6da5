"""Who is in a team: the robots that the scenario names, and further ones as far as it is told.

Bodies may appear in the poses that the scenario does not name. Each is an obstacle, a disc of a set
radius, until somebody says that it is a robot of the team: by a pattern of names in the parameter
``roster.further``. The patterns may change at any time. A robot whose name matches none any more is
released: it is told to stand once more, and is an obstacle again. What the scenario names as
another body never becomes a robot of the team.
"""

from collections.abc import Collection, Mapping, Sequence
from fnmatch import fnmatchcase

from push_model.settings import SettingsError, bounded, settings

MOST = 1000
"""Bodies that the scenario does not name, beyond which others are ignored."""


@settings
class RosterSettings:
    """What becomes of bodies in the poses that the scenario does not name."""

    further: tuple[str, ...] = bounded(
        ("",),
        doc="Patterns, with * and ?, of the names of further robots: bodies that the scenario does "
        "not name and that become robots of the team, for example x*. They must be of the team's "
        "type. The patterns may be changed at any time. Only methods for any number of robots "
        "accept further robots. An empty string matches no name",
    )
    unknown_radius: float = bounded(
        0.0,
        low=0.0,
        high=10.0,
        doc="Radius of the disc with which a body that neither the scenario nor 'further' names is "
        "treated as an obstacle (m); 0: the radius of the team's robots",
    )


class Roster:
    """Of one team. robots: all that take part, those of the scenario first. obstacles: radii [m] of
    all other bodies, but for the object."""

    def __init__(
        self,
        settings: RosterSettings,
        robots: Sequence[str],
        known: Mapping[str, float],
        radius: float,
        open_team: bool,
    ) -> None:
        """robots: of the scenario's team. known: radii [m] of the scenario's other bodies, but for
        the object. radius: [m] of the team's robots. open_team: whether others may take part."""
        self._named, self._known = tuple(robots), dict(known)
        self._radius, self._open = radius, open_team
        self._strangers: dict[str, None] = {}  # in the order in which they appeared
        self._released: tuple[str, ...] = ()
        self.robots: tuple[str, ...] = ()
        self.obstacles: dict[str, float] = {}
        self.change(settings)

    def change(self, settings: RosterSettings) -> None:
        """Take other settings.

        Raises
        ------
        SettingsError: this team takes no further robots.
        """
        patterns = tuple(p for p in settings.further if p)
        if patterns and not self._open:
            raise SettingsError(
                f"roster.further: this team takes no further robots; got {', '.join(patterns)}"
            )
        before = self.robots
        self._settings, self._patterns = settings, patterns
        self._sort()
        self._released += tuple(n for n in before if n not in self.robots)

    def meet(self, names: Collection[str], item: str) -> bool:
        """Names in a frame, in which the object is called ``item``; whether there are new ones."""
        own = {item, *self._named, *self._known, *self._strangers}
        new = [n for n in names if n and n not in own][: MOST - len(self._strangers)]
        self._strangers.update(dict.fromkeys(new))
        if new:
            self._sort()
        return bool(new)

    def _sort(self) -> None:
        further = [
            n for n in self._strangers if any(fnmatchcase(n, pattern) for pattern in self._patterns)
        ]
        self.robots = (*self._named, *further)
        radius = self._settings.unknown_radius or self._radius
        self.obstacles = {
            **self._known,
            **{n: radius for n in self._strangers if n not in further},
        }

    def released(self) -> tuple[str, ...]:
        """Robots that have been released since the last call."""
        found, self._released = self._released, ()
        return found
