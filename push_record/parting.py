"""How far two runs of the same bodies part, and when."""

from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_record.contents import BagContents

LIMITS = (0.001, 0.005)
"""[m] of which the first time beyond is told."""

_POINTS = 500  # positions of a body whose distance from the other path is computed


@dataclass(frozen=True)
class Parting:
    """Of one body. distance ``(n,)`` [m] and angle ``(n,)`` [rad] between its two poses at the
    times of the parting, nan where a run lacks it. path: [m] greatest distance of a position in
    the first run from the path in the second, whenever it was there."""

    name: str
    distance: Array
    angle: Array
    times: Array
    path: float

    @property
    def largest(self) -> tuple[float, float]:
        """[m] greatest distance, and the time [s] of it; nan if it was never seen in both."""
        if not np.isfinite(self.distance).any():
            return float("nan"), float("nan")
        k = int(np.nanargmax(self.distance))
        return float(self.distance[k]), float(self.times[k])

    @property
    def last(self) -> float:
        """[m] distance at the end."""
        seen = self.distance[np.isfinite(self.distance)]
        return float(seen[-1]) if len(seen) else float("nan")

    def beyond(self, limit: float) -> float | None:
        """First time [s] at which the distance is larger than limit [m]; None if it never is."""
        with np.errstate(invalid="ignore"):
            late = np.flatnonzero(self.distance > limit)
        return float(self.times[late[0]]) if len(late) else None


def partings(first: BagContents, second: BagContents) -> list[Parting]:
    """Of every body that both bags have, objects first, at the times of the first bag.

    The poses of the second bag are interpolated. Times that only one of them has are left out.
    """
    times = first.time
    if len(times) and len(second.time):
        times = times[(times >= second.time[0] - 1e-9) & (times <= second.time[-1] + 1e-9)]
    names = [n for n in (*first.scenario.objects, *first.scenario.robots) if n in first.poses]
    found = []
    for name in names:
        if name not in second.poses or not len(times):
            continue
        ways = [_at(times, c.time, c.poses[name]) for c in (first, second)]
        gap = ways[0] - ways[1]
        angle = np.abs(np.vectorize(se2.wrap, otypes=[float])(gap[:, 2]))
        path = _from_path(first.poses[name][:, :2], second.poses[name][:, :2])
        found.append(Parting(name, np.hypot(gap[:, 0], gap[:, 1]), angle, times, path))
    return found


def _from_path(points: Array, path: Array) -> float:
    """[m] greatest distance of some points ``(n, 2)`` from a polyline ``(m, 2)``."""
    points, path = (p[np.isfinite(p).all(axis=1)] for p in (points, path))
    points = points[:: max(1, len(points) // _POINTS)]
    moved = np.flatnonzero(np.hypot(*np.diff(path, axis=0).T) > 0.0)
    if not len(points) or not len(moved):
        return float(np.hypot(*(points - path[:1]).T).max(initial=0.0)) if len(path) else np.nan
    begin, along = path[moved], path[moved + 1] - path[moved]
    square = (along**2).sum(axis=1)
    farthest = 0.0
    for point in points:
        part = np.clip(((point - begin) * along).sum(axis=1) / square, 0.0, 1.0)
        gap = begin + part[:, None] * along - point
        farthest = max(farthest, float(np.hypot(gap[:, 0], gap[:, 1]).min()))
    return farthest


def _at(times: Array, known: Array, poses: Array) -> Array:
    """Poses ``(n, 3)`` at some times; nan where they are not known."""
    order = np.argsort(known, kind="stable")
    unwrapped = poses[order].copy()
    good = np.isfinite(unwrapped[:, 2])
    unwrapped[good, 2] = np.unwrap(unwrapped[good, 2])
    columns = [np.interp(times, known[order], column) for column in unwrapped.T]
    return np.column_stack(columns)
