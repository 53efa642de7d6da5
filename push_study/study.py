"""A study: an experiment's trials, run or gone on with, and what they amount to."""

import csv
import fcntl
import importlib
import json
import os
import pkgutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from push_model.settings import SettingsError
from push_record.revision import revision, versions
from push_study import experiments
from push_study.cluster import check_cluster
from push_study.summary import aggregate, known
from push_study.trials import Row, run_trials
from push_study.uncertainty import uncertainty
from sim_bridge.worlds import world_kind


@dataclass(frozen=True)
class StudyOptions:
    """scenarios: names or paths. trials: of each. seed: of the first trial; the next has the next.

    scheduler: address of a Dask scheduler; empty for local processes. workers: 0 for one a core.
    uncertainty: name of how far the world is from what is believed. world: kind of world; empty for
    the experiment's own. asked: names of the options that somebody has set. One that the
    experiment does not use is refused, see ``Experiment.OPTIONS``. methods: of the leaderboard, by
    name or MODULE:ATTRIBUTE; all where none is named.
    """

    scenarios: tuple[str, ...]
    trials: int
    seed: int
    out: Path
    scheduler: str = ""
    workers: int = 0
    uncertainty: str = "mild"
    world: str = ""
    asked: frozenset[str] = frozenset()
    methods: tuple[str, ...] = ()


class Experiment(Protocol):
    """A module of ``push_study.experiments``; its name is the module's, with dashes."""

    SCENARIOS: tuple[str, ...]
    """Where none are named."""

    OPTIONS: Mapping[str, str]
    """Which of the options ``uncertainty`` and ``world`` it uses, with their defaults. What it does
    not use is refused, and is not written into its summary."""

    def tasks(self, options: StudyOptions) -> Sequence[Any]:
        """Dataclasses, one a trial, with ``scenario``, ``seed`` and ``out``. It raises
        SettingsError for scenarios that do not suit it; nothing has been started then."""
        ...

    def trial(self, task: Any) -> Row:
        """Run one trial; importable, for it runs in other processes."""
        ...

    # A module may also have ``ready()``, which raises SettingsError where something that it needs
    # is not installed; nothing has been started then.
    # A module may also have ``statistics(rows) -> Mapping[str, Any]``: what the rows amount to
    # beyond means, by name, for ``aggregate`` in the summary.

    def conclude(self, options: StudyOptions, tasks: Sequence[Any], rows: list[Row]) -> None:
        """Draw and print what the rows amount to, beside the thesis's figures."""
        ...


def experiment_names() -> list[str]:
    """All experiments, by the names that people use."""
    found = pkgutil.iter_modules(experiments.__path__)
    return sorted(m.name.replace("_", "-") for m in found)


def experiment(name: str) -> Experiment:
    """An experiment by name; raises SettingsError when there is none."""
    if name not in experiment_names():
        known = ", ".join(experiment_names())
        raise SettingsError(f"no experiment called '{name}'; known: {known}")
    module: Any = importlib.import_module(f"push_study.experiments.{name.replace('-', '_')}")
    return module  # type: ignore[no-any-return]


def run_study(name: str, options: StudyOptions) -> dict[str, Any]:
    """Run an experiment, or go on with it where its folder has the beginning; returns the summary.

    Raises
    ------
    SettingsError: something is wrong with the options; nothing has been started.
    FileExistsError: the folder holds something else, or another process is at it.
    """
    what = experiment(name)
    _check(options)
    _refuse_unused(name, what, options)
    options = replace(options, world=options.world or what.OPTIONS.get("world", ""))
    if hasattr(what, "ready"):
        what.ready()
    tasks = what.tasks(options)
    mark = {"experiment": name, "seed": options.seed}
    mark |= {option: getattr(options, option) for option in what.OPTIONS}
    mark["revision"] = revision() or f"planar-push {versions().get('planar-push', '')}".strip()
    with _alone(options.out):
        _claim(options.out, mark)
        rows = run_trials(
            what.trial, tasks, options.out / "trials.jsonl", options.scheduler, options.workers
        )
        if rows:
            _write_table(options.out / "trials.csv", rows)
        summary = {
            **mark,
            "requested": len(tasks),
            "trials": [known(row) for row in rows],
            "aggregate": aggregate(rows),
        }
        _write_summary(options.out, summary)  # also where the statistics fail
        summary["aggregate"] = aggregate(rows, statistics_of(what, rows))
        _write_summary(options.out, summary)
        what.conclude(options, tasks, rows)
    return summary


