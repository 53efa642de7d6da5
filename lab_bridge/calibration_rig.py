"""A robot and an object of a lab as the ``Rig`` of a calibration. It stops where poses are lost, or
where the robot comes too near to the edge of the map."""

import time

import numpy as np

from lab_bridge.capture_diagnosis import Sample
from lab_bridge.marker_mapping import MarkerMapping
from lab_bridge.observation import Observer
from push_estimation.tracks import Track
from push_model.arrays import Array

_LOST = 0.4  # [s] without a pose
_PAIR = 0.006  # [s] between the stamps of two poses of one frame
_EDGE = 0.1  # [m] of the robot's middle from the edge of the map


class RigFailed(RuntimeError):
    """Raised where a calibration cannot go on; the robot has been stopped."""


class LabRig:
    """See Rig."""

    def __init__(self, observer: Observer, robot: str, item: str) -> None:
        self._observer, self._robot, self._item = observer, robot, item
        self._mapping = MarkerMapping(observer.lab, observer.bodies)
        self._by_capture = observer.lab.stamps == "capture"
        grid = observer.scenario.grid
        rows, columns = grid.occupied.shape
        self._low = np.array(grid.origin, dtype=np.float64) + _EDGE
        self._high = self._low - 2.0 * _EDGE + grid.resolution * np.array([columns, rows])

    @property
    def robot(self) -> Array:
        """See Rig."""
        return self._pose(self._robot)

    @property
    def item(self) -> Array:
        """See Rig."""
        return self._pose(self._item)

    def _pose(self, body: str) -> Array:
        pose = self._observer.pose(body)
        if pose is None:
            self._fail(f"no poses of '{body}' arrive")
        assert pose is not None
        return pose

    def _fail(self, why: str) -> None:
        self._observer.command(self._robot, 0.0, 0.0)
        self._observer.run(0.3)
        raise RigFailed(why)

    def run(self, v: float, omega: float, seconds: float) -> Track:
        """See Rig."""
        observer = self._observer
        observer.samples.clear()
        observer.command(self._robot, v, omega)
        kept: list[Sample] = []
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            observer.poll()
            self._watch()
        kept = list(observer.samples)
        return self._track(kept)

    def _watch(self) -> None:
        trouble = self._observer.robots[self._robot].trouble
        if trouble:
            self._fail(f"{self._robot}: {trouble}")
        samples = self._observer.samples
        if not samples:
            return
        for body in (self._robot, self._item):
            marker = self._mapping.markers[body]
            newest = next((s for s in reversed(samples) if s.marker == marker), None)
            first = samples[0].arrived
            if time.time() - (first if newest is None else newest.arrived) > _LOST:
                self._fail(f"no poses of '{body}' arrive")
            if newest is None or body != self._robot:
                continue
            placed = self._mapping.place(body, newest.seen)
            if placed is not None:
                inside = (self._low <= placed.pose[:2]) & (placed.pose[:2] <= self._high)
                if not inside.all():
                    self._fail(f"'{body}' is at the edge of the map; more free floor is needed")

    def _track(self, samples: list[Sample]) -> Track:
        """Frames that show robot and object."""
        times: dict[str, list[float]] = {self._robot: [], self._item: []}
        poses: dict[str, list[Array]] = {self._robot: [], self._item: []}
        for sample in samples:
            body = self._mapping.bodies.get(sample.marker, "")
            placed = self._mapping.place(body, sample.seen) if body in times else None
            if placed is None:
                continue
            stamped = self._by_capture and sample.stamp is not None
            times[body].append(float(sample.stamp) if stamped else sample.arrived)  # type: ignore[arg-type]
            poses[body].append(placed.pose)
        mine, others = np.array(times[self._robot]), np.array(times[self._item])
        if not len(mine) or not len(others):
            return Track(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
        near = np.clip(np.searchsorted(others, mine), 1, max(1, len(others) - 1))
        near = np.minimum(near, len(others) - 1)
        before = np.maximum(near - 1, 0)
        closer = np.abs(others[before] - mine) < np.abs(others[near] - mine)
        pick = np.where(closer, before, near)
        good = np.abs(others[pick] - mine) < _PAIR
        good &= np.append(True, np.diff(mine) > 0.0)
        robots, items = np.array(poses[self._robot]), np.array(poses[self._item])
        return Track(mine[good], robots[good], items[pick[good]])
