"""Round walls: the four maps and seven objects of Queiroz and MacRae 2024, twenty e-pucks.

Theirs is a position only, within about half an object; ours within 0.1 m, and once more with a
heading at random within 0.1 rad.
"""

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

from push_model import se2
from push_model.settings import SettingsError
from push_scenario.bodies import load_object
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.swarm.maps import MAPS, MapTask, load_map

OBJECTS = ("square", "circle", "rectangle", "triangle", "plus", "l", "h")
ROBOTS = 20
_LIMIT = 1200.0  # [s] as theirs


def tasks_of(
    options: StudyOptions, turned: tuple[bool, ...], lost: float | None = None
) -> list[MapTask]:
    """Every map with every object. turned: whether headings matter; lost: as of MapTask."""
    unknown = set(options.scenarios) - set(MAPS)
    if unknown:
        raise SettingsError(f"the maps are {', '.join(MAPS)}, not {', '.join(sorted(unknown))}")
    return [
        MapTask(
            name,
            options.seed + k,
            str(options.out),
            f"transport_{item}",
            ROBOTS,
            heading,
            options.world or "planar",
            options.uncertainty,
            _LIMIT,
            lost,
        )
        for heading in turned
        for name in options.scenarios
        for item in OBJECTS
        for k in range(options.trials)
    ]


def statistics(rows: list[Row]) -> dict[str, float | int]:
    """By map, object and whether headings matter: trials, successes, mean time with planning."""
    columns = ("scenario", "object", "turned")
    return by_cell(rows, columns, ("charged_s", "collision_ticks", "obstacle_ticks"))


def conclude(options: StudyOptions, tasks: Sequence[MapTask], rows: list[Row]) -> None:
    """Successes and times by map and object; ways of the first trials."""
    for turned in (True, False):
        mine = [r for r in rows if r.get("turned") is turned]
        if not mine:
            continue
        good = [r for r in mine if r["success"]]
        print(f"\n{'poses' if turned else 'positions'}: {len(good)} of {len(mine)} reached")
        print("map         " + "".join(f"{item:>20s}" for item in OBJECTS))
        for name in options.scenarios:
            cells = [_cell(mine, name, item) for item in OBJECTS]
            print(f"{name.removeprefix('transport_'):12s}" + "".join(f"{c:>20s}" for c in cells))
    print("reached of all, mean time with planning [s] (worst)")
    for row in rows:
        if not row["success"]:
            print(f"{row['scenario']}, {row.get('object')}, seed {row['seed']}: {row['reason']}")
    for name in options.scenarios:
        _ways(options, name, [t for t in tasks if t.scenario == name and t.seed == options.seed])


def _cell(rows: list[Row], name: str, item: str) -> str:
    mine = [r for r in rows if r["scenario"] == name and r.get("object") == f"transport_{item}"]
    times = [r["charged_s"] for r in mine if r["success"]]
    told = f" {np.mean(times):4.0f} ({max(times):.0f})" if times else ""
    return f"{len(times)} of {len(mine)}{told}" if mine else "-"


def _ways(options: StudyOptions, name: str, tasks: Sequence[MapTask]) -> None:
    """A column an object, with headings above and without below."""
    figure, axes = plt.subplots(2, len(OBJECTS), figsize=(2.6 * len(OBJECTS), 5.4))
    room = load_map(name)
    for task in tasks:
        ax = axes[0 if task.turned else 1, OBJECTS.index(task.object.removeprefix("transport_"))]
        for box in room.boxes:
            (x, y), (w, h) = box.centre, box.size
            ax.add_patch(Rectangle((x - 0.5 * w, y - 0.5 * h), w, h, color="0.6"))
        if task.trace.is_file():
            ways, outline = np.load(task.trace)["ways"], load_object(task.object).outline
            for k in np.linspace(0, len(ways) - 1, 12).astype(int):
                closed = se2.transform(ways[k, 0], np.vstack([outline, outline[:1]]))
                ax.plot(*closed.T, color="C0", lw=0.6, alpha=0.7)
            ax.plot(*ways[:, 0, :2].T, color="C1", lw=0.9)
            ax.plot(*ways[-1, 1:, :2].T, ".", color="C7", ms=3)
        x, y = 0.5 * np.array(room.size)
        ax.set(xlim=(-x, x), ylim=(-y, y), aspect="equal")
        ax.tick_params(labelsize=5)
    figure.tight_layout()
    figure.savefig(options.out / f"{name}.png", dpi=90)
    plt.close(figure)
