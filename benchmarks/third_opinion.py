"""MuJoCo beside both worlds: laws of friction, and random pushes of a box by a disc.

MuJoCo has its own contact solver (soft contacts, elliptic cones). Its box stands on four feet whose
spin torque is that of uniform pressure, as the box of the PyBullet world does.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.measure import at_most
from benchmarks.physics import DISC, WORLDS, advance
from push_model import se2, uniform_pressure_radius
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_object

PUSHES, SPEED, WAY = 40, 0.05, 0.1  # pushes; [m/s]; [m]
ROOM = EnvironmentSpec((8.0, 8.0), resolution=0.05)
_STEP = 5e-4  # [s]

_WORLD = """
<mujoco>
  <option timestep="{step}" cone="elliptic" impratio="100" integrator="implicitfast"
          iterations="200" tolerance="1e-12" noslip_iterations="20"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1" friction="{mu} 0 0" condim="3"
          contype="1" conaffinity="0" solref="0.004 1"/>
    <body name="box" pos="{x} {y} {z}" euler="0 0 {degrees}">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{flat} {flat} {moment}"/>
      <geom type="box" size="{a} {b} {c}" friction="{nu} 0 0" condim="3" contype="2"
            conaffinity="4" solref="0.004 1"/>
      {feet}
    </body>
    <body name="disc" pos="{dx} {dy} {dz}">
      <joint name="along" type="slide" axis="1 0 0"/>
      <joint name="across" type="slide" axis="0 1 0"/>
      <geom type="cylinder" size="{radius} {dz}" mass="5" friction="{nu} 0 0" condim="3"
            contype="4" conaffinity="2" solref="0.004 1"/>
    </body>
  </worldbody>
  <actuator>
    <velocity joint="along" kv="5000"/>
    <velocity joint="across" kv="5000"/>
  </actuator>
