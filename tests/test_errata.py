"""Chapter 2: each entry of docs/errata.md, as printed and as implemented, against an independent
truth. A test fails when the printed formula is put back. Chapters 3 and 4: test_errata_teams.py.
"""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import nnls

from push_model import DifferentialDrive
from push_model.grasp import line_contact_grasp
from push_model.limit_surface import GRAVITY, EllipsoidLimitSurface
from push_model.shapes import rectangle
from push_model.stable_push import contact_on_side, curvature_limits, shifted_limits
from push_model.torque_robot import TorqueRobot
from push_mpc import Contact, ContactForceMpc, ContactForceSettings, LtvMpc, MpcSettings, Reference
from push_mpc.contact_force_mpc import STICK
from push_mpc.line_contact import line_contact
from push_mpc.prediction import CHANGES, CURVATURES, OUTPUTS, WHEELS
from push_mpc.wheel_slip_nmpc import WheelSlipNmpc, WheelSlipSettings, beside
from push_planner import PushCurve, push_sides, shortest_push_curve
from push_scenario.bodies import load_robot

ROOT = Path(__file__).resolve().parents[1]
DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)
HALF, AXLE, MU = 0.045, 0.05, 0.2
SURFACE = EllipsoidLimitSurface(1.0, 0.7652 * HALF)
PIONEER = load_robot("pioneer")


def unit(angle):
    return np.array([math.cos(angle), math.sin(angle)])


def test_every_entry_cites_a_test_that_exists():
    rows = re.findall(r"^\| \(?\d.*\|$", (ROOT / "docs/errata.md").read_text(), re.M)
    assert len(rows) >= 23
    for row in rows:
        cited = re.findall(r"`(tests/[\w/]+\.py)::(test_\w+)`", row)
        assert cited, row
        for path, name in cited:
            assert re.search(rf"^def {name}\(", (ROOT / path).read_text(), re.M), name


def test_2_4_the_curve_leaves_along_the_heading():
    """Truth: the chord of the curve's first hundred-thousandth."""
    random = np.random.default_rng(1)
    for _ in range(10):
        start, end = random.uniform(-1.0, 1.0, (2, 3)) * [1.0, 1.0, 3.0]
        ki, kf, s = *random.uniform(0.2, 2.0, 2), 1e-5
        points, _, _ = PushCurve(start, end, ki, kf, 0.0).sample(100_001)
        assert (points[1] - points[0]) / s == pytest.approx(ki * unit(start[2]), abs=1e-3)
        assert (points[-1] - points[-2]) / s == pytest.approx(kf * unit(end[2]), abs=1e-3)
        alpha = kf * unit(end[2]) - 3.0 * end[:2]
        beta = ki * unit(start[2]) - 3.0 * start[:2]  # as printed
        printed = s**3 * end[:2] - (s - 1.0) ** 3 * start[:2]
        printed += alpha * s**2 * (s - 1.0) + beta * s * (s - 1.0) ** 2
        slope = (printed - start[:2]) / s
        assert slope == pytest.approx(ki * unit(start[2]) - 6.0 * start[:2], abs=1e-3)


def cone_holds(curvature, across=0.0):
    """Whether the centre of mass, ``across`` [m] to the left, moves within the friction cone."""
    forward, sideways = 1.0 - curvature * across, curvature * (HALF + AXLE)
    return forward > 0.0 and abs(sideways) <= MU * forward


def test_2_7_the_limits_bound_the_curvature_and_not_the_radius():
    """Truth: the force on the centre of mass lies in the friction cone."""
    contact = contact_on_side(rectangle(2 * HALF, 2 * HALF).sides[0], 2 * HALF)
    limits = curvature_limits(contact, AXLE, MU, SURFACE)
    low, high = 1.0 / limits.minimum, 1.0 / limits.maximum
    wrong = 0
    for kappa in np.random.default_rng(2).uniform(-6.0, 6.0, 500):
        assert (limits.minimum <= kappa <= limits.maximum) == cone_holds(kappa)
        wrong += (low <= 1.0 / kappa <= high) != cone_holds(kappa)  # as printed
    assert wrong > 400
    straight = shortest_push_curve(
        np.zeros(3), np.array([0.5, 0.0, 0.0]), limits.minimum, limits.maximum
    )
    assert straight is not None and straight.length == pytest.approx(0.5, abs=1e-4)


