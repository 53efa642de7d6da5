"""How far the world of a trial is from what planner, controller and supervisor believe."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_model.arrays import Array
from push_model.drives import HolonomicDrive
from push_model.outlines import inset
from push_model.settings import SettingsError
from push_model.shape_specs import PolygonShape
from push_model.specs import ObjectSpec, RobotSpec
from push_scenario.scenario import Scenario
from push_study.pool import Row

Range = tuple[float, float]
_FEW = 20  # robots of which a row has what was drawn for each; of more, the extremes


@dataclass(frozen=True)
class Uncertainty:
    """Noise of poses, and what is drawn for the world.

    position_noise [m], orientation_noise [rad]: standard deviation. rate [Hz] of the poses.
    latency: [s] its mean is drawn from this range; latency_jitter: [s] half width of its uniform
    distribution in a trial. believed_latency: [s] what the controller makes good, the drawn one
    when None. spread: relative, of frictions. contact_friction, robot_friction: of robot on object
    and of robot on robot; drawn from these ranges instead, where given. com: [m] up to which the
    centre of mass is off. outline: [m] up to which all sides of an object lie farther out, or in,
    than is believed. dropout: share of the frames of each body that are lost. estimated: whether
    the estimator of a robot that pushes alone is on. own_draws: other ones for each scenario.
    """

    position_noise: float = 2e-4
    orientation_noise: float = 0.0017453
    rate: float = 100.0
    latency: Range = (0.01, 0.01)
    latency_jitter: float = 0.0
    believed_latency: float | None = None
    spread: float = 0.2
    contact_friction: Range | None = None
    robot_friction: Range | None = None
    com: float = 0.0
    outline: float = 0.0
    dropout: float = 0.0
    estimated: bool = False
    own_draws: bool = False

    def draw(self, believed: Scenario, seed: int) -> tuple[Scenario, Scenario, Row]:
        """What is believed, with the motion capture of this trial; the world; the drawn values.

        Raises
        ------
        SettingsError: a robot of the scenario has no wheels.
        """
        own = [zlib.crc32(believed.name.encode())] if self.own_draws else []
        random = np.random.default_rng([seed, *own] if own else seed)
        low, high = self.latency
        latency = low if low == high else float(random.uniform(low, high))
        known = latency if self.believed_latency is None else self.believed_latency
        believed = believed.settings(
            "bridge",
            seed=seed,
            motion_capture__position_noise=self.position_noise,
            motion_capture__orientation_noise=self.orientation_noise,
            motion_capture__rate=self.rate,
            motion_capture__latency=latency,
            motion_capture__latency_jitter=self.latency_jitter,
        ).settings("controller", tracker__pose_delay=known)
        believed = believed.settings("group", control__pose_delay=known)
        if self.dropout > 0.0:
            believed = believed.settings("bridge", motion_capture__dropout=self.dropout)
        if self.estimated:
            believed = believed.settings("estimator", enabled=True)
        drawn: Row = {} if low == high else {"latency_s": latency}
        objects = {}
        for name, (item, start) in believed.objects.items():
            objects[name] = (self.draw_item(name, item, random, drawn), start)
        robots = {}
        grips: Row = {}
        for name, (robot, start) in believed.robots.items():
            robots[name] = (self.draw_robot(name, robot, random, grips), start)
        drawn.update(grips if len(robots) <= _FEW else _extremes(grips, list(robots)))
        robots = self.draw_robot_friction(robots, random, drawn)
        return believed, replace(believed, objects=objects, robots=robots), drawn

    def _factor(self, random: np.random.Generator) -> float:
        return float(random.uniform(1.0 - self.spread, 1.0 + self.spread))

    def draw_item(
        self, name: str, item: ObjectSpec, random: np.random.Generator, drawn: Row
    ) -> ObjectSpec:
        """What an object is in this trial; what is drawn is noted by name."""
        floor = item.floor_friction * self._factor(random)
        contact = item.contact_friction * self._factor(random)
        if self.contact_friction is not None:
            contact = float(random.uniform(*self.contact_friction))
        changed = replace(item, floor_friction=floor, contact_friction=contact)
        drawn[f"{name}_floor_friction"] = floor
        drawn[f"{name}_contact_friction"] = contact
        if self.com > 0.0:
            angle, away = random.uniform(-np.pi, np.pi), self.com * np.sqrt(random.uniform())
            x, y = item.com[0] + away * np.cos(angle), item.com[1] + away * np.sin(angle)
            changed = replace(changed, com=(float(x), float(y)))
            drawn[f"{name}_com_x_m"], drawn[f"{name}_com_y_m"] = float(x), float(y)
        if self.outline > 0.0:
            out = float(random.uniform(-self.outline, self.outline))
            corners = tuple((float(x), float(y)) for x, y in inset(item.outline, -out))
            changed = replace(changed, shape=PolygonShape(vertices=corners, frame="given"))
            drawn[f"{name}_outline_m"] = out
        return changed

    def draw_robot(
        self, name: str, robot: RobotSpec, random: np.random.Generator, drawn: Row
    ) -> RobotSpec:
        """What a robot is in this trial; what is drawn is noted by name."""
        grip, drive = self._factor(random), robot.drive
        if isinstance(drive, HolonomicDrive):
            drawn[f"{name}_max_force_n"] = drive.max_force * grip
            return replace(robot, drive=replace(drive, max_force=drive.max_force * grip))
        drive = replace(drive, wheel_friction=drive.wheel_friction * grip)
        drawn[f"{name}_wheel_friction"] = drive.wheel_friction
        return replace(robot, drive=drive)

    def draw_robot_friction(
        self,
        robots: Mapping[str, tuple[RobotSpec, Array]],
        random: np.random.Generator,
        drawn: Row,
    ) -> dict[str, tuple[RobotSpec, Array]]:
        """Robots, by name with their starts, with the friction among them in this trial.

        It is one draw for all. A single robot has none.
        """
        if len(robots) < 2:
            return dict(robots)
        factor = self._factor(random)
        chosen = (
            None if self.robot_friction is None else float(random.uniform(*self.robot_friction))
        )
        result = {}
        for name, (robot, start) in robots.items():
            friction = factor * robot.robot_friction if chosen is None else chosen
            drawn["robot_friction"] = friction
            result[name] = (replace(robot, robot_friction=friction), start)
        return result


UNCERTAINTIES = {
    "none": Uncertainty(0.0, 0.0, 100.0, (0.0, 0.0), spread=0.0),
    "mild": Uncertainty(),
    # Mild, with poses as often as the laws of swarms decide.
    "contest": Uncertainty(rate=50.0),
    # Bumpers whose friction is a guess, on the object and on each other; a box whose load is not
    # centred; a motion capture of half the rate, with jitter, whose latency is known to 20 ms.
    "hard": Uncertainty(
        position_noise=1e-3,
        orientation_noise=float(np.deg2rad(0.5)),
        rate=60.0,
        latency=(0.02, 0.06),
        latency_jitter=0.005,
        believed_latency=0.04,
        contact_friction=(0.1, 0.4),
        robot_friction=(0.2, 1.0),
        com=0.01,
        own_draws=True,
    ),
    # A load that is not centred, and an outline to 5 mm.
    "shape": Uncertainty(com=0.015, outline=0.005, own_draws=True),
    # Nothing is told but the poses, with lost frames among them, and an outline to 5 mm.
    "unknown": Uncertainty(
        position_noise=1e-3,
        orientation_noise=float(np.deg2rad(0.5)),
        rate=60.0,
        latency=(0.02, 0.1),
        latency_jitter=0.01,
        believed_latency=0.04,
        contact_friction=(0.08, 0.5),
        robot_friction=(0.2, 1.0),
        com=0.015,
        outline=0.005,
        dropout=0.01,
        estimated=True,
        own_draws=True,
    ),
}
"""By name, as ``--uncertainty`` takes them."""


def uncertainty(name: str) -> Uncertainty:
    """The uncertainty of a name; raises SettingsError where there is none."""
    if name not in UNCERTAINTIES:
        known = ", ".join(UNCERTAINTIES)
        raise SettingsError(f"uncertainty: expected one of {known}, got '{name}'")
    return UNCERTAINTIES[name]


def _extremes(drawn: Row, robots: Sequence[str]) -> Row:
    """Least and greatest value of each quantity that was drawn for robots."""
    values: dict[str, list[float]] = {}
    for name in robots:
        for key, value in drawn.items():
            if key.startswith(f"{name}_"):
                values.setdefault(key.removeprefix(f"{name}_"), []).append(value)
    found: Row = {}
    for key, drawn_values in values.items():
        found[f"robots_least_{key}"] = min(drawn_values)
        found[f"robots_greatest_{key}"] = max(drawn_values)
    return found