</mujoco>
"""


@dataclass(frozen=True)
class Push:
    """A straight push: pose of the box, place ``(2,)`` of the disc, direction [rad]."""

    box: np.ndarray
    disc: np.ndarray
    direction: float


class MujocoWorld:
    """A box and a disc that is driven at a speed, in MuJoCo."""

    def __init__(self, item: ObjectSpec, push: Push) -> None:
        import mujoco

        self._mujoco = mujoco
        a, b = 0.5 * np.ptp(item.outline, axis=0)
        c = 0.5 * item.height
        foot = uniform_pressure_radius(item.geometry) / math.sqrt(2.0)
        size = 1e-3
        feet = "".join(
            f'<geom type="sphere" size="{size}" pos="{sx * foot} {sy * foot} {-c}" friction="0 0 0"'
            ' condim="3" contype="0" conaffinity="1" mass="0"/>'
            for sx in (-1, 1)
            for sy in (-1, 1)
        )
        x, y, yaw = push.box
        text = _WORLD.format(
            step=_STEP,
            mu=item.floor_friction,
            nu=item.contact_friction,
            x=x,
            y=y,
            z=c + size,
            degrees=math.degrees(yaw),
            mass=item.mass,
            moment=item.moment,
            flat=item.moment,
            a=a,
            b=b,
            c=c,
            feet=feet,
            dx=push.disc[0],
            dy=push.disc[1],
            dz=0.01,
            radius=DISC.footprint_radius,
        )
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)

    def command(self, vx: float, vy: float) -> None:
        self._data.ctrl[:] = vx, vy

    def advance(self, seconds: float) -> None:
        for _ in range(round(seconds / _STEP)):
            self._mujoco.mj_step(self._model, self._data)

    def set_velocity(self, twist: np.ndarray) -> None:
        self._data.qvel[:6] = twist[0], twist[1], 0.0, 0.0, 0.0, twist[2]

    @property
    def velocity(self) -> np.ndarray:
        v = self._data.qvel
        return np.array([v[0], v[1], v[5]])

    @property
    def box(self) -> np.ndarray:
        w, x, y, z = self._data.qpos[3:7]
        return np.array([*self._data.qpos[:2], se2.yaw_from_quaternion(x, y, z, w)])


def nowhere(yaw: float = 0.0) -> Push:
    """No push: the disc is far away."""
    return Push(np.array([0.0, 0.0, yaw]), np.array([3.0, 3.0]), 0.0)


def deceleration(item: ObjectSpec, yaw: float, direction: float) -> np.ndarray:
    """As of ``benchmarks.physics``: along the motion and aside, over mu g."""
    world = MujocoWorld(item, nowhere(yaw))
    world.advance(0.3)
    heading = np.array([math.cos(direction), math.sin(direction)])
    world.set_velocity(np.array([*(0.3 * heading), 0.0]))
    world.advance(0.01)
    first = world.velocity
    world.advance(0.04)
    change = (first - world.velocity)[:2] / 0.04 / (item.floor_friction * 9.81)
    return np.array([change @ heading, heading[0] * change[1] - heading[1] * change[0]])


def spin(item: ObjectSpec, yaw: float) -> float:
    """As of ``benchmarks.physics``: torque of a pure spin over that of uniform pressure."""
    world = MujocoWorld(item, nowhere(yaw))
    world.advance(0.3)
    world.set_velocity(np.array([0.0, 0.0, 6.0]))
    world.advance(0.01)
    first = world.velocity[2]
    world.advance(0.04)
    slowed = (first - world.velocity[2]) / 0.04
    expected = item.floor_friction * 9.81 * uniform_pressure_radius(item.geometry)
    return float(slowed * item.geometry.inertia_per_mass / expected)


def pushes(item: ObjectSpec, count: int = PUSHES) -> list[Push]:
    """Random straight pushes, up to 40 degrees off the normal, anywhere on a side."""
    random, found = np.random.default_rng(5), []
    while len(found) < count:
        side = item.geometry.sides[random.integers(len(item.geometry.sides))]
        part = random.uniform(0.15, 0.85)
        point = side.start + part * (side.end - side.start)
        normal = -side.inward_normal
        place = point + (DISC.footprint_radius + 1e-3) * normal
        angle = math.atan2(-normal[1], -normal[0]) + random.uniform(-0.7, 0.7)
        box = np.array([0.0, 0.0, random.uniform(-3.0, 3.0)])
        found.append(Push(box, se2.transform(box, place[None])[0], angle + box[2]))
    return found


def pushed(kind: str, item: ObjectSpec, push: Push) -> np.ndarray:
    """Pose of the box after a push."""
    seconds = WAY / SPEED
    vx, vy = SPEED * math.cos(push.direction), SPEED * math.sin(push.direction)
    if kind == "mujoco":
        own = MujocoWorld(item, push)
        own.advance(0.2)
        own.command(vx, vy)
        own.advance(seconds)
        return own.box
    strong = replace(DISC, drive=replace(DISC.drive, max_force=50.0))
    robots = {"d": (strong, np.array([*push.disc, 0.0]))}
    with WORLDS[kind](ROOM, robots, {"b": (item, push.box)}) as world:
        advance(world, 0.2)
        world.command_all(["d"], np.array([[vx, vy, 0.0]]), True)
        advance(world, seconds)
        return np.array(world.poses()["b"])


def run() -> dict[str, Any]:
    """The laws in MuJoCo, and how far the three engines part over pushes of 10 cm."""
    try:
        import mujoco
    except ImportError:
        print('  mujoco is not installed; pip install -c constraints.txt -e ".[rivals]" adds it')
        return {}
    item = load_object("box9")
    values = np.array(
        [
            deceleration(item, yaw, direction)
            for yaw in 0.37 * np.arange(6)
            for direction in np.arange(8) * math.pi / 4 + 0.1
        ]
    )
    spins = np.array([spin(item, yaw) for yaw in 0.37 * np.arange(6)])
    print(
        f"  MuJoCo {mujoco.__version__}: deceleration / mu g {values[:, 0].min():.4f} .. "
        f"{values[:, 0].max():.4f}, spin torque / uniform pressure {spins.min():.4f} .. "
        f"{spins.max():.4f}"
    )
    result: dict[str, Any] = {
        "bounds": {
            "deceleration off mu g": at_most(np.abs(values[:, 0] - 1.0).max(), 0.05),
            "spin torque off": at_most(np.abs(spins - 1.0).max(), 0.05),
        }
    }
    ends = {k: [pushed(k, item, p) for p in pushes(item)] for k in (*WORLDS, "mujoco")}
    for one, two in (("planar", "mujoco"), ("pybullet", "mujoco"), ("planar", "pybullet")):
        away, turned = parted(ends[one], ends[two])
        result[f"{one}, {two}"] = {"mm": away.tolist(), "rad": turned.tolist()}
        print(
            f"  {one:8s} and {two:8s}: median {np.median(away):.2f} mm, "
            f"{np.median(turned):.4f} rad; 90th percentile {np.percentile(away, 90):.2f} mm, "
            f"{np.percentile(turned, 90):.4f} rad"
        )
    return result


def parted(ones: list[np.ndarray], others: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """[mm], [rad] between poses."""
    off = np.array([se2.between(a, b) for a, b in zip(ones, others, strict=True)])
    return 1e3 * np.hypot(off[:, 0], off[:, 1]), np.abs(off[:, 2])