def test_2_42_and_3_4_take_inverse_matrices():
    """Truth: maximum dissipation, by brute force over the surface."""
    random = np.random.default_rng(3)
    surface = EllipsoidLimitSurface(1.77, 0.2)
    sphere = random.normal(size=(200_000, 3))
    wrenches = sphere / np.linalg.norm(sphere, axis=1)[:, None] * [1.77, 1.77, 0.2]
    for _ in range(20):
        twist = random.normal(size=3) * [0.05, 0.05, 0.3]
        found = surface.wrench(twist)
        assert found @ twist == pytest.approx((wrenches @ twist).max(), rel=1e-3)
        back = surface.twist_direction(found)
        assert back / np.linalg.norm(back) == pytest.approx(twist / np.linalg.norm(twist))
        H = surface.wrench_metric  # that of (2.42), in (3.4) as well
        printed = H @ twist / math.sqrt(twist @ H @ twist)
        on_surface = printed @ H @ printed
        assert abs(on_surface - 1.0) > 0.5


@pytest.mark.parametrize("across", [-0.03, 0.02])
def test_2_54_the_offset_shifts_the_limits_of_the_centred_object(across):
    """Truth: the friction cone, at curvatures that are bisected."""
    side = rectangle(2 * HALF, 2 * HALF).sides[0]
    centred = curvature_limits(contact_on_side(side, 2 * HALF), AXLE, MU, SURFACE)
    edges = []
    for sign in (-1.0, 1.0):
        inside, outside = 0.0, 20.0 * sign
        for _ in range(60):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if cone_holds(middle, across) else (inside, middle)
        edges.append(inside)
    shifted = shifted_limits(centred, across)
    assert [shifted.minimum, shifted.maximum] == pytest.approx(edges, rel=1e-6)
    # R_lim taken of the contact as it is, so that the offset counts twice; and as of the object
    for other in (shifted_limits(shifted, across), shifted_limits(centred, -across), centred):
        assert abs(other.maximum / edges[1] - 1.0) > 0.03


def half_plane(mpc, circle, at=(0.0, 0.0), speed=0.0):
    """The row of one obstacle at each predicted step, about a robot at ``at`` on the x axis's way:
    normals ``(p, 2)`` and bounds ``(p,)`` on the position in the map."""
    ahead = speed * mpc.settings.step * np.arange(mpc.settings.horizon + 1)
    zero = np.zeros_like(ahead)
    reference = Reference(
        np.column_stack([at[0] + ahead, zero + at[1], zero]),
        np.column_stack([zero + speed, zero, zero]),
    )
    qp = mpc.programme(np.zeros(5), reference, None, circle[None])
    row = WHEELS + CHANGES + CURVATURES
    normals = np.array(qp.normal[:, :2, row])
    return normals, qp.bound[:, row] + (normals * reference.pose[1:, :2]).sum(axis=1)


def test_2_59_the_nearest_point_lies_on_the_obstacle_and_the_half_plane_leaves_it_out():
    """Truth: distances. As printed q lies on a circle about the map's origin; and inside the circle
    q - p0 turns round, so that the half-plane holds the obstacle's centre."""
    random, mpc = np.random.default_rng(4), LtvMpc(MpcSettings(), DRIVE)
    ring = np.array([unit(a) for a in np.linspace(0.0, 2.0 * np.pi, 3601)])
    for _ in range(100):
        p0, o, delta = random.uniform(-1, 1, 2), random.uniform(-1, 1, 2), random.uniform(0.04, 0.2)
        away = (p0 - o) / np.linalg.norm(p0 - o)
        nearest = (o + delta * ring)[np.argmin(np.hypot(*(o + delta * ring - p0).T))]
        normals, bounds = half_plane(mpc, np.array([*o, delta]), p0)
        assert normals[0] @ nearest == pytest.approx(bounds[0], abs=1e-5)
        assert normals[0] @ o - bounds[0] == pytest.approx(delta)
        printed = delta * away
        assert abs(np.linalg.norm(printed - o) - delta) > 1e-3
        inside = o + 0.3 * delta * away
        normals, bounds = half_plane(mpc, np.array([*o, delta]), inside)
        assert normals[0] @ o > bounds[0]
        q = o + delta * away
        assert (q - inside) @ o < (q - inside) @ q


