"""Section 2.4.6: contact forces as unknowns, against the stable-push limits and against S6."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from push_model import DifferentialDrive, se2
from push_model.settings import from_mapping
from push_model.specs import ObjectSpec
from push_model.stable_push import contact_on_side, curvature_limits
from push_mpc import (
    CONTROLLERS,
    Contact,
    ContactForceMpc,
    ContactForceSettings,
    LtvMpc,
    MpcSettings,
    Reference,
    line_contact,
)
from push_mpc.contact_force_mpc import FORCES, STICK
from push_mpc.prediction import OUTPUTS, SLACKS
from push_planner import push_sides
from push_qp.backends import BACKENDS
from push_scenario.scenario import load_scenario
from tests.outlines import L, T, U, item_of

NONE = np.zeros((0, 3))
SPEED = 0.07


def straight(settings, way=0.0, speed=SPEED):
    ahead = way + speed * settings.step * np.arange(settings.horizon + 1)
    zero = np.zeros_like(ahead)
    pose = np.column_stack([ahead, zero, zero])
    return Reference(pose, np.column_stack([zero + speed, zero, zero]))


@pytest.fixture
def contact(robot, box):
    side = push_sides(robot, box, 1.0)[0]
    return Contact(side.nominal, line_contact(robot, box, side.grasp))


def shapes(random):
    """Objects of random outlines, frictions and centres of mass."""
    for outline in (L, T, U):
        yield item_of(outline)
    for _ in range(120):
        corners = random.integers(3, 9)
        angle = np.sort(random.uniform(0, 2 * np.pi, corners))
        if np.diff([*angle, angle[0] + 2 * np.pi]).max() > 2.6 or np.diff(angle).min() < 0.3:
            continue
        outline = random.uniform(0.05, 0.1) * np.column_stack([np.cos(angle), np.sin(angle)])
        values = {
            "shape": {"polygon": {"vertices": outline.tolist()}},
            "mass": 0.05,
            "height": 0.06,
            "floor_friction": 0.3,
            "contact_friction": float(random.uniform(0.1, 0.6)),
            "com": random.uniform(-0.008, 0.008, 2).tolist(),
        }
        yield from_mapping(ObjectSpec, values, "")


def test_forces_in_the_cones_move_it_exactly_along_stable_curvatures(robot):
    """The forces that (2.53) leaves are the stable-push interval of section 2.1.1 once more."""
    random = np.random.default_rng(3)
    checked = tipping = 0
    for item in shapes(random):
        for side in push_sides(robot, item, 1.0):
            grasp = se2.compose(side.grasp, se2.inverse(item.mass_pose(np.zeros(3))))
            line = line_contact(robot, item, grasp)
            assert line is not None
            assert line.centre == pytest.approx(side.grasp[:2], abs=1e-9)
            assert line.right == pytest.approx(side.contact.right, abs=1e-9)
            assert line.left == pytest.approx(side.contact.left, abs=1e-9)
            x, y = line.centre
            unit = np.diag([1.0 / line.radius, 1.0 / line.radius, 1.0])
            for limit in (side.nominal.minimum, side.nominal.maximum):
                if abs(limit) < 1e-3 or abs(limit) > 50.0:
                    continue
                for part, allowed in ((0.98, True), (1.02, False)):
                    k = part * limit
                    twist = unit @ np.array([1.0 - k * y, k * x, k])
                    _, left = nnls(unit @ line.motion_of_forces, twist)
                    assert (left < 1e-9) == allowed, (item.shape, side.index, part)
                tipping += abs(x * limit) / abs(1.0 - y * limit) < 0.98 * item.contact_friction
                checked += 1
    assert checked > 150 and tipping > 10  # also where the contact's ends limit, not friction


@pytest.mark.parametrize("offset", [0.03, -0.05, 0.1])
def test_it_steers_as_the_curvature_constraint_does(robot, contact, offset):
    """Closed loop: what 2.4.7 bounds by two curvatures, (2.53) bounds by forces."""
    ends, worst = [], []
    for kind, settings in ((LtvMpc, MpcSettings()), (ContactForceMpc, ContactForceSettings())):
        mpc = kind(settings, robot.differential)
        e, turned = np.array([0.0, offset, 0.0, -SPEED, 0.0]), [0.0]
        for i in range(400):
            result = mpc.solve(e, straight(settings, 7e-4 * i), contact, NONE)
            assert result.solved, result.reason
            a, eps = result.acceleration
            v, w = e[3] + SPEED + 0.01 * a, e[4] + 0.01 * eps
            if v > 5e-3:
                turned.append(w / v)
            e = e + 0.01 * np.array([np.cos(e[2]) * v - SPEED, np.sin(e[2]) * v, w, 0.0, 0.0])
            e[3:] = v - SPEED, w
        ends.append(e)
        worst.append((min(turned), max(turned)))
    assert ends[1] == pytest.approx(ends[0], abs=1e-4)
    assert abs(ends[1][1]) < 0.5 * abs(offset)
    for low, high in worst:
        assert low >= contact.limits.minimum - 1e-2 and high <= contact.limits.maximum + 1e-2
        assert max(-low, high) > 0.95 * contact.limits.maximum  # the constraint was at work


@pytest.mark.parametrize("name", sorted(BACKENDS))
def test_the_solution_obeys_the_printed_equation(robot, contact, name):
    random = np.random.default_rng(7)
    settings = ContactForceSettings()
    solver = BACKENDS[name]()
    mpc = ContactForceMpc(settings, robot.differential, solver)
    p, pressed = settings.horizon, 0
    for _ in range(15):
        e = random.uniform([-0.01, -0.1, -0.3, -0.02, -0.05], [0.01, 0.1, 0.3, 0.02, 0.05])
        reference = straight(settings)
        qp = mpc.programme(e, reference, contact, NONE)
        answer = solver.solve(qp)
        assert answer.solved
        z, y = answer.z, qp.g + qp.S @ answer.z[:-SLACKS]
        forces = z[2 * p : 2 * p + FORCES * p].reshape(p, FORCES)
        assert forces.min() > -1e-5
        v, w = y[:, 3] + SPEED, y[:, 4]
        assert y[:, OUTPUTS:] == pytest.approx(forces, abs=1e-12)
        moved = np.column_stack([v - w * contact.line.centre[1], w * contact.line.centre[0], w])
        slack = z[-SLACKS + 1]
        off = (moved - forces @ contact.line.motion_of_forces.T) * [
            1.0 / contact.line.radius,
            1.0 / contact.line.radius,
            1.0,
        ]
        assert np.abs(off).max() <= slack + 1e-4
        pressed += np.abs(w / np.maximum(v, 1e-3)).max() > 0.9 * contact.limits.maximum
    assert pressed > 5


def test_without_the_constraint_it_turns_tighter_than_is_stable(robot, contact):
    settings = replace(ContactForceSettings(), constraint=False)
    mpc = ContactForceMpc(settings, robot.differential)
    e = np.array([0.0, 0.05, 0.0, -0.03, 0.0])
    qp = mpc.programme(e, straight(settings), contact, NONE)
    assert np.isinf(qp.bound[:, :STICK]).all()
    answer = BACKENDS["active_set"]().solve(qp)
    y = qp.g + qp.S @ answer.z[:-SLACKS]
    kappa = y[:, 4] / np.maximum(y[:, 3] + SPEED, 1e-3)
    assert np.abs(kappa).max() > 2.0 * contact.limits.maximum


def test_alone_it_is_the_plain_controller(robot):
    plain = LtvMpc(MpcSettings(), robot.differential)
    forces = ContactForceMpc(ContactForceSettings(), robot.differential)
    random = np.random.default_rng(2)
    for _ in range(20):
        e = random.uniform(-0.05, 0.05, 5)
        circles = np.column_stack([random.uniform(0.15, 0.4, (3, 2)), np.full(3, 0.05)])
        a = plain.solve(e, straight(plain.settings), None, circles)
        b = forces.solve(e, straight(plain.settings), None, circles)
        assert b.solved == a.solved
        assert b.acceleration == pytest.approx(a.acceleration, abs=1e-6)


def test_a_push_on_no_line_is_not_solved_and_says_so(robot, contact):
    mpc = ContactForceMpc(ContactForceSettings(), robot.differential)
    result = mpc.solve(np.zeros(5), straight(mpc.settings), Contact(contact.limits), NONE)
    assert not result.solved and "touches" in result.reason
    assert result.acceleration == (0.0, 0.0)
    assert mpc.solve(np.zeros(5), straight(mpc.settings), contact, NONE).solved


def test_where_the_bumper_touches_on_no_line_there_is_none(robot, box):
    side = push_sides(robot, box, 1.0)[0]
    assert line_contact(robot, box, side.grasp) is not None
    assert line_contact(robot, box, side.grasp + [0.01, 0.0, 0.0]) is None  # ahead
    assert line_contact(robot, box, side.grasp + [0.0, 0.2, 0.0]) is None  # aside
    assert line_contact(robot, box, side.grasp + [0.0, 0.0, 0.3]) is None  # on a corner
    ring = next(iter(load_scenario("ring20").robots.values()))[0]
    assert line_contact(ring, box, side.grasp) is None


def test_it_is_chosen_by_name():
    kind = CONTROLLERS["contact_force"]
    assert kind.settings is ContactForceSettings
    assert isinstance(kind.make(kind.settings(), DifferentialDrive(0.0205, 0.0265, 6.28)), LtvMpc)


def test_contact_and_limits_are_of_one_contact(robot, box):
    """The limits that come with a plan are those of the line that the controller finds."""
    for side in box.geometry.sides:
        contact = contact_on_side(side, robot.flat_bumper.width)
        limits = curvature_limits(
            contact, robot.push_distance, box.contact_friction, box.limit_surface()
        )
        grasp = contact.object_pose + [robot.push_distance, 0.0, 0.0]
        line = line_contact(robot, box, grasp)
        expected = box.contact_friction / line.centre[0]
        assert limits.maximum == pytest.approx(expected, rel=1e-6)
