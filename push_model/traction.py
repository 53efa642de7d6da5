"""What a robot can push: the force that its object needs, and what its wheels carry meanwhile.

A push at the height z of the bumper would turn the object over its far edge: the pushed side wants
to rise, and friction at the bumper holds it down and lifts the robot by the same force. That
presses the object on the floor, so that it needs more force. The robot leans back by F z and by the
lift at the distance D; a caster behind the axle takes that up, and the wheels carry so much less.
What they carry times their friction is the traction that there is, unless the motors give less.
"""

import math

from push_model.drives import HolonomicDrive, TorqueDrive
from push_model.limit_surface import GRAVITY
from push_model.specs import ObjectSpec, RobotSpec


def push_force(item: ObjectSpec, lift: float = 0.0) -> float:
    """[N] that keeps an object sliding: mu m g, and more when a part of it presses it down.

    lift: vertical force at the bumper over the horizontal one.
    """
    return item.floor_friction * item.mass * GRAVITY / (1.0 - item.floor_friction * lift)


def lift_share(robot: RobotSpec, item: ObjectSpec) -> float:
    """Vertical friction at the bumper over the force of the push, upward on the robot.

    What holds the pushed side of an object down that yields as if on four springs at the radius rho
    of uniform pressure, a being the distance of the side, at most the friction coefficient:
    ``min(mu, 2 a z / (rho^2 + 2 a^2))``. The nearest side is taken.
    """
    a, rho = item.geometry.inradius, item.pressure_radius
    return min(item.contact_friction, 2.0 * a * robot.bumper_z / (rho**2 + 2.0 * a**2))


def wheel_load(robot: RobotSpec, force: float, lift: float = 0.0) -> float:
    """[N] that both wheels carry while the robot pushes with a force [N].

    lift: vertical force at the bumper over the horizontal one, upward on the robot.

    Without a caster on the side that it leans to, it stands on the rim of its body.
    """
    body = robot.mass
    if not isinstance(robot.drive, HolonomicDrive):
        body -= 2.0 * robot.drive.wheel_mass
    lean = force * (robot.bumper_z + lift * robot.push_distance)
    # about the axle, positive when it presses the front down
    moment = body * GRAVITY * robot.com_ahead - lean
    casters = robot.casters or ()
    ahead = [x for x in casters if x > 0.0] or [robot.body_radius]
    behind = [-x for x in casters if x < 0.0] or [robot.body_radius]
    caster_load = moment / max(ahead) if moment > 0.0 else -moment / max(behind)
    return max(0.0, robot.mass * GRAVITY - lift * force - caster_load)


def traction(robot: RobotSpec, force: float, lift: float = 0.0) -> float:
    """[N] with which a robot can push ahead while it pushes with a force [N]; see wheel_load."""
    drive = robot.drive
    if isinstance(drive, HolonomicDrive):
        return drive.max_force
    torque = drive.max_torque if isinstance(drive, TorqueDrive) else drive.wheel_torque
    carried = drive.wheel_friction * wheel_load(robot, force, lift)
    return min(carried, 2.0 * torque / drive.wheel_radius)


def standing_traction(robot: RobotSpec, lift: float = 0.0) -> float:
    """[N] with which a robot can push at most, leaning back as far as that makes it."""
    low, high = 0.0, max(traction(robot, 0.0, lift), 1e-9)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if traction(robot, middle, lift) >= middle else (low, middle)
    return low


def too_heavy(robot: RobotSpec, item: ObjectSpec) -> str | None:
    """Why a robot cannot push an object alone, or None when it can.

    What it does not call too heavy moves as commanded; what needs 1.25 times what there is loses
    30 % of its way or more. Between the two either may happen: the friction at the bumper depends
    on how they came together. A robot driven by torques is not judged: its wheels may slip and
    push all the same, which is what section 2.3 is about.
    """
    if isinstance(robot.drive, TorqueDrive):
        return None
    lift = lift_share(robot, item)
    needed = push_force(item, lift)
    there = traction(robot, needed, lift)
    if needed <= there:
        return None
    return f"too heavy: needs {needed:.2f} N, has {math.floor(100.0 * there) / 100.0:.2f} N"