def test_2_60_the_normal_at_each_predicted_position_keeps_free_positions():
    """Truth: distances. A robot that passes an obstacle is farther from it than delta all along."""
    random, mpc = np.random.default_rng(5), LtvMpc(MpcSettings(), DRIVE)
    cut = 0
    for _ in range(100):
        o = np.array([random.uniform(0.03, 0.11), random.choice([-1, 1]) * 0.06])
        normals, bounds = half_plane(mpc, np.array([*o, 0.05]), speed=0.07)
        way = 0.07 * mpc.settings.step * np.arange(1, len(bounds) + 1)[:, None] * [1.0, 0.0]
        assert np.hypot(*(way - o).T).min() > 0.05
        assert ((normals * way).sum(axis=1) <= bounds + 1e-9).all()
        n = o / np.linalg.norm(o)  # that of p_0, for the whole horizon
        cut += bool((way @ n > n @ o - 0.05).any())
    assert cut > 90


def test_2_53_is_linear_in_the_robot_frame(robot, box):
    """Truth: the path of a point fixed to the robot, differentiated numerically. Linearised about a
    heading in the map, as printed, the same motion is off by the heading's change."""
    side = push_sides(robot, box, 1.0)[0]
    centred = line_contact(robot, box, side.grasp)
    line = centred.moved(0.0, 0.008)
    contact, mpc = (
        Contact(side.nominal, line),
        ContactForceMpc(ContactForceSettings(), robot.differential),
    )
    p, random = mpc.settings.horizon, np.random.default_rng(6)
    qp = mpc.programme(
        np.zeros(5),
        Reference(np.zeros((p + 1, 3)), np.zeros((p + 1, 3))),
        contact,
        np.zeros((0, 3)),
    )
    worst = 0.0
    for _ in range(50):
        v, w, theta = *random.uniform([0.02, -0.2], [0.1, 0.2]), random.uniform(-3.0, 3.0)
        h, R = 1e-6, np.column_stack([unit(theta), unit(theta + 0.5 * math.pi)])
        later = np.column_stack([unit(theta + w * h), unit(theta + w * h + 0.5 * math.pi)])
        moved = h * v * unit(theta) + (later - R) @ line.centre
        twist = np.append(R.T @ moved / h, w)
        forces = np.linalg.lstsq(line.motion_of_forces, twist, rcond=None)[0]
        y = np.zeros(OUTPUTS + 4)
        y[3:5], y[OUTPUTS:] = (v, w), forces
        assert qp.normal[3, :, :STICK].T @ y == pytest.approx(qp.bound[3, :STICK], abs=1e-6)
        guess = theta + 0.2  # where the last prediction has it
        tangent = unit(guess) - 0.2 * unit(guess + 0.5 * math.pi)
        worst = max(worst, np.linalg.norm(v * (tangent - unit(theta))) / v)
    assert worst > 0.015
    for kappa in np.linspace(-4.0, 4.0, 161):  # the forces that it leaves: the stable curvatures
        twist = [1.0 - kappa * centred.centre[1], kappa * centred.centre[0], kappa]
        held = nnls(centred.motion_of_forces, np.array(twist))[1] < 1e-9
        if min(abs(kappa - contact.limits.minimum), abs(kappa - contact.limits.maximum)) > 1e-3:
            assert held == (contact.limits.minimum <= kappa <= contact.limits.maximum)


def test_2_41_contact_1_is_the_right_end_at_any_heading():
    """Truth: lever times force, point by point. The printed matrix is right."""
    s, angle = HALF, math.atan(MU)
    for theta in np.linspace(-3.0, 3.0, 13):
        found = line_contact_grasp(s, -s, s, MU, theta)
        for k, (lateral, sign) in enumerate([(-s, -1), (-s, 1), (s, -1), (s, 1)]):
            arm = -s * unit(theta) + lateral * unit(theta + 0.5 * math.pi)
            force = unit(theta + sign * angle)
            assert found[:, k] == pytest.approx([*force, arm[0] * force[1] - arm[1] * force[0]])


