"""All methods at all contests of the leaderboard; ``planar-push leaderboard`` runs it."""

from collections.abc import Sequence
from typing import Any

from push_model.outside import source_digest
from push_model.settings import SettingsError
from push_record.revision import revision
from push_study.leaderboard.contests import CONTESTS, contest
from push_study.leaderboard.entries import entries, entry_of
from push_study.leaderboard.match import Match, play
from push_study.leaderboard.page import write
from push_study.leaderboard.standings import Cell, cells
from push_study.pool import Row
from push_study.study import StudyOptions

SCENARIOS = tuple(CONTESTS)
"""Contests, where none are named."""
OPTIONS = {"uncertainty": "contest", "world": "planar"}


def tasks(options: StudyOptions) -> list[Match]:
    """Every method at every contest of its kind, with the same seeds.

    Raises
    ------
    SettingsError: a contest or a method that is not known, or that has nothing to do with the
        others.
    """
    who = entries(options.methods)
    kinds = {contest(name).kind for name in options.scenarios}
    for entry in who.values() if options.methods else ():
        if not entry.kinds & kinds:
            raise SettingsError(
                f"'{entry.name}' takes part in contests of {', '.join(sorted(entry.kinds))}; those "
                f"that were asked for are of {', '.join(sorted(kinds))}"
            )
    world = options.world or OPTIONS["world"]
    found = [
        Match(
            *(name, options.seed + k, str(options.out), method, world, options.uncertainty),
            source_digest(method) + source_digest(entry.system),
        )
        for k in range(options.trials)
        for name in options.scenarios
        for method, entry in who.items()
        if contest(name).kind in entry.kinds
    ]
    return found


def trial(task: Match) -> Row:
    """One match."""
    return play(task)


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Share of successes with its interval, Lambda with its own, and the rank, by cell."""
    return {
        f"{c.contest}, {c.entry.name}": {
            "successes": c.successes,
            "trials": c.trials,
            "wilson": c.share,
            "lambda": c.lambda_,
            "lambda_interval": c.lambda_interval,
            "rank": c.rank,
            "leads": c.leads,
        }
        for c in _standings(rows)
    }


def conclude(options: StudyOptions, tasks: Sequence[Match], rows: list[Row]) -> None:
    """The page, the CSV, and the table on the terminal."""
    found = _standings(rows)
    about = {
        "uncertainty": options.uncertainty,
        "world": options.world,
        "first seed": options.seed,
        "matches a cell": options.trials,
        "revision": revision(),
    }
    write(found, about, options.out)
    for name in dict.fromkeys(c.contest for c in found):
        print(f"\n{name}: {CONTESTS[name].what}")
        for c in found:
            if c.contest == name:
                print(_text(c))
    print(f"\n{options.out}/leaderboard.html")


def _standings(rows: list[Row]) -> list[Cell]:
    who = {name: entry_of(name) for name in dict.fromkeys(r["method"] for r in rows)}
    return cells(rows, who, [n for n in CONTESTS if any(r["scenario"] == n for r in rows)])


def _text(c: Cell) -> str:
    rank = f"{c.rank}." if c.rank else "–"
    low, high = c.share
    time = f"Λ {c.lambda_:5.2f}, {c.seconds:5.1f} s" if c.successes else ""
    head = f"  {rank:3s} {c.entry.name:18s} {c.successes:3d} of {c.trials:<3d}"
    return f"{head} ({low:.2f}–{high:.2f})  {time:18s} [{c.entry.told.text}]"
