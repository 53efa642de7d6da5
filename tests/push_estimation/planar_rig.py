"""A robot and an object in the planar world, seen by a motion capture with noise: a Rig."""

import numpy as np

from push_estimation.tracks import Track
from push_model import se2
from push_model.specs import EnvironmentSpec
from sim_bridge.planar_world import PlanarSettings, PlanarWorld

RATE = 125.0  # [Hz]
STEP = 0.5e-3  # [s]; the slide of an object takes some 40 ms


class PlanarRig:
    """See Rig. marker: ``(3,)`` the marker frame in the robot's frame, which the rig does not
    tell. holes: no poses for the second [s], after the first [s] in the mean."""

    def __init__(
        self,
        robot,
        item,
        gap=0.12,
        marker=(0.0, 0.0, 0.0),
        seed=1,
        noise=(1e-4, 5e-4),
        holes=(np.inf, 0.0),
    ):
        start = np.array([0.0, 0.0, 0.0])
        near = float(-item.outline[:, 0].min())
        there = np.array([gap + near + robot.push_distance, 0.0, 0.0])
        self._world = PlanarWorld(
            EnvironmentSpec(size=(12.0, 12.0)),
            {"robot": (robot, start)},
            {"item": (item, there)},
            PlanarSettings(time_step=STEP),
        )
        self._marker, self._noise = np.array(marker), noise
        self._luck = np.random.default_rng(seed)
        self._every, self._length = holes
        self._holes = np.random.default_rng([seed, 77])
        self._time = 0.0
        self._hole = self._next_hole()
        self._look()

    def _next_hole(self):
        return self._time + self._every * self._holes.exponential()

    def _look(self):
        """Whether there are poses now; the newest stay what they were where there are none."""
        if self._time >= self._hole + self._length:
            self._hole = self._next_hole()
        if self._time >= self._hole:
            return False
        poses = self._world.poses()
        p, o = self._noise
        table = np.array([se2.compose(poses["robot"], self._marker), poses["item"]])
        table += self._luck.standard_normal((2, 3)) * [p, p, o]
        self.robot, self.item = table
        return True

    def run(self, v, omega, seconds):
        self._world.command("robot", v, omega)
        frames = max(1, round(seconds * RATE))
        times, robots, items = [], [], []
        for _ in range(frames):
            self._world.step(round(1.0 / RATE / STEP), contacts=False)
            self._time += 1.0 / RATE
            if self._look():
                times.append(self._time)
                robots.append(self.robot)
                items.append(self.item)
        shown = (np.array(poses).reshape(-1, 3) for poses in (robots, items))
        return Track(np.array(times), *shown)
