"""What the planning of one push plan has used up, and what it has found on the way."""

import time
from collections.abc import Iterator

import numpy as np

from push_model.arrays import Array
from push_planner.guide_path import GuidePath
from push_planner.push_graph import PushGraph, SearchStatistics
from push_planner.push_plan import PlanError, PlanningFailed, PlanStatistics
from push_planner.settings import PlannerSettings


class Work:
    """What has been spent on one plan, and what is left."""

    def __init__(
        self, settings: PlannerSettings, seed: int, robot: Array | None, on_side: int | None = None
    ) -> None:
        self.seed, self.robot, self.on_side = seed, robot, on_side
        self.random = np.random.default_rng(seed)
        self.statistics = SearchStatistics()
        self.iterations = self.poses = 0
        self.graph: PushGraph | None = None  # of the last search out of the start
        self.least = 0.0  # [s] lower bound of the cost of a plan
        self.ways_out = self.ways_in = False  # whether any push leaves the start, ends at the goal
        self.left = settings.total_expansions
        self._most = settings.max_expansions
        self._clock = time.perf_counter()

    def effort(self) -> int:
        """Pushes that the next search may try."""
        return min(self.left, self._most)

    def counted(self, guide: GuidePath) -> PlanStatistics:
        """The work until now."""
        return PlanStatistics(
            self.iterations,
            self.statistics.expanded,
            self.statistics.generated,
            self.statistics.solved,
            self.statistics.feasible,
            guide.cost,
            guide.length,
            guide.clearance,
            time.perf_counter() - self._clock,
        )


class Guides:
    """Guide paths, each made when it is first asked for."""

    def __init__(self, source: Iterator[GuidePath], work: Work, iterations: int) -> None:
        self._source, self._work, self._iterations = source, work, iterations
        self._found: list[GuidePath] = []

    def _another(self) -> bool:
        guide = next(self._source, None)
        if guide is not None:
            self._found.append(guide)
            self._work.iterations += self._iterations
        return guide is not None

    def number(self, number: int) -> GuidePath:
        """One after another, and again from the first."""
        while len(self._found) <= number and self._another():
            pass
        if not self._found:
            raise PlanningFailed(
                PlanError.NO_GUIDE_PATH,
                "no path was found along which the object fits; choose another goal",
            )
        return self._found[number % len(self._found)]

    def rest(self) -> Iterator[None]:
        """Make those that have not been asked for; yields after each."""
        while self._another():
            yield

    def all(self) -> list[GuidePath]:
        """Those that there are."""
        for _ in self.rest():
            pass
        return self._found
