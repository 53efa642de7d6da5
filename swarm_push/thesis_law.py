"""The printed law of chapter 4: a Gaussian that moves by the artificial potential, and coverage."""

import numpy as np

from push_model.arrays import Array
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec
from swarm_push.coverage import Coverage
from swarm_push.density import tangential
from swarm_push.law import Scene, SwarmPhase, SwarmStep
from swarm_push.potential import PotentialSettings, direction_to, swarm_input


@settings
class ThesisLawSettings(PotentialSettings):
    """Parameters of section 4.3. A deviation of 0 means: from the number of robots, as printed."""

    sigma_x: float = bounded(
        0.0,
        low=0.0,
        high=10.0,
        doc="Standard deviation of the density in the direction tangential to the object (m); "
        "0: the value of the thesis for the number of robots",
    )
    sigma_y: float = bounded(
        0.0,
        low=0.0,
        high=10.0,
        doc="Standard deviation of the density in the direction towards the object (m); 0: the "
        "value of the thesis for the number of robots",
    )
    lead: float = bounded(
        0.1,
        low=1e-3,
        high=10.0,
        doc="Distance by which the density is ahead of the mean of the swarm, per unit of "
        "u_swarm: dt of (4.4) (m)",
    )
    gain: float = bounded(
        1.0,
        low=1e-3,
        high=100.0,
        doc="Proportional gain of a robot's velocity towards the centroid of its cell (1/s)",
    )


def printed_sigmas(count: int) -> tuple[float, float]:
    """sigma_x, sigma_y [m] of section 4.3, by the number of robots: with few of them a more
    elliptical density brings more of them to the object."""
    if count <= 5:
        return 0.075, 0.0375
    return 0.1, 0.075 if count <= 8 else 0.1


class ThesisLaw:
    """(4.1)-(4.8) with the errata; all that it knows of the object is its radius."""

    def __init__(self, region: Array, item: ObjectSpec, settings: ThesisLawSettings) -> None:
        self.settings, self._coverage = settings, Coverage(region)
        self.believe(item)

    def believe(self, item: ObjectSpec) -> None:
        """See SwarmLaw."""
        self._radius = item.geometry.circumradius

    def reset(self) -> None:
        """See SwarmLaw; nothing is remembered."""

    def step(self, scene: Scene) -> SwarmStep:
        """See SwarmLaw."""
        s, robots, item = self.settings, scene.robots, scene.pose[:2]
        mean = robots.mean(axis=0) if scene.mean is None else scene.mean
        direction = direction_to(item, scene.target)
        u = swarm_input(mean[None], item, direction, self._radius, s)[0]
        x, y = printed_sigmas(len(robots))
        density = tangential(mean + s.lead * u, item, s.sigma_x or x, s.sigma_y or y)
        centroids = self._coverage.centroids(robots, density)
        phase = self._phase(mean - item, direction)
        free = np.full(len(robots), np.inf)
        velocities = s.gain * (centroids - robots)
        return SwarmStep(velocities, density, centroids, phase, np.zeros((len(robots), 2)), free)

    def _phase(self, d: Array, direction: Array) -> SwarmPhase:
        away = float(np.hypot(*d))
        if away > (1.0 + self.settings.overlap) * self.settings.attraction * self._radius:
            return SwarmPhase.GATHER
        behind = -float(d @ direction) >= away * np.cos((1.0 - self.settings.cone) * np.pi)
        if not behind:
            return SwarmPhase.GO_ROUND
        near = away <= self.settings.repulsion * self._radius
        return SwarmPhase.PUSH if near else SwarmPhase.REALIGN
