"""A row of the leaderboard: a method, what it is told, and whether it reproduces its own paper."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from push_model.outside import from_outside
from push_model.settings import SettingsError

POSITIONS, POSES, PLATES = "positions", "poses of one robot", "poses of groups"
KINDS = POSITIONS, POSES, PLATES
"""Of contests."""
_TOLD = {
    "outline": ("exact", "radius", "seen"),
    "robots": ("all poses", "mean and variance", "own sensing"),
    "control": ("central", "each robot"),
}


@dataclass(frozen=True)
class Told:
    """What a method is told; rows are ranked only among those that are told the same.

    outline: of the object: "exact", "radius", or "seen" where each robot sees what faces it.
    robots: "all poses", "mean and variance", or "own sensing". control: "central" or "each robot".
    """

    outline: str
    robots: str
    control: str

    def __post_init__(self) -> None:
        for name, known in _TOLD.items():
            if getattr(self, name) not in known:
                listed = ", ".join(f"'{k}'" for k in known)
                raise SettingsError(f"told: {name}: expected {listed}, got {getattr(self, name)!r}")

    @property
    def text(self) -> str:
        """In one line."""
        return f"outline: {self.outline}; robots: {self.robots}; control: {self.control}"


@dataclass(frozen=True)
class Reproduction:
    """A figure of a method's own paper, and what our reconstruction reaches in its setting.

    holds: whether it reaches it. test: that measures it, or how it was measured.
    """

    paper: str
    ours: str
    holds: bool
    test: str


@dataclass(frozen=True)
class Entry:
    """A row. system: of which nodes run, see ``push_bringup.systems``: a system or method by name,
    or ``MODULE:ATTRIBUTE``.

    kinds: of contests that it takes part in, of ``KINDS``. parameters: of its nodes, as
    in a scenario, by kind of node. robot: type of its robots where it cannot drive those of the
    contest. disc: whether it believes the object to be its circumscribed disc. reconstructed:
    whether it is somebody else's method; such a row is ranked only with a reproduction that holds.
    """

    name: str
    system: str
    told: Told
    kinds: frozenset[str]
    source: str = "this project"
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    robot: str = ""
    disc: bool = False
    reconstructed: bool = False
    reproduction: Reproduction | None = None

    def __post_init__(self) -> None:
        for kind in self.kinds:
            if kind not in KINDS:
                listed = ", ".join(f"'{k}'" for k in KINDS)
                raise SettingsError(f"{self.name}: unknown kind '{kind}'; known: {listed}")

    @property
    def ranked(self) -> bool:
        """Whether it may be ranked."""
        return not self.reconstructed or (self.reproduction is not None and self.reproduction.holds)

    @property
    def why_not(self) -> str:
        """Why it is not ranked; empty where it is."""
        if self.ranked:
            return ""
        if self.reproduction is None:
            return "not ranked: no reproduction of its paper's figure yet"
        r = self.reproduction
        return f"not ranked: its paper has {r.paper}, our reconstruction {r.ours}"


def entry_from_outside(name: str) -> Entry:
    """An entry by ``MODULE:ATTRIBUTE``.

    Raises
    ------
    SettingsError: it cannot be imported, or is no Entry.
    """
    found = from_outside(name, "entry")
    if not isinstance(found, Entry):
        raise SettingsError(f"entry '{name}': {found!r} is not an Entry of push_study.leaderboard")
    return found
