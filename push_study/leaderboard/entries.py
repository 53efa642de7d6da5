"""The rows that the suite brings: its own methods, the thesis's, and those of other people."""

from dataclasses import asdict

from grasp_opt.group_control import PRINTED_LAW
from push_bringup.systems import system_of
from push_model.settings import SettingsError
from push_study.leaderboard.entry import (
    PLATES,
    POSES,
    POSITIONS,
    Entry,
    Reproduction,
    Told,
    entry_from_outside,
)

__all__ = ["ENTRIES", "PLATES", "POSES", "POSITIONS", "entries", "entry_of"]

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
    Entry("own sensing", "own-sensing", _SENSING, frozenset({POSITIONS})),
    Entry(
        "global input",
        "global-input",
        Told("radius", "mean and variance", "central"),
        frozenset({POSITIONS}),
        "Shahrokhi et al., T-RO 2018",
        robot="disc",
        reconstructed=True,
        reproduction=Reproduction(
            "90 ± 35 s with 100 robots, ten trials; the authors' code, run by us: 58 of 60 trials "
            "reached, median 69 s",
            "38 of 40 trials reached, median 73 s",
            True,
            "planar-push experiment rival-papers --scenarios global-100 --trials 40",
        ),
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
        reproduction=Reproduction(
            "259 ± 16 s with 20 robots, ten trials",
            "141 ± 77 s, ten trials; 232 ± 71 s with a drag on the object instead of friction",
            False,
            "planar-push experiment rival-papers --scenarios gibbs-20 --trials 10",
        ),
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
    Entry(
        "NMPC",
        "stable-nmpc",
        _ALL,
        frozenset({POSES}),
        "Tang et al., RA-L 2023",
        reconstructed=True,
    ),
    Entry(
        "Dubins push",
        "dubins-push",
        _ALL,
        frozenset({POSES}),
        "ReloPush for one object; Ahn and Mavrogiannis 2024",
        reconstructed=True,
        reproduction=Reproduction(
            "the authors' program, run by us: plans for 400 of 400 single boxes, which are pushed "
            "by 2.55 m on average",
            "400 of 400, 2.52 m; 387 ways are equal to a millimetre",
            True,
            "planar-push experiment relopush --scenarios 1-relopush,1-dubins --trials 400 "
            "--seed 2000",
        ),
    ),
    Entry("reactive pusher", "reactive", _ALL, frozenset({POSES}), "this project, a baseline"),
    Entry("group", "group", _ALL, frozenset({PLATES})),
    Entry(
        "printed group law",
        "group",
        _ALL,
        frozenset({PLATES}),
        "the thesis, (3.20)-(3.25), R F in place of R G F",
        {"group": {"control": asdict(PRINTED_LAW)}},
    ),
)


def entry_of(name: str) -> Entry:
    """A row that the suite brings, by name, or one of somebody else by ``MODULE:ATTRIBUTE``.

    Raises
    ------
    SettingsError: there is none.
    """
    known = {e.name: e for e in ENTRIES}
    if name in known:
        return known[name]
    if ":" not in name:
        listed = ", ".join(known)
        raise SettingsError(f"no method called '{name}'; known: {listed}, MODULE:ATTRIBUTE")
    return entry_from_outside(name)


def entries(names: tuple[str, ...] = ()) -> dict[str, Entry]:
    """Rows by what they are asked for; all that the suite brings where nothing is asked for.

    Raises
    ------
    SettingsError: an unknown row, two of one name, one whose system does not exist.
    """
    rows = {name: entry_of(name) for name in names or tuple(e.name for e in ENTRIES)}
    called = [e.name for e in rows.values()]
    for name in called:
        if called.count(name) > 1:
            raise SettingsError(f"two methods of the leaderboard are called '{name}'")
    for entry in rows.values():
        try:
            system_of(entry.system)
        except SettingsError as error:
            raise SettingsError(f"{entry.name}: {error}") from None
    return rows
