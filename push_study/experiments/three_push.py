"""Section 2.4.6, Figure 2.22: the complete manipulation in three pushes, with (2.53) and without.

The room is so low that the object cannot be turned by pi in fewer pushes. Between two of them the
robot steps back, drives round the object and approaches another side, as in the thesis; what it is
off by then is the offset that the next push begins with. With (2.53) and without it the controller
steers the robot, and hopes for the object, as the thesis does; with (2.57) it steers the object.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_model import se2
from push_model.settings import SettingsError
from push_mpc.contact_force_mpc import PRINTED_GAINS
from push_ros.claims import own_domain
from push_scenario.scenario import load_scenario
from push_study.job import digest, run_job
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty
from push_view.bodies import bodies_of

SCENARIOS = ("three-push",)
"""Where none are named."""

_FORCES: dict[str, Any] = {"controller": "contact_force", "tracker__tracked": "robot"}
_PRINTED: dict[str, Any] = {f"mpc__{name}": value for name, value in PRINTED_GAINS.items()}

VARIANTS: dict[str, dict[str, Any]] = {
    "(2.53), printed gains": _FORCES | _PRINTED,
    "none, printed gains": _FORCES | _PRINTED | {"mpc__constraint": False},
    "(2.53), our gains": _FORCES,
    "none, our gains": _FORCES | {"mpc__constraint": False},
    "(2.57)": {"controller": "ltv"},
}
"""Settings of the controller."""
THESIS = (0.04, np.deg2rad(1.8))
"""[m], [rad] final error, as printed, with (2.53)."""


@dataclass(frozen=True)
class ThreePushTask:
    """One run. variant: key of ``VARIANTS``; digest: of the scenario's text."""

    scenario: str
    seed: int
    out: str
    variant: str
    uncertainty: str = "mild"
    digest: str = ""

    @property
    def trace_file(self) -> Path:
        """Where the run leaves its trace."""
        number = list(VARIANTS).index(self.variant)
        return Path(self.out) / f"trace-{Path(self.scenario).stem}-{number}-{self.seed}.npz"


def tasks(options: StudyOptions) -> list[ThreePushTask]:
    """Every variant, as often as there are trials."""
    made = []
    for name in options.scenarios:
        scenario = load_scenario(name)
        if scenario.goal is None:
            raise SettingsError(f"scenario '{name}' has no goal")
        text = digest(scenario)
        made += [
            ThreePushTask(name, seed, str(options.out), variant, options.uncertainty, text)
            for variant in VARIANTS
            for seed in range(options.seed, options.seed + options.trials)
        ]
    return made


def trial(task: ThreePushTask) -> Row:
    """Bring the object to the goal once."""
    with own_domain():
        level = uncertainty(task.uncertainty)
        believed, world, drawn = level.draw(load_scenario(task.scenario), task.seed)
        believed = believed.settings("controller", **VARIANTS[task.variant])
        measures, trace = run_job(believed, world)
    Path(task.out).mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        task.trace_file,
        time=np.array(trace.time[::10]),
        robot=np.array(trace.robot[::10]),
        object=np.array(trace.object[::10]),
    )
    measures["reason"] = f"{task.variant}: {measures['reason']}"
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        "variant": task.variant,
        **measures,
        "solve_time_ms": 1e3 * float(np.median(trace.solve_times or [np.nan])),
        **drawn,
    }


def conclude(options: StudyOptions, tasks: Sequence[ThreePushTask], rows: list[Row]) -> None:
    """The final errors beside the thesis's, and the ways."""
    print(
        "\n                         success position [mm]  orientation [deg]  pushes  lost  solve"
    )
    print(
        "                                 mean     max   mean      max      mean     lost     [ms]"
    )
    for variant in VARIANTS:
        mine = [r for r in rows if r.get("variant") == variant and "position_error_m" in r]
        if not mine:
            continue
        p = 1e3 * np.array([r["position_error_m"] for r in mine])
        o = np.rad2deg([r["orientation_error_rad"] for r in mine])
        pushes = np.mean([r["pushes"] for r in mine])
        lost = np.mean([r["contact_losses"] for r in mine])
        solve = np.median([r["solve_time_ms"] for r in mine])
        wins = sum(bool(r["success"]) for r in mine)
        print(
            f"{variant:22s} {wins:3d}/{len(mine):<3d} {p.mean():7.2f} {p.max():7.2f} "
            f"{o.mean():7.3f} {o.max():7.3f} {pushes:9.1f} {lost:8.1f} {solve:9.3f}"
        )
    print(
        f"thesis                           {1e3 * THESIS[0]:.0f}              "
        f"{np.rad2deg(THESIS[1]):.1f}                3.0"
    )
    _plot(tasks, options.out)


def _plot(tasks: Sequence[ThreePushTask], out: Path) -> None:
    figure, axes = plt.subplots(len(VARIANTS), 1, figsize=(8, 9), squeeze=False)
    for row, variant in zip(axes[:, 0], VARIANTS, strict=True):
        for task in (t for t in tasks if t.variant == variant and t.trace_file.is_file()):
            scenario = load_scenario(task.scenario)
            trace = np.load(task.trace_file)
            outline = bodies_of(scenario).type(next(iter(scenario.objects))).outline
            row.plot(trace["object"][:, 0], trace["object"][:, 1], color="#c22f3d", lw=1.0)
            row.plot(trace["robot"][:, 0], trace["robot"][:, 1], color="#2a62c9", lw=0.5)
            for pose in (trace["object"][0], trace["object"][-1]):
                row.fill(*se2.transform(pose, outline).T, fill=False, lw=0.8)
            if scenario.goal is not None:
                goal = se2.transform(scenario.goal, outline)
                row.fill(*goal.T, fill=False, lw=1.4, color="#d8b400")
        row.set_aspect("equal")
        row.set_title(f"{variant} (red: object, blue: robot)", fontsize=8)
    figure.savefig(out / "three-push.png", dpi=130, bbox_inches="tight")
    plt.close(figure)
