"""A robot that weaves behind a box of unknown friction and centre of mass, in the planar world."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from push_estimation.line_push_model import Bumper
from push_estimation.probing_push import ProbingPush
from push_estimation.push_belief import PushPriorSettings
from push_estimation.push_estimates import PushEstimates
from push_model import se2
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from sim_bridge.planar_world import PlanarSettings, PlanarWorld

RATE = 100.0  # [Hz]
MILD, HARD = (2e-4, 0.0017453), (1e-3, 0.0087266)  # [m], [rad]
PRIOR = PushPriorSettings(friction_low=0.08, friction_high=0.5, com_radius=0.015)
NAMES = ("contact_friction", "com_x", "com_y")


@dataclass
class Weave:
    """truth: by the names of the quantities. estimates: what was found."""

    truth: dict
    estimates: PushEstimates

    def holds(self):
        """Which intervals hold the truth."""
        found = self.estimates.intervals()
        return {n: found[n].low <= v <= found[n].high for n, v in self.truth.items()}

    def ratios(self):
        """Widths over those of the priors."""
        found, prior = self.estimates.intervals(), self.estimates.priors()
        return {n: found[n].width / prior[n].width for n in self.truth}


def weave(
    seed: int,
    noise=MILD,
    way: float = 1.0,
    meddle: Callable | None = None,
    truth: dict | None = None,
    estimates: PushEstimates | None = None,
) -> Weave:
    """A push over ``way`` [m] from a random side; the latency of the poses is none.

    meddle: called before each frame with the world, the time [s] and the poses ``(2, 3)`` that are
    about to be shown; returns those that are shown.
    """
    luck = np.random.default_rng(seed)
    box, epuck = load_object("box9"), load_robot("epuck")
    away, angle = 0.015 * np.sqrt(luck.uniform()), luck.uniform(-np.pi, np.pi)
    drawn = (luck.uniform(0.08, 0.5), away * np.cos(angle), away * np.sin(angle))
    truth = truth or {n: float(v) for n, v in zip(NAMES, drawn, strict=True)}
    item = replace(
        box, contact_friction=truth["contact_friction"], com=(truth["com_x"], truth["com_y"])
    )
    heading = se2.wrap(luck.integers(4) * np.pi / 2)
    world = PlanarWorld(
        EnvironmentSpec(size=(12.0, 12.0)),
        {"robot": (epuck, np.zeros(3))},
        {"item": (item, np.array([0.097, 0.0, heading]))},
        PlanarSettings(time_step=1.0 / RATE),
    )
    bumper = Bumper(epuck.push_distance, epuck.bumper.width / 2.0)
    law = ProbingPush(box.outline, bumper)
    estimates = estimates or PushEstimates(epuck, box, PRIOR)
    gone, k = 0.0, 0
    while gone < way and not law.off:
        poses = world.poses()
        table = np.array([poses["robot"], poses["item"]])
        table += luck.standard_normal((2, 3)) * [noise[0], noise[0], noise[1]]
        shown = table if meddle is None else meddle(world, k / RATE, table)
        v, omega = law.step(1.0 / RATE, table[0], table[1])
        world.command("robot", v, omega)
        estimates.command(1.0 + k / RATE, v, omega)
        estimates.frame(1.0 + k / RATE, shown[0], shown[1])
        world.step(1, contacts=False)
        gone, k = gone + v / RATE, k + 1
    return Weave(truth, estimates)
