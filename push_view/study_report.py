"""A report of a study in HTML: its figures with their spread, and a table of its trials."""

import html
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from push_model.settings import SettingsError
from push_view.html_page import Markup, page, study_script, table
from push_view.palette import ROBOTS

_NOT_PLACES = ("reason", "success", "crashed")
_GROUPS = 12  # values of such a column at most


def is_study(folder: Path) -> bool:
    """Whether a folder holds a study that was concluded."""
    return (folder / "summary.json").is_file()


def write_study_report(folder: Path, out: Path) -> int:
    """Write the report of a study to a file; returns the number of trials.

    Raises
    ------
    SettingsError: the summary cannot be read.
    """
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        rows, aggregate = list(summary["trials"]), dict(summary["aggregate"])
        name = str(summary["experiment"])
    except (ValueError, KeyError, TypeError) as error:
        raise SettingsError(f"{folder / 'summary.json'}: not a summary: {error!r}") from None
    by = grouping(rows)
    parts = [
        _head(name, summary, rows),
        "<h2>Measures</h2>",
        "<p class='soft'>Each point is a trial; the bar is the mean, the band one standard "
        "deviation. Open points: trials that failed.</p>",
        '<div id="charts"></div>',
        _aggregate(aggregate),
        "<h2>Trials</h2>",
        "<p class='soft'>A click on a head sorts the table.</p>",
        _trials(rows),
        _files(folder, out.parent),
    ]
    data = {"measures": measures(rows, by), "by": by, "palette": ROBOTS}
    text = page(f"{name} – planar-push", "\n".join(parts), study_script(), data)
    out.write_text(text, encoding="utf-8")
    return len(rows)


def grouping(rows: Sequence[Mapping[str, Any]]) -> str:
    """The first column of names, at most a dozen, by which the trials are drawn side by side; empty
    if there is none."""
    texts = [k for row in rows[:1] for k, v in row.items() if isinstance(v, str)]
    for name in texts:
        values = {row.get(name) for row in rows}
        if name not in _NOT_PLACES and None not in values and 1 < len(values) <= _GROUPS:
            return name
    return ""


def measures(rows: Sequence[Mapping[str, Any]], by: str) -> list[dict[str, Any]]:
    """By measure: its name, and by group the values and whether each trial succeeded.

    A trial that crashed has no measures: the numbers of its row are what was asked of it.
    """
    rows = [row for row in rows if not row.get("crashed")]
    names = [k for row in rows for k, v in row.items() if _is_measure(k, v)]
    found = []
    for name in dict.fromkeys(names):
        groups: dict[str, list[Any]] = {}
        for row in rows:
            value = row.get(name)
            if _is_measure(name, value) and math.isfinite(float(value or 0.0)):
                label = str(row[by]) if by else "all"
                groups.setdefault(label, []).append([value, bool(row["success"])])
        if any(groups.values()):
            found.append({"name": name, "groups": groups})
    return found


def _is_measure(name: str, value: Any) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and name != "seed"


def _head(name: str, summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> str:
    good = sum(bool(row["success"]) for row in rows)
    words = [f"{good} of {len(rows)} trials succeed"]
    if len(rows) < int(summary.get("requested", len(rows))):
        words.append(f"{summary['requested']} were asked for; the study was interrupted")
    words += [
        f"{key} {summary[key]}"
        for key in ("uncertainty", "world", "seed", "revision")
        if summary.get(key) not in (None, "")
    ]
    line = html.escape(" · ".join(words))
    return f'<h1>{html.escape(name)}</h1><p class="soft">{line}</p>'


def _aggregate(aggregate: Mapping[str, Any]) -> str:
    spread, single = [], []
    for name, value in aggregate.items():
        if isinstance(value, Mapping) and {"mean", "std", "max"} <= value.keys():
            spread.append((name, *(float(value[k]) for k in ("mean", "std", "max"))))
        else:
            text = value if isinstance(value, (int, float)) else json.dumps(value)
            single.append((name, text))
    tables = table(("measure", "mean", "standard deviation", "maximum"), spread, "sortable")
    return f"<h2>Over all trials</h2>{tables}<h2>Statistics</h2>{table(('name', 'value'), single)}"


def _trials(rows: Sequence[Mapping[str, Any]]) -> str:
    heads = list(dict.fromkeys(key for row in rows for key in row))
    cells = [[_value(row.get(head)) for head in heads] for row in rows]
    return table(heads, cells, "sortable")


def _value(value: Any) -> Any:
    if value is None:
        return "–"
    return value if isinstance(value, (bool, int, float)) else str(value)


def _files(folder: Path, base: Path) -> str:
    """Links to the reports of recorded trials and to the pictures in the folder of the study."""
    found = sorted(folder.rglob("report.html")) + sorted(folder.glob("*.png"))
    found += sorted(folder.glob("*.csv"))
    links = []
    for path in found:
        if path.parent == base and path.name == "report.html":
            continue
        there = html.escape(str(path.relative_to(folder)))
        links.append(Markup(f'<li><a href="{there}">{there}</a></li>'))
    if not links or folder != base:
        return ""
    return "<h2>Reports and files of recorded trials</h2><ul>" + "".join(links) + "</ul>"
