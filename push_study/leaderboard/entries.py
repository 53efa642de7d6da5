"""The rows that the suite brings: its own methods, the thesis's, and those of other people."""

from push_model.settings import SettingsError
from push_study.leaderboard.entry import Entry, Told, entry_from_outside

POSITIONS, POSES, PLATES = "positions", "poses of one robot", "poses of groups"
_ALL = Told("exact", "all poses", "central")
_RADIUS = Told("radius", "all poses", "central")
_SENSING = Told("seen", "own sensing", "each robot")
_ESTIMATED = {"outline_estimator": {"enabled": True}}

ENTRIES = (
    Entry("crescent", "swarm", _ALL, frozenset({POSITIONS})),
    Entry(
        "crescent (radius)",
        "swarm",
        _RADIUS,
        frozenset({POSITIONS}),
        parameters=_ESTIMATED,
        disc=True,
    ),
    Entry(
        "printed law",
        "swarm",
        _RADIUS,
        frozenset({POSITIONS}),
        "the thesis, (4.1)-(4.8) with its errata",
        {"swarm": {"law": {"law": "thesis"}}},
    ),
    Entry(
        "global input",
        "global-input",
        Told("radius", "mean and variance", "central"),
        frozenset({POSITIONS}),
        "Shahrokhi et al., T-RO 2018",
        robot="disc",
        reconstructed=True,
    ),
    Entry(
        "occlusion",
        "occlusion",
        _SENSING,
        frozenset({POSITIONS}),
        "Chen et al., T-RO 2015; Queiroz and MacRae 2024",
        reconstructed=True,
    ),
    Entry(
        "Gibbs field",
        "gibbs",
        _SENSING,
        frozenset({POSITIONS}),
        "Rezeck et al., 2021",
        reconstructed=True,
    ),
    Entry("one robot", "one-robot", _ALL, frozenset({POSES})),
    Entry(
        "printed planner",
        "one-robot",
        _ALL,
        frozenset({POSES}),
        "the thesis, Algorithms 1 and 2",
        {"one-robot": {"planner": {"planner": "thesis"}}},
    ),
    Entry("group", "group", _ALL, frozenset({PLATES})),
    Entry(
        "printed group law",
        "group",
        _ALL,
        frozenset({PLATES}),
        "the thesis, (3.20)-(3.25), R F in place of R G F",
        {"group": {"control": {"law": "printed"}}},
    ),
)


def entries(names: tuple[str, ...] = ()) -> tuple[Entry, ...]:
    """The rows that the suite brings, and those of other people by ``MODULE:ATTRIBUTE``.

    names: built-in rows to take, and further rows; all built-in ones where none is built in.

    Raises
    ------
    SettingsError: a name that is neither; two rows of one name.
    """
    known = {e.name: e for e in ENTRIES}
    chosen = [known[n] for n in names if n in known]
    further = [entry_from_outside(n) for n in names if n not in known and ":" in n]
    for name in names:
        if name not in known and ":" not in name:
            listed = ", ".join(known)
            raise SettingsError(f"no method called '{name}'; known: {listed}, MODULE:ATTRIBUTE")
    rows = (*(chosen or ENTRIES), *further)
    if len({e.name for e in rows}) < len(rows):
        raise SettingsError("two methods of the leaderboard have one name")
    return rows
