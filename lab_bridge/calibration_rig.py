"""A robot and an object of a lab as the ``Rig`` of a calibration. It stops while poses are lost,
and for good where they stay away or where the robot comes too near to the edge of the map."""

import time

import numpy as np

from lab_bridge.capture_diagnosis import Sample
from lab_bridge.marker_mapping import MarkerMapping
from lab_bridge.observation import Observer
from push_estimation.tracks import Track
from push_model.arrays import Array

_LOST = 0.4  # [s] without a pose, after which the robot stops
_AWAY = 5.0  # [s] more without a pose, after which the calibration ends
_BACK = 0.2  # [s] during which poses have to come again
_KEPT = 1.0  # [s] of poses from before a run
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
            self._fail(f"no usable poses of '{body}' arrive")
        assert pose is not None
        return pose

    def _fail(self, why: str) -> None:
        self._observer.command(self._robot, 0.0, 0.0)
        self._observer.run(0.3)
        raise RigFailed(why)

    def run(self, v: float, omega: float, seconds: float) -> Track:
        """See Rig. Where poses are lost, the robot stops, and the run ends when they are back."""
        observer, begun = self._observer, time.time()
        observer.samples[:] = [s for s in observer.samples if begun - s.arrived < _KEPT]
        observer.command(self._robot, v, omega)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            observer.poll()
            self._check()
            if self._unseen(_LOST):
                self._wait_for_poses()
                break
        return self._track([s for s in observer.samples if s.arrived >= begun])

    def _newest(self, body: str, oldest: float) -> Array | None:
        """The newest pose ``(3,)`` of a body that can be used and has arrived within the last
        ``oldest`` [s]; None where there is none."""
        marker, since = self._mapping.markers[body], time.time() - oldest
        for sample in reversed(self._observer.samples):
            if sample.arrived < since:
                return None
            if sample.marker == marker:
                placed = self._mapping.place(body, sample.seen)
                if placed is not None:
                    return placed.pose
        return None

    def _unseen(self, limit: float) -> str:
        """A body of which no usable pose has arrived for limit [s]; empty where there is none."""
        for body in (self._robot, self._item):
            if self._newest(body, limit) is None:
                return body
        return ""

    def _wait_for_poses(self) -> None:
        observer = self._observer
        observer.command(self._robot, 0.0, 0.0)
        now = seen = time.monotonic()
        limit = now + _AWAY
        while now - seen < _BACK:
            observer.poll()
            self._check()
            now = time.monotonic()
            body = self._unseen(_BACK / 2.0)
            if body:
                seen = now
            if body and now > limit:
                self._fail(f"no usable poses of '{body}' arrive")

    def _check(self) -> None:
        """Fail where the robot cannot be commanded, or is about to leave the map."""
        trouble = self._observer.robots[self._robot].trouble
        if trouble:
            self._fail(f"{self._robot}: {trouble}")
        pose = self._newest(self._robot, _KEPT)
        if pose is not None:
            inside = (self._low <= pose[:2]) & (pose[:2] <= self._high)
            if not inside.all():
                self._fail(f"'{self._robot}' is at the edge of the map; more free floor is needed")

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