def torque_cases():
    """A robot, speeds, torques, and the accelerations of body and axle by differences of places."""
    random, h = np.random.default_rng(7), 1e-3
    robot = TorqueRobot.of(PIONEER)
    for _ in range(30):
        v, w, right, left = random.uniform([-0.8, -2.0, -2.0, -2.0], [0.8, 2.0, 2.0, 2.0])
        a, eps = robot.accelerations(v, w, right, left)
        places = []
        for t in (-h, 0.0, h):  # about t = 0, exactly to the third order
            turn = w * t + 0.5 * eps * t**2
            along, across = v * t + 0.5 * a * t**2, 0.5 * v * w * t**2
            axle = np.array([along, across])
            places.append((axle, axle + robot.ahead * unit(turn)))
        axle, body = ((places[0][i] - 2.0 * places[1][i] + places[2][i]) / h**2 for i in range(2))
        yield robot, (v, w, right, left), (a, eps), body, axle


def residuals(robot, u, accelerations, body, axle):
    """[N], [Nm]: Newton's and Euler's laws about the common centre of mass."""
    (_, _, right, left), (a, eps) = u, accelerations
    r, lever, wheels = robot.radius, robot.half_track, 2.0 * robot.wheel_mass
    pull = [
        (t - robot.rolling * (a + s * lever * eps) / r) / r for t, s in ((right, 1), (left, -1))
    ]
    force = robot.body_mass * body + wheels * axle
    middle = robot.body_mass * robot.ahead / robot.mass
    inertia = robot.turning - robot.mass * middle**2
    euler = inertia * eps - (lever * (pull[0] - pull[1]) - middle * force[1])
    return force[0] - sum(pull), euler


def test_2_13_the_centre_of_mass_ahead_has_the_other_signs():
    """Truth: Newton's and Euler's laws, with accelerations by differences of places."""
    worst = np.zeros(2)
    for robot, u, accelerations, body, axle in torque_cases():
        assert residuals(robot, u, accelerations, body, axle) == pytest.approx((0, 0), abs=1e-3)
        v, w, right, left = u
        r, lever, lag = robot.radius, robot.half_track, robot.body_mass * robot.ahead
        a = ((right + left) / r - lag * w**2) / (robot.mass + 2.0 * robot.rolling / r**2)
        eps = lever / r * (right - left) + lag * v * w
        eps /= robot.turning + 2.0 * lever**2 / r**2 * robot.rolling
        ahead = np.array([a - robot.ahead * w**2, v * w + robot.ahead * eps])
        off = residuals(robot, u, (a, eps), ahead, np.array([a, v * w]))
        worst = np.maximum(worst, np.abs(off))
    assert worst[0] > 5.0 and worst[1] > 2.0
    assert TorqueRobot.of(PIONEER).ahead < 0.0  # the printed robot carries it behind the axle


def test_2_24_the_lateral_force_feels_the_turn_of_the_velocity():
    """Truth: masses times accelerations by differences of places."""
    worst = 0.0
    for robot, u, (_, eps), body, axle in torque_cases():
        aside = robot.body_mass * body[1] + 2.0 * robot.wheel_mass * axle[1]
        assert robot.tractions(*u)[2] == pytest.approx(aside, abs=1e-4)
        worst = max(worst, abs(robot.mass * eps * robot.ahead - aside))
    assert worst > 10.0


def test_2_29_to_2_32_two_wheels_bear_the_sideways_force_once():
    """Truth: masses times accelerations by differences of places. As printed, it counts twice."""
    share, worst = WheelSlipSettings().sideways_share, 0.0
    for robot, u, _, body, axle in torque_cases():
        aside = robot.body_mass * body[1] + 2.0 * robot.wheel_mass * axle[1]
        loads, pulls = robot.loads(*u)[:2], robot.tractions(*u)[:2]
        borne = {}
        for part in (share, 1.0):
            left_over = robot.slip_margins(*u, 1.0, share=part)
            both = (np.array(loads) - left_over) ** 2 - np.array(pulls) ** 2
            borne[part] = float(np.sqrt(np.maximum(both, 0.0)).sum())
        assert borne[share] == pytest.approx(abs(aside), abs=1e-3)
        assert borne[1.0] == pytest.approx(2.0 * abs(aside), abs=1e-3)
        worst = max(worst, borne[1.0] - abs(aside))
    assert worst > 10.0


