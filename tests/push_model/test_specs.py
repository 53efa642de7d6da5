import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from push_model import DifferentialDrive, SettingsError, from_mapping, se2
from push_model.bumpers import FlatBumper, RingBumper
from push_model.drives import HolonomicDrive, SpeedDrive, TorqueDrive
from push_model.outlines import inside_convex
from push_model.specs import ObjectSpec, RobotSpec

SPEED = SpeedDrive(0.02, 0.03, 6.0, 0.01, 0.05)
TORQUE = TorqueDrive(0.1, 0.17, 12.0, 5.0, 0.5, 0.005)
DISC = HolonomicDrive(0.1, 2.0, 1.0)
PLATE = ObjectSpec({"rectangle": {"length": 0.4, "width": 0.2}}, 0.3, 0.05, 0.6, 0.2)


def robot(drive=SPEED, bumper=None, **values):
    body = {"body_radius": 0.2, "body_height": 0.1, "mass": 2.0, **values}
    return RobotSpec(drive, bumper or FlatBumper(0.3, 0.25), **body)


@pytest.mark.parametrize("drive", [SPEED, TORQUE, DISC])
@pytest.mark.parametrize(
    "bumper", [FlatBumper(0.3, 0.25), RingBumper(0.25), RingBumper(0.1, z=0.01)]
)
def test_every_drive_carries_every_bumper(drive, bumper):
    made = robot(drive, bumper)
    assert from_mapping(RobotSpec, asdict(made)) == made
    assert made.max_speed == drive.max_speed and made.max_turn_rate == drive.max_turn_rate
    assert made.kinematics == (None if drive is DISC else drive)
    assert made.push_distance == (0.25 if bumper.distance == 0.25 else 0.1)
    assert np.hypot(*made.outline.T).max() <= made.footprint_radius / math.cos(math.pi / 32) + 1e-12
    angle = np.linspace(0.0, 2.0 * math.pi, 500)
    disc = np.column_stack([np.cos(angle), np.sin(angle)])
    if isinstance(bumper, RingBumper):
        assert inside_convex(made.outline, 0.9999 * made.footprint_radius * disc).all()
    else:
        assert inside_convex(made.outline, np.array([[0.2499, 0.1499], [0.2499, -0.1499]])).all()


def test_a_body_that_bulges_beyond_a_narrow_bumper_is_in_the_outline():
    made = robot(bumper=FlatBumper(0.02, 0.21))
    angle = np.linspace(0.0, 2.0 * math.pi, 500)
    disc = 0.198 * math.cos(math.pi / 24) * np.column_stack([np.cos(angle), np.sin(angle)])
    assert inside_convex(made.outline, disc).all()
    assert inside_convex(made.outline, np.array([[0.2099, 0.0099], [0.2099, -0.0099]])).all()


def test_what_is_left_out_is_written_out():
    """The bumper's height and the casters of a robot with wheels, and of one without."""
    wheeled, disc = robot(), robot(DISC)
    assert wheeled.bumper_z == wheeled.bumper.z == 0.02
    assert wheeled.casters == pytest.approx((0.15, -0.15))
    assert disc.bumper_z == 0.05 and disc.casters == ()
    low = robot(bumper=RingBumper(0.05, z=0.008), casters=(-0.1,))
    assert low.bumper_z == 0.008 and low.casters == (-0.1,)


def test_wheels_and_flat_bumpers_are_asked_for_by_name():
    assert isinstance(robot().differential, DifferentialDrive)
    assert robot().flat_bumper.width == 0.3
    with pytest.raises(SettingsError, match=r"two driven wheels.*holonomic"):
        _ = robot(DISC).differential
    with pytest.raises(SettingsError, match=r"flat bumper.*ring"):
        _ = robot(bumper=RingBumper(0.1)).flat_bumper


def test_impossible_robots_are_refused():
    with pytest.raises(SettingsError, match="more than its wheels"):
        robot(mass=0.02)
    with pytest.raises(SettingsError, match="com_ahead"):
        robot(com_ahead=0.3)
    with pytest.raises(SettingsError, match=r"drive: missing key 'max_torque'"):
        from_mapping(RobotSpec, {**asdict(robot()), "drive": {"kind": "torque"}})


def test_disc_saturates_keeping_direction():
    random = np.random.default_rng(3)
    for vx, vy, omega in random.normal(0.0, 0.3, (200, 3)) * [1, 1, 10]:
        sx, sy, so = DISC.saturate(vx, vy, omega)
        assert math.hypot(sx, sy) <= 0.1 * (1 + 1e-12) and abs(so) <= 2.0 * (1 + 1e-12)
        assert sx * vy == pytest.approx(sy * vx) and sx * omega == pytest.approx(so * vx)
        assert math.hypot(vx, vy) > 0.1 or abs(omega) > 2.0 or (sx, sy, so) == (vx, vy, omega)


def test_centre_of_mass_off_the_geometric_centre():
    """Mechanics is about the centre of mass; poses convert between the two frames, both ways."""
    lopsided = replace(PLATE, com=(0.05, -0.02))
    assert lopsided.outline == pytest.approx(PLATE.outline)
    assert lopsided.geometry.outline == pytest.approx(PLATE.outline - [0.05, -0.02])
    assert lopsided.geometry.sides[2].distance == pytest.approx(0.15)  # the +x side is nearer
    assert lopsided.geometry.sides[0].distance == pytest.approx(0.25)
    parallel_axes = PLATE.moment + 0.3 * (0.05**2 + 0.02**2)
    assert lopsided.moment == pytest.approx(parallel_axes)
    assert replace(PLATE, inertia=0.007).moment == 0.007
    random = np.random.default_rng(5)
    for geometric in random.uniform(-3, 3, (100, 3)):
        mass = lopsided.mass_pose(geometric)
        outline = se2.transform(geometric, lopsided.outline)
        assert se2.transform(mass, lopsided.geometry.outline) == pytest.approx(outline)
        assert lopsided.geometric_pose(mass) == pytest.approx(geometric)
    with pytest.raises(SettingsError, match=r"com \(0.3, 0.0\)"):
        replace(PLATE, com=(0.3, 0.0))


def test_frames_of_an_ordinary_object_are_the_same_bits():
    pose = np.array([0.1, 0.2, 7.0])
    assert PLATE.mass_pose(pose) is pose and PLATE.geometric_pose(pose) is pose
    assert (PLATE.geometry.outline == PLATE.outline).all()
    assert PLATE.moment == 0.3 * PLATE.geometry.inertia_per_mass


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ({"rectangle": {"length": -1, "width": 1}}, "f.shape.rectangle.length: -1 is out of range"),
        ({"kind": "rectangle", "length": -1, "width": 1}, "f.shape.length: -1 is out of range"),
        ({"rectangle": {"length": 1}}, "f.shape.rectangle: missing key 'width'"),
        ({"circle": {"radius": 1}}, "f.shape: expected one key of rectangle, polygon"),
        ({"kind": "circle"}, "f.shape.kind: expected one of: ellipse, flower"),
        (
            {"polygon": {"vertices": [[0, 0], [1, 1], [1, 0], [0, 1]]}},
            "f.shape.polygon: a polygon",
        ),
        ({"flower": {"radius": 1, "amplitude": 2, "petals": 5}}, "f.shape.flower: flower: amp"),
    ],
)
def test_wrong_shapes_are_named_as_the_file_writes_them(shape, words):
    with pytest.raises(SettingsError) as error:
        from_mapping(ObjectSpec, {**asdict(PLATE), "shape": shape}, "f")
    assert words in str(error.value)
