"""URDF of a robot with two driven wheels: body, bumper, wheels, casters.

Wheels are spheres because PyBullet's cylinders are polygons by default and cost 4 % in distance;
they touch nothing but the floor. Casters are frictionless spheres.
"""

from dataclasses import dataclass

from push_model.bumpers import FlatBumper, RingBumper
from push_model.specs import RobotSpec
from push_model.torque_robot import BODY_HEIGHT

COM_HEIGHT = BODY_HEIGHT
"""[m] Centre of mass of the body above the axle."""
_UNDERSIDE = 0.005  # [m] of the body above the floor


@dataclass(frozen=True)
class Wheels:
    """radius, half_track [m]; mass [kg] of one; inertia [kg m^2]: about the axle, and across it."""

    radius: float
    half_track: float
    mass: float
    inertia: tuple[float, float]


def wheeled_urdf(spec: RobotSpec, wheels: Wheels) -> str:
    """URDF text. The frame is at the axle midpoint; mass and inertia of the body are d ahead of it.

    ``com_ahead`` and ``inertia`` are of the body without its wheels, as m_c, d and I_r of (2.13).
    """
    body_mass = spec.mass - 2.0 * wheels.mass
    h, r, wr = spec.body_height, spec.body_radius, wheels.radius
    ixx = body_mass * (3.0 * r**2 + h**2) / 12.0
    izz = body_mass * r**2 / 2.0 if spec.inertia is None else spec.inertia
    body_z = h / 2.0 - wr + _UNDERSIDE
    collisions = _collision(f'<cylinder radius="{r}" length="{h - _UNDERSIDE}"/>', 0.0, body_z)
    collisions += _bumper(spec)
    com = (spec.com_ahead, COM_HEIGHT)
    text = '<robot name="robot">' + _link("body", body_mass, (ixx, ixx, izz), collisions, com)
    along, across = wheels.inertia
    for name, side in (("left", 1.0), ("right", -1.0)):
        shape = _collision(f'<sphere radius="{wr}"/>', 0, 0)
        text += _link(name, wheels.mass, (across, along, across), shape)
        text += (
            f'<joint name="{name}_axle" type="continuous"><parent link="body"/>'
            f'<child link="{name}"/><origin xyz="0 {side * wheels.half_track} 0"/>'
            '<axis xyz="0 1 0"/></joint>'
        )
    caster = 0.2 * wr
    for i, x in enumerate(spec.casters or ()):
        shape = _collision(f'<sphere radius="{caster}"/>', 0, 0)
        text += _link(f"caster{i}", 1e-4, (1e-8, 1e-8, 1e-8), shape)
        z = -wr + caster + spec.caster_clearance
        text += (
            f'<joint name="caster{i}_arm" type="fixed"><parent link="body"/>'
            f'<child link="caster{i}"/><origin xyz="{x} 0 {z}"/></joint>'
        )
    return text + "</robot>"


def _bumper(spec: RobotSpec) -> str:
    """What touches objects: a low strip or ring. A high face would meet the lower edge of a hull,
    where PyBullet finds normals that lean and lift."""
    b = spec.bumper
    z = spec.bumper_z - spec.differential.wheel_radius
    if isinstance(b, RingBumper):
        return _collision(f'<cylinder radius="{b.radius}" length="{b.height}"/>', 0.0, z)
    assert isinstance(b, FlatBumper)
    thickness = min(0.005, b.distance / 4.0)
    strip = f'<box size="{thickness} {b.width} {b.height}"/>'
    # the arm that carries the strip
    arm_width = min(b.width, 2 * spec.body_radius) * 0.5
    arm = f'<box size="{b.distance - thickness} {arm_width} {b.height * 0.5}"/>'
    return _collision(strip, b.distance - thickness / 2.0, z) + _collision(
        arm, (b.distance - thickness) / 2.0, z
    )


def _collision(geometry: str, x: float, z: float) -> str:
    return f'<collision><origin xyz="{x} 0 {z}"/><geometry>{geometry}</geometry></collision>'


def _link(
    name: str,
    mass: float,
    inertia: tuple[float, float, float],
    collisions: str,
    com: tuple[float, float] = (0.0, 0.0),
) -> str:
    ixx, iyy, izz = inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="{com[0]} 0 {com[1]}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"{collisions}</link>"
    )