def test_2_27_and_2_28_moments_about_the_floor():
    """Truth: moments about the axle's line on the floor, of all forces and all moving masses."""
    worst = np.zeros(2)
    for robot, u, (a, _), body, _ in torque_cases():
        v, w = u[:2]
        right, left, caster = robot.loads(*u)
        assert right + left + caster == pytest.approx(robot.mass * GRAVITY)
        pitch = robot.body_mass * GRAVITY * robot.ahead - caster * robot.caster
        wheels = 2.0 * (robot.wheel_mass * robot.radius + robot.rolling / robot.radius)
        assert pitch == pytest.approx(
            robot.body_mass * robot.height * body[0] + wheels * a, abs=1e-3
        )
        roll = robot.half_track * (right - left)
        tilt = robot.body_mass * robot.height * body[1]
        tilt += 2.0 * robot.wheel_mass * robot.radius * v * w
        assert roll == pytest.approx(tilt, abs=1e-3)
        lever = robot.height - robot.radius
        printed = robot.mass * (GRAVITY * robot.ahead - body[0] * lever) / robot.caster
        off = abs(printed - caster), abs(robot.mass * body[1] * lever - tilt) / robot.half_track
        worst = np.maximum(worst, off)
    assert (worst > 5.0).all()  # [N] on the caster, between the wheels


def test_2_16_headings_are_continuous_over_the_horizon():
    """Truth: equal poses have no error; and a robot that spins once more is not better off."""
    nmpc = WheelSlipNmpc(WheelSlipSettings(constraint=False), PIONEER)
    n = nmpc.settings.horizon + 1
    state = np.array([0.0, 0.0, math.pi - 0.05, 0.0, 0.0])
    still, reference = np.zeros(2 * nmpc.settings.control_horizon), np.tile(state, (n, 1))
    reference[:, 2] = -math.pi - 0.05  # the same pose, a turn away
    assert nmpc.evaluate(still, state, reference)[0] > 100.0
    assert nmpc.evaluate(still, state, beside(state, reference))[0] == pytest.approx(0.0, abs=1e-9)
    t = nmpc.settings.step * np.arange(n)
    turning = np.zeros((n, 5))
    turning[:, 2] = np.arctan2(np.sin(1.5 * t), np.cos(1.5 * t))
    spins = np.linspace(-12.0, 12.0, 2401)
    continuous = beside(np.zeros(5), turning)[:, 2]
    for wrap, valleys in ((True, 3), (False, 1)):
        error = spins[:, None] * t - continuous
        cost = ((np.arctan2(np.sin(error), np.cos(error)) if wrap else error) ** 2).sum(axis=1)
        minima = (cost[1:-1] < cost[:-2]) & (cost[1:-1] < cost[2:])
        assert minima.sum() == 1 if valleys == 1 else minima.sum() >= valleys


@pytest.mark.parametrize("axis", [0, 1, 3])
def test_2_19_limits_leave_room_between_them(axis):
    """Truth: an interval. As printed, nothing is within its limits."""
    nmpc = WheelSlipNmpc(WheelSlipSettings(constraint=False), PIONEER)
    limit = nmpc.settings.position_limit if axis < 3 else PIONEER.drive.max_wheel_speed
    scale = 1.0 if axis < 3 else nmpc.robot.radius
    still, reference = np.zeros(2 * nmpc.settings.control_horizon), np.zeros((16, 5))
    for value in np.linspace(-1.2, 1.2, 49) * limit:
        state = np.zeros(5)
        state[axis] = value * scale
        _, violation = nmpc.evaluate(still, state, reference)
        assert violation == pytest.approx(max(0.0, abs(value) - limit), abs=0.3 * (axis == 3))
        assert not (value + limit <= 0.0 and limit - value <= 0.0)  # as printed
