"""Object trajectories, random grasps, and the least forces of a task."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from grasp_opt.contact_outline import ContactOutline, Contacts
from grasp_opt.effort import least_effort
from grasp_opt.object_trajectory import polynomial, sinusoid, study_trajectories
from grasp_opt.selection import NoGraspFound, apart, behind, random_grasp
from grasp_opt.wrench_cone import margin, task_wrenches, wrench_rays
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_scenario.bodies import load_object

PLATES = ("plate_square", "plate_triangle", "plate_hexagon", "plate_ellipse")


@pytest.mark.parametrize("name", list(study_trajectories()))
def test_twists_are_the_slopes_of_the_poses(name):
    t = study_trajectories()[name]
    assert t.pose[0] == pytest.approx(t.sample(-1.0)) and t.twist[0] == pytest.approx(np.zeros(3))
    assert t.twist[-1] == pytest.approx(np.zeros(3), abs=1e-9)
    slope = np.gradient(t.pose, t.time, axis=0)[3:-3]
    assert slope == pytest.approx(t.twist[3:-3], abs=2e-3)
    speed = np.hypot(*t.twist[:, :2].T)
    assert speed.max() == pytest.approx(0.1, abs=1e-3)
    assert np.abs(np.gradient(speed, t.time)).max() < 0.11
    assert 0.85 < t.length < 1.3
    body = t.body_twists
    assert np.hypot(*body[:, :2].T) == pytest.approx(speed)
    if name.startswith("polynomial"):
        assert np.abs(body[:, 1]).max() < 1e-5 and np.abs(body[:, 2]).max() > 0.04
    else:
        assert not t.pose[:, 2].any() and not body[:, 2].any()


def test_curves_are_the_ones_that_were_asked_for():
    t = polynomial((0.3, -0.2), 0.8, 0.1, 0.1)
    x, y, theta = t.pose.T
    assert y == pytest.approx(0.3 * x**2 - 0.2 * x**3, abs=1e-6) and x[-1] == pytest.approx(0.8)
    assert np.tan(theta) == pytest.approx(0.6 * x - 0.6 * x**2, abs=1e-5)
    t = sinusoid(0.05, 0.5, 1.0, 0.1, 0.1)
    assert t.pose[:, 1] == pytest.approx(0.05 * np.sin(4 * np.pi * t.pose[:, 0]), abs=1e-5)


@pytest.mark.parametrize("name", PLATES)
def test_random_grasps_meet_their_requirements_and_cover_what_they_may(name):
    item = load_object(name)
    outline = ContactOutline(item.geometry)
    random = np.random.default_rng(3)
    velocity = np.array([1.0, 0.3])
    angles = []
    for _ in range(100):
        contacts = random_grasp(outline, 3, 0.05, velocity, random)
        centres = contacts.centres(0.05)
        gaps = [np.hypot(*(centres[i] - centres[j])) for i in range(3) for j in range(i)]
        assert min(gaps) >= 0.102 and apart(contacts, 0.05) and behind(contacts, velocity)
        assert (contacts.normals @ velocity > 0.0).all()
        angles += list(np.arctan2(*contacts.normals.T[::-1]))
    # the whole half circle about the velocity where the outline has such normals
    spread = np.ptp(angles)
    if name == "plate_triangle":  # one side looks that way
        assert spread == pytest.approx(0.0, abs=1e-9)
    else:
        assert spread > (2.9 if name == "plate_ellipse" else 1.0)


def test_what_has_no_place_is_said_so():
    outline = ContactOutline(load_object("box9").geometry)
    with pytest.raises(NoGraspFound, match="5 robots of 50 mm find no place"):
        random_grasp(outline, 5, 0.05, np.array([1.0, 0.0]), np.random.default_rng(1))


def test_normals_across_the_velocity_do_not_count_as_behind_by_rounding():
    across = Contacts(np.array([[0.0, 0.1]]), np.array([[1e-17, -1.0]]))
    assert not behind(across, np.array([1.0, 0.0]))


def test_least_forces_hold_the_task_and_none_are_less():
    """100 grasps that pass the test: equilibrium, within the cones, and SLSQP finds no better."""
    item = load_object("plate_ellipse")
    outline, surface = ContactOutline(item.geometry), item.limit_surface()
    random = np.random.default_rng(9)
    trajectories = list(study_trajectories().values())
    seen = 0
    while seen < 100:
        trajectory = trajectories[random.integers(6)]
        twists = trajectory.body_twists[5::40]
        contacts = random_grasp(outline, 3, 0.05, twists[0, :2], random)
        rays = wrench_rays(contacts.points, contacts.normals, 0.2, surface.radius)
        held = margin(rays, task_wrenches(twists, surface, surface.radius))
        effort = least_effort(contacts, 0.2, twists, surface)
        if held < 0.05:
            assert (effort.lacking > 1e-3) == (held < -1e-3) or abs(held) < 0.05
            continue
        seen += 1
        assert effort.lacking < 1e-3
        G = grasp_matrix(contacts.points)
        k = random.integers(len(twists))
        wrench = surface.wrench(twists[k])
        assert G @ effort.forces[k].ravel() == pytest.approx(wrench, abs=2e-3)
        for force, normal in zip(effort.forces[k], contacts.normals, strict=True):
            across = normal[0] * force[1] - normal[1] * force[0]
            assert abs(across) <= 0.2 * float(force @ normal) + 1e-9
        if seen % 10 == 0:
            edges = [cone_edges(n, 0.2) for n in contacts.normals]
            spread = np.zeros((6, 6))
            for i, e in enumerate(edges):
                spread[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = e.T
            A = G @ spread
            start = linprog(np.ones(6), A_eq=A, b_eq=wrench, bounds=(0, None)).x
            best = minimize(
                lambda z, s=spread: float((s @ z) @ (s @ z)),
                start,
                constraints={"type": "eq", "fun": lambda z, a=A, w=wrench: a @ z - w},
                bounds=[(0.0, None)] * 6,
                method="SLSQP",
                options={"ftol": 1e-12, "maxiter": 300},
            )
            assert (effort.forces[k] ** 2).sum() <= best.fun * 1.01 + 1e-6


def test_the_energy_of_a_translation_is_the_floors_friction():
    item = load_object("plate_square")
    contacts = Contacts(np.array([[-0.175, 0.1], [-0.175, -0.1]]), np.array([[1.0, 0.0]] * 2))
    twists = np.tile([0.1, 0.0, 0.0], (10, 1))
    effort = least_effort(contacts, 0.2, twists, item.limit_surface())
    assert effort.energy == pytest.approx(0.6 * 0.3 * 9.81, rel=1e-4)