def statistics_of(what: Any, rows: list[Row]) -> Mapping[str, Any]:
    """What an experiment makes of its rows besides means, by name."""
    found: Mapping[str, Any] = what.statistics(rows) if hasattr(what, "statistics") else {}
    return found


def _refuse_unused(name: str, what: Experiment, options: StudyOptions) -> None:
    """An option that does nothing is refused by name."""
    why = {
        "uncertainty": "its trials have a fixed one",
        "world": "its scenarios choose the world, by bridge.world",
    }
    defaults = StudyOptions((), 1, 1, Path())
    for option, reason in why.items():
        set_ = option in options.asked or getattr(options, option) != getattr(defaults, option)
        if set_ and option not in what.OPTIONS:
            raise SettingsError(f"--{option}: '{name}' does not use it: {reason}; leave it out")


def complete(summary: dict[str, Any]) -> bool:
    """Whether every trial has a row, and at least one of them succeeded."""
    rows = summary["trials"]
    return len(rows) == summary["requested"] and any(r["success"] for r in rows)


def _check(options: StudyOptions) -> None:
    if options.trials < 1:
        raise SettingsError(f"trials: expected at least 1, got {options.trials}")
    if options.workers < 0:
        raise SettingsError(f"workers: expected at least 0, got {options.workers}")
    if options.seed < 0:
        raise SettingsError(f"seed: expected at least 0, got {options.seed}")
    stems = [Path(s).stem for s in options.scenarios]
    if not stems or not all(stems):
        raise SettingsError("scenarios: expected names or paths, with commas between them")
    if len(set(stems)) < len(stems):
        raise SettingsError(
            f"scenarios: give each once, and files with different names; got {', '.join(stems)}"
        )
    uncertainty(options.uncertainty)
    if options.world:
        world_kind(options.world)
    if options.scheduler and options.workers:
        raise SettingsError(
            "workers: local processes are not used with --scheduler; "
            "give only one of the two options"
        )
    if options.scheduler:
        check_cluster()


def _claim(out: Path, study: dict[str, Any]) -> None:
    """Make the folder this study's, or see that it is."""
    mark = out / "study.json"
    if mark.is_file():
        try:
            there = dict(json.loads(mark.read_text(encoding="utf-8")))
        except (ValueError, TypeError) as error:
            raise FileExistsError(
                f"{mark} cannot be read ({error}), so the study there cannot be continued; choose "
                "another --out"
            ) from None
        for key, value in study.items():
            if there.get(key) != value:
                raise FileExistsError(
                    f"{out} holds a study whose {key} is {there.get(key)!r}, this one's is "
                    f"{value!r}; choose another --out"
                )
        return
    new = out / "study.new"
    if any(path != new for path in out.iterdir()):
        raise FileExistsError(f"{out} exists already and is not a study; choose another --out")
    if not os.access(out, os.W_OK):
        raise SettingsError(f"{out}: this folder cannot be written")
    new.write_text(json.dumps(study, indent=1) + "\n", encoding="utf-8")
    new.replace(mark)


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Make the folder. Nobody else is at its study meanwhile; the system lets go when the process
    ends."""
    if out.exists() and not out.is_dir():
        raise FileExistsError(f"{out} exists already and is not a study; choose another --out")
    out.mkdir(parents=True, exist_ok=True)
    folder = os.open(out, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(folder)
        raise FileExistsError(
            f"another process writes to the study in {out}; wait for it, or choose another --out"
        ) from error
    try:
        yield
    finally:
        os.close(folder)


def _write_summary(out: Path, summary: Mapping[str, Any]) -> None:
    (out / "summary.json").write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n")


def _write_table(path: Path, rows: list[Row]) -> None:
    keys = list(dict.fromkeys(k for r in rows for k in r))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, keys)
        writer.writeheader()
        writer.writerows(rows)
